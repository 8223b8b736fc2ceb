"""Cards and recipes of agents: what is written is read, and what does not fit is refused by name."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spoofgym.policies.card import CARD_FILE, Card, Score, layout_digest, read_card, weights_digest
from spoofgym.policies.learned import POLICY_FILE, LearnedSpoofer, load_policy
from spoofgym.policies.recipe import RECIPE_FILE, Recipe, read_recipe
from tests.run_folders import spoofer

FLIGHT = {"scenario": "liu-flight:horizon=12", "knowledge": "blind"}
SCORE = Score("snapshot", "mean undetected error", "m", 3.5, (3.0, 4.0), 100, 7)


@pytest.fixture
def agent(tmp_path: Path) -> Path:
    """An agent with its card, without the files of the run that trained it."""
    spoofer(FLIGHT, tmp_path / "run")
    policy = LearnedSpoofer.load(tmp_path / "run")
    folder = tmp_path / "agent"
    folder.mkdir()
    policy.save(folder)
    card_of(policy).write(folder)
    return folder


def card_of(policy: LearnedSpoofer, **changes: Any) -> Card:
    given: dict[str, Any] = {
        "name": "agent",
        "role": "spoofer",
        "environment": "spoofgym/Spoofer-v0",
        "arguments": dict(policy.configuration),
        "layout_digest": layout_digest(policy.layout),
        "weights_digest": policy.weights_digest,
        "training": {"program": "spoofgym.learning.spoofer", "seed": 1},
        "scores": (SCORE,),
    }
    return Card(**{**given, **changes})


def test_an_agent_is_its_policy_and_its_card(agent: Path) -> None:
    policy = load_policy(agent)
    assert isinstance(policy, LearnedSpoofer)
    assert policy.configuration == FLIGHT
    card = read_card(agent)
    assert card == card_of(policy)
    assert card.scores == (SCORE,)
    assert (card.licence, card.schema_version) == ("MIT", 1)


def test_digests_tell_layouts_and_weights_apart() -> None:
    assert layout_digest(["a", "b"]) != layout_digest(["b", "a"]) != layout_digest(["a, b"])
    one = np.arange(6, dtype=np.float32)
    assert weights_digest([one.reshape(2, 3)]) != weights_digest([one.reshape(3, 2)])
    assert weights_digest([one]) == weights_digest([one.copy()])
    assert weights_digest([one]) != weights_digest([np.nextafter(one, np.float32(1e9))])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"weights_digest": "0" * 64}, "is the card of another policy: its weights have the digest 000000000000"),
        ({"layout_digest": "0" * 64}, "is the card of another policy: its layout have"),
        ({"arguments": {"scenario": "liu-flight"}}, "who plays is unknown"),
        ({"arguments": {"scenario": "liu-flight", "attacks": "training"}}, "is the run folder of a defender"),
    ],
)
def test_a_card_of_another_policy_is_refused(agent: Path, changes: dict[str, Any], message: str) -> None:
    card_of(LearnedSpoofer.load(agent), **changes).write(agent)
    with pytest.raises(ValueError, match=re.escape(message)):
        LearnedSpoofer.load(agent)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda card: card.pop("licence"), "entries are missing or unknown: licence"),
        (lambda card: card.update(colour="red"), "entries are missing or unknown: colour"),
        (lambda card: card.update(schema_version=2), "a card of version 2; this program reads version 1"),
        (lambda card: card.update(name=3), "name must be text, got 3"),
        (lambda card: card.update(arguments=[]), "arguments must be a table"),
        (lambda card: card.update(scores={}), "scores must be a list"),
        (lambda card: card["scores"][0].pop("unit"), "a score has the entries games, interval"),
        (lambda card: card["scores"][0].update(interval=[1.0]), "a score holds an entry of another kind"),
        (lambda card: card["scores"][0].update(games=-1), "a score holds an entry of another kind"),
    ],
)
def test_a_damaged_card_is_told_in_one_line(agent: Path, change: Any, message: str) -> None:
    content = json.loads((agent / CARD_FILE).read_text())
    change(content)
    (agent / CARD_FILE).write_text(json.dumps(content))
    with pytest.raises(ValueError, match=re.escape(message)) as told:
        read_card(agent)
    assert CARD_FILE in str(told.value)
    with pytest.raises(ValueError, match=re.escape(CARD_FILE)):
        load_policy(agent)


@pytest.mark.parametrize("text", ["", "[]", "{", '{"schema_version": 1', "\x00", "3"])
def test_what_is_no_card_is_told(agent: Path, text: str) -> None:
    (agent / CARD_FILE).write_text(text)
    with pytest.raises(ValueError, match=re.escape(CARD_FILE)):
        load_policy(agent)


def test_a_folder_without_files_is_told(tmp_path: Path, agent: Path) -> None:
    with pytest.raises(FileNotFoundError, match=re.escape(CARD_FILE)):
        read_card(tmp_path)
    (agent / POLICY_FILE).unlink()
    with pytest.raises(FileNotFoundError, match=re.escape(POLICY_FILE)):
        load_policy(agent)


def test_a_recipe_is_a_command_line(tmp_path: Path) -> None:
    options = {"scenario": 'a "quoted", é', "detector": ["snapshot", "windowed:n=5"], "clip_range": 0.2, "warm": True}
    written = Recipe("spoofgym.learning.defender", options)
    written.write(tmp_path)
    assert read_recipe(tmp_path) == written
    assert written.arguments == [
        *("--scenario", 'a "quoted", é', "--detector", "snapshot", "--detector", "windowed:n=5"),
        *("--clip-range", "0.2", "--warm", "true"),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("program = 'os'\n[options]\n", "program must be one of spoofgym.learning.spoofer"),
        ("program = 'spoofgym.learning.spoofer'\n", "a recipe has a program and a table of options"),
        ("program = ", RECIPE_FILE),
    ],
)
def test_a_recipe_that_is_none_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / RECIPE_FILE).write_text(text)
    with pytest.raises(ValueError, match=re.escape(message)):
        read_recipe(tmp_path)
    with pytest.raises(FileNotFoundError, match="cannot be trained again"):
        read_recipe(tmp_path / "nowhere")
