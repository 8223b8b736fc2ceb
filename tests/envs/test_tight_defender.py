"""Defender-v0 on ranges: single satellites that are left out, masks, protection levels."""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.arrays import Floats
from spoofgym.envs.config import DefenderConfig
from spoofgym.envs.defender import DefenderEnv
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.defender_seat import EXCLUDE
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.streams import RunStreams

SPOOFER, DEFENDER = "spoofgym/Spoofer-v0", "spoofgym/Defender-v0"
KUJUR = "kujur-flight:horizon=40,onset=60"
LIU = "liu-flight:horizon=40,onset=60,coupling=tight"
SHORT = "kujur-flight:horizon=12,onset=60"
DEAF = "snapshot:threshold=1e9"
SKIES = [(4.0, 5.0), (8.5, 15.0), (9.5, 25.0), (10.7, 20.0)]
QUIET: dict[str, Any] = {"attacks": "none", "outage": 0.0, "multipath": 0.0}

Under = Callable[[float, float], Scenario]


def defender(lanes: int, seed: int = 5, **arguments: Any) -> DefenderGame:
    """Lanes of a defender's game at epoch 0."""
    given: dict[str, Any] = {"scenario": KUJUR, "detectors": "snapshot", "attacks": "none"} | arguments
    result = DefenderGame(DefenderConfig(**given), lanes, streams=RunStreams.from_seed(seed, lanes))
    result.reset(np.arange(lanes))
    return result


def entries(game: DefenderGame) -> dict[str, Floats]:
    """The quantities behind the observation, by their names, (N,) each."""
    scales = np.array([field.scale for field in game.fields])
    seen = game.observation().astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        raw = np.where(scales > 0, scales * seen / (1.0 - np.abs(seen)), seen)
    return {field.name: raw[:, place] for place, field in enumerate(game.fields)}


def leaving(game: DefenderGame, *slots: int) -> np.ndarray:
    """To use the epoch, and to leave some slots out, in every lane."""
    action = np.zeros((game.num_lanes, 2 + game.scenario.slots), dtype=np.int64)
    action[:, [2 + slot for slot in slots]] = EXCLUDE
    return action


def by_slot(game: DefenderGame, name: str) -> Floats:
    """An entry of every slot, (N, S)."""
    seen = entries(game)
    return np.stack([seen[f"{name} {slot}"] for slot in range(game.scenario.slots)], axis=1)


# --- the defender: satellites -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("sky", SKIES, ids=str)
def test_a_game_under_few_rising_and_setting_satellites(sky: tuple[float, float], under: Under) -> None:
    """Entries, masks and counts against the sky; everything finite, whoever is left out by chance."""
    scenario = under(*sky)
    present = scenario.tight_model().dynamics.present
    game = defender(6, scenario=scenario, detectors=("snapshot", "separation-bank"), attacks="ramp:1", clean=0.3)
    slots = scenario.slots
    assert game.action_space == gym.spaces.MultiDiscrete([2, 5] + [2] * slots)
    rng = np.random.default_rng(0)
    for k in range(40):
        seen = game.observation()
        assert game.observation_space.contains(seen[0])
        assert np.isfinite(seen).all()
        there = np.tile(present[k], (6, 1)) & game.simulation.epoch.available[:, None]
        np.testing.assert_array_equal(by_slot(game, "satellite in slot"), there)
        np.testing.assert_allclose(entries(game)["satellites in view"], there.sum(axis=1), rtol=1e-5)
        assert not by_slot(game, "code residual of slot")[~there].any()
        masks = game.seat.action_masks()
        assert masks.shape == (6, 2 + 5 + 2 * slots)
        assert masks[:, :7].all()
        assert masks[:, 7::2].all()
        np.testing.assert_array_equal(masks[:, 8::2], there)
        action = rng.integers(game.action_space.nvec, size=(6, 2 + slots))
        action[:, 2:] &= rng.random((6, slots)) < 0.3
        outcome = game.step(action)
        np.testing.assert_array_equal(outcome.ignored, (action[:, 2:] & ~there).sum(axis=1))
        left_out = (action[:, 2:] & there).sum(axis=1)
        np.testing.assert_array_equal(outcome.left_out, np.where(outcome.used, left_out, 0))
        assert np.isfinite(game.error).all()
        assert game.error.max() < 200.0


def test_an_outage_empties_the_sky() -> None:
    game = defender(30, outage=1.0, multipath=0.0)
    lost = 0
    for _ in range(40):
        out = ~game.simulation.epoch.available
        lost += int(out.sum())
        assert not by_slot(game, "satellite in slot")[out].any()
        assert not by_slot(game, "code residual of slot")[out].any()
        assert not game.seat.action_masks()[out, 8::2].any()
        outcome = game.step(leaving(game, 0, 3))
        np.testing.assert_array_equal(outcome.ignored, np.where(out, 2, 0))
        np.testing.assert_array_equal(outcome.left_out, np.where(out, 0, 2))
        np.testing.assert_array_equal(outcome.used, ~out)
    assert lost > 100


def test_a_satellite_that_is_left_out_has_no_say() -> None:
    """Exactly: left out all along, a captured one changes nothing; used, it does. Its own residual tells of it."""
    captured = "partial:ramp:3,satellites=1"
    for fidelity in ("linear", "strapdown"):
        errors, residuals = {}, {}
        for attacks in ("none", captured):
            for slots in ((), (0,)):
                game = defender(1, attacks=attacks, clean=0.0, outage=0.0, multipath=0.0, fidelity=fidelity)
                track = []
                for _ in range(40):
                    game.step(leaving(game, *slots))
                    track.append(game.simulation.error[0])
                errors[attacks, slots], residuals[attacks, slots] = np.array(track), game.observation()[0]
        np.testing.assert_array_equal(errors["none", (0,)], errors[captured, (0,)])
        assert np.abs(errors["none", ()] - errors[captured, ()]).max() > 1.0
        assert np.abs(errors["none", ()] - errors["none", (0,)]).max() > 0.01
        names = [field.name for field in game.fields]
        differ = residuals["none", (0,)] != residuals[captured, (0,)]
        by_name = {name for name, changed in zip(names, differ, strict=True) if changed}
        assert "code residual of slot 0" in by_name
        assert not {f"code residual of slot {slot}" for slot in range(1, 8)} & by_name


def test_the_filter_is_less_certain_without_a_satellite() -> None:
    """Of the predicted position; and to leave out all in view is to exclude the epoch, with its depth."""
    games = {slots: defender(1, **QUIET) for slots in ((), (0,), (0, 1, 2, 3, 4, 5))}
    for _ in range(20):
        for slots, game in games.items():
            game.step(leaving(game, *slots))
    sigmas = [float(entries(game)["predicted position sigma"][0]) for game in games.values()]
    assert sigmas[0] < sigmas[1] < sigmas[2]
    everyone, excluded = (defender(1, **QUIET) for _ in range(2))
    for _ in range(15):
        for game in (everyone, excluded):
            game.step(leaving(game))
    all_out, exclude = leaving(everyone, *range(8)), leaving(excluded)
    all_out[:, 1], exclude[:, :2] = 2, (EXCLUDE, 2)
    one, other = everyone.step(all_out), excluded.step(exclude)
    for name in ("backtrack", "used", "left_out", "reward"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.backtrack[0], one.used[0]) == (10, False)
    assert everyone.seat.coast[0] == excluded.seat.coast[0] == 1
    np.testing.assert_array_equal(everyone.observation(), excluded.observation())


def test_leaving_a_clean_satellite_out_costs_its_share() -> None:
    game = defender(1, exclusion_cost=0.4, **QUIET)
    assert game.step(leaving(game)).exclusion[0] == 0.0
    assert game.step(leaving(game, 2, 5)).exclusion[0] == pytest.approx(-0.4 * 2 / 8)
    assert game.step(leaving(game, *range(8))).exclusion[0] == pytest.approx(-0.4)
    spoofed = defender(1, exclusion_cost=0.4, attacks="jump:onset=60", clean=0.0, outage=0.0, multipath=0.0)
    spoofed.step(leaving(spoofed))
    assert spoofed.attacked[0]
    assert spoofed.step(leaving(spoofed, 2, 5)).exclusion[0] == 0.0


def test_actions_outside_the_space_are_refused() -> None:
    env = DefenderEnv(scenario=KUJUR, detectors="snapshot", attacks="none")
    env.reset(seed=0)
    assert "satellites_ignored" not in env.reset(seed=0)[1]
    with pytest.raises(ValueError, match=r"\[0 or 1, 0 to 4, then 8 times 0 or 1\], got"):
        env.step(np.array([0, 0, 2, *[0] * 7]))
    with pytest.raises(ValueError, match=r"shape \(10,\), got \(2,\)"):
        env.step(np.array([0, 0]))
    *_, info = env.step(np.array([0, 0, 1, *[0] * 7]))
    assert (info["satellites_left_out"], info["satellites_ignored"]) == (1, 0)
    assert isinstance(info["satellites_left_out"], int)
    assert env.action_masks().shape == (2 + 5 + 16,)


def test_unused_satellites_are_no_reason_to_backtrack() -> None:
    """A depth is read where the epoch is left out, and not where some of its satellites are."""
    game = defender(1, **QUIET)
    for _ in range(12):
        game.step(leaving(game))
    action = leaving(game, 0, 1)
    action[:, 1] = 2
    outcome = game.step(action)
    assert (outcome.backtrack_asked[0], outcome.used[0], game.seat.coast[0]) == (0, True, 0)
    assert not game.seat.excluding[0]
    action[:, 0] = EXCLUDE
    assert game.step(action).backtrack_asked[0] == 10


# --- the defender: what it sees ---------------------------------------------------------------------------------------


def test_entries_of_the_defender_are_those_of_the_page() -> None:
    """Those of fixes first, unchanged, then the rows of the second table, spelled out."""
    detectors = ("snapshot", "separation-bank", "kujur-monitor:n=30")
    game = defender(1, detectors=detectors)
    names = [field.name for field in game.fields]
    loose = defender(1, scenario=KUJUR + ",coupling=loose", detectors="snapshot")
    others = [field.name for field in loose.fields]
    count = len(others) + 2
    assert [name for name in names[:count] if "separation" not in name and "kujur" not in name] == others
    lines = [line.strip() for line in (DefenderEnv.__doc__ or "").splitlines()]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]
    begin = next(place for place, row in enumerate(rows) if row[0].startswith("code residual"))
    expected: list[tuple[str, float]] = []
    for text, _, scale in rows[begin : begin + 6]:
        number = 0.0 if scale == "not squashed" else float(scale)
        if "slot 0, ..., S - 1" in text:
            expected += [(text.replace("0, ..., S - 1", str(slot)), number) for slot in range(8)]
        elif "NAME" in text:
            bounding = list(game.simulation.detectors)[1:]
            expected += [(text.partition(", for")[0].replace("NAME", name), number) for name in bounding]
        else:
            expected.append((text, number))
    assert [(field.name, field.scale) for field in game.fields[count:]] == expected


def test_code_residuals_are_standard_normal_in_a_clean_game() -> None:
    """500 games, 8 slots, 2 epochs: means within 6.5 and variances within 8 standard errors, 1e-9 in all."""
    lanes = 500
    game = defender(lanes, **QUIET)
    for k in range(15):
        if k % 14 == 0:
            residual = by_slot(game, "code residual of slot")
            innovation = game.simulation.epoch.innovation
            sigma = np.sqrt(innovation.covariance[:, range(8), range(8)])
            np.testing.assert_allclose(residual, innovation.residual[:, :8] / sigma, rtol=1e-4, atol=1e-5)
            assert np.abs(residual.mean(axis=0)).max() < 6.5 / np.sqrt(lanes)
            assert np.abs(residual.var(axis=0) - 1.0).max() < 8.0 * np.sqrt(2.0 / lanes)
        game.step(leaving(game))


def test_protection_levels_are_those_of_filter_and_detectors() -> None:
    """Over the alert limits of the scenario: up for a bank of heights, horizontal for the others."""
    detectors = ("snapshot", "separation-bank:n=30", "separation-bank:n=30,direction=horizontal", "kujur-monitor:n=30")
    scenario = make_scenario(KUJUR).changed(name="narrow", alert_limits=(80.0, 40.0))
    game = defender(3, scenario=scenario, detectors=detectors, attacks="ramp:2", clean=0.0)
    running = list(game.simulation.detectors.values())
    limits = {running[1].name: 40.0, running[2].name: 80.0, running[3].name: 40.0}
    levels = [name for name in entries(game) if name.startswith("protection level of")]
    assert len(levels) == 3
    for k in range(30):
        seen = entries(game)
        for name, limit in limits.items():
            expected = game.simulation.detectors[name].protection_level / limit  # type: ignore[attr-defined]
            assert np.isfinite(expected).all()
            np.testing.assert_allclose(
                seen[f"protection level of {name} over its alert limit"], expected, rtol=1e-4, err_msg=f"{name} at {k}"
            )
        covariance = game.simulation.navigator.position_covariance
        worst = np.sqrt(np.linalg.eigvalsh(covariance[:, :2, :2])[:, -1])
        np.testing.assert_allclose(
            seen["protection level horizontal over its alert limit"], 6.0 * worst / 80.0, rtol=1e-4
        )
        up = 5.33 * np.sqrt(covariance[:, 2, 2])
        np.testing.assert_allclose(seen["protection level vertical over its alert limit"], up / 40.0, rtol=1e-4)
        game.step(leaving(game, 1) if k % 3 else leaving(game))


def test_the_filters_own_level_is_blind_to_spoofing_and_the_banks_is_not_moved_by_it() -> None:
    """The same for a clean and a spoofed game, to the last bit: it is the residuals that tell them apart."""
    clean, spoofed = (
        defender(1, attacks=attacks, clean=0.0, outage=0.0, multipath=0.0) for attacks in ("none", "ramp:3,onset=60")
    )
    for _ in range(30):
        clean.step(leaving(clean))
        spoofed.step(leaving(spoofed))
    one, other = entries(clean), entries(spoofed)
    for axis in ("horizontal", "vertical"):
        name = f"protection level {axis} over its alert limit"
        assert one[name][0] == other[name][0]
    assert spoofed.error[0] - clean.error[0] > 10.0
    assert one["code residual of slot 0"][0] != other["code residual of slot 0"][0]
