"""Filters side by side on a drive with raw ranges: a synthetic one, and a phone's."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from spoofgym.evaluation import recorded_ranges
from spoofgym.evaluation.recorded_ranges import FILTERS, common, game_onsets, side_by_side
from spoofgym.logs.log import Fixes
from spoofgym.studies.recorded_ranges import main
from tests.logs.range_drive import write_drive
from tests.logs.test_ranges_log import DRIFT
from tests.scenarios.test_recorded import write_log

PHONE = Path(__file__).parents[3] / "shared" / "data" / "car-phone-raw"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drives") / "drive"
    write_drive(folder, turns=5)
    return folder


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded_ranges, "DURATION", 40.0)
    monkeypatch.setattr(recorded_ranges, "SPACING", 30.0)


def test_white_noise_gives_no_alarms_and_a_pull_is_followed(folder: Path) -> None:
    """The fixes lie 0.5 m from the truth, and the noise of the ranges is no more than the filters expect.

    A detector's statistic exceeds its threshold in one of 100,000 epochs at most: in the 100 epochs here alarms begin
    three times or more with a probability below 1e-9.
    """
    *_, report = side_by_side(str(folder))
    json.dumps(report, allow_nan=False)
    assert [row["filter"] for row in report["clean"]] == list(FILTERS)
    for row in report["clean"]:
        assert row["compared"] > 80
        assert 80 < row["common"] <= row["compared"]
        assert row["median_m"] < 2.5
        assert row["median_m"] < row["p95_m"] < 6.0
        assert 0.0 < row["nis_per_degree"] < 1.3
        assert all(entry["begun"] < 3 for entry in row["false_alarms"].values())
        assert ("raim" in row["false_alarms"]) == (row["filter"] == "tight")
    assert len(report["onsets_s"]) >= 2
    # of 170 epochs with a drift of 4 m √2 / √9 each by the code: the median is good to 0.3 m/s, by the rate to 0.02
    assert report["clock"]["by_pseudoranges_mps"] == pytest.approx(DRIFT, abs=2.0)
    assert report["clock"]["by_range_rates_mps"] == pytest.approx(DRIFT, abs=0.2)
    for row in report["pulled"]:
        # the offset grows steadily to 40 s times the rate, and the filters follow it with all that they take
        assert row["median_m"] == pytest.approx(20.0 * row["rate_mps"], abs=3.0)
        assert row["p95_m"] == pytest.approx(38.0 * row["rate_mps"], abs=5.0)
        assert row["owed"]["games"] <= row["any"]["games"] <= row["games"] == len(report["onsets_s"])
        if row["detector"] == "raim":
            assert row["owed"]["games"] == 0


def test_the_program_prints_tables_and_json(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main([str(folder), "--json", str(tmp_path / "report.json")])
    lines = capsys.readouterr().out.splitlines()
    report = json.loads((tmp_path / "report.json").read_text())
    assert sum(line.startswith("| tight |") for line in lines) == 1 + sum(
        row["filter"] == "tight" for row in report["pulled"]
    )
    assert len({line.count("|") for line in lines[:5]}) == 1
    assert report["kind"] == "recorded-ranges"


@pytest.mark.parametrize("there", [False, True])
def test_a_folder_without_ranges_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str], there: bool) -> None:
    if there:
        write_log(tmp_path / "log")
    assert main([str(tmp_path / "log")]) == 2
    message = capsys.readouterr().err
    assert str(tmp_path / "log") in message
    assert ("has no ranges" if there else "is no folder; a log is a folder with") in message


def test_common_epochs_and_games_between_gaps() -> None:
    times = np.array([0.0, 1.0, 2.0, 3.0, 10.0])
    assert common(times, [np.array([0.3, 1.6, 9.8]), np.array([0.2, 1.0, 10.1])]).tolist() == [1, 0, 0, 0, 1]
    moments = np.concatenate([np.arange(0.0, 100.0), np.arange(130.0, 300.0)])
    fixes = Fixes(moments, np.zeros((len(moments), 3)), None, None, None)
    # games of 40 s: from 60 s on they reach the gap after 99 s, from 130 s on they begin behind it
    assert game_onsets(fixes, 0.0, 260.0).tolist() == [0.0, 30.0, 150.0, 180.0, 210.0]
    with pytest.raises(ValueError, match=r"leaves no game of 40 s .* between 90 and 140 s"):
        game_onsets(fixes, 90.0, 140.0)


@pytest.mark.slow
@pytest.mark.skipif(not PHONE.is_dir(), reason="../shared/data, real logs for tests, is absent")
def test_a_phone_in_a_city(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded_ranges, "SPACING", 600.0)
    monkeypatch.setattr(recorded_ranges, "PULLS", (2.0,))
    *_, report = side_by_side(str(PHONE))
    for row in report["clean"]:
        assert row["common_median_m"] < 4.0
    for row in report["pulled"]:
        assert row["median_m"] == pytest.approx(40.0, abs=4.0)
