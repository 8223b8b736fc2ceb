import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEST = """
import os
from pathlib import Path

def test_the_folders_can_be_written():
    for name in ("SPOOFGYM_CACHE", "HYPOTHESIS_STORAGE_DIRECTORY"):
        folder = Path(os.environ[name])
        folder.mkdir(exist_ok=True)
        (folder / "file").touch()
        print("in", folder)
"""


@pytest.mark.parametrize(
    ("cache", "workers"), [("kept", "0"), ("cannot be written", "1"), ("switched off", "0"), ("switched off", "1")]
)
def test_the_suite_runs_with_and_without_a_test_cache(tmp_path, cache, workers):
    checkout = tmp_path / "checkout"
    (checkout / "tests").mkdir(parents=True)
    shutil.copy(ROOT / "pyproject.toml", checkout)
    shutil.copy(ROOT / "tests" / "conftest.py", checkout / "tests")
    (checkout / "tests" / "test_small.py").write_text(TEST)
    if cache == "cannot be written":
        # a file where the folder should be, because modes do not stop root
        (checkout / ".pytest_cache").touch()
    options = ["-p", "no:cacheprovider"] if cache == "switched off" else []
    command = [sys.executable, "-m", "pytest", "-v", "-rP", "-n", workers, *options]
    result = subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False, timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr
    folders = [Path(line.removeprefix("in ")) for line in result.stdout.splitlines() if line.startswith("in ")]
    assert len(folders) == 2
    inside = [folder.is_relative_to(checkout) for folder in folders]
    assert inside == [cache == "kept"] * 2
    assert [folder.exists() for folder in folders] == inside
