"""Agents play again and compare with their cards; the table of the page is written by the program."""

from dataclasses import replace
from pathlib import Path

import pytest

from spoofgym.policies.card import read_card
from spoofgym.policies.published import agents_folder, published_names
from spoofgym.studies import agents, export
from tests.run_folders import spoofer
from tests.studies.test_export import finished

FLIGHT = {"scenario": "liu-flight:horizon=12", "knowledge": "blind", "detector": "snapshot"}


@pytest.fixture
def agent(tmp_path: Path) -> Path:
    spoofer(FLIGHT, tmp_path / "run")
    assert export.main([str(finished(tmp_path / "run", {})), str(tmp_path / "mine"), "--games", "50"]) == 0
    return tmp_path / "mine"


def test_an_agent_plays_as_its_card_tells(agent: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert agents.main([str(agent), "--check"]) == 0
    told = capsys.readouterr().out
    assert "mine" in told
    assert "does not hold" not in told
    card = read_card(agent)
    assert agents.played_again(str(agent), card) == card.scores


def test_a_score_that_does_not_hold_is_told(agent: Path, capsys: pytest.CaptureFixture[str]) -> None:
    card = read_card(agent)
    (score,) = card.scores
    replace(card, scores=(replace(score, value=99.0, interval=(98.0, 100.0)),)).write(agent)
    assert agents.main([str(agent), "--check", "--games", "20"]) == 1
    assert "does not hold" in capsys.readouterr().out
    replace(card, scores=(replace(score, opponent="nobody"),)).write(agent)
    assert agents.main([str(agent), "--check"]) == 2
    assert "tells other opponents than its policy has" in capsys.readouterr().err


def test_the_table_of_a_page_is_replaced(agent: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n\n{agents.BEGIN}\nold\n{agents.END}\n\nafter\n")
    for _ in range(2):
        assert agents.main([str(agent), "--write", str(page)]) == 0
        text = page.read_text()
        assert text.startswith("before\n")
        assert text.endswith("after\n")
        assert "old" not in text
        assert text.count("| mine | spoofer | liu-flight:horizon=12 | blind | snapshot | mean undetected error") == 1
    page.write_text("nothing")
    assert agents.main([str(agent), "--write", str(page)]) == 2
    assert "has no place for the table" in capsys.readouterr().err


def test_the_page_of_the_published_agents_is_the_table_of_their_cards() -> None:
    text = (agents_folder() / "README.md").read_text(encoding="utf-8")
    for name in published_names():
        card = read_card(agents_folder() / name)
        assert card.name == name
        for score in card.scores:
            assert f"{score.metric} {agents.shown(score)} |" in text


@pytest.mark.parametrize("name", ["liu-flight-snapshot-spoofer", "liu-flight-ramp-defender"])
def test_a_published_agent_plays_as_its_card_tells(name: str) -> None:
    """500 games on the seeds of the card: intervals of 95 % of the same games overlap wherever it plays alike."""
    card = read_card(agents_folder() / name)
    for told, found in zip(card.scores, agents.played_again(name, card, 500), strict=True):
        assert agents.overlap(told, found)
