"""When attacks begin and end: exact probabilities against what the families draw."""

import numpy as np
import pytest
from scipy.stats import chi2

from spoofgym.attacks.families import DEFAULT_MANOEUVRE, RandomJump, spoofed_stretch
from spoofgym.optimum.bayes.schedule import schedule
from spoofgym.scenarios import make_scenario

DRAWN = 40_000


@pytest.mark.parametrize("name", ["foi-drive", "liu-flight:horizon=60,rate=2"])
def test_it_is_what_is_drawn(name: str) -> None:
    """Pearson's test on onsets and on ends; either fails by chance with a probability of 1e-7."""
    scenario = make_scenario(name)
    family, epochs = RandomJump(), scenario.timeline.num_epochs
    family.bind(scenario.timeline, 1)
    family.follow(scenario.velocity_in_steps())
    found = schedule(scenario.timeline, scenario.manoeuvres(), DEFAULT_MANOEUVRE)
    first, last = spoofed_stretch(family.drawn(np.random.default_rng(1).random((DRAWN, 12))))
    assert _fits(first - 1, found.onset)
    # an end is seen where the game goes on
    seen = np.array([end * found.onset[: max(epochs - d + 1, 0)].sum() for d, end in enumerate(found.ends)])
    ended = last < epochs
    assert ended.sum() == pytest.approx(DRAWN * seen.sum(), abs=6.0 * np.sqrt(DRAWN * seen.sum()) + 1e-9)
    if ended.any():
        assert _fits((last - first + 2)[ended], seen / seen.sum())


def _fits(values: np.ndarray, probability: np.ndarray) -> bool:
    expected = len(values) * probability
    counted = np.bincount(values, minlength=len(probability))
    assert len(counted) == len(probability)
    assert not counted[probability == 0.0].any()
    often = expected >= 5.0
    statistic = ((counted - expected)[often] ** 2 / expected[often]).sum()
    return bool(statistic < chi2.isf(1e-7, often.sum()))


def test_probabilities_are_whole() -> None:
    scenario = make_scenario("foi-drive")
    found = schedule(scenario.timeline, scenario.manoeuvres(), 0.3)
    assert found.onset.sum() == pytest.approx(1.0, abs=1e-12)
    assert found.ends.sum() + found.lasts[-1] == pytest.approx(1.0, abs=1e-12)
    assert found.lasts[0] == 1.0
    without = schedule(scenario.timeline, (), 0.3)
    np.testing.assert_allclose(without.onset, schedule(scenario.timeline, scenario.manoeuvres(), 0.0).onset, atol=1e-15)
