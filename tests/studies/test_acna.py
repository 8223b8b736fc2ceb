"""The parameter study of ACNA: its tests against the detector, its rates, and the command."""

import json

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.detectors import Acna
from spoofgym.responses.exclude import Exclude
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.studies import acna as acna_study
from spoofgym.studies.acna import ATTACKS, PUBLISHED, Rates, play


class OneOfAcna(Acna):
    """One test of the published detector, without a warm memory, as the study plays it."""

    def __init__(self, test):
        super().__init__(preset="song", position="auxiliary")
        other = 1e9
        if test == "jump":
            self.slow_threshold = other
        else:
            self.jump_threshold = other
        self.memory = 0

    def know(self, facts):
        """The thresholds are out of the paper's bounds by intention."""


@pytest.mark.parametrize("test", ["jump", "slow"])
def test_the_published_pair_is_the_detector(test):
    """Counted by hand over two runs of the same seeds in the same loop."""
    window, level = PUBLISHED[test]
    rates = play("song-robot:odometer=set-b", test, np.array([window, 20]), np.array([level, 6.0]), 2, 7)
    false = missed = 0
    for seed in (7, 8):
        scenario = make_scenario("song-robot:odometer=set-b")
        simulation = Simulation(scenario, make_attack(ATTACKS[test]), [OneOfAcna(test)], Exclude(), 1, seed)
        simulation.reset()
        for k in range(1, 301):
            simulation.resolve()
            simulation.observe()
            if k <= 150:
                false += simulation.alarm[0]
            else:
                missed += not simulation.alarm[0]
    assert rates.false_alarm[0] == pytest.approx(false / 300)
    assert rates.missed[0] == pytest.approx(missed / 300)
    np.testing.assert_allclose(rates.accuracy, 1.0 - 0.5 * rates.total)


def test_thresholds_at_the_ends():
    """A threshold of zero always alarms, one of a kilometre never does; a window misses its own length."""
    rates = play("song-robot", "jump", np.array([1, 1, 4]), np.array([0.0, 1000.0, 10.0]), 1, 0)
    np.testing.assert_array_equal(rates.false_alarm, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(rates.missed, [0.0, 1.0, 3.0 / 150.0])


@pytest.fixture
def few(monkeypatch):
    """A grid of invented rates in place of the study, the accuracy of whose pairs rises with the threshold."""

    def rates(scenario, test, runs, seed, num_threads):
        shape = (20, len(acna_study.THRESHOLDS[test]))
        values = np.linspace(0.0, 1.0, shape[0] * shape[1]).reshape(shape)
        return Rates(values, 0.5 - 0.5 * values, 0.5 - 0.5 * values)

    monkeypatch.setattr(acna_study, "study", rates)


@pytest.mark.usefixtures("few")
def test_the_command(capsys, tmp_path):
    figure = tmp_path / "deep" / "study.png"
    acna_study.main(["--runs", "1", "--figure", str(figure)])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "song-robot, 1 runs per pair from seed 0"
    assert sum(line.startswith("| jump |") for line in lines) == 7
    assert "| slow | published, n_s = 5 | 1.28 |" in "\n".join(lines)
    assert lines[-1] == f"figure in {figure}"
    assert figure.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.usefixtures("few")
def test_json_alone_on_stdout_or_in_a_file(capsys, tmp_path):
    acna_study.main(["--runs", "1", "--json", "-"])
    printed = capsys.readouterr()
    report = json.loads(printed.out)
    assert (report["schema_version"], report["kind"]) == (1, "acna-study")
    assert (report["scenario"], report["runs"], report["seed"]) == ("song-robot", 1, 0)
    assert sum(line.startswith(("| jump |", "| slow |")) for line in printed.err.splitlines()) == len(report["rows"])
    for test in ("jump", "slow"):
        *best, published = (row for row in report["rows"] if row["test"] == test)
        assert [(row["choice"], row["window"]) for row in best] == [("best", n) for n in (1, 2, 3, 5, 10, 20)]
        assert {row["threshold_m"] for row in best} == {acna_study.THRESHOLDS[test][-1]}
        assert best[-1]["accuracy"] == 1.0
        assert (published["choice"], published["window"], published["threshold_m"]) == ("published", *PUBLISHED[test])
        alone = play("song-robot", test, *(np.array([value]) for value in PUBLISHED[test]), 1, 0)
        assert [published[name] for name in ("false_alarm", "missed")] == [alone.false_alarm[0], alone.missed[0]]
    path = tmp_path / "deep" / "study.json"
    acna_study.main(["--runs", "1", "--json", str(path)])
    assert json.loads(path.read_text()) == report
    assert capsys.readouterr().out.splitlines()[-1] == f"rows in {path}"


def test_the_study_has_all_pairs(monkeypatch):
    monkeypatch.setattr(acna_study, "EPOCHS", np.array([1, 2, 3]))
    monkeypatch.setitem(acna_study.THRESHOLDS, "slow", np.array([0.5, 1.28]))
    grid = acna_study.study("song-robot", "slow", 1, 0)
    assert grid.accuracy.shape == (3, 2)
    alone = play("song-robot", "slow", np.array([3]), np.array([0.5]), 1, 0)
    assert grid.accuracy[2, 0] == alone.accuracy[0]


def test_bad_arguments_are_refused(capsys):
    assert acna_study.main(["--scenario", "liu-flight:horizon=10"]) == 2
    assert "needs odometer, which scenario 'liu-flight:horizon=10' does not give" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        acna_study.main(["--runs", "0"])
    assert "expected a whole number, 1 or more, got '0'" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        acna_study.main(["--figure", "study.gif"])
    assert "a figure's name ends in .png, .svg, .pdf, got 'study.gif'" in capsys.readouterr().err
