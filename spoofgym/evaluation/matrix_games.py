"""Every detector against every attack, at an equal false-alarm rate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from spoofgym.attacks import ATTACKS as KNOWN_ATTACKS
from spoofgym.attacks import make_attack
from spoofgym.attacks.base import Attack
from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors import DETECTORS as KNOWN_DETECTORS
from spoofgym.detectors import at_arl0, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.opponents import make_spoofer
from spoofgym.envs.policy_players import PolicySpoofer
from spoofgym.envs.trained import spoofer_config
from spoofgym.evaluation.defenders import check_names
from spoofgym.evaluation.matrix import detection_curves, matrix_report, matrix_rows
from spoofgym.evaluation.monte_carlo import WatchedEpisodes, watch_attack
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.seeds import seed_rows
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.policies.optimal import ORACLES, oracles
from spoofgym.scenario import Scenario
from spoofgym.specification import registered_by_others

DETECTORS = (
    "snapshot",
    "px4-gate",
    "ardupilot-gate",
    "rio",
    "acna",
    *(f"windowed:n={n}" for n in (10, 30, 60, 120)),
    "window-bank",
    "cusum",
    "fma",
    *(f"signed-mean:n={n}" for n in (10, 30, 60, 120)),
    "mean-innovation:n=30",
    "aime",
    "signed-cusum",
    "ewma",
    "mewma",
    "ramp-bank",
    "solution-separation:n=30",
    "whiteness",
    "relative-motion",
    "acceleration",
    "bias-range",
    "ensemble",
)
ATTACKS = (
    "jump",
    "ramp:0.1",
    "ramp:0.2",
    "ramp:0.3",
    "ramp:0.5",
    "ramp:2",
    "jump-ramp:0.1,jump=5",
    "slow-change:mean=0.1,variance=0.01",
    "exponential:0.02,time=30",
    "fusion-ripper:2,f=1.02",
    "meaconing:0.02",
    "circle:15",
    "azimuth:0.1",
    "noise-matched:level=0.5",
    "tracking-error:ramp:0.2,sigma=1,time=20",
)
"""On the Liu flight the smaller of them tell detectors apart; any detector sees the larger ones."""
CLEAN = "none"


@dataclass(frozen=True)
class Matrix:
    """What every attack meets.

    Attributes:
        scenario: of the games.
        fidelity: of the simulation.
        arl0: of every detector that has one, epochs.
        episodes: of each attack.
        seed: of game 0.
        threads: of the simulation.
    """

    scenario: Scenario
    fidelity: str
    arl0: float
    episodes: int
    seed: int
    threads: int

    def report(
        self,
        detectors: Sequence[str],
        attacks: Sequence[str],
        policies: Sequence[LearnedSpoofer],
        progress: Progress = silent,
    ) -> dict[str, Any]:
        """The whole ``"matrix"`` report; arguments and errors as `reports`."""
        *_, whole = self.reports(detectors, attacks, policies, progress)
        return whole

    def reports(
        self,
        detectors: Sequence[str],
        attacks: Sequence[str],
        policies: Sequence[LearnedSpoofer],
        progress: Progress = silent,
    ) -> Iterator[dict[str, Any]]:
        """The ``"matrix"`` report after the clean games and after every attack; the last one is whole.

        Args:
            detectors: specifications; none = `DETECTORS`, and those that somebody else has registered.
            attacks: specifications, or names of `ORACLES`; none = `ATTACKS` and all oracles, and those that somebody
                else has registered.
            policies: learned spoofers.
            progress: shows what is played.

        Raises:
            ValueError: a part that is unknown or does not fit the scenario, or a policy that sees its detector's
                statistics or has the name of another one.
        """
        self.check_knowledge(policies)
        check_names(policies)
        with progress("attacks"):
            scripted = self._attacks(attacks)
        with progress("thresholds"):
            ready = self._detectors(detectors or (*DETECTORS, *registered_by_others(KNOWN_DETECTORS)))
        clean = self._play(make_attack(CLEAN), ready, progress)
        common = (self.scenario, self.fidelity, self.arl0, self.episodes, ready)
        rows, curves = matrix_rows(ready, CLEAN, clean), list[dict[str, Any]]()
        for attack in (*scripted, *(PolicySpoofer(policy) for policy in policies)):
            yield {**matrix_report(*common, list(rows), list(curves)), "learned": []}
            games = self._play(attack, ready, progress)
            rows += matrix_rows(ready, attack.name, games)
            curves += detection_curves(ready, clean, attack.name, games)
        yield {**matrix_report(*common, rows, curves), "learned": seed_rows(rows, policies)}

    def check_knowledge(self, policies: Sequence[LearnedSpoofer]) -> None:
        """Refuse policies that see the statistics of a detector.

        Raises:
            ValueError: naming the policy.
        """
        for policy in policies:
            _check_knowledge(policy.name, spoofer_config(policy).knowledge)

    def names(self, attacks: Sequence[str], policies: Sequence[LearnedSpoofer]) -> list[str]:
        """Of the attacks that `report` plays with these arguments, the clean games left out."""
        return [attack.name for attack in self._attacks(attacks)] + [policy.name for policy in policies]

    def _attacks(self, given: Sequence[str]) -> list[Attack]:
        asked = given or (*ATTACKS, *ORACLES, *registered_by_others(KNOWN_ATTACKS))
        known: dict[str, Attack] = {}
        if any(text in ORACLES for text in asked):
            known = {attack.name: attack for attack in oracles(self.scenario, self.arl0)}
        lacking = [text for text in given if text in ORACLES and text not in known]
        if lacking:
            raise ValueError(
                f"attack {lacking[0]!r} needs a matched filter and fixes without velocity, scenario "
                f"{self.scenario.name!r} has not both"
            )
        made = [known.get(text) or make_spoofer(text) for text in asked if text in known or text not in ORACLES]
        for attack in made:
            _check_knowledge(attack.name, attack.knowledge)
        return made

    def _detectors(self, given: Sequence[str]) -> list[Detector]:
        detectors = [make_detector(at_arl0(text, self.arl0)) for text in given]
        names = [detector.name for detector in detectors]
        if len(set(names)) < len(names):
            raise ValueError(f"each detector can be given once only, got {', '.join(names)}")
        return calibrated_for_play(detectors, self.scenario, self.fidelity)

    def _play(self, attack: Attack, detectors: list[Detector], progress: Progress) -> WatchedEpisodes:
        with progress(attack.name):
            return watch_attack(
                self.scenario,
                attack,
                detectors,
                self.episodes,
                self.seed,
                fidelity=self.fidelity,
                threads=self.threads,
            )



def _check_knowledge(name: str, knowledge: str) -> None:
    if knowledge == "full":
        raise ValueError(
            f"policy {name!r} sees the statistics of its own detector (knowledge 'full'): the matrix takes policies "
            "that know less, 'blind' or 'shadow'"
        )
