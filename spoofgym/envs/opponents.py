"""What fills a seat of a game: an attack or a response of its registry, a learned policy, or a pool of them.

Each has a specification:

- ``ramp:0.5``, ``exclude``, ...: an attack or a response by its registered name;
- ``unseen:BUDGET``, ``closed-form:BUDGET``: the optimal attacks of `spoofgym.policies.unseen` and `.furthest`;
- ``policy:NAME`` or ``policy:FOLDER``: a learned policy, published or in a run folder;
- ``DETECTOR > RESPONSE`` or ``DETECTOR/RESPONSE``: a response that follows the alarm of one of the game's detectors
  alone;
- ``pool:A+B+C`` or ``pool:A+B+C,weights=2+1+1``: a pool, from which every run draws its opponent. Within it ``/``
  stands for the comma between the options of a part and ``~`` for ``+``, as in every part within a part; the slashes of
  a ``policy:FOLDER`` stay;
- ``tracking-error:policy:FOLDER,sigma=1``, ``partial:...``, ``position-only:...``: an attack around any of these.

In Python a pool may also be a sequence of specifications and objects, or of pairs of these and a weight.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from spoofgym import validation
from spoofgym.attacks import make_attack
from spoofgym.attacks.base import Attack
from spoofgym.attacks.pool import POPULATIONS, AttackPool
from spoofgym.attacks.recorded import NAME as RECORDED
from spoofgym.attacks.recorded import Recorded
from spoofgym.detectors import DETECTORS, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.policy_players import PolicyDefender, PolicySpoofer
from spoofgym.policies.classical import SEPARATOR, watcher_and_response
from spoofgym.policies.furthest import NAME as CLOSED_FORM
from spoofgym.policies.furthest import Furthest
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.policies.published import POLICY, policy_folder
from spoofgym.policies.unseen import NAME as UNSEEN
from spoofgym.policies.unseen import Unseen
from spoofgym.responses import RESPONSES, make_response
from spoofgym.responses.base import Response
from spoofgym.responses.pool import ResponsePool
from spoofgym.responses.watching import Watching
from spoofgym.scenario import Scenario
from spoofgym.specification import Specification, unnest

POOL = "pool:"
FITTED: dict[str, Callable[..., Attack]] = {UNSEEN: Unseen, CLOSED_FORM: Furthest, RECORDED: Recorded}
"""Attacks that only their game tells: optimal ones, and the one that a log holds."""
Part = TypeVar("Part")


def make_spoofer(given: str | Attack) -> Attack:
    """The attack that a specification names, a learned spoofer or a pool included; an object is returned as it is.

    No game of a pool is clean here.

    Raises:
        ValueError: it is unknown, or the policy cannot be read.
        FileNotFoundError: the folder holds no policy.
    """
    if isinstance(given, str) and given.strip().startswith(POOL):
        return AttackPool([(make_spoofer(part), weight) for part, weight in pool_parts(given)], 0.0, given.strip())
    if isinstance(given, str) and given.strip().startswith(POLICY):
        return PolicySpoofer(LearnedSpoofer.load(policy_folder(given)), given.strip())
    return make_attack(given, lambda nested: make_spoofer(_unnested(nested)), FITTED)


def spoofer_pool(attacks: Any, clean: float) -> AttackPool:
    """The pool from which a defender's opponents are drawn.

    Args:
        attacks: a population by its name, with options; a pool, which keeps its own share; an attack or a policy; or
            several, with equal weights or as pairs with a weight each.
        clean: share of games without an attack.

    Raises:
        ValueError: an unknown attack, or a share that is given twice.
    """
    if isinstance(attacks, AttackPool):
        return copy.deepcopy(attacks)
    if isinstance(attacks, str) and not _is_own(attacks) and Specification.parse(attacks).name in POPULATIONS:
        if "clean" in Specification.parse(attacks).options:
            given = validation.written(clean)
            raise ValueError(f"the share of clean games is given by clean={given}, not in {attacks!r}")
        pool = make_attack(f"{attacks},clean={float(clean)!r}")
        assert isinstance(pool, AttackPool)
        return pool
    return AttackPool(_members(attacks, lambda item: copy.deepcopy(make_spoofer(item))), clean)


def make_defender(given: Any, scenario: Scenario, detectors: Sequence[Detector]) -> Response:
    """The response that a specification names, a learned defender or a pool included.

    Args:
        given: a specification; a response, which is copied; or several, with equal weights or as pairs with a weight
            each, from which every run draws.
        scenario: of the game.
        detectors: of the game, with their thresholds.

    Raises:
        ValueError: it is unknown, or the policy cannot be read.
        FileNotFoundError: the folder holds no policy.
    """
    if (isinstance(given, str) and given.strip().startswith(POOL)) or isinstance(given, tuple | list):
        return ResponsePool(_members(given, lambda item: make_defender(item, scenario, detectors)))
    if isinstance(given, str) and given.strip().startswith(POLICY):
        return PolicyDefender(LearnedDefender.load(policy_folder(given)), given.strip(), scenario)
    if isinstance(given, str) and (pair := watcher_and_response(given)) is not None:
        watcher, response = pair
        return Watching(make_defender(response, scenario, detectors), make_detector(watcher).name, detectors)
    if isinstance(given, str) and (name := given.partition(":")[0].strip()) in DETECTORS and name not in RESPONSES:
        raise ValueError(f"{given!r} is a detector: name the response to its alarm, too, e.g. '{given}/exclude'")
    return copy.deepcopy(make_response(given))


def _is_own(text: str) -> bool:
    return text.strip().startswith((POLICY, POOL))


def _unnested(text: str) -> str:
    """The specification of a part within another one; the slashes of a ``policy:FOLDER`` stay.

    Raises:
        ValueError: the part holds a policy itself, whose folder has slashes: they cannot be told from commas.
    """
    if text.strip().startswith(POLICY):
        return text
    if (pair := watcher_and_response(text)) is not None:
        return SEPARATOR.join(map(_unnested, pair))
    _, inside, policy = text.partition(POLICY)
    if inside and any("=" not in piece for piece in policy.split("/")[1:]):
        raise ValueError(
            f"{text!r}: a policy:FOLDER with slashes can be spelled within one other part, not within two; name a "
            "published agent or a folder of the working directory, or give the parts as a list in Python"
        )
    return str(unnest(text))


def _members(given: Any, make: Callable[[Any], Part]) -> list[tuple[Part, float]]:
    """The members of a pool with their weights, from a specification, one part, or a sequence of parts or pairs."""
    if isinstance(given, str) and given.strip().startswith(POOL):
        return [(make(part), weight) for part, weight in pool_parts(given)]
    several = list(given) if isinstance(given, tuple | list) else [given]
    return [(make(item[0]), item[1]) if _is_pair(item) else (make(item), 1.0) for item in several]


def _is_pair(item: object) -> bool:
    """Whether an item of a pool is a part with its weight."""
    return isinstance(item, tuple | list) and len(item) == 2 and not isinstance(item[1], str | Attack | Response)


def parts_of(text: str) -> list[str]:
    """The specifications of all parts of a pool, those of pools within it included; of anything else, itself.

    Raises:
        ValueError: what `pool_parts` refuses.
    """
    if not text.strip().startswith(POOL):
        return [text]
    return [inner for part, _ in pool_parts(text) for inner in parts_of(part)]


def pool_parts(text: str) -> list[tuple[str, float]]:
    """The parts and weights of ``pool:A+B,weights=2+1``.

    Raises:
        ValueError: an unknown option, or weights that are no numbers or as many as there are parts.
    """
    spelling = f"{text!r}: a pool is spelled pool:A+B or pool:A+B,weights=2+1"
    if not text.strip().removeprefix(POOL).strip():
        raise ValueError(spelling)
    specification = Specification.parse(text)
    unknown = sorted(set(specification.options) - {"weights"})
    if specification.value is None or unknown:
        raise ValueError(spelling)
    parts = [_unnested(part) for part in specification.value.split("+")]
    written = specification.options.get("weights")
    weights = ["1"] * len(parts) if written is None else written.split("+")
    if len(weights) != len(parts):
        raise ValueError(f"{text!r}: {len(parts)} parts need as many weights, got {len(weights)}")
    try:
        return [(part, float(weight)) for part, weight in zip(parts, weights, strict=True)]
    except ValueError as error:
        raise ValueError(f"{text!r}: weights must be numbers, got {written}") from error
