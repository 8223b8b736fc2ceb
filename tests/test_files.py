"""Files are written whole or not at all, and a destination that cannot be written is refused before the work."""

import errno
import json
import os
import stat
import threading
from pathlib import Path

import pytest

from spoofgym import files


def test_a_file_and_its_folder_are_made(tmp_path):
    files.write_json(tmp_path / "a" / "b" / "out.json", {"x": 1.5})
    assert json.loads((tmp_path / "a" / "b" / "out.json").read_text()) == {"x": 1.5}
    assert [path.name for path in (tmp_path / "a" / "b").iterdir()] == ["out.json"]


def test_a_number_that_json_does_not_have_leaves_the_file_as_it_was(tmp_path):
    files.write_json(tmp_path / "out.json", [1])
    with pytest.raises(ValueError, match="Out of range"):
        files.write_json(tmp_path / "out.json", [float("nan")])
    assert (tmp_path / "out.json").read_text() == "[\n  1\n]\n"


@pytest.mark.parametrize("moment", ["fsync", "replace"])
@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_leaves_what_was_there_and_no_draft(tmp_path, monkeypatch, moment, error):
    path = tmp_path / "out.txt"
    files.write_text(path, "before")

    def failing(*_):
        raise error

    monkeypatch.setattr(files.os, moment, failing)
    with pytest.raises(type(error)) as raised:
        files.write_text(path, "after")
    if isinstance(error, OSError):
        assert raised.value.filename == str(path)
        assert raised.value.errno == errno.ENOSPC
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_permissions_are_those_of_an_ordinary_file(tmp_path):
    (tmp_path / "ordinary").write_text("")
    files.write_text(tmp_path / "new", "x")
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "ordinary").stat().st_mode
    (tmp_path / "new").chmod(0o640)
    files.write_text(tmp_path / "new", "y")
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640


def test_a_link_is_followed(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real" / "out.txt")
    for text in ("one", "two"):
        files.check_file(tmp_path / "link")
        files.write_text(tmp_path / "link", text)
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "real" / "out.txt").read_text() == text


def test_a_pipe_is_written_to_and_stays_one(tmp_path):
    path, read = tmp_path / "pipe", []
    os.mkfifo(path)
    reader = threading.Thread(target=lambda: read.append(path.read_text()))
    reader.start()
    files.check_file(path)
    files.write_text(path, "through")
    reader.join()
    assert read == ["through"]
    assert stat.S_ISFIFO(path.stat().st_mode)


def test_a_full_device_is_told(tmp_path):
    if not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full")
    files.check_file("/dev/full")
    with pytest.raises(OSError, match="No space left") as raised:
        files.write_text("/dev/full", "x")
    assert raised.value.filename == "/dev/full"
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_checks_leave_nothing(tmp_path):
    files.check_file(tmp_path / "a" / "out.json")
    files.check_folder(tmp_path / "b" / "c")
    files.check_folder(tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("check", "place", "message"),
    [
        (files.check_file, "folder", "is a folder, a file is meant"),
        (files.check_file, "file/out.json", "cannot be written: Not a directory"),
        (files.check_file, "file/deeper/out.json", "cannot be written: Not a directory"),
        (files.check_file, "x" * 300, "cannot be written: File name too long"),
        (files.check_file, "loop", "cannot be written: Too many levels of symbolic links"),
        (files.check_folder, "file", "is a file, a folder is meant"),
        (files.check_folder, "file/run", "nothing can be written there: Not a directory"),
        (files.check_folder, "x" * 300, "nothing can be written there: File name too long"),
    ],
)
def test_a_place_that_cannot_be_written_is_named(tmp_path, check, place, message):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(ValueError, match=message) as raised:
        check(tmp_path / place)
    assert str(raised.value).startswith(str(tmp_path / place))
    assert (tmp_path / "file").read_text() == ""


@pytest.mark.parametrize("check", [files.check_file, files.check_folder])
def test_a_full_disk_and_a_read_only_folder_are_told_before_the_work(tmp_path, monkeypatch, check):
    for number, words in ((errno.ENOSPC, "No space left on device"), (errno.EROFS, "Read-only file system")):

        def failing(number=number, words=words, **_):
            raise OSError(number, words)

        monkeypatch.setattr(files.tempfile, "TemporaryFile", failing)
        with pytest.raises(ValueError, match=words):
            check(tmp_path / "out")


def test_a_file_that_may_not_be_written_is_told(tmp_path, monkeypatch):
    (tmp_path / "out").write_text("kept")
    monkeypatch.setattr(files.os, "access", lambda path, mode: False)
    with pytest.raises(ValueError, match="out cannot be written: permission denied"):
        files.check_file(tmp_path / "out")


def test_drafts_that_a_kill_left_are_removed(tmp_path):
    for name in (".0a.draft", "kept.draft", ".kept"):
        (tmp_path / name).write_text("")
    files.remove_drafts(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".kept", "kept.draft"]


@pytest.mark.parametrize("error", [KeyError("a"), RecursionError("deep"), TypeError("two\nlines"), MemoryError()])
def test_a_reader_of_a_damaged_file_names_it_in_one_line(error):
    with pytest.raises(ValueError, match=r"^x is damaged: .+") as raised, files.reading("x"):
        raise error
    assert "\n" not in str(raised.value)


def test_a_figure_has_the_format_of_its_name(tmp_path):
    figure = pytest.importorskip("matplotlib.figure").Figure()
    for name, start in (("a.png", b"\x89PNG"), ("b.PDF", b"%PDF"), ("c.svg", b"<?xml")):
        files.write_figure(tmp_path / name, figure)
        assert (tmp_path / name).read_bytes().startswith(start)
