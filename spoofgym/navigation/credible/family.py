"""The credible filter of a ground robot, in the linear fidelity: odometer and yaw carry it, fixes correct it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.navigation.credible.kalman import CredibleTuning, credible_linear_model, standing_start
from spoofgym.navigation.credible.runs import AuxiliaryRule, CredibleModel, CredibleNavigator
from spoofgym.navigation.credible.truth import PlanarTruth
from spoofgym.navigation.facts import LINEAR_MODEL, ODOMETER, FilterFacts
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.fixes import FixFamily
from spoofgym.navigation.loose.warm_start import COLOUR, NUM_JOINT
from spoofgym.parallel import RunSlices
from spoofgym.sensors.odometer import Odometer, OdometerGrade
from spoofgym.sensors.receiver import Receiver, draw_noise
from spoofgym.streams import RunStreams


@dataclass(frozen=True, kw_only=True, eq=False)
class CredibleFamily(FixFamily):
    """Credible filters on a motion in the plane.

    The filter is linear, and so is what an offset does to it (`linear_model`); but its model is wrong (it takes an
    auxiliary position that drifts for independent measurements), so that its clean innovations are not white.

    Attributes:
        truth: the true motion.
        odometer: the encoders.
        grade: of their errors and the yaw's.
        receiver: of the fixes.
        tuning: what the filter believes.
        rule: for the auxiliary position.
        imu_bias: what the data sheet of the IMU allows, (6,), rad/s and m/s²; the filter estimates none.
    """

    truth: PlanarTruth
    odometer: Odometer
    grade: OdometerGrade
    receiver: Receiver
    tuning: CredibleTuning
    rule: AuxiliaryRule
    imu_bias: tuple[float, ...]

    fidelities = ("linear",)
    offers = (ODOMETER, LINEAR_MODEL)
    matched = False
    random = True
    dimension = 3

    @property
    def bias_sigma(self) -> Floats:
        """Data-sheet bias of the IMU, (6,), rad/s and m/s²."""
        return np.array(self.imu_bias)

    @property
    def fix_sigma(self) -> float:
        """Of the receiver's whole error per horizontal axis, 1 sigma, m."""
        return math.hypot(self.receiver.white_sigma[0], self.receiver.markov_sigma[0])

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        truth = self.truth
        drift = self.grade.drift_sigma(truth.speed, truth.interval, truth.horizon * truth.interval)
        return FilterFacts(
            truth.name,
            truth.timeline.interval,
            self.bias_sigma,
            self.offers,
            self.linear_model,
            self.fix_sigma,
            drift,
            matched=self.matched,
        )

    @kept_by_burn_in
    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """What offsets do to the filter from epoch -burn_in on, every fix used: exact."""
        return credible_linear_model(self.tuning, self.rule.anchoring != "free", self.truth.times(burn_in))

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> CredibleNavigator:
        """A navigator whose model starts ``burn_in`` epochs before epoch 0; arguments as in `FilterFamily`."""
        model = CredibleModel(
            motion=self.truth.motion(burn_in),
            odometer=self.odometer,
            grade=self.grade,
            tuning=self.tuning,
            rule=self.rule,
        )
        return CredibleNavigator(model, num_runs, slices, demands)

    @cached_property
    def start_factor(self) -> Floats:
        """A square root of the joint covariance of filter and receiver after a long standstill, (30, 30)."""
        return standing_start(self.tuning, self.receiver)

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """Joint states of filter and receiver after a long standstill, (n, 30)."""
        initial = np.zeros((len(runs), NUM_JOINT))
        normals = np.stack([streams(run, "initial").standard_normal(NUM_JOINT) for run in runs])
        for j in np.flatnonzero(self.start_factor.any(axis=0)):
            initial += normals[:, j, None] * self.start_factor[:, j]
        return initial

    def draw_receiver_noise(self, runs: Runs, initial: Floats, burn_in: int, streams: RunStreams) -> Floats:
        """Receiver noise of the epochs -burn_in..K, (n, burn_in + K + 1, 3), m."""
        epochs = burn_in + self.truth.horizon + 1
        return np.stack(
            [
                draw_noise(self.receiver, epochs, streams(run, "receiver"), initial[place, COLOUR])
                for place, run in enumerate(runs)
            ]
        )
