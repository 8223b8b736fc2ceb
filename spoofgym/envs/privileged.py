"""What a critic may know in training and no defender ever: the true error and the schedule of the attack."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spoofgym.attacks.pool import AttackPool
from spoofgym.envs.observation import Field, Squash
from spoofgym.geodesy import AXES
from spoofgym.sensors.confounders import Confounders
from spoofgym.simulation import Simulation


def privileged_fields(error_scale: float) -> tuple[Field, ...]:
    """The entries of the privileged state, in order."""
    return (
        *(Field(f"position error {axis}", "m", error_scale) for axis in AXES[:2]),
        *(Field(f"velocity error {axis}", "m/s", 0.1 * error_scale) for axis in AXES[:2]),
        *(Field(f"offset of the fix {axis}", "m", error_scale) for axis in AXES[:2]),
        Field("attack in force", "1", 0.0),
        Field("attack to come", "1", 0.0),
        Field("epochs to the attack's begin", "epochs", 20.0),
        Field("epochs to the attack's end", "epochs", 20.0),
        Field("multipath", "1", 0.0),
    )


class PrivilegedState:
    """The privileged states of N lanes.

    Attributes:
        fields: the entries, in order.
    """

    def __init__(
        self, simulation: Simulation, attacks: AttackPool, confounders: Confounders, error_scale: float
    ) -> None:
        """Look at a simulation and at the parts whose schedules are known at reset."""
        self._simulation, self._attacks, self._confounders = simulation, attacks, confounders
        self.fields = privileged_fields(error_scale)
        self._squash = Squash(self.fields)
        self._all = np.arange(simulation.num_runs)

    def __call__(self) -> NDArray[np.float32]:
        """Of the present epoch before its fix is resolved, (N, P)."""
        simulation, attacks = self._simulation, self._attacks
        index = simulation.epoch.index
        coming, ending = attacks.first - index, attacks.last - index
        spoofed = attacks.last >= attacks.first
        flags = [
            spoofed & (coming <= 0) & (ending >= 0),
            spoofed & (coming > 0),
            np.where(spoofed, np.maximum(coming, 0), 0),
            np.where(spoofed, np.maximum(ending + 1, 0), 0),
            self._confounders.multipath[self._all, index],
        ]
        parts = [simulation.error[:, :2], simulation.navigator.velocity_error[:, :2], simulation.offset[:, :2]]
        return self._squash(np.concatenate([*parts, np.stack(flags, axis=1).astype(np.float64)], axis=1))
