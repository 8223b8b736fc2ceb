"""Runs taken together, against formulas; per-game results in a file, which hold what the rows say."""

import numpy as np
import pytest

from spoofgym.evaluation.aggregate import aggregate, of_one_setting
from spoofgym.evaluation.game_log import GameLog
from spoofgym.policies.learned import load_policy
from tests.run_folders import spoofer


def test_means_are_those_of_the_runs():
    values = np.array([[1.0, 3.0], [0.0, 0.0], [5.0, 7.0], [100.0, 300.0]])  # means 2, 0, 6, 200
    found = aggregate(values, resamples=10)
    assert (found.runs, found.games) == (4, 2)
    assert found.mean == 52.0
    assert found.iqm == 4.0  # of 2 and 6: the lowest and the highest quarter are left out


def test_one_run_has_the_interval_of_the_mean_of_its_games():
    """The bootstrap's spread of 2000 resamples errs by 1.6 %: 15 % is more than nine sigma of it."""
    values = np.random.default_rng(1).normal(3.0, 2.0, (1, 4000))
    low, high = aggregate(values).mean_interval
    assert 0.5 * (low + high) == pytest.approx(values.mean(), abs=0.1 * 2.0 / np.sqrt(4000) * 6)
    assert high - low == pytest.approx(2 * 1.96 * values.std() / np.sqrt(4000), rel=0.15)


def test_runs_that_differ_widen_the_interval():
    """Ten runs that differ by a standard deviation of 1 and whose games are all alike."""
    levels = np.random.default_rng(2).normal(0.0, 1.0, 10)
    low, high = aggregate(np.repeat(levels[:, None], 50, axis=1)).mean_interval
    assert high - low == pytest.approx(2 * 1.96 * levels.std() / np.sqrt(10), rel=0.15)


def test_games_are_drawn_within_their_strata():
    values, strata = np.array([[0.0] * 30 + [10.0] * 70]), [0] * 30 + [1] * 70
    assert aggregate(values, strata).mean_interval == pytest.approx((7.0, 7.0))
    low, high = aggregate(values).mean_interval
    assert low < 6.5 < 7.5 < high


@pytest.mark.parametrize(("values", "strata"), [(np.zeros(3), None), (np.zeros((2, 0)), None), (np.zeros((2, 3)), [0])])
def test_what_does_not_fit_is_refused(values, strata):
    with pytest.raises(ValueError, match="aggregate: "):
        aggregate(values, strata)


def test_policies_of_one_environment_belong_together(tmp_path):
    for name, scenario in (("a", "liu-flight"), ("b", "foi-drive"), ("c", "liu-flight")):
        spoofer({"scenario": scenario, "knowledge": "blind"}, tmp_path / name)
    assert of_one_setting([load_policy(tmp_path / name) for name in "abc"]) == [["a", "c"]]


def test_a_file_of_games_holds_them_by_player_and_population(tmp_path):
    log = GameLog(40)
    log.note("x", "training", error_m=[1.0, 2.0], attack=np.array(["none", "ramp:1"]))
    log.note("y", "training", error_m=[3.0, 4.0], attack=np.array(["none", "ramp:1"]))
    log.write(tmp_path / "games.npz")
    with np.load(tmp_path / "games.npz") as found:  # np.load refuses pickles by itself
        assert found["training.players"].tolist() == ["x", "y"]
        assert found["training.seeds"].tolist() == [40, 41]
        assert found["training.error_m"].tolist() == [[1.0, 2.0], [3.0, 4.0]]
        assert found["training.attack"][1].tolist() == ["none", "ramp:1"]
