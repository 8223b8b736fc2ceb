"""The package as a whole: what importing it loads, and its version."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import spoofgym
from tests.run_folders import spoofer

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
UNWANTED = (
    *("torch", "matplotlib", "stable_baselines3", "pettingzoo", "rich"),
    *("spoofgym.learning", "spoofgym.studies"),
)


def test_playing_and_evaluating_need_neither_torch_nor_a_terminal() -> None:
    """Every module of policies, envs and evaluation is imported, except the adapters to other libraries."""
    code = (
        "import importlib, pkgutil, sys, spoofgym.policies, spoofgym.envs, spoofgym.evaluation\n"
        "for package in (spoofgym.policies, spoofgym.envs, spoofgym.evaluation):\n"
        "    for module in pkgutil.iter_modules(package.__path__, package.__name__ + '.'):\n"
        "        if module.name not in ('spoofgym.envs.sb3', 'spoofgym.envs.duel'):\n"
        "            importlib.import_module(module.name)\n"
        f"print([name for name in {UNWANTED} if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert result.stdout.strip() == "[]"


def test_training_without_its_extra_says_what_to_install() -> None:
    code = "import sys; sys.modules['stable_baselines3'] = None; import spoofgym.learning"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1].endswith("pip install 'spoofgym[train]'")


def test_version_is_that_of_the_project_file() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert re.search(r'^version = "(.+)"$', text, flags=re.MULTILINE).group(1) == spoofgym.__version__


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A folder with the files of a wheel where an installation puts them, and a published agent among them."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        wheel = tomllib.load(file)["tool"]["hatch"]["build"]["targets"]["wheel"]
    site, agents = tmp_path / "site", tmp_path / "agents"
    agents.mkdir()
    spoofer({"scenario": "liu-flight:horizon=5", "knowledge": "blind"}, agents / "x")
    folders = {"spoofgym": ROOT / "spoofgym", "agents": agents}
    for folder in wheel["only-include"]:
        target = site / wheel["sources"].get(folder, folder)
        shutil.copytree(folders[folder], target, ignore=shutil.ignore_patterns("__pycache__"))
    return site


def test_an_installed_package_has_its_programs_and_agents_in_any_folder(installed: Path, tmp_path: Path) -> None:
    """Without the checkout: the working directory is empty, and train, tests and benchmarks are not on the path."""
    empty = tmp_path / "empty"
    empty.mkdir()
    programs = ("evaluate spoofers", "tune", "reproduce", "train spoofer", "train defender")
    code = (
        "import runpy, sys, spoofgym\n"
        "from spoofgym.policies.learned import load_policy\n"
        "from spoofgym.policies.published import policy_folder, published_names\n"
        "print(spoofgym.__file__, published_names(), load_policy(policy_folder('policy:x')).kind)\n"
        f"for name in {programs}:\n"
        "    sys.argv = ['spoofgym', *name.split(), '--help']\n"
        "    try:\n"
        "        runpy.run_module('spoofgym', run_name='__main__')\n"
        "    except SystemExit as end:\n"
        "        print(name, end.code)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-c", code]
    result = subprocess.run(command, capture_output=True, text=True, check=True, cwd=empty, env=environment)
    lines = result.stdout.splitlines()
    assert lines[0] == f"{installed / 'spoofgym' / '__init__.py'} ['x'] spoofer"
    assert sum(line.endswith(" 0") and line.startswith(programs) for line in lines) == len(programs)
    assert not any(empty.iterdir())
