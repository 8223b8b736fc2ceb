"""Golden episodes: short seeded games whose numbers are kept, so that moving code cannot change what it computes."""
