import itertools
import os
import pickle
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from spoofgym.geodesy import normal_gravity
from spoofgym.kernels import njit, storage

FAR = "FACTOR = 2.0\n\n@njit(cache=True)\ndef far(x):\n    return FACTOR * x\n"
NEAR = "@njit(cache=True)\ndef near(x):\n    return far(x) + 1.0\n"


@pytest.fixture
def folder(monkeypatch, tmp_path):
    folder = tmp_path / "kept" / "versions"
    monkeypatch.setattr(storage, "place", lambda: folder)
    storage._remove_unused.cache_clear()
    yield folder
    storage._remove_unused.cache_clear()


def program(change=("", "")):
    """The kernel ``near``, which uses ``far`` of another file, as a new program finds it."""
    far = {"njit": njit, "__name__": "far"}
    exec(FAR.replace(*change), far)
    near = {"njit": njit, "__name__": "near", "far": far["far"]}
    exec(NEAR.replace(*change), near)
    return near["near"]


def loaded(kernel):
    return sum(kernel.stats.cache_hits.values())


def names(folder):
    return sorted(path.name.partition("-")[0] for path in folder.iterdir())


def test_the_next_program_loads_what_this_one_compiled(folder):
    first, second = program(), program()
    assert first(1.0) == second(1.0) == 3.0
    assert (loaded(first), loaded(second)) == (0, 1)
    assert names(folder) == ["far.far", "near.near"]


def test_a_change_in_another_file_is_seen_and_the_old_code_removed(folder):
    assert program()(1.0) == 3.0
    before = set(folder.iterdir())
    changed = program(("FACTOR = 2.0", "FACTOR = 5.0"))
    assert (changed(1.0), loaded(changed)) == (6.0, 0)
    assert not before & set(folder.iterdir())
    assert names(folder) == ["far.far", "near.near"]
    assert program()(1.0) == 3.0


def test_each_signature_and_processor_has_a_file(folder, monkeypatch):
    kernel = program()
    assert (kernel(1.0), kernel(1)) == (3.0, 3.0)
    assert names(folder) == ["far.far"] * 2 + ["near.near"] * 2
    again = program()
    assert (again(1.0), again(1), loaded(again)) == (3.0, 3.0, 2)


@pytest.mark.parametrize(
    "damage", [lambda content: b"", lambda content: content[:-1], lambda content: content[:40] + b"x" + content[41:]]
)
def test_damaged_files_are_compiled_again(folder, damage):
    program()(1.0)
    for path in folder.iterdir():
        path.write_bytes(damage(path.read_bytes()))
    assert (program()(1.0), loaded(kernel := program()), kernel(1.0), loaded(kernel)) == (3.0, 0, 3.0, 1)


def test_a_folder_that_is_removed_in_between_is_made_again(folder):
    kernel = program()
    kernel(1.0)
    shutil.rmtree(folder)
    assert kernel(1) == 3.0
    assert names(folder) == ["far.far", "near.near"]


def test_a_full_disk_leaves_nothing_and_stops_nobody(folder, monkeypatch):
    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(Path, "replace", full)
    assert program()(1.0) == 3.0
    assert list(folder.iterdir()) == []


def test_without_a_place_kernels_are_compiled_in_memory(monkeypatch):
    monkeypatch.setattr(storage, "place", lambda: None)
    kernel = program()
    assert (kernel(1.0), kernel.stats.cache_path) == (3.0, None)


def test_what_was_not_used_for_long_is_removed(folder):
    folder.mkdir(parents=True)
    other = folder.parent / "other versions"
    other.mkdir()
    kinds = [*itertools.product((folder, other), ("old.nbc", "old.draft", "new.nbc", "old.txt"))]
    for place, name in kinds:
        (place / name).touch()
        if name.startswith("old"):
            os.utime(place / name, (0.0, time.time() - 1.01 * storage.UNUSED))
    program()(1.0)
    assert [name for place, name in kinds if (place / name).exists()] == ["new.nbc", "old.txt"] * 2


def test_what_is_loaded_counts_as_used(folder):
    program()(1.0)
    for path in folder.iterdir():
        os.utime(path, (0.0, 0.0))
    program()(1.0)
    assert max(path.stat().st_mtime for path in folder.iterdir()) > time.time() - storage.UNUSED


def test_disabled_and_flushed(folder):
    kernel = program()
    kernel._cache.disable()
    kernel(1.0)
    assert names(folder) == ["far.far"]
    kernel._cache.enable()
    kernel(1)
    assert names(folder) == ["far.far", "far.far", "near.near"]
    kernel._cache.flush()
    assert names(folder) == ["far.far", "far.far"]


def test_a_kernel_can_be_pickled():
    assert pickle.loads(pickle.dumps(normal_gravity))(0.8, 100.0) == normal_gravity(0.8, 100.0)


REST = """
from spoofgym.geodesy import normal_gravity
from spoofgym.mechanization import gravity_and_coriolis
print(normal_gravity(0.8, 100.0), -gravity_and_coriolis(0.8, 100.0, 0.0, 0.0, 0.0)[2])
"""


def gravity(folder, count=1):
    """Gravity by `geodesy` and of a vehicle at rest, as programs see them that run at once on a copy of the package."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", REST]
    runs = [
        subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(count)
    ]
    said = [run.communicate(timeout=300)[0].split() for run in runs]
    return np.array(said, dtype=float)


@pytest.mark.slow
def test_an_updated_checkout_runs_the_new_physics(package_copy):
    """By a constant in another file, of as many letters, with the file's time as it was; two programs at once."""
    before = gravity(package_copy.parent, 2)
    geodesy = package_copy / "geodesy.py"
    text, times = geodesy.read_text(encoding="utf-8"), geodesy.stat()
    changed = text.replace("EQUATORIAL_GRAVITY = 9.78", "EQUATORIAL_GRAVITY = 9.12")
    geodesy.write_text(changed, encoding="utf-8")
    os.utime(geodesy, ns=(times.st_atime_ns, times.st_mtime_ns))
    after = gravity(package_copy.parent, 2)
    assert (np.ptp(before, axis=0) == 0.0).all()
    assert (np.ptp(after, axis=0) == 0.0).all()
    np.testing.assert_array_equal(before[:, 0], before[:, 1])
    np.testing.assert_array_equal(after[:, 0], after[:, 1])
    assert (before[:, 0] - after[:, 0] > 0.5).all()
