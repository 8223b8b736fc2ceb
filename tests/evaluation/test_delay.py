"""What a delay costs: as nobody's and as an exact defender's games at its ends, and more in between."""

from pathlib import Path

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.cli.main import main
from spoofgym.evaluation.delay import delay_reports
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.program import last_of
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

DRIVE = "foi-drive:horizon=30,guidance=first-order:1"
PULL = "ramp:1,direction=0"
GAMES = 30


def report(delays, attack=PULL):
    return last_of(delay_reports(make_scenario(DRIVE), [attack], delays, GAMES, 0))["rows"]


def largest(decide) -> float:
    """Mean of the largest deviation of games in which ``decide`` says what becomes of each fix."""
    demands = Demands(excludes=True)
    simulation = Simulation(make_scenario(DRIVE), make_attack(PULL), (), None, GAMES, 0, demands=demands)
    simulation.reset()
    for _ in range(30):
        simulation.resolve(decide(simulation))
        simulation.observe()
    assert simulation.steering is not None
    return float(simulation.steering.largest.mean())


def test_its_ends_are_a_defender_that_never_and_one_that_always_leaves_out() -> None:
    rows = report([0.0, 30.0])
    at_once = largest(lambda simulation: Decision(~simulation.attacked))
    never = largest(lambda simulation: Decision(np.ones(GAMES, dtype=bool)))
    assert [row["deviation"]["largest_m"] for row in rows] == [at_once, at_once, never, never]


def test_a_longer_delay_costs_more_and_taking_back_less() -> None:
    rows = report([5.0, 10.0, 20.0])
    alone = [row["deviation"]["largest_m"] for row in rows if not row["takes_back"]]
    back = [row["deviation"]["largest_m"] for row in rows if row["takes_back"]]
    assert alone == sorted(alone)
    assert all(less < more for less, more in zip(back, alone, strict=True))
    assert back[2] > 10.0, "what the vehicle has driven is not taken back"


def test_a_vehicle_that_keeps_its_path_is_refused() -> None:
    with pytest.raises(ValueError, match="add guidance=first-order:2"):
        last_of(delay_reports(make_scenario("foi-drive"), [PULL], [0.0], 1, 0))
    with pytest.raises(ValueError, match="delay must be"):
        report([-1.0])


def test_the_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["study", "delay", "--scenario", DRIVE, "--attack", PULL, "--delay", "3", "--episodes", "5"]
    assert main([*command, "--json", str(tmp_path / "out.json")]) == 0
    assert PULL in capsys.readouterr().out
    assert (tmp_path / "out.json").stat().st_size > 0
