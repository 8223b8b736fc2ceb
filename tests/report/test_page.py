"""The file itself: complete, small, and written whole or not at all."""

import json
import re
from html.parser import HTMLParser
from importlib.resources import files as resources
from pathlib import Path

import pytest

from spoofgym.evaluation.game_trace import GameTrace
from spoofgym.report.games import game_story
from spoofgym.report.page import SCRIPTS, STYLES, script_json, write_page
from spoofgym.report.program import main

MOST_WITHOUT_DATA = 200_000
"""Bytes of a page without its games and results."""


class Collected(HTMLParser):
    """Addresses that a page names, and the texts of its elements."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.data = ""
        self._in_data = False

    def handle_starttag(self, tag: str, attrs: list) -> None:
        attributes = dict(attrs)
        self.addresses += [attributes[name] for name in ("src", "href", "action") if attributes.get(name)]
        self._in_data = attributes.get("id") == "data"

    def handle_endtag(self, tag: str) -> None:
        self._in_data = False

    def handle_data(self, data: str) -> None:
        if self._in_data:
            self.data += data


@pytest.fixture(scope="module")
def written(game: GameTrace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "game.html"
    write_page(path, [game])
    return path


def test_a_page_is_complete_and_asks_for_nothing(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    found = Collected()
    found.feed(text)
    assert [address for address in found.addresses if not address.startswith("#")] == []
    assert "default-src 'none'" in text
    for call in ("fetch(", "XMLHttpRequest", "WebSocket", "EventSource", "import(", "sendBeacon", "@import", "url("):
        assert call not in text
    assert "Copyright (c) 2022 Leon Sorokin" in text, "the licence of uPlot asks for it"


def test_the_game_is_in_the_page_and_everything_else_is_small(written: Path, game: GameTrace) -> None:
    found = Collected()
    found.feed(written.read_text(encoding="utf-8"))
    [figure] = json.loads(found.data)
    assert GameTrace.from_json(figure["game"]).events == game.events
    assert len(written.read_bytes()) - len(found.data) < MOST_WITHOUT_DATA


def test_a_long_game_stays_small() -> None:
    from spoofgym.evaluation.game_recording import play_game

    game = play_game("foi-drive", "ramp:0.5", ("snapshot", "signed-mean:n=5"), "snapshot > exclude")
    assert len(script_json(game.to_json())) < 75_000


def test_screen_readers_get_the_story(written: Path, game: GameTrace) -> None:
    story = game_story(game)
    assert "The first alarm comes at 21 s from snapshot" in story
    assert "fixes are excluded, the first at 21 s" in story
    assert f"{game.error[-1]:.1f} m at the end" in story
    assert story in written.read_text(encoding="utf-8")


def test_no_asset_is_forgotten_or_ends_a_script() -> None:
    folder = resources("spoofgym.report").joinpath("assets")
    there = {path.name for path in folder.iterdir() if path.name.endswith((".js", ".css"))}
    assert there == {name for name in (*SCRIPTS, *STYLES) if "/" not in name}
    for name in SCRIPTS:
        assert "</script" not in folder.joinpath(name).read_text(encoding="utf-8").lower()


def test_scripts_are_short() -> None:
    folder = resources("spoofgym.report").joinpath("assets")
    lengths = {name: len(folder.joinpath(name).read_text(encoding="utf-8").splitlines()) for name in SCRIPTS}
    assert {name: length for name, length in lengths.items() if length > 250} == {}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("no json", "is no JSON file"),
        ("[1, 2]", "no report of spoofgym"),
        ('{"kind": "recipe", "schema_version": 1}', "its kind is 'recipe'"),
        ('{"kind": "game", "schema_version": 7}', "this version reads schema_version 1, got 7"),
        ("[" * 100_000, "is no JSON file"),
    ],
)
def test_a_stranger_is_refused_in_one_line_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, words: str
) -> None:
    given, out = tmp_path / "given.json", tmp_path / "report.html"
    given.write_text(content, encoding="utf-8")
    assert main([str(given), "-o", str(out)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert words in line
    assert str(given) in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["given.json"]


def test_a_page_that_was_there_stays_where_a_source_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("before", encoding="utf-8")
    assert main([str(tmp_path / "nothing.json"), "-o", str(tmp_path / "report.html")]) == 2
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == "before"


def test_a_place_that_cannot_be_written_is_named(
    tmp_path: Path, game: GameTrace, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ValueError, match="is a folder, a file is meant"):
        write_page(tmp_path, [game])
    with pytest.raises(SystemExit) as status:
        main([str(tmp_path / "x.json"), "-o", str(tmp_path)])
    assert status.value.code == 2
    assert "is a folder" in capsys.readouterr().err


def test_a_page_needs_a_source(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one"):
        write_page(tmp_path / "report.html", [])


def test_ids_of_a_page_are_unique(written: Path) -> None:
    ids = re.findall(r'\bid="([^"]+)"', re.sub(r"(?s)<script.*?</script>", "", written.read_text(encoding="utf-8")))
    assert len(ids) == len(set(ids))
