"""`spoofgym play`: one game, told as a story and written as a page, a table and JSON, all of the same game."""

import csv
import json

import numpy as np
import pytest

from spoofgym.cli.play import main
from spoofgym.cli.story import BARS, PLAIN_BARS, sparkline, story
from spoofgym.evaluation.game_recording import play_game
from spoofgym.evaluation.game_trace import ALARM, BACKTRACK, GameTrace
from tests.run_folders import defender, spoofer

DRIVE = "foi-drive:horizon=60"
PULLED = ["--scenario", DRIVE, "--attack", "ramp:2", "--detector", "snapshot", "--response", "exclude-and-backtrack:10"]


@pytest.fixture(scope="module")
def game():
    return play_game(DRIVE, "ramp:2", ["snapshot"], "exclude-and-backtrack:10")


def test_the_story_tells_what_happened_and_when(game):
    lines = list(story(game, 80))
    text = "\n".join(lines)
    first, back = game.first(ALARM), game.first(BACKTRACK)
    (alarm,) = [line for line in lines if "alarm of snapshot" in line and "after the onset" in line]
    assert float(alarm.split()[0]) == pytest.approx(game.time[first.epoch])
    assert float(alarm.split()[1]) == pytest.approx(game.error[first.epoch], abs=0.006)
    assert f"{back.detail} taken back" in text
    assert f"mean {game.error.mean():.2f} m" in text
    assert lines[-1] == "the spoofer is detected"


@pytest.mark.parametrize("columns", [80, 40])
def test_it_fits_the_terminal_and_tells_all(game, columns):
    lines = list(story(game, columns))
    assert max(map(len, lines)) <= columns
    assert "alarm of snapshot" in " ".join(" ".join(lines).split())
    assert any(letter in line for line in lines for letter in BARS)


def test_a_terminal_without_blocks_gets_others(game):
    assert "\n".join(story(game, 80, blocks=False)).isascii()


def test_a_sparkline_shows_the_largest_of_each_stretch():
    values = np.zeros(100)
    values[57] = 8.0
    assert sparkline(values, 10) == "▁▁▁▁▁█▁▁▁▁"
    assert sparkline(np.array([0.0, 4.0, 8.0]), 10, PLAIN_BARS) == "_+#"
    assert sparkline(np.zeros(4), 10) == "▁▁▁▁"
    assert sparkline(np.array([np.nan, 1.0]), 10) == "▁█"


def test_a_quiet_game_is_told():
    quiet = "\n".join(story(play_game("liu-flight:horizon=5", None, ["snapshot:threshold=1e9"]), 80))
    assert "Nothing happens: no attack, no alarm." in quiet
    assert "detected" not in quiet


def test_page_table_and_json_are_of_the_same_game(tmp_path, capsys):
    names = ["page.html", "game.csv", "game.json"]
    page, table, content = (tmp_path / name for name in names)
    assert main([*PULLED, "--seed", "3", "--page", str(page), "--csv", str(table), "--json", str(content)]) == 0
    text = capsys.readouterr().out
    assert "seed 3" in text
    assert all(name in text for name in names)
    game = GameTrace.from_json(json.loads(content.read_text()))
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["error_m"]) for row in rows] == pytest.approx(game.error.tolist(), abs=2e-3)
    assert "ramp:2" in page.read_text()


def test_json_alone_on_stdout(capsys):
    assert main([*PULLED, "--json", "-"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["players"]["attack"] == "ramp:2"
    assert "scenario  foi-drive" in printed.err


def test_a_policy_takes_its_own_seat(tmp_path, capsys):
    spoofer({"scenario": "liu-flight:horizon=12", "knowledge": "blind"}, tmp_path / "x")
    defender({"scenario": DRIVE, "attacks": "none", "detectors": ["snapshot"]}, tmp_path / "d")
    assert main(["--policy", str(tmp_path / "x"), "--response", "none", "--detector", "snapshot"]) == 0
    text = capsys.readouterr().out
    assert f"spoofer   policy:{tmp_path / 'x'}" in text
    assert "scenario  liu-flight:horizon=12" in text
    assert main(["--policy", str(tmp_path / "d"), "--attack", "ramp:1"]) == 0
    assert f"defender  policy:{tmp_path / 'd'}" in capsys.readouterr().out
    assert main(["--policy", str(tmp_path / "x"), "--attack", "ramp:1"]) == 2
    assert "is a spoofer, whose seat --attack 'ramp:1' has taken" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--attack", "rmap:1"], "unknown attack 'rmap': did you mean 'ramp'?"),
        (["--detector", "raim"], "needs ranges to satellites"),
        (["--response", "exclud"], "unknown response 'exclud': did you mean 'exclude'?"),
        (["--policy", "nobody"], "'nobody' is no run folder and no published agent"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(arguments, words, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert main([*arguments, "--page", str(page)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert not page.exists()
