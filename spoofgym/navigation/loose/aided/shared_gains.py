"""The linear fidelity of an aided filter with shared gains: every run uses every fix and every reading of an aid."""

from __future__ import annotations

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.loose.aided.error_batch import AidedErrorBatch
from spoofgym.navigation.loose.aided.kernels import carry_with_shared_gains
from spoofgym.navigation.loose.aided.model import AidedModel
from spoofgym.navigation.loose.shared_gains import LinearNavigator

GRAIN = 1024
"""Runs below which a slice is not worth a thread."""


class AidedNavigator(AidedErrorBatch, LinearNavigator):
    """N runs of the true error under an aided filter with shared, precomputed gains.

    H, R and the times of the aids are known in advance, and none has a gate, so that their gains are shared, too.
    """

    model: AidedModel
    carry_grain = GRAIN

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        """One epoch: no run can go back."""
        model = self.model
        carry_with_shared_gains(
            runs, model.aid_steps, model.measurements, model.aid_gains, self._errors, self._told, auxiliary
        )
