"""The benchmark's program: what it prints, what it writes into its page, and how it tells mistakes."""

import json
from pathlib import Path

import pytest

from spoofgym.evaluation.benchmark import ATTACK, DEFEND
from spoofgym.evaluation.benchmark_play import described
from spoofgym.evaluation.benchmark_v1 import V1
from spoofgym.studies import benchmark, benchmark_page
from spoofgym.studies.benchmark_page import players_of, read_rows
from spoofgym.studies.benchmark_presentation import MARKS, page_columns, page_rows
from tests.evaluation.tiny_benchmark import TINY

PAGE = Path(__file__).parents[2] / "docs" / "results" / "benchmark.md"


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark, "V1", TINY)
    monkeypatch.setattr(benchmark_page, "published_names", lambda: [])


def run(folder: Path, *arguments: str) -> int:
    return benchmark.main([*arguments, "--out", str(folder / "games"), "--workers", "1"])


@pytest.mark.usefixtures("tiny")
def test_a_player_gets_a_table_and_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path, ATTACK, "ramp:1", "--tasks", "drive/undetected,flight", "--json", "-") == 0
    told = capsys.readouterr()
    report = json.loads(told.out)
    assert (report["kind"], report["benchmark"], report["digest"]) == ("benchmark", "tiny v0", TINY.digest)
    assert [row["task"] for row in report["tasks"]] == ["drive/undetected/snapshot", "flight/undetected/snapshot"]
    whole = report["summary"]["interquartile_mean"]
    low, high = whole["ci95"]
    assert low <= whole["value"] <= high
    assert f"tiny v0 ({TINY.digest}), track 'attack': ramp:1" in told.err
    line = next(line for line in told.err.splitlines() if line.split()[:1] == ["all"])
    assert line.split() == ["all", f"{whole['value']:.3f}", f"[{low:.3f},", f"{high:.3f}]", "2", "of", "3"]


@pytest.mark.usefixtures("tiny")
def test_the_page_is_written_and_its_rows_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n" + "".join(f"{begin}\nold\n{end}\n" for begin, end in MARKS.values()) + "after\n")
    assert run(tmp_path, "table", "--write", str(page)) == 0
    told, text = capsys.readouterr(), page.read_text()
    assert "old" not in text
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    for player in (*TINY.attackers, *TINY.defenders):
        assert f"| `{player}` | " in text
        assert f"`{player}`" in told.out
    assert "ramp:1 against snapshot" in told.err
    # all rows are there: nothing is played, even without the games
    assert benchmark.main(["table", "--write", str(page), "--out", str(tmp_path / "others"), "--workers", "1"]) == 0
    assert capsys.readouterr().err == ""
    assert page.read_text() == text
    page.with_suffix(".json").write_text("{}")
    assert run(tmp_path, "table", "--write", str(page)) == 2
    assert f"error: {page.with_suffix('.json')} is damaged" in capsys.readouterr().err
    page.with_suffix(".json").unlink()
    page.write_text("nothing")
    assert run(tmp_path, "table", "--write", str(page)) == 2
    assert "has no place for the table" in capsys.readouterr().err


@pytest.mark.usefixtures("tiny")
def test_references_that_differ_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path, "references", DEFEND, "--tasks", "drive/error/held-out") == 1
    assert "differs" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((ATTACK, "snapshot > exclude"), "'snapshot > exclude' defends: it plays the track 'defend'"),
        ((DEFEND, "ramp:1", "--tasks", "moon"), "spoofgym-bench v1 has no task 'moon' in the track 'defend'"),
        ((DEFEND, "policy:nobody"), "'nobody' is no run folder and no published agent"),
        ((DEFEND, "policy:liu-flight-snapshot-spoofer"), "is the run folder of a spoofer, not of a defender"),
    ],
)
def test_mistakes_take_one_line(
    arguments: tuple[str, ...], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(tmp_path, *arguments) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ")
    assert message in told
    assert told.count("\n") == 1


def test_the_page_holds_the_rows_that_are_kept_of_all_players() -> None:
    """`spoofgym benchmark table --write docs/results/benchmark.md` plays whoever is lacking."""
    rows, text = read_rows(PAGE.with_suffix(".json"), V1), PAGE.read_text(encoding="utf-8")
    assert V1.digest in text
    for track, players in players_of(V1).items():
        assert [row["player"] for row in rows[track]] == [described(track, name) for name in players]
        begin, end = MARKS[track]
        table = text.partition(begin)[2].partition(end)[0]
        assert f"| {' | '.join(page_columns(V1, track))} |" in table
        for row in page_rows(V1, track, rows[track]):
            assert f"| {' | '.join(row)} |" in table
