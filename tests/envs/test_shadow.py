"""The spoofer's shadow filter, with the victim's model and with a wrong one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from spoofgym.envs.shadow import shadow_model
from spoofgym.envs.spoofer import SpooferEnv
from spoofgym.envs.spoofer_seat import INNOVATION_UNIT
from spoofgym.optimum import expected_play
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario

SHORT = "liu-flight:horizon=12"
WRONG = ["liu-flight:horizon=12,imu=tactical", "liu-flight:horizon=12,sigma=7.4"]
DEAF = "snapshot:threshold=1000"


def short_flight() -> Scenario:
    return make_scenario(SHORT)


def rates(epochs: int) -> np.ndarray:
    return np.random.default_rng(2).uniform(-0.3, 0.3, (epochs, 3))


@pytest.mark.parametrize("shadow", [None, *WRONG])
def test_means_are_those_of_the_model_that_the_spoofer_believes_in(shadow: str | None) -> None:
    """Against the recursion that computes the exact value of attacks."""
    env = SpooferEnv(scenario=SHORT, detector=DEAF, shadow=shadow)
    env.reset(seed=1)
    whitened, offsets = [], []
    for action in rates(12):
        env.step(action)
        whitened.append(env.game.seat.shadow.whitened[0].copy())
        offsets.append(env.game.seat.offset[0].copy())
    play = expected_play(make_scenario(shadow or SHORT).linear_model(), np.array(offsets), 25.9)
    np.testing.assert_allclose(whitened, play.whitened, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(env.game.seat.shadow.position_error[0, :2], play.final_error, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("shadow", WRONG)
def test_a_wrong_shadow_changes_what_is_seen_and_nothing_else(shadow: str) -> None:
    right, wrong = (SpooferEnv(scenario=SHORT, knowledge="full", shadow=kind) for kind in (None, shadow))
    np.testing.assert_array_equal(right.reset(seed=3)[0], wrong.reset(seed=3)[0])
    for action in rates(12):
        one, other = right.step(action), wrong.step(action)
        assert one[1:] == other[1:]
        same = one[0] == other[0]
        assert same[:8].all()
        assert not same[8:20].any()
        assert same[20:].all()  # the victim's own innovation and statistic
        if one[2]:
            break


@pytest.mark.parametrize("knowledge", ["shadow", "full"])
def test_the_victim_named_as_shadow_is_the_default(knowledge: str) -> None:
    default, named = (SpooferEnv(scenario=SHORT, knowledge=knowledge, shadow=kind) for kind in (None, SHORT))
    np.testing.assert_array_equal(default.reset(seed=4)[0], named.reset(seed=4)[0])
    for action in rates(4):
        np.testing.assert_array_equal(default.step(action)[0], named.step(action)[0])


def test_innovation_action_goes_through_the_wrong_filter() -> None:
    """At the first epoch no error has grown: s = -L' u of the believed L', so that the victim sees L⁻¹ L' u."""
    arguments: dict[str, Any] = {"scenario": SHORT, "knowledge": "full", "detector": DEAF}
    env, clean = SpooferEnv(action="innovation", shadow=WRONG[1], **arguments), SpooferEnv(**arguments)
    env.reset(seed=5)
    clean.reset(seed=5)
    wanted = np.array([0.5, -0.25, 0.1])
    env.step(wanted)
    clean.step(np.zeros(3))
    mine = make_scenario(SHORT).linear_model().innovation_factor[1]
    believed = make_scenario(WRONG[1]).linear_model().innovation_factor[1]
    change = env.game.simulation.epoch.innovation.whitened[0] - clean.game.simulation.epoch.innovation.whitened[0]
    np.testing.assert_allclose(change, np.linalg.solve(mine, believed @ (INNOVATION_UNIT * wanted)), rtol=1e-9)
    np.testing.assert_allclose(env.game.seat.shadow.whitened[0], INNOVATION_UNIT * wanted, rtol=1e-9)


@pytest.mark.parametrize(
    ("shadow", "message"),
    [
        ("liu-flight:horizon=20", r"does not fit the game 'liu-flight:horizon=12': epochs: 20 instead of 12$"),
        ("liu-flight:horizon=12,onset=700", r"start, s: 700.0 instead of 800.0$"),
        ("liu-flight:horizon=12,rate=2", r"interval, s: 0.5 instead of 1.0$"),
        ("foi-drive", r"start, s: 20.0 instead of 800.0; epochs: 230 instead of 12$"),
        ("moon", r"unknown scenario 'moon'"),
        ("liu-flight:horizon=12,colour=red", r"no option 'colour'; valid options: .*sigma"),
    ],
)
def test_another_timeline_is_refused(shadow: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SpooferEnv(scenario=SHORT, shadow=shadow)


def test_another_dimension_is_refused() -> None:
    flight = short_flight()
    sigma = (0.1, 0.1, 0.1)
    richer = flight.changed(
        name="with velocity",
        receiver=replace(flight.family.receiver, velocity_sigma=sigma),
        tuning=replace(flight.family.tuning, measurement_sigma=(*flight.family.tuning.measurement_sigma, *sigma)),
    )
    with pytest.raises(ValueError, match=r"'with velocity' does not fit .*: dimension of the fix: 6 instead of 3"):
        shadow_model(flight, richer)
    assert shadow_model(richer, richer) is richer.linear_model()


def test_a_blind_spoofer_has_no_shadow_filter() -> None:
    with pytest.raises(ValueError, match=r"'liu-flight' needs knowledge 'shadow' or 'full'"):
        SpooferEnv(knowledge="blind", shadow="liu-flight")
