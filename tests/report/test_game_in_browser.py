"""The page of a game in a browser: it draws, it moves, and it can be used with the keyboard and on a phone."""

import csv
import time
from dataclasses import replace
from pathlib import Path

import pytest

from spoofgym.evaluation.game_trace import GameTrace
from spoofgym.report.page import write_page
from tests.report.browser import DESK, PHONE, Browser

pytestmark = pytest.mark.xdist_group("browser")
MOVED = """
const figure = document.querySelector('figure.game');
return [
  ...[...figure.querySelectorAll('.drawing-track svg > [transform]')].map((mark) => mark.getAttribute('transform')),
  ...[...figure.querySelectorAll('.playhead')].map((head) => head.style.left),
  ...[...figure.querySelectorAll('.legend .value, .readout dd')].map((value) => value.textContent),
]
"""


@pytest.fixture(scope="module")
def page(game: GameTrace, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "game.html"
    write_page(path, [game])
    return path


@pytest.mark.parametrize("size", [PHONE, DESK], ids=["phone", "desk"])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_game_draws_in_both_themes_on_every_screen(page: Path, browser: Browser, size: tuple, theme: str) -> None:
    browser.open(page, size, theme)
    assert browser.errors() == []
    assert browser.undrawn() == []
    assert browser.blank() == 0
    assert browser.too_wide() <= 0
    assert browser.run("return document.documentElement.dataset.theme") == theme
    assert browser.run("return document.querySelectorAll('figure.game canvas').length") == 4
    assert browser.run("return performance.getEntriesByType('resource').length") == 0


def test_the_scrubber_moves_all_figures(page: Path, browser: Browser) -> None:
    browser.open(page)
    slider = browser.find(".transport input[type=range]")
    at_end = browser.run(MOVED)
    slider.send_keys("\ue011")  # Home
    browser.settle()
    at_start = browser.run(MOVED)
    heads = [place for place in at_start if place and place.endswith("px")]
    assert len(heads) == 4
    assert len(set(heads)) == 1, "all playheads stand at one time"
    assert sum(one != other for one, other in zip(at_start, at_end, strict=True)) > len(at_start) // 2
    slider.send_keys("\ue014")  # right arrow
    browser.settle()
    assert slider.get_attribute("aria-valuetext") == "21 s, epoch 1 of 60"
    assert browser.find(".transport output").text == "21 s, epoch 1 of 60"


def test_play_goes_on_and_pause_stops(page: Path, browser: Browser) -> None:
    browser.open(page, motion="reduce")
    epoch = "return Number(document.querySelector('figure.game .drawing').dataset.epoch)"
    assert browser.run(epoch) == 60, "nothing plays by itself"
    play = browser.find(".transport .play")
    play.click()
    deadline = time.monotonic() + 20.0
    while not 2 <= browser.run(epoch) < 60:
        assert time.monotonic() < deadline
    assert play.text == "Pause"
    play.click()
    stopped = browser.run(epoch)
    assert play.text == "Play"
    time.sleep(0.6)  # two epochs and more of a game of 60
    assert browser.run(epoch) == stopped


def test_keys_go_from_event_to_event(page: Path, browser: Browser, game: GameTrace) -> None:
    browser.open(page)
    browser.find(".transport input[type=range]").send_keys("\ue011", "]")
    epoch = "return Number(document.querySelector('figure.game .drawing').dataset.epoch)"
    assert browser.run(epoch) == game.events[0].epoch
    browser.find(".transport input[type=range]").send_keys("]")
    assert browser.run(epoch) == min(event.epoch for event in game.events if event.epoch > game.events[0].epoch)
    browser.find(".events li:last-child button").click()
    assert browser.run(epoch) == game.events[-1].epoch


def test_the_reader_may_choose_the_theme(page: Path, browser: Browser) -> None:
    browser.open(page, theme="light")
    before = browser.run("return getComputedStyle(document.body).backgroundColor")
    browser.find("#theme").send_keys("dark")
    browser.settle()
    assert browser.run("return document.documentElement.dataset.theme") == "dark"
    assert browser.run("return getComputedStyle(document.body).backgroundColor") != before
    assert browser.blank() == 0
    browser.find("#theme").send_keys("as the system")


def test_numbers_can_be_downloaded(page: Path, browser: Browser, game: GameTrace, downloads: Path) -> None:
    browser.open(page)
    browser.run("document.querySelector('button.csv').click()")
    deadline = time.monotonic() + 20.0
    while not (found := list(downloads.glob("*.csv"))):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    with found[0].open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(game.time)
    assert float(rows[7]["estimated_east_m"]) == pytest.approx(game.estimated[7, 0], abs=1e-3)
    assert rows[1]["events"].startswith("onset")


def test_names_are_text_and_never_code(game: GameTrace, browser: Browser, tmp_path: Path) -> None:
    evil = "</script><script>window.hacked=1</script><img src=x onerror='window.hacked=2'>\u2028${window.hacked=3}"
    players = replace(game.players, scenario=evil, attack=evil, response=evil)
    statistics = (replace(game.statistics[0], name=evil),)
    write_page(tmp_path / "evil.html", [replace(game, players=players, statistics=statistics)], title=evil)
    browser.open(tmp_path / "evil.html")
    assert browser.undrawn() == []
    assert browser.run("return window.hacked === undefined")
    assert browser.find("h1").text.startswith("</script><script>")
    assert browser.errors() == []
