"""The installed package at work: without a checkout and without PyTorch, and with the extra that training needs."""

import json
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from spoofgym.kernels.storage import SUFFIX
from tests.installed.conftest import ROOT, Installation

pytestmark = pytest.mark.xdist_group("installed")

HEAVY = ("torch", "stable_baselines3", "matplotlib", "ray", "pettingzoo", "pygame", "moviepy", "onnx", "tensorboard")
AGENTS = tuple(path.parent.name for path in sorted((ROOT / "agents").glob("*/card.json")))
WITHOUT_TORCH = (
    "list",
    "list detectors",
    "play --scenario foi-drive:horizon=60 --page game.html --csv game.csv",
    *(f"play --policy {agent}" for agent in ("liu-flight-snapshot-spoofer", "liu-flight-ramp-defender")),
    "evaluate spoofers --attacker liu-flight-snapshot-spoofer --episodes 200 --json a.json",
    "evaluate defenders --only --defender snapshot/exclude --episodes 20 --json d.json",
    "benchmark attack ramp:0.5 --tasks liu-flight/error/tuned-onset --workers 1 --json b.json",
    "agents",
    "check",
)
MISSING = {
    "train spoofer": "pip install 'spoofgym[train]'",
    "train defender": "pip install 'spoofgym[train]'",
    "train league": "pip install 'spoofgym[train]'",
    "exploit": "pip install 'spoofgym[train]'",
    "evaluate spoofers --figure x.png": "pip install 'spoofgym[render]'",
}


def in_one_process(commands: Iterable[str]) -> str:
    """Code that runs commands one after the other, to load the libraries once, and tells how each has ended."""
    return (
        "import sys\n"
        "from spoofgym.cli.main import main\n"
        f"for command in {list(commands)}:\n"
        "    try:\n"
        "        status = main(command.split())\n"
        "    except SystemExit as end:\n"
        "        status = end.code\n"
        "    print(command, '->', status, file=sys.stderr)\n"
    )


@pytest.fixture
def empty(installation: Installation) -> Iterator[Path]:
    """The working directory of all programs, empty before and after."""
    assert not any(installation.empty.iterdir())
    yield installation.empty
    for path in installation.empty.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def test_the_environment_has_what_the_package_requires_and_no_more(installation: Installation) -> None:
    code = (
        "import importlib.util, sys, spoofgym\n"
        "print(spoofgym.__file__)\n"
        f"print([name for name in {HEAVY} if importlib.util.find_spec(name)])\n"
        f"print([name for name in ('train', 'tests', 'benchmarks') if importlib.util.find_spec(name)])\n"
        f"print([name for name in (*{HEAVY}, 'numba', 'scipy', 'rich') if name in sys.modules])"
    )
    done = installation.run(installation.python, "-c", code)
    assert done.stdout.splitlines() == [str(installation.site / "spoofgym" / "__init__.py"), "[]", "[]", "[]"]


def test_importing_loads_nothing_heavy_where_all_is_installed(installation: Installation) -> None:
    """Where PyTorch and matplotlib are there, `import spoofgym` leaves them alone: it takes as long as Gymnasium."""
    code = f"import sys, spoofgym; print([name for name in (*{HEAVY}, 'numba', 'scipy') if name in sys.modules])"
    done = installation.run(installation.python, "-c", code, extra="train")
    assert done.stdout == "[]\n", done.stderr


def test_everything_but_training_works_without_its_extras(installation: Installation, empty: Path) -> None:
    code = (
        # nothing here depends on how often detectors alarm, and calibrating those of an agent takes longest
        "from spoofgym.calibration import thresholds\n"
        "thresholds.SIMULATED_FIRST_ALARMS = 10\n"
        f"{in_one_process(WITHOUT_TORCH)}"
        "from spoofgym.policies.learned import load_policy\n"
        "from spoofgym.policies.published import published_folder, published_names\n"
        "print([load_policy(published_folder(name)).folder.name for name in published_names()], file=sys.stderr)\n"
        f"print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)"
    )
    done = installation.run(installation.python, "-c", code)
    told = done.stderr.splitlines()
    expected = [f"{command} -> 0" for command in WITHOUT_TORCH]
    assert [line for line in told if " -> " in line] == expected, done.stderr
    assert told[-2:] == [str(list(AGENTS)), "[]"]
    assert {path.name for path in empty.iterdir()} == {"game.html", "game.csv", "a.json", "d.json", "b.json", "runs"}
    assert (empty / "game.html").read_text(encoding="utf-8").startswith("<!")
    assert json.loads((empty / "a.json").read_text())


def test_what_needs_an_extra_says_which_in_one_line(installation: Installation, empty: Path) -> None:
    done = installation.run(installation.python, "-c", in_one_process(MISSING))
    told = done.stderr.splitlines()
    assert len(told) == 2 * len(MISSING), done.stderr
    for (command, wanted), said, status in zip(MISSING.items(), told[::2], told[1::2], strict=True):
        assert wanted in said
        assert status in (f"{command} -> 1", f"{command} -> 2")
    assert not any(empty.iterdir())


def test_the_command_is_installed(installation: Installation) -> None:
    done = installation.spoofgym("train", "spoofer")
    assert (done.returncode, done.stdout) == (1, "")
    said = f"error: training needs PyTorch and Stable-Baselines3: {MISSING['train spoofer']}"
    assert done.stderr.splitlines() == [said]


def test_parts_of_the_library_say_which_extra_they_need(installation: Installation) -> None:
    tries = {
        "import spoofgym.duel": "multiagent",
        "import spoofgym.envs.sb3": "sb3",
        "import gymnasium, spoofgym; gymnasium.make('spoofgym/Spoofer-v0', render_mode='rgb_array')": "render",
        "import gymnasium, spoofgym; gymnasium.make('spoofgym/Spoofer-v0', render_mode='human')": "render",
        "from spoofgym.sensors.rinex import read_rinex; read_rinex('x', 0.0)": "logs",
        "from spoofgym.policies import onnx_model; onnx_model.onnx_model(None)": "onnx",
        "from spoofgym.evaluation.engine import make_engine; make_engine('ray')": "ray",
    }
    code = (
        "import sys\n"
        f"for statement in {list(tries)}:\n"
        "    try:\n"
        "        exec(statement)\n"
        "    except ImportError as error:\n"
        "        print(error)\n"
        "    except Exception as error:\n"
        "        print(type(error), error)"
    )
    done = installation.run(installation.python, "-c", code)
    told = done.stdout.splitlines()
    assert len(told) == len(tries), done.stdout + done.stderr
    for line, extra in zip(told, tries.values(), strict=True):
        assert f"spoofgym[{extra}]" in line


@pytest.mark.slow
def test_training_works_with_its_extra_from_any_folder(installation: Installation, empty: Path) -> None:
    pytest.importorskip("stable_baselines3")
    drive = "--scenario foi-drive:horizon=60 --detector snapshot"
    few = "--lanes 4 --validation-episodes 20 --imitate false"
    players = "--spoofer ramp:1 --defender snapshot/exclude --games 20 --resamples 20 --workers 1"
    commands = (
        "train spoofer --scenario liu-flight:horizon=20 --steps 1 --out spoofer",
        f"train defender {drive} --steps 1 {few} --out defender",
        f"train league {drive} --rounds 0 {players} --out league",
    )
    done = installation.run(installation.python, "-c", in_one_process(commands), extra="train")
    ends = [line for line in done.stderr.splitlines() if " -> " in line]
    assert ends == [f"{command} -> 0" for command in commands], done.stderr
    assert (empty / "spoofer" / "policy.npz").exists()
    assert (empty / "defender" / "policy.npz").exists()
    # what was trained is played without PyTorch
    done = installation.spoofgym("play", *drive.split(), "--policy", "defender")
    assert done.returncode == 0, done.stderr


NOBODY = 65534
"""A user who owns nothing."""


@pytest.fixture
def nobody() -> tuple[str, ...]:
    """What makes a program another user's, who owns nothing."""
    if os.name != "posix" or os.geteuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("a user without rights can be played by root alone, with setpriv")
    return ("setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups")


def _share_kernels(folder: Path) -> None:
    """Copy what the checkout has compiled to where this user keeps compiled code, which saves the time."""
    compiled = ROOT / "spoofgym" / "__pycache__" / "kernels" / folder.name
    if not compiled.is_dir():
        return
    folder.mkdir(parents=True, exist_ok=True)
    for path in compiled.glob(f"*{SUFFIX}"):  # and no drafts, which other tests may be about to finish
        shutil.copy(path, folder)
    for path in (folder, *folder.iterdir()):
        os.chown(path, NOBODY, NOBODY)


def test_a_user_who_can_write_nowhere_plays_and_is_told(
    installation: Installation, nobody: tuple[str, ...], tmp_path: Path
) -> None:
    """The installation is another's, the home cannot be written to, and there is no folder of caches."""
    probe = installation.run(installation.python, "-c", "import numba", before=nobody)
    if probe.returncode != 0:
        pytest.skip("the packages of the tests lie where another user may not read")
    home = installation.folder / "home"
    home.mkdir(mode=0o555, exist_ok=True)
    temporary = installation.folder / "tmp"
    temporary.mkdir(exist_ok=True)
    temporary.chmod(0o1777)
    settings = {"HOME": str(home), "TMPDIR": str(temporary), "XDG_CACHE_HOME": "", "SPOOFGYM_CACHE": ""}
    find = "import warnings; warnings.simplefilter('ignore'); from spoofgym.kernels.place import place; print(place())"
    _share_kernels(Path(installation.run(installation.python, "-c", find, before=nobody, **settings).stdout.strip()))
    code = (
        "import pathlib, sys, spoofgym\n"
        "for folder in (pathlib.Path(spoofgym.__file__).parent, pathlib.Path.home()):\n"
        "    try:\n"
        "        (folder / 'x').write_text('')\n"
        "    except OSError:\n"
        "        continue\n"
        "    sys.exit(f'{folder} can be written to')\n"
        "from spoofgym.cli.main import main\n"
        "sys.exit(main(['list']) or main(['play', '--scenario', 'liu-flight:horizon=20', '--attack', 'ramp:0.5']))"
    )
    done = installation.run(installation.python, "-c", code, before=nobody, **settings)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "Compiled code is kept in" in done.stderr
    assert not any(home.iterdir())
