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


def test_evaluating_needs_neither_torch_nor_a_terminal() -> None:
    """Every module of policies, envs and evaluation is imported, but the adapter to Stable-Baselines3."""
    code = (
        "import importlib, pkgutil, sys, spoofgym.policies, spoofgym.envs, spoofgym.evaluation\n"
        "for package in (spoofgym.policies, spoofgym.envs, spoofgym.evaluation):\n"
        "    for module in pkgutil.iter_modules(package.__path__, package.__name__ + '.'):\n"
        "        if module.name != 'spoofgym.envs.sb3':\n"
        "            importlib.import_module(module.name)\n"
        f"unwanted = {(*HEAVY, 'rich', 'spoofgym.learning', 'spoofgym.studies')}\n"
        "print([name for name in unwanted if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert result.stdout.strip() == "[]"


def test_version_is_that_of_the_project_file() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.search(r'^version = "(.+)"$', text, flags=re.MULTILINE).group(1) == spoofgym.__version__
