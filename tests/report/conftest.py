from collections.abc import Iterator
from pathlib import Path

import pytest

from spoofgym.evaluation.game_recording import play_game
from spoofgym.evaluation.game_trace import GameTrace
from tests.report.browser import Browser, chromium


@pytest.fixture(scope="session")
def game() -> GameTrace:
    """A jump that is found, excluded, taken back, and followed by a reset: every kind of event but the end."""
    return play_game("foi-drive:horizon=60", "jump:30", ("snapshot",), "snapshot > px4-auto", seed=1)


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with chromium(downloads_of(tmp_path_factory)) as found:
        yield found


@pytest.fixture(scope="session")
def downloads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return downloads_of(tmp_path_factory)


def downloads_of(factory: pytest.TempPathFactory) -> Path:
    folder = factory.getbasetemp() / "downloads"
    folder.mkdir(exist_ok=True)
    return folder
