"""What is uploaded: what the wheel and the sdist hold and say of themselves, and that an index would take them."""

import re
import subprocess
import sys
import tarfile
import zipfile
from email.message import Message
from email.parser import HeaderParser
from pathlib import Path

import pytest

import spoofgym
from hatch_build import for_an_index

pytestmark = pytest.mark.xdist_group("installed")

ROOT = Path(__file__).parents[2]
EXTRAS = {"sb3", "train", "render", "multiagent", "logs", "ray", "onnx", "completion", "docs", "dev"}
LARGEST_WHEEL = 5_000_000
"""Bytes; the package is code and small policies."""


def sources(*folders: str) -> set[str]:
    """Every file in some folders of the checkout that belongs to it: what git does not ignore."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *folders]
    try:
        listed = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout.splitlines()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("what belongs to the checkout is known to git alone")
    return {name for name in listed if (ROOT / name).is_file()}


def inside_wheel(folder: Path) -> set[str]:
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as archive:
        return set(archive.namelist())


def inside_sdist(folder: Path) -> set[str]:
    with tarfile.open(next(folder.glob("*.tar.gz"))) as archive:
        files = [member.name for member in archive.getmembers() if member.isfile()]
    assert {name.split("/")[0] for name in files} == {f"spoofgym-{spoofgym.__version__}"}
    return {name.partition("/")[2] for name in files}


@pytest.fixture(scope="session")
def metadata(distributions: Path) -> Message:
    with zipfile.ZipFile(next(distributions.glob("*.whl"))) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return HeaderParser().parsestr(archive.read(name).decode())


def test_the_wheel_holds_the_package_and_its_agents_and_nothing_else(distributions: Path) -> None:
    found = inside_wheel(distributions)
    about = {name for name in found if name.split("/")[0].endswith(".dist-info")}
    expected = sources("spoofgym") | {f"spoofgym/{name}" for name in sources("agents")}
    assert found - about == expected
    assert {name.partition("/")[2] for name in about} >= {"METADATA", "entry_points.txt", "licenses/LICENSE"}
    assert "spoofgym/py.typed" in found
    assert any(name.endswith(".js") for name in found)
    assert next(distributions.glob("*.whl")).stat().st_size < LARGEST_WHEEL


def test_the_sdist_holds_what_builds_tests_and_documents_it(distributions: Path) -> None:
    found = inside_sdist(distributions)
    folders = sources("spoofgym", "agents", "train", "tests", "benchmarks", "docs")
    files = {"README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "LICENSE", "Makefile", "constraints.txt"}
    files |= {"hatch_build.py"}
    assert found - {"PKG-INFO", ".gitignore"} == folders | files | {"pyproject.toml"}


def test_an_index_would_take_both(distributions: Path) -> None:
    """`twine check`: the metadata are valid, and the description can be shown."""
    command = [sys.executable, "-m", "twine", "check", "--strict", *map(str, sorted(distributions.iterdir()))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("PASSED") == 2


def test_metadata_name_the_extras_the_version_and_the_command(metadata: Message, distributions: Path) -> None:
    assert set(metadata.get_all("Provides-Extra", [])) >= EXTRAS
    assert metadata["Version"] == spoofgym.__version__
    assert metadata["License-Expression"] == "MIT"
    with zipfile.ZipFile(next(distributions.glob("*.whl"))) as archive:
        name = next(name for name in archive.namelist() if name.endswith("entry_points.txt"))
        assert "spoofgym = spoofgym.cli.main:main" in archive.read(name).decode()


def test_the_description_has_no_link_that_leads_nowhere(metadata: Message) -> None:
    """An index shows it beside no checkout: the words of the README, and no relative link or picture."""
    text = metadata.get_payload()
    assert isinstance(text, str)
    assert metadata["Description-Content-Type"] == "text/markdown"
    relative = re.findall(r"\]\((?!https?:|#)[^)]*\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(relative) > 10
    assert re.findall(r"\]\((?!https?:|#)[^)]*\)|(?:src|href)=\"(?!https?:)", text) == []
    assert "# spoofgym" in text
    assert "Three results" in text


def test_links_of_the_description_lead_to_the_repository_where_one_is_named() -> None:
    page = "[how](docs/a.md#b), ![map](c.gif), [web](https://example.org), [below](#d)"
    assert for_an_index(page, None) == "how, *map*, [web](https://example.org), [below](#d)"
    assert for_an_index(page, "https://example.org/x") == (
        "[how](https://example.org/x/blob/HEAD/docs/a.md#b), ![map](https://example.org/x/raw/HEAD/c.gif), "
        "[web](https://example.org), [below](#d)"
    )


def test_every_extra_that_is_named_anywhere_exists(metadata: Message) -> None:
    texts = [ROOT / name for name in sources("spoofgym", "docs", "agents") if name.endswith((".py", ".md"))]
    texts += [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    named = {
        extra
        for path in texts
        for group in re.findall(r"spoofgym\[([\w,]+)\]", path.read_text(encoding="utf-8"))
        for extra in group.split(",")
    }
    assert "train" in named
    assert named <= set(metadata.get_all("Provides-Extra", []))


def test_the_version_is_told_once_and_cited(metadata: Message) -> None:
    """The package says it; the project file reads it there, and the citation is of it."""
    assert 'dynamic = ["version"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert cited is not None
    assert cited.group(1) == spoofgym.__version__
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(rf"^## \[(Unreleased|{re.escape(spoofgym.__version__)})\]", changes, flags=re.MULTILINE)


def test_the_page_of_the_installation_lists_every_extra(metadata: Message) -> None:
    text = (ROOT / "docs" / "start" / "install.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `(\w+)` \|", text.partition("## Extras")[2].partition("\n## ")[0], flags=re.MULTILINE)
    assert set(listed) == set(metadata.get_all("Provides-Extra", []))
