"""Published agents are found by name, in an installed package and in a checkout."""

import pytest

from spoofgym.calibration import thresholds
from spoofgym.envs.vector import DuelDefenderVectorEnv, DuelSpooferVectorEnv
from spoofgym.policies import published
from spoofgym.policies.learned import POLICY_FILE, SPOOFER, load_policy
from spoofgym.policies.published import (
    agents_folder,
    policy_folder,
    published_folder,
    published_names,
    shown_player,
)
from spoofgym.policies.recipe import read_recipe


@pytest.fixture(params=["agents", "spoofgym/agents"], ids=["checkout", "wheel"])
def agents(request, tmp_path, monkeypatch):
    """A folder of agents where a checkout, or an installed package, has it."""
    (tmp_path / "spoofgym").mkdir()
    monkeypatch.setattr(published.spoofgym, "__file__", str(tmp_path / "spoofgym" / "__init__.py"))
    folder = tmp_path / request.param
    for name in ("b", "a"):
        (folder / name).mkdir(parents=True)
        (folder / name / POLICY_FILE).touch()
    (folder / "README.md").touch()
    (folder / "draft").mkdir()
    return folder


def test_agents_have_names(agents):
    assert agents_folder() == agents
    assert published_names() == ["a", "b"]
    assert published_folder("a") == policy_folder("a") == agents / "a"


def test_another_name_is_refused_with_the_valid_ones(agents):
    for find in (published_folder, policy_folder):
        with pytest.raises(ValueError, match=r"'draft'.*; published agents: a, b$"):
            find("draft")


def test_a_path_is_a_run_folder(agents, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "x").mkdir(parents=True)
    assert policy_folder("runs/x").resolve() == tmp_path / "runs" / "x"
    with pytest.raises(ValueError, match=r"^'runs/y' is no run folder; published agents: a, b$"):
        policy_folder("runs/y")


def test_a_published_name_is_no_folder_of_the_working_directory(agents, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").mkdir()
    assert policy_folder("a") == agents / "a"


def test_the_agents_of_this_version_can_play(monkeypatch: pytest.MonkeyPatch) -> None:
    """All are loaded; one of each role plays the drive, against detectors that are calibrated in a hurry."""
    monkeypatch.setattr(thresholds, "SIMULATED_FIRST_ALARMS", 10)
    monkeypatch.setattr(thresholds, "_KNOWN", {})
    names = published_names()
    assert names
    with pytest.raises(ValueError, match=rf"no published agent is named 'x'; published agents: {', '.join(names)}$"):
        published_folder("x")
    players = {}
    for name in names:
        policy = load_policy(published_folder(name))
        assert policy.name == name
        if policy.configuration["scenario"] == "foi-drive":
            players[policy.kind] = name
    assert len(players) == 2
    for name in players.values():
        policy = load_policy(published_folder(name))
        detectors = tuple(policy.configuration.get("detectors", ["snapshot"]))
        config = {"scenario": policy.configuration["scenario"], "detectors": detectors}
        if policy.kind == SPOOFER:
            env = DuelDefenderVectorEnv(2, spoofer=f"policy:{name}", **config)
        else:
            env = DuelSpooferVectorEnv(2, defender=f"policy:{name}", **config)
        env.reset(seed=1)
        env.step(env.action_space.sample())


def test_they_are_small_and_can_be_trained_again() -> None:
    size = sum(path.stat().st_size for path in agents_folder().rglob("*") if path.is_file())
    assert size < 3e6
    for name in published_names():
        assert read_recipe(published_folder(name)).options["seed"] is not None


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ("ramp:0.5", "ramp:0.5"),
        ("policy:drive-ramp-defender", "drive-ramp-defender"),
        ("policy:/runs/league/policies/spoofer-1", "policies/spoofer-1"),
        ("policy:/runs/exploit/spoofers/0b2914cd4e0b/seed-3", "learned, seed 3"),
    ],
)
def test_a_player_is_shown_without_its_path(given, shown):
    assert shown_player(given) == shown
