"""`--json`, `--seed`, `--threads` and `--import` of all programs: one meaning each, and a reason where one has none."""

import argparse

import pytest

from spoofgym import command_line, own_parts
from spoofgym.cli.commands import COMMANDS

NO_ROWS = "it makes a page, a folder or a log, and no rows"
NOTHING_IS_DRAWN = "nothing in it is drawn"
PINNED = "its seeds are part of what is compared"
LOOKS = "it only looks at what is there"
ONE_RUN = "a log has one run, and one game has no runs to share"
WORKERS = "processes share its work: --workers"
SERIAL = "it uses one thread"
NO_PARTS = "it takes no part by its name"
LACKING = {
    "--json": {
        "report": NO_ROWS,
        "import": NO_ROWS,
        "train spoofer": NO_ROWS,
        "train defender": NO_ROWS,
        "train again": NO_ROWS,
        "export": NO_ROWS,
        "benchmark table": "--write keeps its rows beside the page",
    },
    "--seed": {
        **dict.fromkeys(("list", "report", "check", "import", "check-log"), LOOKS),
        **dict.fromkeys(("benchmark attack", "benchmark defend", "benchmark table", "benchmark references"), PINNED),
        "train again": "the recipe has it",
        "agents": "the card has it",
        "thresholds": "a threshold is the same for everybody who asks for it",
        "study recorded-ranges": NOTHING_IS_DRAWN,
        **dict.fromkeys(("study fusion-ripper", "estimate-noise", "study noise"), NOTHING_IS_DRAWN),
    },
    "--threads": {
        **dict.fromkeys(("list", "report", "check", "import", "check-log"), LOOKS),
        **dict.fromkeys(("benchmark attack", "benchmark defend", "benchmark table", "benchmark references"), WORKERS),
        "bound bayes": WORKERS,
        **dict.fromkeys(("play", "evaluate recorded", "study recorded-ranges", "study fusion-ripper"), ONE_RUN),
        "study real-attacks": ONE_RUN,
        **dict.fromkeys(("estimate-noise", "study noise"), ONE_RUN),
        **dict.fromkeys(("thresholds", "bound duel", "export", "agents", "reproduce", "study aids"), SERIAL),
    },
    "--import": {
        **dict.fromkeys(("report", "check", "import", "check-log", "reproduce"), NO_PARTS),
        **dict.fromkeys(("study self-tuning", "study patient-spoofer", "study recorded-ranges"), NO_PARTS),
        **dict.fromkeys(("study fusion-ripper", "estimate-noise", "study noise"), NO_PARTS),
        "train again": "a recipe names parts of spoofgym alone",
    },
}
"""Programs that do not have an option, and why."""
UNDERSTOOD = {
    "--json": {command_line.json_output},
    "--seed": {command_line.seed_number, command_line.learner_seed},
    "--threads": {command_line.threads},
    "--import": {own_parts.take},
}
"""What reads the value of an option: the same everywhere."""


def programs():
    """Every command line of `spoofgym`, by its name; one with subcommands has one for each."""
    for command in COMMANDS:
        yield from _leaves(command.parser())


def _leaves(parser):
    inner = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not inner:
        yield parser.prog.removeprefix("spoofgym "), parser
    for action in inner:
        for each in action.choices.values():
            yield from _leaves(each)


def option(parser, name):
    return next((action for action in parser._actions if name in action.option_strings), None)


@pytest.mark.parametrize("name", LACKING)
def test_a_program_has_the_option_or_a_reason_to_lack_it(name):
    lacking = {program for program, parser in programs() if option(parser, name) is None}
    assert lacking == set(LACKING[name])


@pytest.mark.parametrize("name", LACKING)
def test_the_option_is_read_alike_everywhere(name):
    found = [action for _, parser in programs() if (action := option(parser, name)) is not None]
    assert {action.type for action in found} <= UNDERSTOOD[name]
    assert len({(action.metavar, type(action)) for action in found}) == 1
    assert all(action.help for action in found)


def test_every_program_is_listed_once():
    names = [name for name, _ in programs()]
    assert len(names) == len(set(names))
