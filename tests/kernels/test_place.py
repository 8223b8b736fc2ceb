import os
import stat
import tempfile
from pathlib import Path
from warnings import formatwarning

import numba
import pytest

from spoofgym.kernels import place as module


@pytest.fixture
def bare(monkeypatch, tmp_path):
    """Nothing can be written: the package lies below a file, and so does every other folder."""
    (tmp_path / "file").write_text("no folder")
    nowhere = tmp_path / "file" / "below"
    monkeypatch.setattr(module, "PACKAGE", nowhere / "spoofgym")
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("SPOOFGYM_CACHE", str(nowhere))
    monkeypatch.setattr(tempfile, "tempdir", str(nowhere))
    return tmp_path


def place():
    """As a new process finds it."""
    return module.place.__wrapped__()


def test_the_first_folder_that_can_be_written(bare, monkeypatch):
    temporary, cache, given = (bare / name for name in ("temporary", "cache", "given"))
    temporary.mkdir(mode=0o755)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    with pytest.warns(UserWarning, match=f"^Compiled code is kept in {temporary}.* Set SPOOFGYM_CACHE to a folder"):
        assert place().is_relative_to(temporary)
    monkeypatch.setenv("SPOOFGYM_CACHE", str(cache))
    assert place().is_relative_to(cache / "kernels")
    monkeypatch.setattr(module, "PACKAGE", bare / "spoofgym")
    assert place() == bare / "spoofgym" / "__pycache__" / "kernels" / module.TAG
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(given))
    assert place().is_relative_to(given)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(bare / "file"))
    assert place().is_relative_to(bare / "spoofgym")


def test_copies_of_the_package_keep_apart(bare, monkeypatch):
    monkeypatch.setenv("SPOOFGYM_CACHE", str(bare / "cache"))
    first = place()
    monkeypatch.setattr(module, "PACKAGE", bare / "file" / "other" / "spoofgym")
    assert place() != first
    assert place().name == first.name == module.TAG


def test_nothing_can_be_written(bare):
    with pytest.warns(UserWarning, match="^Compiled code is not kept, and each start takes long"):
        assert place() is None


def test_the_warning_takes_one_line(bare):
    with pytest.warns(UserWarning, match="not kept") as caught:
        place()
    assert len(caught) == 1
    shown = caught[0]
    assert formatwarning(shown.message, shown.category, shown.filename, shown.lineno).count("\n") == 1


posix = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes and owners are those of POSIX")


@posix
class TestTemporary:
    """A folder whose name anybody can guess."""

    @pytest.fixture
    def folder(self, bare, monkeypatch):
        above = bare / "temporary"
        above.mkdir()
        above.chmod(0o1777)
        monkeypatch.setattr(tempfile, "tempdir", str(above))
        return above / f"spoofgym-kernels-{os.geteuid()}"

    def test_it_is_closed_to_others_and_found_again(self, folder):
        first = module._temporary()
        assert first.is_relative_to(folder)
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        assert module._temporary() == first

    def test_a_link_is_not_followed(self, folder, tmp_path):
        (tmp_path / "theirs").mkdir(mode=0o700)
        folder.symlink_to(tmp_path / "theirs")
        assert module._temporary() is None
        assert list((tmp_path / "theirs").iterdir()) == []

    @pytest.mark.parametrize("mode", [0o755, 0o770, 0o702])
    def test_one_that_others_can_enter_is_not_used(self, folder, mode):
        folder.mkdir()
        folder.chmod(mode)
        assert module._temporary() is None

    def test_one_of_another_user_is_not_used(self, folder, monkeypatch):
        owner = os.geteuid()
        monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
        (folder.parent / f"spoofgym-kernels-{owner + 1}").mkdir(mode=0o700)
        assert module._temporary() is None

    def test_one_that_others_can_replace_is_not_used(self, folder):
        folder.parent.chmod(0o777)
        assert module._temporary() is None

    def test_a_file_in_its_place_is_no_error(self, folder):
        folder.write_text("no folder")
        assert module._temporary() is None


def test_numba_says_where_it_is():
    from spoofgym.geodesy import normal_gravity

    assert Path(normal_gravity.stats.cache_path) == module.place()
