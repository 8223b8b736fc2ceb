"""Whether a recorded log says what it seems to: units, axes, signs, clocks and holes, by what contradicts them."""
