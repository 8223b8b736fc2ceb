"""A bank of chi-square windows of several lengths."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import Detector, ThresholdDetector
from spoofgym.detectors.chi_square import DEFAULT_P_FA, at_all_degrees, measured_degrees, quantile
from spoofgym.detectors.ring import MovingSum
from spoofgym.navigation.interface import Epoch

DEFAULT_LENGTHS = "5+10+20+60"
DIGITS = len(str(validation.LONGEST))


def window_lengths(owner: str, name: str, text: object) -> tuple[int, ...]:
    """Lengths spelled ``5+10+20``, in epochs.

    Args:
        owner: whose option, for the message.
        name: of the option.
        text: the spelling.

    Raises:
        ValueError: they are not whole numbers, 1 or more, each greater than the one before, 10,000 at most.
    """
    pieces = text.split("+") if isinstance(text, str) else [""]
    lengths = tuple(int(piece) for piece in pieces if piece.isascii() and piece.isdigit() and len(piece) <= DIGITS)
    # a zero before the first makes it 1 or more
    increasing = all(before < after for before, after in zip((0, *lengths), lengths, strict=False))
    if len(lengths) < len(pieces) or not increasing or lengths[-1] > validation.LONGEST:
        raise ValueError(
            f"{owner}: {name} must be whole numbers, 1 or more and increasing, {validation.LONGEST} at most, with + "
            f"between, e.g. 5+20; got {validation.shown(text)}"
        )
    return lengths


class WindowBank(ThresholdDetector):
    """Alarm where the sum of the nis over any of several windows is too large: a bank of `Windowed`.

    A short window finds what is fast, a long one what is slow. The false-alarm budget of an epoch is split evenly: with
    J lengths the sum over n_j epochs has the bound T_j, which chi-square with m n_j degrees of freedom exceeds with
    probability budget / J, and

        statistic = max over j of (Σ nis over the last n_j epochs) / T_j.

    So a matched filter's statistic exceeds 1 with a probability of at most the budget. It fixes the ratios of the
    bounds, and the threshold is one factor on all of them; it is calibrated, since windows overlap.

    Epochs that have not come, and those without a fix, count as zero. Of ranges the degrees of freedom are the
    measurements in each window, and the sums are brought to m n_j (`at_all_degrees`). Bank and split: Quartararo and
    Langel 2022 (NAVIGATION 69(1), navi.507); lengths and budget are ours.

    Args:
        lengths: epochs of the windows, increasing, with ``+`` between.
        budget: probability of a false alarm in an epoch, from which the ratios of the bounds follow.
        threshold: the factor on the bounds; 1 for the bounds themselves.
        arl0: average run length between false alarms, epochs; 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "window-bank"

    def __init__(
        self,
        lengths: str = DEFAULT_LENGTHS,
        budget: float = DEFAULT_P_FA,
        threshold: float | None = None,
        arl0: float | None = None,
    ) -> None:
        self.lengths = window_lengths(self.kind, "lengths", lengths)
        self.memory = self.lengths[-1] - 1
        self.budget = validation.probability(self.kind, "budget", budget)
        self.set_up(threshold, arl0, lengths=lengths, budget=self.budget)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the windows, and set their bounds for fixes of ``dimension`` m."""
        self._sums = [MovingSum(num_runs, length) for length in self.lengths]
        self._degrees = [MovingSum(num_runs, length) for length in self.lengths]
        self._share = self.budget / len(self.lengths)
        self._most = [dimension * length for length in self.lengths]
        self._bounds = [quantile(self._share, most) for most in self._most]

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        for window in (*self._sums, *self._degrees):
            window.reset(runs)

    def take(self, runs: Runs, other: Detector) -> None:
        """Copy the windows of a copy of this bank."""
        assert isinstance(other, WindowBank)
        pairs = zip((*self._sums, *self._degrees), (*other._sums, *other._degrees), strict=True)
        for mine, theirs in pairs:
            mine.take(runs, theirs)

    def update(self, epoch: Epoch) -> Floats:
        """The largest sum over its bound, (N,)."""
        largest = np.zeros(len(epoch.index))
        measured = None if epoch.innovation.present is None else measured_degrees(epoch).astype(np.float64)
        for place, (window, bound) in enumerate(zip(self._sums, self._bounds, strict=True)):
            total = window.push(epoch.innovation.nis)
            if measured is not None:
                degrees = self._degrees[place].push(measured).astype(np.int64)
                # without a measurement the sum is a rounding error
                total = at_all_degrees(np.where(degrees > 0, total, 0.0), degrees, self._share, self._most[place])
            np.maximum(largest, total / bound, out=largest)
        return largest
