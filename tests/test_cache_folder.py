from pathlib import Path

import pytest

from spoofgym import cache_folder


def test_the_first_that_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("SPOOFGYM_CACHE", "/given")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert cache_folder.folder() == Path("/given")
    monkeypatch.setenv("SPOOFGYM_CACHE", "")
    assert cache_folder.folder() == Path("/somewhere/spoofgym")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    assert cache_folder.folder() == tmp_path / ".cache" / "spoofgym"


def nobody():
    raise RuntimeError("Could not determine home directory.")


@pytest.mark.parametrize("home", [lambda: Path("/no/such/home"), nobody])
def test_a_home_that_does_not_exist_is_not_made(monkeypatch, home):
    for name in ("SPOOFGYM_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", home)
    assert cache_folder.folder() is None
