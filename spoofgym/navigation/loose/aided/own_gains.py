"""The linear fidelity of an aided filter with a covariance per run: fixes can be left out, readings of aids, too."""

from __future__ import annotations

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.loose.aided.error_batch import AidedErrorBatch
from spoofgym.navigation.loose.aided.kernels import carry_with_own_gains
from spoofgym.navigation.loose.aided.model import AidedModel
from spoofgym.navigation.loose.own_gains import OwnCovarianceNavigator


class AidedOwnNavigator(AidedErrorBatch, OwnCovarianceNavigator):
    """N runs of the true error under an aided filter, each with a covariance of its own.

    The aids act while a run is carried. So they act on runs that leave fixes out, and once more, through their gates
    anew, where fixes are taken back.
    """

    model: AidedModel

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        model = self.model
        carry_with_own_gains(
            runs,
            epochs,
            model.aid_steps,
            model.measurements,
            self._errors,
            self._told,
            self.past.ring,
            auxiliary,
        )
