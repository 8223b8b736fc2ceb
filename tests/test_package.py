"""The package as a whole: what importing it loads, and its version."""

import re
import subprocess
import sys
from pathlib import Path

import spoofgym

ROOT = Path(__file__).parents[1]
HEAVY = ("torch", "matplotlib", "stable_baselines3", "pettingzoo")


def test_import_is_light() -> None:
    code = (
        "import sys, spoofgym, spoofgym.envs.spoofer, spoofgym.envs.vector, spoofgym.envs.checker\n"
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert result.stdout.strip() == "[]"


def test_version_is_that_of_the_project_file() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.search(r'^version = "(.+)"$', text, flags=re.MULTILINE).group(1) == spoofgym.__version__
