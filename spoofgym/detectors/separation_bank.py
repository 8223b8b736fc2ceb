"""A test by solution separation in sequential, overlapping windows, with a protection level (Kujur 2024, section 5)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.separation_theory import protection_level, separation_threshold
from spoofgym.navigation.facts import COASTING, INERTIAL_SOLUTION, RANGES, FilterFacts
from spoofgym.navigation.interface import Demands, Epoch
from spoofgym.navigation.separation.coasting import coasting_tables
from spoofgym.navigation.separation.windows import CoastingWindows, OwnFilters, Separated
from spoofgym.navigation.tight.model import TightModel
from spoofgym.specification import spell

DEFAULT_WINDOW = 60
DEFAULT_P_FA = 1e-5
DEFAULT_P_MD = 1e-6
DIRECTIONS = {"up": (2,), "east": (0,), "north": (1,), "horizontal": (0, 1)}
"""Places of the axes that are tested, among east, north and up."""


class SeparationBank(ThresholdDetector):
    """Alarm where the filter has gone too far from one of the solutions that have coasted since the last n epochs.

    A window opens after every epoch and closes n epochs later. Along an axis u, with d = u'(x_KF - x_coast) and
    σ_ss² = u'(P_coast - P_KF) u, after the present ranges (eqs 49 and 50),

        statistic = largest |d| / T of all open windows,        T = Q⁻¹(P_FA / (2 n)) σ_ss,

    against 1. The coasting bounds the error whatever the signals say, so that after each epoch there is a protection
    level, PL = T + Q⁻¹(P_MD) σ_coast (our reading of eq 51); it is that of the most uncertain window, the oldest.
    ``direction=horizontal`` tests east and north, each with half of P_FA and P_MD, and puts both levels together by the
    root of their squares, which is conservative (ours).

    All windows are followed at once (`spoofgym.navigation.separation.windows`). Where the gains are shared their
    variances are tabulated; where every run has a covariance of its own they are the run's, what it has left out or
    taken back included, and an epoch that the filter does not use is separated as if it were. What was taken back is
    also gone from the windows. A filter that was reset to its ranges separates from the coasting by this jump as well.
    In the strapdown fidelity Φ is that along the truth. Where innovations before epoch 0 are drawn, these epochs are
    as epoch 0.

    Args:
        n: windows that are open at once, which is also their length in epochs.
        direction: ``up``, ``east``, ``north`` or ``horizontal``.
        p_fa: probability of a false alarm at an epoch; 1e-5 with nothing given.
        p_md: probability that the error is beyond the protection level without an alarm, to one side.
        split: whether every window gets an equal part of P_FA, as in the paper, or all of it.
        arl0: average run length between false alarms, epochs; a factor on all T, and so in PL, is then calibrated.

    Attributes:
        scale: factor on T in the protection level that another one has calibrated; 1.
        protection_level: PL after the present epoch, (N,), m.
        coasting_sigma: σ_coast of the oldest window, (N,), m; horizontally the root of the sum of both variances.

    Raises:
        ValueError: p_fa and arl0 are both given, or a value is out of range.
    """

    kind = "separation-bank"
    needs = (RANGES, INERTIAL_SOLUTION, COASTING)
    demands = Demands(auxiliary=True)

    def __init__(
        self,
        n: int = DEFAULT_WINDOW,
        direction: str = "up",
        p_fa: float | None = None,
        p_md: float = DEFAULT_P_MD,
        split: bool = True,
        arl0: float | None = None,
    ) -> None:
        validation.at_most_one(self.kind, p_fa=p_fa, arl0=arl0)
        self.n = validation.epochs(self.kind, "n", n, 1, validation.LONGEST_TABLE)
        self.memory = self.n - 1
        self.direction = validation.one_of(self.kind, "direction", direction, tuple(DIRECTIONS))
        axes = DIRECTIONS[self.direction]
        self.p_md = validation.probability(self.kind, "p_md", p_md) / len(axes)
        self.p_fa = validation.probability(self.kind, "p_fa", DEFAULT_P_FA if p_fa is None else p_fa)
        split = validation.boolean(self.kind, "split", split)
        self.scale = 1.0
        self.multiplier = float(separation_threshold(self.p_fa, len(axes) * (self.n if split else 1), 1.0))
        if arl0 is None:
            self.threshold = 1.0
        else:
            self.target_arl0 = validation.average_run_length(self.kind, "arl0", arl0)
        self._name = spell(
            self.kind,
            n=None if n == DEFAULT_WINDOW else self.n,
            direction=None if direction == "up" else direction,
            p_fa=p_fa,
            p_md=None if p_md == DEFAULT_P_MD else p_md,
            split=None if split else split,
            arl0=arl0,
        )

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the windows."""
        self._windows = CoastingWindows(num_runs, self.n)
        self.protection_level = np.zeros(num_runs)
        self.coasting_sigma = np.zeros(num_runs)

    def know(self, facts: FilterFacts) -> None:
        """Compute what all windows share, along the scenario."""
        assert facts.range_model is not None
        burn_in = 0 if facts.matched else self.memory
        model = facts.range_model(burn_in)
        assert isinstance(model, TightModel)
        self._tables = coasting_tables(model, DIRECTIONS[self.direction], self.n, burn_in)

    def reset(self, runs: Runs) -> None:
        """Close the windows of these runs."""
        self._windows.reset(runs)

    @property
    def recovery_depth(self) -> Runs:
        """Epochs before the present one whose ranges to take back after an alarm, (N,), at most those since the reset.

        They lead to the beginning of the newest window that had closed without an alarm before the present epoch (ours:
        the paper goes to its end, where the filter is within PL but may have been spoofed for less than n epochs).
        """
        return self._windows.age - 1

    def update(self, epoch: Epoch) -> Floats:
        """The largest separation over its threshold, (N,)."""
        factor = self.multiplier * self.scale * (1.0 if self.threshold is None else self.threshold)
        ratio, separation, coasting = self._separate(epoch, factor)
        levels = protection_level(factor * separation, self.p_md, coasting)
        self.protection_level = np.sqrt(np.add.reduce(levels**2, axis=1))
        self.coasting_sigma = np.sqrt(np.add.reduce(coasting**2, axis=1))
        return ratio / self.multiplier

    def _separate(self, epoch: Epoch, limit: float) -> Separated:
        row, whitened, view = epoch.index + self.n - 1, epoch.innovation.whitened, epoch.view
        # the navigator's own covariances begin at epoch 0; in a burn-in every range is used
        if view is None or view.shared_gains or (epoch.index < 0).any():
            return self._windows.separate(self._tables, row, whitened, limit)
        return self._windows.separate_own(
            self._tables,
            row,
            whitened,
            limit,
            OwnFilters(
                auxiliary=view.auxiliary,
                covariance=view.inertial_covariance,
                gain=view.position_gain,
                given=_given(epoch),
                backtracked=view.backtracked,
            ),
        )


def _given(epoch: Epoch) -> Flags:
    """Whether the receiver gives ranges, (N,)."""
    return np.ones(len(epoch.index), dtype=bool) if epoch.available is None else epoch.available
