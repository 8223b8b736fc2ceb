"""Runs that nothing stopped, each made once for several files of tests, which one worker runs."""

import pytest

from spoofgym import files
from spoofgym.learning import defender
from tests.learning.runs import SHORT, STEPS, begun, few_lessons, result, resume


@pytest.fixture(scope="session")
def taught(tmp_path_factory):
    """The folder of a short run of the defender's training."""
    folder = tmp_path_factory.mktemp("runs") / "short"
    with few_lessons():
        assert defender.main([*SHORT, "--steps", str(STEPS), "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="session")
def uninterrupted(tmp_path_factory):
    """The results of runs that nothing stopped, and the number of files that each wrote."""
    made = {}

    def make(name):
        if name not in made:
            path = tmp_path_factory.mktemp("runs") / "run"
            program, writes, real = begun(path, name), [], files.write_bytes
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(files, "write_bytes", lambda *given: (writes.append(given[0]), real(*given)))
                assert resume(program, path) == 0
            made[name] = path, result(path), len(writes)
        return made[name]

    return make
