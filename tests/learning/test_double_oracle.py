"""Leagues: a tiny game whose every best response is enumerated, resumption from any kill, and what is refused."""

import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.opponents import POOL
from spoofgym.evaluation.duels import harms, play_matrix, with_detectors_of
from spoofgym.evaluation.payoff import nash, nash_conv
from spoofgym.learning.double_oracle import ROUNDS_FILE, SETTINGS_FILE, League, LeagueSettings, mixture
from spoofgym.specification import Specification, unnest
from spoofgym.studies.league_presentation import league_figure, league_tables
from tests.run_folders import spoofer

SPOOFERS = ("ramp:0.3,direction=90", "ramp:1,direction=90", "ramp:4,direction=90")
DEFENDERS = ("snapshot > exclude:reuse=5", "windowed:n=5,threshold=25 > latch", "always-exclude")
QUIET = {"clean": 0.3, "outage": 0.0, "multipath": 0.0}
DUEL = with_detectors_of(DuelConfig(scenario="foi-drive:horizon=60", detectors=("snapshot",), **QUIET), DEFENDERS)
SETTINGS = LeagueSettings(
    duel=DUEL, spoofers=SPOOFERS[:1], defenders=DEFENDERS[:1], rounds=5, games=40, most_games=40, seed=3, resamples=20
)


@pytest.fixture(scope="module")
def whole() -> np.ndarray:
    """The payoff of every spoofer against every defender."""
    cells = play_matrix(DUEL, SPOOFERS, DEFENDERS, SETTINGS.games, SETTINGS.seed)
    return harms(cells).mean(axis=2)


def enumerating(whole: np.ndarray) -> Callable[..., str]:
    """A trainer that knows the whole game: the best response is looked up."""

    def best(side: str, opponent: str, folder: Path, seed: int) -> str:
        names, weights = [opponent], [1.0]
        if opponent.startswith(POOL):
            given = Specification.parse(opponent)
            names = [unnest(part) for part in str(given.value).split("+")]
            weights = [float(weight) for weight in given.options["weights"].split("+")]
        others = DEFENDERS if side == "spoofer" else SPOOFERS
        shares = np.zeros(len(others))
        for name, weight in zip(names, weights, strict=True):
            shares[others.index(name)] = weight
        if side == "spoofer":
            return SPOOFERS[int((whole @ shares).argmax())]
        return DEFENDERS[int((shares @ whole).argmin())]

    return best


def test_it_finds_the_equilibrium_of_the_enumerated_game(whole: np.ndarray, tmp_path: Path) -> None:
    rounds = League(SETTINGS, tmp_path, enumerating(whole)).play()
    last, exact = rounds[-1], nash(whole)
    assert last.mixtures.value == pytest.approx(exact.value, rel=1e-9)
    spread = [np.zeros(3), np.zeros(3)]
    for shares, names, found in (
        (spread[0], SPOOFERS, zip(last.spoofers, last.mixtures.spoofers, strict=True)),
        (spread[1], DEFENDERS, zip(last.defenders, last.mixtures.defenders, strict=True)),
    ):
        for name, share in found:
            shares[names.index(name)] = share
    assert nash_conv(whole, *spread) == pytest.approx(0.0, abs=1e-9 * whole.max())
    # nobody who gains nothing is taken in, and nobody twice
    assert len(set(last.spoofers)) == len(last.spoofers)
    assert len(set(last.defenders)) == len(last.defenders)
    assert not any(gain["joins"] for gain in rounds[-2].gains.values())
    rows = [SPOOFERS.index(name) for name in last.spoofers]
    columns = [DEFENDERS.index(name) for name in last.defenders]
    np.testing.assert_allclose(last.mean, whole[np.ix_(rows, columns)], rtol=1e-12)
    np.testing.assert_allclose(last.worst, last.mean.max(axis=0), rtol=0)


@pytest.mark.parametrize("kill", [1, 2, 3, 4])
def test_a_league_that_is_killed_goes_on(kill: int, whole: np.ndarray, tmp_path: Path) -> None:
    """In its training number ``kill``. Nothing is played twice, and the end is as if nothing had happened."""
    settings = replace(SETTINGS, rounds=2)
    League(settings, tmp_path / "once", enumerating(whole)).play()
    best, calls = enumerating(whole), []

    def killed(*arguments: Any) -> str:
        calls.append(arguments)
        if len(calls) == kill:
            raise KeyboardInterrupt
        return best(*arguments)

    told: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        League(settings, tmp_path / "twice", killed).play(told.append)
    League(settings, tmp_path / "twice", best).play(told.append)
    played = [line for line in told if " against " in line and "trained" not in line]
    assert len(set(played)) == len(played)
    for name in (SETTINGS_FILE, ROUNDS_FILE):
        assert (tmp_path / "once" / name).read_text() == (tmp_path / "twice" / name).read_text()


CLOSE = replace(SETTINGS, spoofers=SPOOFERS, defenders=DEFENDERS, rounds=1, games=10, most_games=40)
"""Few games decide nothing: those that matter are played until the enumerated game is there."""


def test_cells_get_more_games_where_they_decide_who_is_mixed_in(whole: np.ndarray, tmp_path: Path) -> None:
    rounds = League(CLOSE, tmp_path, enumerating(whole)).play()
    last, exact = rounds[-1], nash(whole)
    assert set(np.unique(last.games)) <= {10, 20, 40}
    assert last.games.min() < 40 == last.games.max()
    assert last.mixtures.value == pytest.approx(exact.value, rel=1e-9)
    assert nash_conv(whole, last.mixtures.spoofers, last.mixtures.defenders) == pytest.approx(0.0, abs=1e-9)
    # every cell is the mean of its first games
    cells = harms(play_matrix(DUEL, SPOOFERS, DEFENDERS, 40, SETTINGS.seed))
    for place in np.ndindex(3, 3):
        assert last.mean[place] == pytest.approx(cells[place][: last.games[place]].mean(), rel=1e-12)


def test_a_league_that_is_killed_between_games_ends_alike(whole: np.ndarray, tmp_path: Path) -> None:
    """Again and again; the cells on disk then have more games than the rounds that are gone through again."""
    best, told = enumerating(whole), []
    League(CLOSE, tmp_path / "once", best).play(told.append)
    assert any(", games 10 to 19" in line for line in told)

    class Kill:
        left = 12

        def __call__(self, line: str) -> None:
            self.left -= 1
            if not self.left:
                raise KeyboardInterrupt

    for _ in range(len(told)):
        try:
            League(CLOSE, tmp_path / "twice", best).play(Kill())
        except KeyboardInterrupt:
            continue
        break
    League(CLOSE, tmp_path / "twice", best).play()
    assert (tmp_path / "once" / ROUNDS_FILE).read_text() == (tmp_path / "twice" / ROUNDS_FILE).read_text()


def test_a_league_of_before_has_as_many_games_everywhere(whole: np.ndarray, tmp_path: Path) -> None:
    settings = replace(SETTINGS, rounds=0)
    League(settings, tmp_path, enumerating(whole)).play()
    content = json.loads((tmp_path / SETTINGS_FILE).read_text())
    del content["most_games"]
    (tmp_path / SETTINGS_FILE).write_text(json.dumps(content))
    with pytest.raises(ValueError, match="its most_games is 40, not 160"):
        League(replace(settings, most_games=None), tmp_path, enumerating(whole))
    League(settings, tmp_path, enumerating(whole)).play()


def test_another_league_is_refused(whole: np.ndarray, tmp_path: Path) -> None:
    best = enumerating(whole)
    League(replace(SETTINGS, rounds=0), tmp_path, best).play()
    League(replace(SETTINGS, rounds=1), tmp_path, best).play()  # more rounds are the same league
    other = replace(SETTINGS, duel=replace(DUEL, payoff="beyond:5"))
    with pytest.raises(ValueError, match=r"holds another league: its duel\.payoff is 'error', not 'beyond:5'"):
        League(other, tmp_path, best)
    content = json.loads((tmp_path / SETTINGS_FILE).read_text())
    (tmp_path / SETTINGS_FILE).write_text(json.dumps({**content, "schema_version": 9}))
    with pytest.raises(ValueError, match="is of version 9; this program plays version 1"):
        League(SETTINGS, tmp_path, best)
    for text in ("{", "[]"):
        (tmp_path / SETTINGS_FILE).write_text(text)
        with pytest.raises(ValueError, match=re.escape(f"{SETTINGS_FILE} is damaged")):
            League(SETTINGS, tmp_path, best)


def test_rounds_that_are_damaged_are_named(whole: np.ndarray, tmp_path: Path) -> None:
    league = League(replace(SETTINGS, rounds=0), tmp_path, enumerating(whole))
    for text in ("{}", "[1]", "["):
        (tmp_path / ROUNDS_FILE).write_text(text)
        with pytest.raises(ValueError, match=re.escape(f"{ROUNDS_FILE} is damaged")):
            league.play()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"spoofers": ("ramp:1", "nobody")}, "unknown attack 'nobody'"),
        ({"defenders": ("policy:nobody",)}, "'nobody' is no run folder and no published agent"),
        ({"defenders": ("cusum > exclude",)}, "cusum"),
    ],
)
def test_a_player_that_cannot_play_is_refused_before_anything_is_written(
    changes: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=message):
        League(replace(SETTINGS, **changes), tmp_path / "league", lambda *_: "")
    assert not (tmp_path / "league").exists()


def test_a_damaged_cell_is_named(whole: np.ndarray, tmp_path: Path) -> None:
    League(replace(SETTINGS, rounds=0), tmp_path, enumerating(whole)).play()
    (cell,) = (tmp_path / "cells").iterdir()
    whole_file, few = cell.read_bytes(), io.BytesIO()
    np.savez(few, harm=np.zeros(3), clean=np.zeros(3, bool))
    for content in (whole_file[:-5], few.getvalue(), b""):
        cell.write_bytes(content)
        with pytest.raises(ValueError, match=re.escape(f"{cell.name} is damaged")):
            League(replace(SETTINGS, rounds=0), tmp_path, enumerating(whole)).play()


def test_a_frozen_policy_stays_as_it_is(tmp_path: Path) -> None:
    text = spoofer({"scenario": "foi-drive:horizon=60", "knowledge": "blind"}, tmp_path / "x")
    settings = replace(SETTINGS, spoofers=(text,), rounds=0)
    League(settings, tmp_path / "league", lambda *_: text).play()
    file = tmp_path / "x" / "policy.npz"
    arrays = dict(np.load(file))
    np.savez(file, **{**arrays, "bias_0": arrays["bias_0"] + np.float32(1.0)})
    with pytest.raises(ValueError, match="is not the policy that this league has played: its weights have changed"):
        League(settings, tmp_path / "league", lambda *_: text).play()


def test_mixtures_are_spelled_as_pools() -> None:
    assert mixture(SPOOFERS, np.array([0.0, 1.0, 0.0])) == SPOOFERS[1]
    found = mixture(("ramp:1,direction=90", "policy:runs/a"), np.array([0.25, 0.75]))
    assert found == "pool:ramp:1/direction=90+policy:runs/a,weights=0.25+0.75"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"spoofers": ()}, "at least one spoofer and one defender"),
        ({"games": 1}, "games must be"),
        ({"most_games": 39}, "most_games must be a whole number, 40 or more"),
        ({"meta": "best"}, "meta must be"),
        ({"rounds": -1}, "rounds must be"),
    ],
)
def test_settings_that_are_none_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(SETTINGS, **changes)


def test_tables_and_the_figure_tell_who_is_exploited(whole: np.ndarray, tmp_path: Path) -> None:
    rounds = League(replace(SETTINGS, rounds=3), tmp_path, enumerating(whole)).play()
    report = {**SETTINGS.content(), "results": [each.content() for each in rounds]}
    values, spoofing, defending, worst = league_tables(report)
    assert values.row_count == 4
    assert spoofing.row_count >= 1 <= defending.row_count
    assert worst.row_count == len(rounds[-1].defenders) + 1  # the mixture is a defender, too
    heights = []
    for results in (report["results"], report["results"][-1:]):
        league_figure({**report, "results": results}, tmp_path / "league.png")
        heights.append(imread(tmp_path / "league.png").shape[0])
    assert heights[0] > heights[1] > 200  # a single round has no course of the value to draw


def test_the_title_fits_above_a_matrix_of_few_players(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cell = {"mean": [[9.9]], "half_width": [[0.1]], "value": 9.9, "value_ci95": [9.1, 10.7], "gains": {}}
    mixed = {"spoofer_mixture": [1.0], "defender_mixture": [1.0], "spoofers": ["ramp:1"], "defenders": ["always-use"]}
    duel = {"scenario": "liu-flight:horizon=250,imu=tactical", "payoff": "error"}
    drawn: list[Any] = []
    monkeypatch.setattr("spoofgym.files.write_figure", lambda path, figure: drawn.append(figure))
    league_figure({"duel": duel, "results": [{"number": 0, **cell, **mixed}]}, tmp_path / "league.png")
    figure = drawn[0]
    figure.canvas.draw()
    assert figure.bbox.x1 >= max(text.get_window_extent().x1 for text in figure.texts)
    assert "liu-flight:horizon=250,imu=tactical" in figure.texts[0].get_text()


@pytest.mark.parametrize("name", ["a+b", "a,b"])
def test_a_folder_that_no_mixture_can_name_is_refused_before_anybody_trains(name: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="separate the players of a mixture"):
        League(SETTINGS, tmp_path / name, pytest.fail)
