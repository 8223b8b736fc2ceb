"""The Bayesian bound: against a known population of attacks, no defender errs less than the one who knows it.

The way through this room: `schedule` (when attacks begin and end) · `shapes` and `tree` (what they look like) ·
`filtering` (the best filter of a game, and how an offset moves it) · `bank` (every attack that may be under way, and
how well it explains the fixes) · `sizes` (the integral over size and heading) · `median` (the estimate that errs least)
· `follow` (a game, epoch by epoch) · `estimates` (all of it, for a scenario).
"""

from spoofgym.optimum.bayes.estimates import Bayesian, Estimates, Fixes
from spoofgym.optimum.bayes.shapes import POPULATION_SHAPES, RESOLUTIONS, Resolution

__all__ = ["POPULATION_SHAPES", "RESOLUTIONS", "Bayesian", "Estimates", "Fixes", "Resolution"]
