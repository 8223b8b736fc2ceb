"""What no test can see: the gain of a whole game, against the mean filter itself and against other directions."""

from types import SimpleNamespace

import numpy as np
import pytest

from spoofgym.navigation.loose.mean_maps import error_map
from spoofgym.optimum import game_gain
from spoofgym.optimum.response import error_response
from spoofgym.parallel import RunSlices
from spoofgym.scenarios import make_scenario

GAINS = {"foi-drive": 15.6, "liu-flight:horizon=250,imu=tactical": 61.5, "liu-flight": 2.0}
"""m per unit of noncentrality, to the digits that the prototype gave."""


@pytest.mark.parametrize("scenario", GAINS)
def test_gain_is_that_of_the_prototype(scenario: str) -> None:
    found = game_gain(make_scenario(scenario).linear_model())
    assert found.gain == pytest.approx(GAINS[scenario], abs=0.05)
    assert np.sqrt((found.error**2).sum(axis=1).mean()) == pytest.approx(found.gain, rel=1e-12)
    assert (found.whitened**2).sum() == pytest.approx(1.0, rel=1e-12)


def test_its_offsets_do_in_the_mean_filter_what_the_map_says() -> None:
    """The filter of the spoofer's shadow, another implementation of Liu's equations, is sent the offsets."""
    scenario = make_scenario("foi-drive:horizon=40")
    found = game_gain(scenario.linear_model())
    shadow = scenario.family.mean_filter(1, RunSlices(1))
    shadow.reset(np.arange(1))
    before = np.zeros((1, 3))
    for k in range(41):
        offset = before if k == 0 else found.offsets[None, k - 1]
        shadow.advance(np.array([k]), offset, before, np.full(1, scenario.timeline.interval))
        if k:
            np.testing.assert_allclose(shadow.whitened[0], found.whitened[k - 1], atol=1e-9)
            np.testing.assert_allclose(shadow.position_error[0, :2], found.error[k - 1], atol=1e-9)
        before = offset


def test_no_other_innovations_do_more() -> None:
    model = make_scenario("foi-drive:horizon=40").linear_model()
    found, mapped = game_gain(model), error_map(model)
    others = np.random.default_rng(1).standard_normal((mapped.shape[1], 500))
    errors = mapped @ (others / np.linalg.norm(others, axis=0))
    assert (np.sqrt((errors**2).sum(axis=0) / 40) < found.gain).all()


def test_the_last_rows_are_the_map_to_the_final_error() -> None:
    model = make_scenario("liu-flight:horizon=30").linear_model()
    np.testing.assert_allclose(error_map(model)[-2:], error_response(model, 30).reshape(2, -1), atol=1e-12)


def test_receivers_that_give_velocity_are_refused() -> None:
    with pytest.raises(ValueError, match=r"the gain of a game exists only for position fixes \(m = 3\)"):
        game_gain(SimpleNamespace(dimension=6))  # type: ignore[arg-type]
