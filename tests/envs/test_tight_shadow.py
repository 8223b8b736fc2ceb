"""The shadow of a tightly coupled filter: the noise-free victim exactly, and the mean of noisy ones."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from scipy import stats

from spoofgym.arrays import Floats
from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.spoofer import SpooferEnv
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.navigation.spoof import Spoof
from spoofgym.navigation.tight.mean import TightMeanFilter
from spoofgym.navigation.tight.shared_gains import TightNavigator
from spoofgym.parallel import RunSlices
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.streams import RunStreams

KUJUR = "kujur-flight:horizon=40,onset=60,drag_off_rate=4"
LIU = "liu-flight:horizon=40,onset=60,coupling=tight,drag_off_rate=4"
DEAF = "snapshot:threshold=1e9"
REUSED = (5.64236, 5.0)
SKIES = [(4.0, 5.0), (8.5, 15.0), (9.5, 25.0), (10.7, 20.0), REUSED]
USE = Decision(np.ones(1, dtype=bool))
CLOCK_ALONE = np.array([0.0, 0.0, 0.0, 1.0])

Under = Callable[[float, float], Scenario]


def game(scenario: str | Scenario, lanes: int, seed: int = 7, **arguments: Any) -> SpooferGame:
    """Lanes of a game that no alarm ends, at epoch 0."""
    arguments = {"detector": DEAF, "on_alarm": "respond", "response": "always-use"} | arguments
    config = SpooferConfig(scenario=scenario, **arguments)
    result = SpooferGame(config, lanes, streams=RunStreams.from_seed(seed, lanes))
    result.reset(np.arange(lanes))
    return result


def actions(epochs: int) -> Floats:
    return np.random.default_rng(2).uniform(-0.3, 0.3, (epochs, 4))


class SilentVictim:
    """A victim without any noise or error of its own, whose ranges the scenario spoofs."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.navigator = scenario.family.navigator("linear", Demands(), 0, 1, RunSlices(1))
        assert isinstance(self.navigator, TightNavigator)
        assert not self.navigator.normals.any()
        self.offset = np.zeros((1, 4))
        self.whitened = np.zeros(3)

    def meet(self, offset: Floats) -> None:
        """Go through the ranges of the next epoch, moved by an offset (4,)."""
        following = self.navigator.index + 1
        rate = (offset - self.offset) / self.scenario.timeline.interval
        spoof = Spoof(offset[None, :3], rate[:, :3], offset[None, 3], rate[:, 3])
        self.navigator.propagate()
        innovation = self.navigator.innovate(self.scenario.family.spoofed("linear", following, 0, spoof))
        self.whitened = innovation.in_position.whitened[0]
        self.navigator.resolve(USE)
        self.offset = offset[None]

    def would_meet(self, offset: Floats) -> Floats:
        """The whitened innovation in the position, (3,), of the next epoch, with an offset."""
        other = deepcopy(self)
        other.meet(offset)
        return other.whitened


@pytest.mark.parametrize("sky", [*SKIES, "liu"], ids=str)
def test_the_shadow_is_the_victim_without_noise(sky: Any, under: Under) -> None:
    """All states, the last innovation, and the coming one where the offset is held; with range rates, too."""
    scenario = make_scenario(LIU) if sky == "liu" else under(*sky)
    present = scenario.tight_model().dynamics.present
    assert sky in ((4.0, 5.0), "liu") or present.any(axis=0).sum() > present.all(axis=0).sum()
    played, victim = game(scenario, 1), SilentVictim(scenario)
    shadow = played.seat.shadow
    assert isinstance(shadow, TightMeanFilter)
    victim.meet(np.zeros(4))
    for action in actions(40):
        played.step(action[None])
        victim.meet(played.seat.offset[0])
        np.testing.assert_allclose(shadow.error[0], victim.navigator.state[0], rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(shadow.whitened[0], victim.whitened, rtol=1e-8, atol=1e-10)
        assert shadow.clock_error[0] == pytest.approx(victim.navigator.clock_error[0], rel=1e-9)
        if played.index[0] < 40:
            coming = victim.would_meet(played.seat.offset[0])
            np.testing.assert_allclose(shadow.coming[0], coming, rtol=1e-8, atol=1e-10)


def test_a_satellite_rises_into_a_slot_that_another_has_left(under: Under) -> None:
    """Under one sky, so that what the spoofer did to the first must be forgotten; under another there are only four."""
    dynamics = under(*REUSED).tight_model().dynamics
    ((before, slot),) = np.argwhere(dynamics.started[1:])
    epoch = before + 1
    assert dynamics.present[:3, slot].all()
    assert not dynamics.present[epoch - 1, slot]
    assert dynamics.satellite[epoch, slot] != dynamics.satellite[0, slot]
    assert under(10.7, 20.0).tight_model().dynamics.present.sum(axis=1).min() == 4


@pytest.mark.parametrize("sky", [(4.0, 5.0), (10.7, 20.0)], ids=str)
def test_the_shadow_is_the_mean_of_many_victims(sky: tuple[float, float], under: Under) -> None:
    """Means of 2000 games against their standard error, 7 sigma each: false failure below 1e-9 in all."""
    lanes = 2000
    played = game(under(*sky), lanes, fidelity="linear")
    shadow = played.seat.shadow
    assert isinstance(shadow, TightMeanFilter)
    tolerance = 7.0 / np.sqrt(lanes)
    for k, action in enumerate(actions(40) + np.array([0.3, -0.2, 0.0, 0.2]), start=1):
        played.step(np.tile(action, (lanes, 1)))
        if k % 13 == 0:
            whitened = played.simulation.epoch.innovation.in_position.whitened
            deviation = whitened.mean(axis=0) - shadow.whitened[0]
            assert (np.abs(deviation) < tolerance * whitened.std(axis=0)).all()
    errors = played.simulation.error
    deviation = errors.mean(axis=0) - shadow.position_error[0]
    assert (np.abs(deviation) < tolerance * errors.std(axis=0)).all()
    assert abs(played.seat.clock_error.mean() - shadow.clock_error[0]) < tolerance * played.seat.clock_error.std()
    assert np.hypot(*shadow.position_error[0, :2]) > 3.0 * tolerance * errors.std(axis=0).max()


@pytest.mark.parametrize("scenario", [KUJUR, LIU])
def test_the_strapdown_victim_follows_the_shadow(scenario: str) -> None:
    """The nonlinear filter, spoofed minus clean on the same noise: within 1 % of what it is moved, and 2 cm."""
    spoofed, clean = (game(scenario, 1, fidelity="strapdown") for _ in range(2))
    assert spoofed.seat.shadow is not None
    for action in actions(40):
        spoofed.step(action[None])
        clean.step(np.zeros((1, 4)))
    moved = (spoofed.simulation.error - clean.simulation.error)[0]
    expected = spoofed.seat.shadow.position_error[0]
    assert np.linalg.norm(moved - expected) < 0.01 * np.linalg.norm(expected) + 0.02
    assert np.linalg.norm(expected) > 1.0


@pytest.mark.parametrize("scenario", [KUJUR, LIU])
def test_a_pull_of_the_clock_stays_in_the_clock(scenario: str) -> None:
    """Every satellite is late by the same: the clock follows the spoofer, the position by less than a thousandth."""
    spoofed, clean = (game(scenario, 1) for _ in range(2))
    for _ in range(40):
        spoofed.step(0.5 * CLOCK_ALONE[None])
        clean.step(np.zeros((1, 4)))
    pulled = 40 * 0.5 * spoofed.scenario.clock_rate * spoofed.scenario.timeline.interval
    assert spoofed.seat.offset[0].tolist() == [0.0, 0.0, 0.0, pulled]
    assert (spoofed.seat.clock_error - clean.seat.clock_error)[0] == pytest.approx(pulled, rel=1e-3)
    moved = (spoofed.simulation.error - clean.simulation.error)[0]
    assert np.abs(moved).max() < 1e-3 * pulled
    assert spoofed.error[0] == pytest.approx(clean.error[0], abs=1e-3 * pulled)


@pytest.mark.parametrize("scenario", [KUJUR, LIU])
def test_a_clock_that_is_pulled_fast_is_seen_and_slowly_is_not(scenario: str) -> None:
    """Against the snapshot test, 200 games: all see 4 m/s at once; of 0.04 m/s fewer than 1 in 10 hear.

    By the noncentral chi-square of the mean innovation a game misses the fast one with less than 1e-12; the slow one
    is caught with less than 1 % a game, so that 20 of 200 have less than 1e-12.
    """
    lanes = 200
    fast, slow = (game(scenario, lanes, detector="snapshot") for _ in range(2))
    fast.step(np.tile(CLOCK_ALONE, (lanes, 1)))
    assert fast.simulation.alarm.all()
    for _ in range(40):
        outcome = slow.step(np.tile(0.01 * CLOCK_ALONE, (lanes, 1)))
    assert outcome.alarmed.sum() < 20
    assert slow.seat.offset[0, 3] == pytest.approx(0.4 * slow.scenario.clock_rate * slow.scenario.timeline.interval)


@pytest.mark.parametrize(("scenario", "second"), [(KUJUR, 2.0), (LIU, 4.0)])
def test_a_fast_clock_is_missed_as_rarely_as_the_test_above_says(scenario: str, second: float) -> None:
    """The whole mean innovation of the first epoch of 4 m/s: code and carrier move by 2 m, range rates by 4 m/s.

    The threshold of the snapshot test (1e-5) lies between the two that are taken here.
    """
    model = make_scenario(scenario).tight_model()
    present, interval = model.dynamics.present[1], model.dynamics.interval
    pull = np.concatenate([4.0 * interval * present, second * present])
    mean = np.linalg.solve(model.innovation_factor[1], pull)
    degrees = 2 * int(present.sum())
    assert stats.ncx2.cdf(stats.chi2.isf(1e-6, degrees), degrees, mean @ mean) < 1e-12
    assert stats.ncx2.sf(stats.chi2.isf(1e-4, degrees), degrees, 1e-4 * (mean @ mean)) < 0.01


def test_a_wrong_shadow_changes_the_mean_entries_alone() -> None:
    other = KUJUR + ",imu=kujur-tactical"
    right, wrong = (SpooferEnv(scenario=KUJUR, knowledge="full", detector=DEAF, shadow=kind) for kind in (None, other))
    np.testing.assert_array_equal(right.reset(seed=3)[0], wrong.reset(seed=3)[0])
    names = [field.name for field in right.game.fields]
    believed = np.array([name.startswith("mean") for name in names])
    for action in actions(12):
        one, two = right.step(action), wrong.step(action)
        assert one[1:] == two[1:]
        np.testing.assert_array_equal(one[0][~believed], two[0][~believed])
    assert (one[0] != two[0])[believed].all()


@pytest.mark.parametrize(
    ("shadow", "message"),
    [
        ("kujur-flight:horizon=40,onset=60,coupling=loose", r"coupling: loose instead of tight$"),
        ("kujur-flight:horizon=20,onset=60", r"epochs: 20 instead of 40$"),
    ],
)
def test_another_coupling_or_timeline_is_refused(shadow: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SpooferEnv(scenario=KUJUR, shadow=shadow)
    with pytest.raises(ValueError, match="coupling: tight instead of loose"):
        SpooferEnv(scenario=KUJUR + ",coupling=loose", shadow=KUJUR)
