"""The tightly coupled filter on the ranges of an antenna that rests, with a resting IMU that is simulated.

The ranges are those of the log in every run. The IMU is one of a stated grade: every run draws its biases and its noise
from the alignment on, so that runs differ as flights with other sensors of the grade would.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.logs.alignment import Alignment
from spoofgym.logs.alignment.rest import LEVEL_SIGMA
from spoofgym.logs.resting_log import HEADING
from spoofgym.mechanization import attitude_matrix
from spoofgym.navigation.interface import Decision
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.tight.resting import TightRestingNavigator
from spoofgym.navigation.tight.states import BIAS
from spoofgym.navigation.tuning import true_noise_density
from spoofgym.parallel import RunSlices
from spoofgym.scenarios.recorded_tight import RecordedRanges, bare_model
from spoofgym.sensors.imu import ImuGrade
from spoofgym.streams import RunStreams

SIMULATED = "simulated"


@dataclass(frozen=True, kw_only=True, eq=False)
class RestingRanges(RecordedRanges):
    """Tightly coupled filters on the ranges of an antenna that rests. Errors are against its known place.

    The clean run has a perfect IMU.

    Attributes:
        imu: grade of the simulated one.
    """

    doubts = (
        "another place of the antenna (antenna_lat_deg, antenna_lon_deg, antenna_h_m), range rates of the wrong sign "
        "or unit (range_rate_mps), wrong ranges or ephemerides, an attack that log.toml does not state (first_effect_s)"
    )
    kind = TightRestingNavigator

    imu: ImuGrade

    @cached_property
    def alignment(self) -> Alignment:
        """Level and with its heading, as it is simulated, at the first fix from the log's start on."""
        heading = self.log.heading or HEADING
        time = self.log.fixes.time
        fix = min(int(np.searchsorted(time, self.log.start)), len(time) - 1)
        sigma = np.array([LEVEL_SIGMA, LEVEL_SIGMA, heading.sigma])
        attitude = attitude_matrix(0.0, 0.0, heading.value)
        return Alignment("static", fix, attitude, np.zeros(3), sigma, f"IMU {SIMULATED}: {self.imu.name}")

    def _noisy(self, model: StrapdownModel) -> StrapdownModel:
        """The model with the white noise of the simulated IMU."""
        return replace(model, true_noise=np.sqrt(true_noise_density(self.imu, 0.0)))

    def _game_model(self, first: int) -> StrapdownModel:
        return self._noisy(super()._game_model(first))

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """Where the filters of the runs stand before epoch -burn_in, each after its own way from the alignment.

        Shape (k, n + 6): errors beside the clean run, what is estimated beside, and the estimated biases.
        """
        first, states = self._first(burn_in), self.num_states
        power_on = np.zeros((len(runs), states + 6))
        for place, run in enumerate(runs.tolist()):
            power_on[place, BIAS] = self.imu.whole_bias_sigma * streams(run, "initial").standard_normal(6)
        model = self._noisy(self.model.part(0, max(first, 1)))
        tight = bare_model(self.dynamics.part(0, max(first, 1)), self._cold)
        satellites, unknown = self.ranges.geometry.position[: max(first, 1)], np.zeros(max(first, 1))
        navigator = TightRestingNavigator(model, tight, satellites, unknown, int(runs.max()) + 1, RunSlices(1))
        navigator.reset(runs, power_on, streams)
        for epoch in range(first):
            navigator.propagate(runs)
            navigator.innovate(np.tile(self._measured[epoch], (len(runs), 1)), runs)
            navigator.resolve(Decision(np.ones(len(runs), dtype=bool)), runs)
        return navigator.joint(runs, super()._game_model(first))
