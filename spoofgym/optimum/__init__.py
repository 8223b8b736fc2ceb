"""Optimal attacks, and the exact value of the spoofer's game against the snapshot test.

The way through this package: `survival` (what one epoch costs) · `play` (what a whole sequence of offsets is worth: the
one place that computes it) · `response` (the linear maps behind it) · `closed_form`, `ramp`, `bounded` (three
attackers) · `upper_bound` and `dynamic_programme` (what no attacker can exceed, from above and from below). Against
other tests: `cumulative` (the sum of the statistics in a window) · `linear_tests` and `zero_alarm` (any set of tests
that keep the signs of the innovations). Against every test: `gain` (what none of them can see). For defenders: `bayes`
(the least error against a known population of attacks), `gaussian_spoofer` with `pull_process` (what none of them can
stay below in the duel).
"""

from spoofgym.optimum.bayes import Bayesian
from spoofgym.optimum.bounded import BoundedOptimum, bounded_optimum
from spoofgym.optimum.closed_form import ClosedForm, best_budget, noncentrality_optimum
from spoofgym.optimum.cumulative import cumulative_optimum, missed_magnitude
from spoofgym.optimum.dynamic_programme import Lattice, dynamic_programme
from spoofgym.optimum.gain import GameGain, game_gain
from spoofgym.optimum.gaussian_spoofer import LowerBound, lower_bound
from spoofgym.optimum.linear_tests import LinearTest, ewma, gate, window_mean
from spoofgym.optimum.play import Outcome, expected_play
from spoofgym.optimum.ramp import BestRamp, best_ramp
from spoofgym.optimum.upper_bound import UpperBound, upper_bound
from spoofgym.optimum.zero_alarm import ZeroAlarm, zero_alarm

__all__ = [
    "Bayesian",
    "BestRamp",
    "BoundedOptimum",
    "ClosedForm",
    "GameGain",
    "Lattice",
    "LinearTest",
    "LowerBound",
    "Outcome",
    "UpperBound",
    "ZeroAlarm",
    "best_budget",
    "best_ramp",
    "bounded_optimum",
    "cumulative_optimum",
    "dynamic_programme",
    "ewma",
    "expected_play",
    "game_gain",
    "gate",
    "lower_bound",
    "missed_magnitude",
    "noncentrality_optimum",
    "upper_bound",
    "window_mean",
    "zero_alarm",
]
