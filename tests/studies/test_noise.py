"""The programs that estimate noises of a log, and that judge them."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spoofgym.evaluation.noise.estimate import clean_stretch, log_of_fixes
from spoofgym.logs.log_noise import read_noise
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.recorded import recorded
from spoofgym.studies.blind_noise import main as study
from spoofgym.studies.estimate_noise import main as estimate
from tests.logs.known_noise import TRUE, write

DATA = Path(__file__).parents[3] / "shared" / "data"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    noise = replace(TRUE, position_walk=(0.03, 0.03, 0.03))
    return write(tmp_path_factory.mktemp("noise") / "drive", 4, legs=4, noise=noise)


def test_what_is_written_is_what_the_scenario_believes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Never silently: without the option the file is not read."""
    before = make_scenario(f"recorded:{folder}")
    path = folder / "noise.toml"
    assert estimate([str(folder), "--end", "100", "-o", str(path), "--json", str(folder / "report.json")]) == 0
    said = capsys.readouterr().out
    assert "gyro noise" in said
    assert f"noises in {path}" in said
    noise = read_noise(path)
    report = json.loads((folder / "report.json").read_text())
    assert noise.gyro_noise == pytest.approx(report["noises"][0]["value"], rel=1e-5)
    assert report["end_s"] == 100.0
    unasked, asked = make_scenario(f"recorded:{folder}"), make_scenario(f"recorded:{folder},noise=estimated")
    assert asked.name == f"recorded:{folder},noise=estimated"
    np.testing.assert_array_equal(log_of_fixes(unasked).clean.nis, log_of_fixes(before).clean.nis)
    np.testing.assert_allclose(log_of_fixes(asked).model.filter_density, noise.density)
    assert log_of_fixes(asked).clean.nis[40:].mean() > 1.3 * log_of_fixes(before).clean.nis[40:].mean()
    elsewhere = folder.parent / "of-another.toml"
    shutil.copy(path, elsewhere)
    other = make_scenario(f"recorded:{folder},noise={elsewhere}")
    np.testing.assert_array_equal(log_of_fixes(other).clean.nis, log_of_fixes(asked).clean.nis)
    elsewhere.write_text(elsewhere.read_text().replace("[found]", "# changed\n[found]").replace("0.0", "0.1", 1))
    assert make_scenario(f"recorded:{folder},noise={elsewhere}") is not other  # a changed file is read again


def test_options_that_do_not_go_together(folder: Path) -> None:
    for options in ({"noise_factor": 3.0}, {"sigma_floor": 1.0}, {"coupling": "tight"}):
        with pytest.raises(ValueError, match="noise takes the place of noise_factor and sigma_floor"):
            recorded(str(folder), noise="estimated", **options)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="noise must not contain a comma"):
        recorded(str(folder), noise="a,b")
    with pytest.raises(ValueError, match=r"none\.toml is missing; spoofgym estimate-noise"):
        recorded(str(folder), noise=str(folder / "none.toml"))


def test_the_table_of_blind_figures(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert study([str(folder), "--of", str(folder), "--json", str(folder / "blind.json")]) == 0
    said = capsys.readouterr().out.splitlines()
    for head, rule, *rows in (said[:4], said[5:9]):
        assert head.count("|") == rule.count("|") == rows[0].count("|") == rows[1].count("|")
        assert [row.split(" | ")[1] for row in rows] == ["as it is", "drive"]
    report = json.loads((folder / "blind.json").read_text())
    assert [row["noise"] for row in report["rows"]] == ["as it is", "drive"]


def test_a_log_that_is_too_short(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert estimate([str(folder), "--end", "50"]) == 2
    assert "a stretch needs 60 fixes" in capsys.readouterr().err


@pytest.mark.skipif(not (DATA / "car-long-loop").exists(), reason="needs ../shared/data")
def test_noises_of_a_drive_hold_on_another_one(tmp_path: Path) -> None:
    """The snapshot test hears again: car-loop's noises on car-long-loop, which the estimate has not seen."""
    path = tmp_path / "noise.toml"
    assert estimate([str(DATA / "car-loop"), "-o", str(path)]) == 0
    figures = []
    for option in ("", f",noise={path}"):
        log = log_of_fixes(make_scenario(f"recorded:{DATA / 'car-long-loop'}{option}"))
        figures.append(log.clean.nis_per_degree(clean_stretch(log).start))
    assert figures[0] < 0.05
    assert 0.5 < figures[1] < 2.0
