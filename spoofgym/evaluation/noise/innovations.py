"""The innovations of a filter along a recorded log, and what it believed of the position before each fix."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import position_difference
from spoofgym.logs.log_noise import LogNoise
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.loose.warm_start import NUM_JOINT
from spoofgym.parallel import RunSlices
from spoofgym.scenarios.recorded_loose import RecordedFixes
from spoofgym.streams import RunStreams

POSITION = slice(6, 9)


@dataclass(frozen=True, eq=False)
class Innovations:
    """Of one filter at the epochs of a log, every fix used.

    Attributes:
        residual: (E, m), m and m/s.
        covariance: S, (E, m, m).
        whitened: L⁻¹ residual with S = L L', (E, m).
        nis: normalised innovation squared, (E,).
        position_error: of the position that is predicted for each fix, before it is used, (E, 3), m ENU.
        position_sigma: what the filter believes of it, 1 sigma, (E, 3), m.
    """

    residual: Floats
    covariance: Floats
    whitened: Floats
    nis: Floats
    position_error: Floats
    position_sigma: Floats


def believing(log: RecordedFixes, noise: LogNoise | None) -> StrapdownModel:
    """The model of a log whose filter believes in noises; None = in those that it has without any file."""
    density = log.tuning.noise_density(log.grade) if noise is None else noise.density
    variance = np.square(log.believed_sigma(noise))
    covariance = variance[:, :, None] * np.eye(log.dimension)
    prior = log.model.prior_covariance.copy()
    prior[POSITION, POSITION] = np.diag(log.tuning.initial_scale**2 * variance[0, :3])
    return replace(log.model, filter_density=density, measurement_covariance=covariance, prior_covariance=prior)


def until(model: StrapdownModel, epochs: int) -> StrapdownModel:
    """The first epochs of a model."""
    return replace(
        model,
        time=model.time[:epochs],
        boundaries=model.boundaries[: epochs + 1],
        fix_position=model.fix_position[:epochs],
        fix_velocity=model.fix_velocity[:epochs],
        true_position=model.true_position[:epochs],
        true_velocity=model.true_velocity[:epochs],
        measurement_covariance=model.measurement_covariance[:epochs],
    )


def innovations(model: StrapdownModel) -> Innovations | None:
    """Run the filter over all epochs of a model; None = it diverges."""
    navigator = StrapdownNavigator(model, 1, RunSlices(1))
    navigator.reset(np.array([0]), np.zeros((1, NUM_JOINT)), RunStreams.from_seed(0, 1))
    found = navigator.sweep()
    if found is None:
        return None
    return Innovations(
        *found.formed,
        position_error=position_difference(found.position, model.true_position),
        position_sigma=np.sqrt(found.position_variance),
    )
