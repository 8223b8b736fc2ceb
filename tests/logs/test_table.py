"""Tables of a log: what is too large is refused before it fills the memory, and messages stay short and exact."""

from __future__ import annotations

import gzip
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs import table
from spoofgym.logs.table import check_increasing, read_table, seconds

GROUP = [("t_s", "x")]


def bomb(path: Path, content: bytes, times: int) -> Path:
    with gzip.open(path, "wb", 1) as file:
        for _ in range(times):
            file.write(content)
    return path


def test_an_archive_is_unpacked_up_to_the_limit_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "LARGEST", 2**20)
    path = bomb(tmp_path / "imu.csv.gz", bytes(2**20), 64)
    tracemalloc.start()
    with pytest.raises(ValueError, match=r"imu\.csv\.gz: has more than 1048576 bytes of text, which is the limit"):
        read_table(path, GROUP, [], {})
    assert tracemalloc.get_traced_memory()[1] < 8 * 2**20
    tracemalloc.stop()
    plain = tmp_path / "imu.csv"
    plain.write_bytes(b"t_s,x\n" + 2**18 * b"1,2\n")
    with pytest.raises(ValueError, match=r"imu\.csv: has more than 1048576 bytes"):
        read_table(plain, GROUP, [], {})


def test_an_archive_of_empty_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "MOST_LINES", 1000)
    path = bomb(tmp_path / "gnss.csv.gz", 100 * b"1\n", 11)
    with pytest.raises(ValueError, match="has more than 1000 lines"):
        read_table(path, GROUP, [], {})


@pytest.mark.parametrize("end", ["\r", "\v", "\f", "\x1c", "\x85", "\u2028"])
def test_only_a_line_feed_ends_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str) -> None:
    """What is not counted is not split at either: an archive of it does not become millions of texts."""
    monkeypatch.setattr(table, "LARGEST", 2**24)
    path = bomb(tmp_path / "gnss.csv.gz", ("ab" + end).encode() * 2**16, 32)
    tracemalloc.start()
    with pytest.raises(ValueError, match=r"gnss\.csv\.gz, line 1: (a carriage return without|has \d+ characters)"):
        read_table(path, GROUP, [], {})
    assert tracemalloc.get_traced_memory()[1] < 2**26
    tracemalloc.stop()


def test_carriage_returns_before_line_feeds_and_others(tmp_path: Path) -> None:
    path = tmp_path / "gnss.csv"
    path.write_bytes(b"t_s,x\r\n1,2\r\n2,3\r\n\r\n")
    np.testing.assert_array_equal(read_table(path, GROUP, [], {})["x"], [2.0, 3.0])
    path.write_bytes(b"t_s,x\n1,2\n2,3\r3,4\n4,5\n")
    with pytest.raises(ValueError, match=r"line 3: a carriage return without a line feed"):
        read_table(path, GROUP, [], {})


def test_a_message_does_not_quote_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "gnss.csv"
    for text in (90_000 * "a", "t_s,x\n1,2\n2," + 90_000 * "y"):
        path.write_text(text)
        with pytest.raises(ValueError, match="line") as caught:
            read_table(path, GROUP, [], {})
        assert len(str(caught.value)) < 600


def test_what_is_no_utf_8_is_said(tmp_path: Path) -> None:
    path = tmp_path / "gnss.csv"
    path.write_bytes("t_s,x\n1,2\n2,3\n".encode("utf-16"))
    with pytest.raises(ValueError, match="it is no text in UTF-8"):
        read_table(path, GROUP, [], {})


@pytest.mark.parametrize(
    ("time", "text"),
    [
        (1732340029.25, "1732340029.25"),
        (1732350000.0, "1732350000"),
        (0.1 + 0.2, "0.3"),
        (570774.6438403815, "570774.64384"),
        (-2.5, "-2.5"),
        (1e16, "10000000000000000"),
    ],
)
def test_a_time_keeps_its_digits(time: float, text: str) -> None:
    assert seconds(time) == text


def test_times_that_stand_still() -> None:
    """Stamps that were written with too few digits differ from a single one that is doubled."""
    time = 1732340000.0 + np.array([0.0, 1.0, 1.0, 3.0])
    with pytest.raises(ValueError, match=r"line 4: t_s must increase, got 1732340001 after 1732340001; a row"):
        check_increasing(Path("gnss.csv"), time)
    with pytest.raises(ValueError, match=r"line 3: t_s must increase, .*; so it is in 9 of 10 lines; a row"):
        check_increasing(Path("gnss.csv"), np.full(10, 1.73234e9))
    with pytest.raises(ValueError, match="line 9: t_s must increase, got 1 after 2"):
        check_increasing(Path("gnss.csv"), np.array([1.0, 2.0, 1.0]), np.array([3, 5, 9]))
