"""Optimal attacks against the snapshot test, and the exact value of the spoofer's game.

The way through this package: `survival` (what one epoch costs) · `play` (what a whole sequence of offsets is worth: the
one place that computes it) · `response` (the linear maps behind it) · `closed_form`, `ramp`, `bounded` (three
attackers) · `upper_bound` and `dynamic_programme` (what no attacker can exceed, from above and from below).
"""

from spoofgym.optimum.bounded import BoundedOptimum, bounded_optimum
from spoofgym.optimum.closed_form import ClosedForm, best_budget, noncentrality_optimum
from spoofgym.optimum.dynamic_programme import Lattice, dynamic_programme
from spoofgym.optimum.play import Outcome, expected_play
from spoofgym.optimum.ramp import BestRamp, best_ramp
from spoofgym.optimum.upper_bound import UpperBound, upper_bound

__all__ = [
    "BestRamp",
    "BoundedOptimum",
    "ClosedForm",
    "Lattice",
    "Outcome",
    "UpperBound",
    "best_budget",
    "best_ramp",
    "bounded_optimum",
    "dynamic_programme",
    "expected_play",
    "noncentrality_optimum",
    "upper_bound",
]
