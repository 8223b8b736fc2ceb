"""The distributions as they are uploaded, and the wheel installed into an empty environment.

The environment has the package, what the package requires, and nothing else: no checkout, no PyTorch, no matplotlib.
Requirements are those of the wheel's metadata, linked from the environment of the tests, so nothing is downloaded.
"""

import os
import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import Distribution, PathDistribution, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
NAME = "spoofgym"


@dataclass(frozen=True)
class Installation:
    """The wheel in an environment of its own.

    Attributes:
        folder: of the environment; everybody may read it.
        site: where its packages lie.
        home: the user's, beside an empty working directory.
    """

    folder: Path
    site: Path

    @property
    def python(self) -> Path:
        return self.folder / "bin" / "python"

    @property
    def empty(self) -> Path:
        return self.folder / "empty"

    def environment(self, extra: str = "") -> dict[str, str]:
        """Of a program: that of the tests, without a checkout, and with the packages of an extra."""
        given = {**os.environ, "PYTHONPATH": str(self.extra(extra)) if extra else ""}
        given.pop("VIRTUAL_ENV", None)
        return given

    def extra(self, name: str) -> Path:
        """A folder with the packages that an extra adds."""
        folder = self.folder / "extras" / name
        if not folder.exists():
            folder.mkdir(parents=True)
            link(required(self.wheel, (name,)) - required(self.wheel), folder)
        return folder

    @property
    def wheel(self) -> Distribution:
        """What the wheel says of itself."""
        return PathDistribution(next(self.site.glob(f"{NAME}-*.dist-info")))

    def run(
        self, *command: str | Path, extra: str = "", before: Sequence[str] = (), **environment: str
    ) -> subprocess.CompletedProcess[str]:
        """Run a program in the empty folder."""
        return subprocess.run(
            [*before, *map(str, command)],
            capture_output=True,
            text=True,
            check=False,
            cwd=self.empty,
            env={**self.environment(extra), **environment},
        )

    def spoofgym(self, *arguments: str | Path, extra: str = "", **environment: str) -> subprocess.CompletedProcess[str]:
        """Run the command ``spoofgym``."""
        return self.run(self.folder / "bin" / NAME, *arguments, extra=extra, **environment)


def required(package: Distribution, extras: Sequence[str] = ()) -> set[str]:
    """The packages that a package requires, and those that they require."""
    found: set[str] = set()
    pending: list[tuple[Distribution, tuple[str, ...]]] = [(package, tuple(extras))]
    while pending:
        one, with_extras = pending.pop()
        for line in one.requires or []:
            requirement = Requirement(line)
            marker = requirement.marker
            if marker is not None and not any(marker.evaluate({"extra": extra}) for extra in ("", *with_extras)):
                continue
            name = canonicalize_name(requirement.name)
            if name == NAME:  # an extra of its own that takes another
                pending.append((package, tuple(requirement.extras)))
            elif name not in found:
                found.add(name)
                pending.append((distribution(name), tuple(requirement.extras)))
    return found


def link(names: set[str], folder: Path) -> None:
    """Put packages of the environment of the tests into a folder, by links to what lies at their top."""
    for name in sorted(names):
        package = distribution(name)
        for top in {file.parts[0] for file in package.files or []} - {"..", "__pycache__"}:
            if not (folder / top).exists():
                (folder / top).symlink_to(Path(str(package.locate_file(top))).resolve())


@pytest.fixture(scope="session")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist, and the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="session")
def installation(distributions: Path) -> Iterator[Installation]:
    """The wheel, installed. Kernels that the checkout has compiled are taken as they are."""
    with tempfile.TemporaryDirectory(prefix="spoofgym-installed-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        venv.create(folder, symlinks=True)
        site = next(folder.glob("lib/python*/site-packages"))
        python = str(folder / "bin" / "python")
        command = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index"]
        command += ["--no-compile", "--disable-pip-version-check", *map(str, distributions.glob("*.whl"))]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        made = Installation(folder, site)
        link(required(made.wheel), site)
        made.empty.mkdir()
        kernels = ROOT / NAME / "__pycache__" / "kernels"
        with suppress(OSError):
            kernels.mkdir(parents=True, exist_ok=True)
            (site / NAME / "__pycache__").mkdir()
            (site / NAME / "__pycache__" / "kernels").symlink_to(kernels)
        yield made
