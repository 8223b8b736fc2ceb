"""Least and largest values of the options of scenarios, where one limit serves several of them."""

MOST_EPOCHS = 100_000
"""Of a game."""
SIGMAS = (1e-3, 1e6)
"""Of a fix, m."""
SPEEDS = (0.1, 1e4)
"""Of a vehicle, m/s."""
NOISE_FACTORS = (1e-6, 1e6)
"""On the variance of a filter's process noise."""
