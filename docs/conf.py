"""How Sphinx builds the documentation: ``make docs``."""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent))

import spoofgym  # noqa: E402

project = "spoofgym"
author = "spoofgym contributors"
project_copyright = "spoofgym contributors"
version = release = spoofgym.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["_build", "images/*.md"]
needs_sphinx = "8.1"

# ---- pages in Markdown
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
smartquotes_action = "De"  # dashes and ellipses alone: a prime is a transpose, no quotation mark
suppress_warnings = ["myst.header"]  # a page that is generated from a docstring begins where the docstring does
highlight_language = "none"  # indented blocks are commands and what they print

# ---- the API, from the docstrings
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # shapes and units stand in the docstrings, types in the signatures
autodoc_inherit_docstrings = False
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
viewcode_line_numbers = True

# ---- how it looks
html_theme = "furo"
html_title = "spoofgym"
html_static_path = ["static"]
html_css_files = ["pages.css"]
html_copy_source = False
html_show_sphinx = False

ENVIRONMENTS = {
    "spoofer": ("spoofgym.envs.spoofer", "SpooferEnv", "Spoofer-v0"),
    "defender": ("spoofgym.envs.defender", "DefenderEnv", "Defender-v0"),
    "duel": ("spoofgym.envs.duel", "DuelParallelEnv", "The duel"),
    "duel-spoofer": ("spoofgym.envs.duel_sides", "DuelSpooferEnv", "DuelSpoofer-v0"),
    "duel-defender": ("spoofgym.envs.duel_sides", "DuelDefenderEnv", "DuelDefender-v0"),
}
"""Page, module, class and title: a docstring of an environment is a page in Markdown."""


def write_environment_pages(_app: Any) -> None:
    """Write ``environments/*.md`` from the docstrings; a page that has not changed is left as it is."""
    for page, (module, name, title) in ENVIRONMENTS.items():
        docstring = inspect.getdoc(getattr(importlib.import_module(module), name))
        text = f"# {title}\n\n{linked(str(docstring))}\n"
        path = DOCS / "environments" / f"{page}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def linked(text: str) -> str:
    """The text with pages that it names as files, ``docs/reference/robot.md``, as links."""
    return re.sub(r"`docs/([a-z/-]+)\.md`", r"[\1](../\1.md)", text)


LITERAL = re.compile(r"(``.+?``|`[^`]+`)")


def escape_equations(_app: Any, _what: str, _name: str, _part: Any, _options: Any, lines: list[str]) -> None:
    """Keep reStructuredText from reading |u| as a substitution, x* as emphasis and x_ as a link, outside literals."""
    for place, line in enumerate(lines):
        pieces = LITERAL.split(line)
        pieces[::2] = [re.sub(r"(?<!\\)([|*]|_(?=\W|$))", r"\\\1", piece) for piece in pieces[::2]]
        lines[place] = "".join(pieces)


def setup(app: Any) -> None:
    """Generate the pages of the environments before anything is read."""
    app.connect("builder-inited", write_environment_pages)
    app.connect("autodoc-process-docstring", escape_equations)
