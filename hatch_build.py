"""What a build adds to the metadata: the README as a package index can show it.

An index shows the description beside no checkout, where relative links and pictures lead nowhere. Links lead to the
repository that ``[project.urls]`` names as ``Source``. Where it names none, links become their words, and pictures
their descriptions.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"(?P<picture>!?)\[(?P<words>[^\]]*)\]\((?!\w+:|#)(?P<target>[^)\s]+)\)")


def for_an_index(text: str, source: str | None) -> str:
    """A page in Markdown without relative links.

    Args:
        text: of the page.
        source: address of the repository, where its files are found under ``blob/HEAD`` and ``raw/HEAD``; None = there
            is none.
    """

    def instead(link: re.Match[str]) -> str:
        if source is None:
            return f"*{link['words']}*" if link["picture"] else link["words"]
        place = "raw" if link["picture"] else "blob"
        return f"{link['picture']}[{link['words']}]({source}/{place}/HEAD/{link['target']})"

    return LINK.sub(instead, text)


class ReadmeHook(MetadataHookInterface):
    """Puts the README into the metadata."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set ``readme``."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        source = metadata.get("urls", {}).get("Source")
        metadata["readme"] = {"content-type": "text/markdown", "text": for_an_index(text, source)}
