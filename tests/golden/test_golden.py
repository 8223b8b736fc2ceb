"""What a short seeded game computes is what it computed when the golden arrays were made."""

from functools import cache

import pytest

from tests.golden import store

CALIBRATED = ("game defender default", "game alone Defender-v0")
"""Episodes that calibrate the default detectors of a defender, which other tests do, too: one worker does it once."""
EPISODES = [
    pytest.param(kind, name, marks=[pytest.mark.xdist_group("default defender")] if name in CALIBRATED else [])
    for kind in store.KINDS
    for name in store.names(store.FOLDER, kind)
]
"""As they are written; that they are all episodes is a test below."""
EXPECTED = cache(store.read)


@pytest.mark.parametrize(("kind", "name"), EPISODES)
def test_golden(kind: str, name: str) -> None:
    expected = EXPECTED(store.FOLDER, kind)[name]
    found = store.KINDS[kind]()[name]()
    assert store.differences(expected, found, store.tolerances().get(name, {})) == []


def test_every_episode_has_golden_arrays_and_none_are_left_over() -> None:
    for kind, episodes in store.KINDS.items():
        assert set(store.names(store.FOLDER, kind)) == episodes().keys()
