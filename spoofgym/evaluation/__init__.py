"""How good a player is: Monte Carlo, metrics, reports."""
