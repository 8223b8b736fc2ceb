"""Runs that nothing stopped, made once for all tests of run folders, which one worker runs."""

import pytest

from spoofgym import files
from tests.learning.runs import begun, result, resume


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
