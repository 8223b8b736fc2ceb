"""Solutions that coast on inertia from every past epoch, and their distance from the filter."""
