"""The command line of the programs: a parser that tells a mistake in one line, and types of arguments."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from spoofgym import figures, files, own_parts
from spoofgym.validation import nearest

STDOUT = "-"
EXAMPLES = "examples:"
MOST_THREADS = 1024
MOST_COUNT = 10**12
"""Of anything: no computer would come to an end with more."""
LARGEST_LEARNER_SEED = 2**32 - 1
"""NumPy's older generator, which Stable-Baselines3 seeds, takes no larger one; those of the games do."""


class Help(argparse.HelpFormatter):
    """Folds what a help text says to the terminal, and leaves its examples as they are, so that they can be copied."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith(EXAMPLES):
            return "\n".join(indent + line for line in text.splitlines())
        return super()._fill_text(text, width, indent)


class Parser(argparse.ArgumentParser):
    """An `argparse` parser whose errors take one line and name the nearest option, and whose help ends with examples.

    Attributes:
        examples: commands to copy, one a line.
    """

    def __init__(self, *arguments: Any, examples: Sequence[str] = (), **options: Any) -> None:
        """Take what `argparse.ArgumentParser` takes, and the examples."""
        options.setdefault("formatter_class", Help)
        if examples:
            options.setdefault("epilog", "\n".join([EXAMPLES, *(f"  {line}" for line in examples)]))
        super().__init__(*arguments, **options)
        self.examples = tuple(examples)

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """The options of a command line; one that is unknown is told together with the nearest that is known."""
        found, unknown = self.parse_known_args(args, namespace)
        if unknown:
            known = _options(self)
            given = next((text.partition("=")[0] for text in unknown if text.startswith("-")), "")
            self.error(f"unrecognized arguments: {' '.join(unknown)}{nearest(given, known)}")
        return found

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse what is none of an argument's choices; the nearest of them is named."""
        if action.choices is not None and value not in action.choices:
            valid = [str(choice) for choice in action.choices]
            told = f"invalid choice: {value!r}{nearest(str(value), valid)} (choose from {', '.join(valid)})"
            raise argparse.ArgumentError(action, told)

    def error(self, message: str) -> NoReturn:
        """Tell what is wrong and exit with status 2."""
        self.exit(2, f"error: {' '.join(message.split())} ({self.prog} --help lists the options)\n")


def _options(parser: argparse.ArgumentParser) -> list[str]:
    """Every option of a parser and of its subcommands."""
    names: list[str] = []
    for action in parser._actions:
        names += action.option_strings
        if isinstance(action, argparse._SubParsersAction):
            names += [name for inner in action.choices.values() for name in _options(inner)]
    return names


def count(text: str) -> int:
    """A whole number of 1 or more; ``1e6`` and ``1_000_000`` are understood."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value != int(value) or value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number, 1 or more, got {text!r}")
    if value > MOST_COUNT:
        raise argparse.ArgumentTypeError(f"expected a whole number, {MOST_COUNT:,} or less, got {text!r}")
    return int(value)


def threads(text: str) -> int:
    """A number of threads."""
    value = count(text)
    if value > MOST_THREADS:
        raise argparse.ArgumentTypeError(f"expected {MOST_THREADS} threads or fewer, got {text!r}")
    return value


def seed_number(text: str) -> int:
    """A whole number of 0 or more."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"expected a whole number, 0 or more, got {text!r}")
    return value


def learner_seed(text: str) -> int:
    """A seed of a training."""
    value = seed_number(text)
    if value > LARGEST_LEARNER_SEED:
        raise argparse.ArgumentTypeError(f"expected a whole number from 0 to {LARGEST_LEARNER_SEED}, got {text!r}")
    return value


def share(text: str) -> float:
    """A number from 0 to 1."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"expected a number from 0 to 1, got {text!r}")
    return value


def share_of_alarms(text: str) -> float:
    """A probability between 0 and 1."""
    value = share(text)
    if value in (0.0, 1.0):
        raise argparse.ArgumentTypeError(f"expected a number between 0 and 1, got {text!r}")
    return value


def above_one(text: str) -> float:
    """A finite number greater than 1."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, got {text!r}") from None
    if not 1.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"expected a finite number greater than 1, got {text!r}")
    return value


def picture(text: str) -> Path:
    """A file that can be written, whose ending names a picture format."""
    path = Path(text)
    if path.suffix.lower() not in files.PICTURES:
        raise argparse.ArgumentTypeError(f"a figure's name ends in {', '.join(files.PICTURES)}, got {text!r}")
    if not figures.can_draw():
        raise argparse.ArgumentTypeError(figures.MISSING)
    return output(text)


def output(text: str) -> Path:
    """A file that can be written."""
    if not text or text.endswith("/"):
        raise argparse.ArgumentTypeError(f"expected the name of a file, got {text!r}")
    try:
        files.check_file(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return Path(text)


def json_output(text: str) -> Path | str:
    """A file that can be written, or ``-`` for stdout."""
    return text if text == STDOUT else output(text)


def run_folder(text: str) -> Path:
    """A folder that exists or can be made, and can be written."""
    try:
        files.check_folder(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return Path(text)


def add_seed(parser: argparse.ArgumentParser, of: str, default: int = 0) -> None:
    """The option ``--seed`` of a program; ``of`` says what it seeds: "game 0", say."""
    parser.add_argument("--seed", type=seed_number, default=default, help=f"of {of} (default: %(default)s)")


def add_threads(parser: argparse.ArgumentParser, default: int = 2) -> None:
    """The option ``--threads`` of a program that simulates."""
    parser.add_argument("--threads", type=threads, default=default, help="of the simulation (default: %(default)s)")


def add_import(parser: argparse.ArgumentParser) -> None:
    """The option ``--import`` of a program that takes parts by their names: one's own are known from then on."""
    parser.add_argument(
        "--import",
        action="append",
        type=own_parts.take,
        metavar="MODULE",
        dest="imported",
        help="Python module that registers parts of your own; repeatable",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """The option ``--json`` of a program that prints rows."""
    parser.add_argument(
        "--json",
        type=json_output,
        metavar="FILE",
        help="write the rows as JSON; - = to stdout, and nothing else there",
    )


def games_output(text: str) -> Path:
    """A file that can be written, whose name ends in ``.npz``."""
    if not text.lower().endswith(".npz"):
        raise argparse.ArgumentTypeError(f"a file of games ends in .npz, got {text!r}")
    return output(text)


def add_games(parser: argparse.ArgumentParser) -> None:
    """The option ``--games`` of a program that plays many."""
    parser.add_argument(
        "--games",
        type=games_output,
        metavar="FILE.npz",
        help="write what came of every single game: NumPy arrays (players, games)",
    )


def add_figure(parser: argparse.ArgumentParser) -> None:
    """The option ``--figure`` of a program that draws."""
    parser.add_argument(
        "--figure", type=picture, metavar="FILE", help="write a figure: PNG, SVG or PDF by its ending"
    )
