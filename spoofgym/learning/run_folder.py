"""A training run on disk: what was fixed at its start, where it stands, and what a resumed one may not change.

``config.json`` is written before the training begins and says all that the run is: environment, learner, seed, steps.
``checkpoint.pt`` says where it stands. Both are written whole or not at all, so that a run can be resumed from any
moment: without a checkpoint it starts again with the settings that it began with. What else lies in the folder follows
from the checkpoint.
"""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from spoofgym import files, own_parts
from spoofgym.command_line import (
    LARGEST_LEARNER_SEED,
    MOST_COUNT,
    MOST_THREADS,
    add_import,
    count,
    learner_seed,
    run_folder,
    threads,
)
from spoofgym.envs.trained import ENVIRONMENTS, config_from
from spoofgym.learning import checkpoint
from spoofgym.policies.learned import CONFIG_FILE, environment_of, read_config

CHECKPOINT_FILE = "checkpoint.pt"
DEFAULT_STEPS = 3_200_000
NO_SETTINGS = ("out", "resume", "threads", "imported")
"""Options that say where and how a run is computed, not what it is."""


@dataclass(frozen=True)
class Run:
    """What is fixed when a run starts.

    Attributes:
        environment: a configuration of it, by specifications.
        learner: its settings.
        seed: from which all random numbers of the run come.
        steps: GNSS epochs to play, of all learners together.
    """

    environment: Any
    learner: Any
    seed: int
    steps: int

    def content(self) -> dict[str, Any]:
        """For ``config.json``."""
        return {
            "environment": asdict(self.environment),
            "learner": asdict(self.learner),
            "seed": self.seed,
            "steps": self.steps,
        }

    def options(self) -> dict[str, Any]:
        """Every setting by the name of its option."""
        content = self.content()
        settings = {**content["environment"], **content["learner"], "seed": self.seed, "steps": self.steps}
        watched: Any = settings.get("detectors", settings.get("detector"))
        settings["detector"] = [watched] if isinstance(watched, str) else list(watched)
        return settings


def add_options(parser: argparse.ArgumentParser, folder: str) -> None:
    """The options that every training has; of an option that is not given the namespace has no entry."""
    add = parser.add_argument
    add("--steps", type=count,
        help=f"GNSS epochs to play, rounded up to whole rollouts (default: {DEFAULT_STEPS}); with --resume, a larger "
        "number lengthens a run that has come to its end")
    add("--seed", type=learner_seed, help="of all random numbers of the run (default: 0)")
    add("--out", type=run_folder, default=Path(folder), help="run folder (default: %(default)s)")
    add("--threads", type=threads, help="of the learner and the simulation (default: 1)")
    add("--resume", action="store_true", default=False,
        help="go on from the last checkpoint in the run folder, or start again where there is none yet, with the "
        "settings of the run; an option that contradicts them is refused")
    add_import(parser)


class RunFolder:
    """The folder of one run.

    Attributes:
        path: of the folder.
    """

    def __init__(self, path: Path, program: str, environments: tuple[type, ...], learner: type) -> None:
        """A folder that may hold a run.

        Args:
            path: of the folder.
            program: that trains, for messages.
            environments: types of the configurations of environments on which it trains.
            learner: type of the settings of the learner.

        Raises:
            ValueError: nothing can be written there.
        """
        files.check_folder(path)
        self.path, self._program, self._environments, self._learner = path, program, environments, learner

    @property
    def holds_run(self) -> bool:
        """Whether a run was started here."""
        return (self.path / CONFIG_FILE).exists()

    def begin(self, run: Run) -> None:
        """Write down what the run is.

        Raises:
            ValueError: the folder holds a run, or a part of the run has no specification.
            OSError: it cannot be written.
        """
        self.refuse_overwriting()
        files.write_json(self.path / CONFIG_FILE, run.content())

    def refuse_overwriting(self) -> None:
        """Refuse to start a run where there is one.

        Raises:
            ValueError: the folder holds a run.
        """
        if self.holds_run:
            raise ValueError(f"{self.path} already holds a run; choose another --out, or --resume to go on")

    def run(self) -> Run:
        """The run that was started here.

        Raises:
            ValueError: there is none, or its ``config.json`` is damaged.
        """
        if not self.holds_run:
            raise ValueError(f"{self.path} holds no run to resume: it has no {CONFIG_FILE}")
        path = self.path / CONFIG_FILE
        learner_type, content = self._learner, read_config(self.path)
        with files.reading(path):
            found = ENVIRONMENTS[environment_of(content["environment"])]
        # an environment of the other side is refused by the name of this one
        kind: Any = found if found in self._environments else self._environments[0]
        environment: Any = config_from(kind, content["environment"], path)
        with files.reading(path):
            known = {field.name for field in fields(learner_type)}
            if set(content["learner"]) != known:
                raise ValueError(f"the settings of the learner must be {', '.join(sorted(known))}")
            learner = learner_type(**content["learner"])
            if environment.threads > MOST_THREADS:
                raise ValueError(f"threads must be {MOST_THREADS} or fewer, got {environment.threads}")
            return Run(environment, learner, _seed(content["seed"]), _steps(content["steps"]))

    @contextmanager
    def naming_settings(self) -> Iterator[None]:
        """What is wrong with the parts of a run that was started here is told with the name of its file.

        Raises:
            ValueError: naming the file, where there is one, and the reason.
        """
        try:
            yield
        except (ValueError, FileNotFoundError) as error:
            if not self.holds_run:
                raise
            raise ValueError(f"{self.path / CONFIG_FILE}: {error}") from error

    def resumed(self, given: dict[str, Any]) -> Run:
        """The run that goes on here, with the options that were given beside ``--resume``.

        A run that has come to its end may be lengthened by ``steps``.

        Raises:
            ValueError: an option contradicts the run, naming it; or the run has come to its end.
        """
        run = self.run()
        self.refuse_changes(run, {name: value for name, value in given.items() if name != "steps"})
        steps = given.get("steps", run.steps)
        state = self.state()
        if state is not None and self.finished(run, state):
            played = state["played"]
            if steps <= max(run.steps, played):
                raise ValueError(f"the run has played {played:,} steps already: give more than that by --steps")
            run = replace(run, steps=steps)
            files.write_json(self.path / CONFIG_FILE, run.content())
        else:
            self.refuse_changes(run, {"steps": steps})
        files.remove_drafts(self.path)
        return replace(run, environment=replace(run.environment, threads=given.get("threads", run.environment.threads)))

    def refuse_changes(self, run: Run, given: dict[str, Any]) -> None:
        """Refuse options that say otherwise than the run.

        Raises:
            ValueError: naming the first of them, what was given and what the run has.
        """
        kept = run.options()
        for name, value in given.items():
            if name not in NO_SETTINGS and value != kept[name]:
                raise ValueError(
                    f"a resumed run keeps its settings: --{name.replace('_', '-')} {_spelled(value)} was given, "
                    f"the run has {_spelled(kept[name])}"
                )

    def finished(self, run: Run, state: checkpoint.State) -> bool:
        """Whether a checkpoint is that of the run's end."""
        return bool(state["finished"] >= run.steps)

    def state(self) -> checkpoint.State | None:
        """Where the run stands; None before its first checkpoint.

        Raises:
            ValueError: the checkpoint is damaged.
        """
        path = self.path / CHECKPOINT_FILE
        if not path.exists():
            return None
        state = checkpoint.load(path)
        with files.reading(path):
            checkpoint.whole(state["played"])
            checkpoint.whole(state["finished"])
        return state

    def save(self, state: checkpoint.State) -> None:
        """Keep a checkpoint in the place of the one before."""
        checkpoint.save(self.path / CHECKPOINT_FILE, state)

    @property
    def command(self) -> str:
        """The command that goes on with this run."""
        own = "".join(f" --import {shlex.quote(module)}" for module in own_parts.taken())
        return f"spoofgym train {self._program.rpartition('.')[2]} --resume --out {shlex.quote(str(self.path))}{own}"


def given_options(options: argparse.Namespace) -> dict[str, Any]:
    """The options of a command line that are settings of a run, and the number of threads."""
    return {name: value for name, value in vars(options).items() if name not in ("out", "resume", "imported")}


def _seed(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST_LEARNER_SEED:
        raise ValueError(f"seed must be a whole number from 0 to {LARGEST_LEARNER_SEED}, got {value!r}")
    return value


def _steps(value: Any) -> int:
    if not 1 <= checkpoint.whole(value) <= MOST_COUNT:
        raise ValueError(f"steps must be from 1 to {MOST_COUNT:,}, got {value}")
    return int(value)


def _spelled(value: Any) -> str:
    if isinstance(value, bool):
        return json.dumps(value)
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)
