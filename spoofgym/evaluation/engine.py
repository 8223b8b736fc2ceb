"""Where independent tasks are computed: in this process, in processes of this machine, or on a Ray cluster.

All engines give the same results, in the order of the tasks. A task keeps what it has computed on disk by itself, so
that nothing that is finished is lost where another one fails. A worker that dies is replaced and its tasks are tried
again; a task that fails is named when all others have come to their ends.
"""

from __future__ import annotations

import logging
import os
import re
import socket
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, Protocol

from spoofgym import own_parts, validation

OWNER = "engine"
TRIES = 3
"""How often a task is begun whose worker dies."""
MOST_WORKERS = 1024
PATIENCE = 10.0
"""For the head of a cluster to take a connection, s."""
ENGINES = ("processes", "ray")
Notify = Callable[[str], None]


@dataclass(frozen=True)
class Task:
    """A call that needs no other.

    Attributes:
        name: told when it begins or fails.
        function: of a module, so that another process finds it.
        arguments: of the call, which can be pickled.
    """

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()

    def __call__(self) -> Any:
        """Compute it here."""
        return self.function(*self.arguments)


class Engine(Protocol):
    """Computes tasks."""

    def run(self, tasks: Sequence[Task], notify: Notify) -> list[Any]:
        """The results of tasks, in their order.

        Args:
            tasks: to compute.
            notify: told the name of each task when it begins, or is handed out.

        Raises:
            ValueError: a task refuses its arguments; the message names the task.
            RuntimeError: another failure of a task, or workers that died with it.
        """


class Here:
    """Computes tasks one after the other in this process."""

    def run(self, tasks: Sequence[Task], notify: Notify) -> list[Any]:
        """The results of tasks, in their order; as `Engine.run`."""
        results, failures = [], []
        for task in tasks:
            notify(task.name)
            try:
                results.append(task())
            except Exception as error:
                failures.append((task, error))
        _raise_first(failures)
        return results


class Processes:
    """Computes tasks in processes of this machine, which stay for the next tasks: to begin one takes seconds."""

    def __init__(self, workers: int) -> None:
        """Use so many processes.

        Raises:
            ValueError: no worker, or too many.
        """
        self._workers = validation.whole(OWNER, "workers", workers, 1, MOST_WORKERS)
        self._pool: ProcessPoolExecutor | None = None

    def run(self, tasks: Sequence[Task], notify: Notify) -> list[Any]:
        """The results of tasks, in their order; as `Engine.run`."""
        results: dict[int, Any] = {}
        failures: list[tuple[Task, Exception]] = []
        left, tries = list(range(len(tasks))), dict.fromkeys(range(len(tasks)), 0)
        for task in tasks:
            notify(task.name)
        while left:
            for place in left:
                tries[place] += 1
            lost = self._try([(place, tasks[place]) for place in left], results, failures)
            failures += [(tasks[place], _died()) for place in lost if tries[place] == TRIES]
            left = [place for place in lost if tries[place] < TRIES]
        _raise_first(failures)
        return [results[place] for place in range(len(tasks))]

    def _try(
        self, tasks: list[tuple[int, Task]], results: dict[int, Any], failures: list[tuple[Task, Exception]]
    ) -> list[int]:
        """Compute tasks; the places of those whose worker died, or never took them."""
        lost, whole = [], False
        pool = self._pool or ProcessPoolExecutor(
            self._workers, get_context("spawn"), own_parts.take_all, (own_parts.taken(),)
        )
        try:
            begun: list[tuple[int, Task, Future[Any]]] = []
            for place, task in tasks:
                try:
                    begun.append((place, task, pool.submit(task)))
                except BrokenProcessPool:
                    lost.append(place)
            for place, task, future in begun:
                try:
                    results[place] = future.result()
                except BrokenProcessPool:
                    lost.append(place)
                except Exception as error:
                    failures.append((task, error))
            whole = not lost
        finally:
            self._pool = pool if whole else None
            if not whole:
                pool.shutdown(wait=True, cancel_futures=True)
        return lost


class Ray:
    """Computes tasks on a Ray cluster, or on a Ray of this machine (extra ``spoofgym[ray]``)."""

    def __init__(self, address: str | None = None) -> None:
        """Join a cluster.

        Args:
            address: of its head, ``ray://HOST:PORT`` or ``auto``; None = a Ray of this machine.

        Raises:
            ImportError: Ray is missing.
            ValueError: the address does not answer.
        """
        try:
            import ray
        except ImportError as error:
            raise ImportError("the engine 'ray' needs Ray: pip install 'spoofgym[ray]'") from error
        self._ray = ray
        try:
            _knock(address)
            ray.init(
                address=address,
                ignore_reinit_error=True,
                include_dashboard=False,
                log_to_driver=False,
                logging_level=logging.ERROR,
            )
        except Exception as error:
            raise ValueError(f"{OWNER}: no Ray answers at {address!r}: {' '.join(str(error).split())}") from error

    def run(self, tasks: Sequence[Task], notify: Notify) -> list[Any]:
        """The results of tasks, in their order; as `Engine.run`."""
        compute = self._ray.remote(max_retries=TRIES - 1, num_cpus=1)(_compute)
        waiting = []
        for task in tasks:
            notify(task.name)
            waiting.append(compute.remote(task, own_parts.taken()))
        results, failures = [], []
        for task, reference in zip(tasks, waiting, strict=True):
            try:
                results.append(self._ray.get(reference))
            except self._ray.exceptions.RayTaskError as error:
                failures.append((task, error.cause if isinstance(error.cause, Exception) else error))
            except self._ray.exceptions.RayError:
                failures.append((task, _died()))
        _raise_first(failures)
        return results


def _knock(address: str | None) -> None:
    """Open and close a connection to the head of a cluster, where one is named: Ray itself would try for minutes.

    Raises:
        OSError: nobody listens there.
    """
    found = re.fullmatch(r"(?:ray://)?([^/:]+):(\d{1,5})", address or "")
    if found:
        socket.create_connection((found[1], int(found[2])), PATIENCE).close()


def _compute(task: Task, own: Sequence[str]) -> Any:
    own_parts.take_all(own)
    return task()


def make_engine(name: str, workers: int | None = None, address: str | None = None) -> Engine:
    """The engine of a name.

    Args:
        name: "processes" or "ray".
        workers: processes; 1 = compute here; None = one for each core. Ray decides by itself.
        address: of a Ray cluster; None = a Ray of this machine.

    Raises:
        ValueError: an unknown name, a number of workers beside Ray, an address beside processes, or one that does not
            answer.
        ImportError: Ray is missing.
    """
    validation.one_of(OWNER, "engine", name, ENGINES)
    if name == "ray":
        if workers is not None:
            raise ValueError(f"{OWNER}: Ray knows its own workers: leave workers={workers} out")
        return Ray(address)
    if address is not None:
        raise ValueError(f"{OWNER}: address {address!r} is of the engine 'ray'")
    count = workers if workers is not None else os.cpu_count() or 1
    return Here() if count == 1 else Processes(count)


def _died() -> RuntimeError:
    return RuntimeError(f"its worker died {TRIES} times")


def _raise_first(failures: Sequence[tuple[Task, Exception]]) -> None:
    """Raise the first failure, by the name of its task.

    Raises:
        ValueError: a task that refused its arguments.
        RuntimeError: another failure.
    """
    for task, error in failures:
        kind = ValueError if isinstance(error, ValueError) else RuntimeError
        raise kind(f"{task.name}: {' '.join(str(error).split()) or type(error).__name__}") from error
