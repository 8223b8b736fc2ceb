"""The posterior of a short game, against an enumeration that shares no equation with it but Liu's.

Mean innovations and errors come from `error_map` and `expected_columns`, attacks from the families themselves, and
every onset, end, rate and heading of a fine grid is weighed at every epoch.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from spoofgym.arrays import Floats
from spoofgym.attacks.families import DRAWS, AttackFamily, ClimbingSpiral, RandomRamp
from spoofgym.navigation.loose.mean_maps import expected_columns
from spoofgym.optimum.bayes import Bayesian, Fixes, Resolution
from spoofgym.optimum.bayes.held_out_shapes import spiral
from spoofgym.optimum.bayes.schedule import schedule
from spoofgym.optimum.bayes.shapes import Shape, ramp
from spoofgym.optimum.gain import error_map
from spoofgym.responses import make_response
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

RATES, HEADINGS = 60, 80
TOLD = np.array([0.5, 0.9, 0.8, 0.0, 0.0, 0.0])
"""Of a spiral: it turns at 2.4 deg/s and climbs at 0.6 m/s."""


@cache
def scenario() -> Scenario:
    return make_scenario("foi-drive:horizon=22")


def enumerated(family: AttackFamily) -> tuple[Floats, Floats, Floats]:
    """Probability of every attack (H,), its mean innovations (K, 3, H) and mean errors (K, 2, H)."""
    timeline = scenario().timeline
    family.bind(timeline, 1)
    rate, heading = np.meshgrid((np.arange(RATES) + 0.5) / RATES, np.arange(HEADINGS) / HEADINGS, indexing="ij")
    draws = np.zeros((rate.size, DRAWS))
    draws[:, 6:] = TOLD
    draws[:, 5], draws[:, 6] = heading.ravel(), rate.ravel()
    whole = family.drawn(draws)  # from epoch 0 to the end
    when = schedule(timeline, (), 0.0)
    probability, offsets = [], []
    for onset in np.flatnonzero(when.onset):
        moved = np.zeros_like(whole)
        moved[:, onset:] = whole[:, : whole.shape[1] - onset]
        ends = [*range(onset + 21, timeline.num_epochs + 1), None]  # the first epoch without an offset
        for end in ends:
            cut = moved.copy()
            if end is not None:
                cut[:, end:] = 0.0
            chance = when.lasts[timeline.num_epochs - onset] if end is None else when.ends[end - onset]
            probability.append(np.full(rate.size, when.onset[onset] * chance / rate.size))
            offsets.append(cut)
    together = np.concatenate(offsets)
    model = scenario().linear_model()
    deviations = (together[:, k].T for k in range(1, timeline.num_epochs + 1))
    whitened, _ = expected_columns(model, deviations, len(together))
    error = error_map(model) @ whitened.reshape(-1, len(together))
    return np.concatenate(probability), whitened, error.reshape(timeline.num_epochs, 2, len(together))


def played(sent: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Games with offsets (G, K+1, 3): of the unaided solution innovations and error, of the filter both, too."""
    games, epochs = sent.shape[:2]
    unaided = Simulation(scenario(), None, (), make_response("always-exclude"), games, seed=5)
    trusting = Simulation(scenario(), None, (), None, games, seed=5)
    unaided.reset()
    trusting.reset()
    residual, drift, whitened, error = (np.empty((games, epochs, size)) for size in (3, 2, 3, 2))
    for k in range(epochs):
        if k:
            unaided.observe(sent[:, k])
            trusting.observe(sent[:, k])
        residual[:, k], whitened[:, k] = unaided.epoch.innovation.residual, trusting.epoch.innovation.whitened
        unaided.resolve()
        trusting.resolve()
        drift[:, k], error[:, k] = unaided.error[:, :2], trusting.error[:, :2]
    return residual, drift, whitened, error


@pytest.mark.parametrize(("shape", "family"), [(ramp, RandomRamp(0.0)), (spiral, ClimbingSpiral(0.0))])
def test_it_is_that_of_the_enumeration(shape: Shape, family: AttackFamily) -> None:
    epochs = scenario().timeline.num_epochs + 1
    # nothing, 0.3 m/s north from epoch 1, and 0.8 m/s south-west from epoch 0, both as the family turns and climbs
    draws = np.zeros((2, DRAWS))
    draws[:, 6:] = TOLD
    low, high = (0.2, 5.0) if shape is ramp else (0.3, 3.0)
    draws[:, 5], draws[:, 6] = (0.0, 0.625), np.log(np.array([0.3, 0.8]) / low) / np.log(high / low)
    family.bind(scenario().timeline, 1)
    sent = np.zeros((3, epochs, 3))
    sent[1:] = family.drawn(draws)
    sent[1] = np.roll(sent[1], 1, axis=0)
    sent[1, 0] = 0.0
    residual, drift, whitened, error = played(sent)
    probability, shown, moved = enumerated(family)
    nodes = shape(scenario().timeline, Resolution(), TOLD)
    bayesian = Bayesian(scenario(), nodes, clean=0.25, resolution=Resolution(sizes=12, headings=12))
    for game in range(len(sent)):
        found = bayesian.estimates(Fixes(residual[game], np.ones(epochs, dtype=bool), np.zeros(epochs)))
        # the best filter of a matched scenario is its own
        np.testing.assert_allclose(drift[game] - found.trusting, error[game], atol=1e-8)
        score = np.zeros(len(probability))
        for k in range(1, epochs):
            score += whitened[game, k] @ shown[k - 1] - 0.5 * (shown[k - 1] ** 2).sum(axis=0)
            weight = 0.75 * probability * np.exp(score - score.max())
            none = 0.25 * np.exp(-score.max())
            # attacks that have not begun are no attacks yet
            waiting = ~shown[:k].any(axis=(0, 1))
            total = weight.sum() + none
            assert abs(found.quiet[k] - (none + weight[waiting].sum()) / total) < 0.005
            np.testing.assert_allclose(found.mean[k] - found.trusting[k], moved[k - 1] @ weight / total, atol=0.02)
    assert found.quiet[-1] < 1e-6 < found.quiet[2]
