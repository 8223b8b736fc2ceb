"""All attackers of one game, evaluated on the same noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.detectors.base import Detector
from spoofgym.envs.policy_players import PolicySpoofer
from spoofgym.envs.trained import spoofer_config
from spoofgym.evaluation.aggregate import aggregate, aggregate_row, of_one_setting
from spoofgym.evaluation.departure_rows import departure_entry, departure_figures
from spoofgym.evaluation.game_log import GameLog
from spoofgym.evaluation.metrics import AttackerScore, attacker_score, undetected_error
from spoofgym.evaluation.monte_carlo import Episodes, watch_attack
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import attacker_row
from spoofgym.optimum import expected_play
from spoofgym.policies.baselines import Baseline, known_baselines, searched_baselines
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation


@dataclass(frozen=True)
class Evaluation:
    """What every attacker is evaluated on.

    Attributes:
        scenario: of the game.
        detector_names: their specifications.
        detectors: with their thresholds.
        fidelity: of the simulation.
        episodes: games of each attacker.
        seed: of game 0.
        threads: of the simulation.
        threshold: of the snapshot test where exact values exist, else None.
        log: keeps what came of every game.
    """

    scenario: Scenario
    detector_names: tuple[str, ...]
    detectors: list[Detector]
    fidelity: str
    episodes: int
    seed: int
    threads: int
    threshold: float | None
    log: GameLog = field(default_factory=lambda: GameLog(0))

    def rows(
        self, policies: list[LearnedSpoofer], attacks: list[Attack], progress: Progress = silent
    ) -> Iterator[dict[str, Any]]:
        """Rows of the baselines, of scripted attacks and of policies, in this order, each when it has been played.

        Check attacks and policies before: `check_attacks`, `check_layouts`.
        """
        with progress("baselines"):
            baselines = self._baselines()
        optimum = next((baseline.exact for baseline in baselines if baseline.name == "optimum"), None)
        for baseline in baselines:
            yield self._row(baseline, optimum, progress)
        for attack in attacks:
            yield self._row(Baseline(attack.name, attack.knowledge, attack, None), optimum, progress)
        for policy in policies:
            player = PolicySpoofer(policy)
            with progress(player.name):
                (score, further), exact = self._score(player), self.exact(policy)
            yield attacker_row(player.name, player.knowledge, score, exact, optimum) | further

    def check_attacks(self, attacks: list[Attack]) -> None:
        """Refuse attacks that do not fit the game, before anything is played.

        Raises:
            ValueError: what `Simulation` refuses.
        """
        for attack in attacks:
            Simulation(self.scenario, deepcopy(attack), self.detectors, fidelity=self.fidelity)

    def check_layouts(self, policies: list[LearnedSpoofer]) -> None:
        """Refuse policies that were trained for another observation.

        Raises:
            ValueError: naming the policy and the first entry that differs, or what cannot be built of its game.
        """
        self.check_attacks([PolicySpoofer(policy) for policy in policies])

    def _baselines(self) -> list[Baseline]:
        if self.threshold is not None:
            return known_baselines(self.scenario, self.threshold)
        return searched_baselines(self.scenario, self._mean_score)

    def _row(self, baseline: Baseline, optimum: float | None, progress: Progress) -> dict[str, Any]:
        score: AttackerScore | None = None
        further: dict[str, Any] = {}
        if baseline.attack is not None:
            with progress(baseline.name):
                score, further = self._score(baseline.attack, baseline.name)
        return attacker_row(baseline.name, baseline.knowledge, score, baseline.exact, optimum) | further

    def _score(self, attack: Attack, name: str = "") -> tuple[AttackerScore, dict[str, Any]]:
        """The figures of an attack and of the vehicle, whose games are kept under a name: its own if none is given."""
        games = self.play(attack, self.episodes)
        self.log.note(
            name or attack.name,
            undetected_error_m=undetected_error(games),
            final_error_m=games.final_error,
            alarm_epoch=games.alarm_epoch,
            **departure_figures(games.departures),
        )
        return attacker_score(games), departure_entry(games.departures)

    def aggregates(self, policies: Sequence[LearnedSpoofer]) -> list[dict[str, Any]]:
        """A row for the policies of each setting of which there are several, when their games have been played."""
        players = {policy.name: PolicySpoofer(policy).name for policy in policies}
        found = []
        for names in of_one_setting(policies):
            errors = np.stack([self.log.of(players[name], "undetected_error_m") for name in names])
            found.append(aggregate_row(names, aggregate(errors)))
        return found

    def _mean_score(self, attack: Attack, episodes: int) -> float:
        """Mean undetected error of an attack, m."""
        return float(np.mean(undetected_error(self.play(attack, episodes))))

    def play(self, attack: Attack, episodes: int) -> Episodes:
        """Games of an attack."""
        return watch_attack(
            self.scenario,
            attack,
            self.detectors,
            episodes,
            self.seed,
            fidelity=self.fidelity,
            threads=self.threads,
        ).together()

    def exact(self, policy: LearnedSpoofer) -> float | None:
        """Exact undetected error of a policy whose offsets do not depend on chance, m; else None.

        The policy may choose them by the shadow filter of another model: what they are worth is the victim's to say.
        """
        config = spoofer_config(policy)
        if self.threshold is None or config.knowledge == "full" or config.tracking_sigma:
            return None
        simulation = Simulation(self.scenario, PolicySpoofer(policy), self.detectors, fidelity=self.fidelity, seed=0)
        offsets = offsets_without_chance(simulation)
        return float(expected_play(self.scenario.linear_model(), offsets, self.threshold).score)


def offsets_without_chance(simulation: Simulation) -> Floats:
    """The offsets that the attack of a simulation of one run sends, (K, 3), m ENU."""
    simulation.reset()
    offsets = []
    for _ in range(simulation.scenario.timeline.num_epochs):
        simulation.resolve()
        simulation.observe()
        offsets.append(simulation.offset[0].copy())
    return np.array(offsets)
