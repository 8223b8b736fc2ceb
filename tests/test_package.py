"""The package as a whole: what importing it loads. `tests/installed` tests it as a wheel."""

import subprocess
import sys
from pathlib import Path

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
