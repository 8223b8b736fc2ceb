"""The noises of a recorded log: estimated from the filter's innovations, and judged where they were not estimated."""
