"""The Bayesian bound: against a known population of attacks, no defender errs less than the one who knows it.

The way through this room: `schedule` (when attacks begin and end) · `shapes`, `held_out_shapes`, `populations` and
`tree` (what they look like) · `filtering` (the best filter of a game, and how an offset moves it) · `bank` (every
attack that may be under way, and how well it explains the fixes) · `sizes` (the integral over size and heading) ·
`follow` (an epoch) · `median` (the estimate that errs least) · `estimates` (all of it, for a scenario) · `reach` and
`choosers` (who may only choose among the solutions of the vehicle's filter).
"""

from spoofgym.optimum.bayes.choosers import LONGEST, Chooser, Hindsight
from spoofgym.optimum.bayes.estimates import Bayesian, Estimates, Fixes, Watcher
from spoofgym.optimum.bayes.populations import POPULATION_SHAPES
from spoofgym.optimum.bayes.reach import View
from spoofgym.optimum.bayes.shapes import RESOLUTIONS, SHAPE_DRAWS, Resolution

__all__ = [
    "LONGEST",
    "POPULATION_SHAPES",
    "RESOLUTIONS",
    "SHAPE_DRAWS",
    "Bayesian",
    "Chooser",
    "Estimates",
    "Fixes",
    "Hindsight",
    "Resolution",
    "View",
    "Watcher",
]
