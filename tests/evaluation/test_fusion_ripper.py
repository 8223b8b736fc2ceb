"""Published outcomes beside ours: on a small log of our own, and on the drive of the study where it is present."""

from pathlib import Path

import pytest

from spoofgym.cli.main import main
from spoofgym.evaluation.fusion_ripper import (
    FOLLOWED,
    HELD,
    LOST,
    OUTCOMES,
    Replay,
    fusion_ripper_report,
    read_outcomes,
)
from spoofgym.scenarios import make_scenario
from tests.evaluation.test_recorded import DATA, write_log

HEAD = "trace,side,profiling_start_s,aggressive_start_s,d_m,f,max_dev_m,first_over_0.895_s,first_over_2.405_s\n"
LINES = (
    "x,lhs,40,50,0.7,1.1,4.71,52,63\n"  # 0.7 · 1.1²⁰
    "x,lhs,42,50,0.7,1.1,4.70,52,63\n"
    "x,rhs,44,55,0.7,1.1,1.1,54,\n"
    "x,rhs,45,55,0.7,1.1,300,56,68\n"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    log = write_log(tmp_path_factory.mktemp("drive") / "log")
    (log / OUTCOMES).write_text(HEAD + LINES)
    return log


def test_the_file_is_read(folder: Path) -> None:
    first, _, third, last = read_outcomes(folder)
    assert (first.side, first.profiling, first.aggressive, first.d, first.f) == ("left", 40.0, 50.0, 0.7, 1.1)
    assert first.growth == 20
    assert [each.outcome(20) for each in (first, third, last)] == [FOLLOWED, HELD, LOST]
    assert third.first_over == (54.0, None)


def test_a_victim_without_lidar_follows_to_either_side(folder: Path) -> None:
    """Fixes of 0.3 m at 2 Hz: the filter lags the growth by some seconds, each of which is 10 % of the offset."""
    report = fusion_ripper_report(folder, "first-order:1")
    assert report["growth_s"] == 20
    rows = {row["published_victim"]: row for row in report["rows"]}
    assert {name: row["attacks"] for name, row in rows.items()} == {FOLLOWED: 2, HELD: 1, LOST: 1}
    end = 0.7 * 1.1**20
    for row in rows.values():
        assert 0.7 * end < row["pulled_m"]["median"] < 1.2 * end
        assert row["error_m"]["median"] == pytest.approx(row["pulled_m"]["median"], abs=1.0)
        assert 0.5 * end < row["departed_m"]["median"] < 1.2 * end
        small, large = (each["ours_s"] for each in row["first_over"])
        assert small < large < 20.0
    assert rows[FOLLOWED]["first_over"][0]["published_s"] == 2.0
    assert rows[HELD]["first_over"][1]["published_s"] is None


def test_the_program_says_what_is_missing(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "fusion-ripper", str(folder), "--json", str(tmp_path / "out.json")]) == 0
    assert "follows" in capsys.readouterr().out
    assert (tmp_path / "out.json").stat().st_size > 0
    assert main(["study", "fusion-ripper", str(tmp_path)]) == 2
    assert f"there is no {OUTCOMES}" in " ".join(capsys.readouterr().err.split())
    for spoilt in (HEAD, HEAD + "x,up,1,2,3,4,5,6,7\n", HEAD + "x,lhs,1,2,,4,5,6,7\n", "side\nlhs\n"):
        (tmp_path / OUTCOMES).write_text(spoilt)
        with pytest.raises(ValueError, match=r"holds no attack|line 2 is no outcome"):
            read_outcomes(tmp_path)


@pytest.mark.skipif(not (DATA / "car-kaist" / OUTCOMES).is_file(), reason="needs ../shared/data/car-kaist")
def test_the_drive_of_the_study() -> None:
    """Most published victims follow the offset to 17.9 m; ours comes within a fifth of it, a few seconds later."""
    attacks = read_outcomes(DATA / "car-kaist")
    outcomes = [attack.outcome(34) for attack in attacks]
    assert [outcomes.count(name) for name in (FOLLOWED, HELD, LOST)] == [116, 48, 3]
    attack = attacks[outcomes.index(FOLLOWED)]
    assert attack.largest == pytest.approx(0.7 * 1.1**34, abs=0.02)
    onset = attack.profiling - 1.0
    ours = Replay(make_scenario(f"recorded:{DATA / 'car-kaist'},onset={onset!r},guidance=first-order:1")).of(attack, 34)
    assert ours.pulled == pytest.approx(attack.largest, rel=0.2)
    for mine, published in zip(ours.first_over, attack.first_over, strict=True):
        assert mine == pytest.approx(published - attack.aggressive, abs=4.0)
