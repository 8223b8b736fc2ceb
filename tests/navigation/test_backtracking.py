"""Taking fixes back: equal to a run in which they had been left out, in both fidelities; resets; weighted fixes."""

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

RUNS = 4
EPOCHS = 45
HISTORY = 20
AT = 30
DEPTHS = np.array([0, 3, 11, 20])
SCENARIO = "liu-flight:horizon=60"
FIDELITIES = ("linear", "strapdown")
ALL = np.ones(RUNS, dtype=bool)
SOLUTION = {"linear": ("state", "covariance"), "strapdown": ("attitude", "velocity", "position", "bias", "covariance")}


def play(decide, fidelity, runs=RUNS, threads=1, history=HISTORY, scenario=SCENARIO, auxiliary=False):
    """Errors (after each resolve), innovations of each epoch, and the simulation after EPOCHS."""
    simulation = Simulation(
        make_scenario(scenario),
        make_attack("ramp:3,onset=815"),
        (),
        None,
        runs,
        7,
        fidelity=fidelity,
        threads=threads,
        demands=Demands(excludes=True, history=history, auxiliary=auxiliary),
    )
    simulation.reset()
    errors, whitened = [], []
    for k in range(EPOCHS):
        simulation.resolve(decide(k))
        errors.append(simulation.error.copy())
        whitened.append(simulation.observe().innovation.whitened.copy())
    return np.array(errors), np.array(whitened), simulation


def back_at(depths, use_after=False):
    def decide(k):
        if k == AT:
            return Decision(np.full(len(depths), use_after), backtrack=depths)
        return Decision(np.full(len(depths), k < AT or use_after))

    return decide


def left_out(depths, use_after=False):
    """Every fix from ``depths`` before AT on is left out; from AT on they are used again or left out, too."""

    def decide(k):
        return Decision((k < AT - depths) | (use_after & (k >= AT)))

    return decide


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("use_after", [False, True], ids=["coast", "use"])
def test_equal_to_a_run_in_which_the_fixes_had_been_left_out(fidelity, use_after):
    errors, whitened, simulation = play(back_at(DEPTHS, use_after), fidelity)
    expected, expected_whitened, reference = play(left_out(DEPTHS, use_after), fidelity)
    np.testing.assert_array_equal(errors[AT:], expected[AT:])
    np.testing.assert_array_equal(whitened[AT:], expected_whitened[AT:])
    for name in SOLUTION[fidelity]:
        np.testing.assert_array_equal(
            getattr(simulation.navigator, name), getattr(reference.navigator, name), err_msg=name
        )


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_the_output_already_given_is_not_rewritten_and_the_recomputed_track_stands_beside_it(fidelity):
    always, _, _ = play(lambda k: Decision(ALL), fidelity)
    errors, _, simulation = play(back_at(DEPTHS), fidelity)
    expected, _, _ = play(left_out(DEPTHS), fidelity)
    np.testing.assert_array_equal(errors[:AT], always[:AT])
    assert np.abs(errors[AT - 1, 3] - expected[AT - 1, 3]).max() > 5.0
    since = EPOCHS - AT + 3
    track = simulation.navigator.recomputed_error(since)
    # the newest of them is the last resolved epoch, EPOCHS - 1
    np.testing.assert_allclose(track[1:], expected[EPOCHS - since :, 1:].swapaxes(0, 1), rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match="history of 20, got 21"):
        simulation.navigator.recomputed_error(21)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_later_backtrack_starts_from_the_recomputed_states(fidelity):
    def twice(k):
        if k == AT:
            return Decision(~ALL, backtrack=DEPTHS)
        # into the stretch that has been recomputed, and before the fixes used from AT + 1 on
        return Decision(~ALL, backtrack=np.full(RUNS, 8)) if k == AT + 6 else Decision(np.full(RUNS, k < AT + 6))

    errors, _, _ = play(twice, fidelity)
    expected, _, _ = play(left_out(np.maximum(DEPTHS, 2)), fidelity)
    np.testing.assert_array_equal(errors[AT + 6 :], expected[AT + 6 :])


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_depth_is_cut_at_the_history_and_at_the_beginning(fidelity):
    seen = {}

    def decide(k):
        return Decision(~ALL, backtrack=np.full(RUNS, 50)) if k in (5, AT) else Decision(np.full(RUNS, k < AT))

    simulation = Simulation(
        make_scenario(SCENARIO), None, (), None, RUNS, 7, fidelity=fidelity, demands=Demands(True, HISTORY)
    )
    simulation.reset()
    for k in range(AT + 1):
        simulation.resolve(decide(k))
        seen[k] = simulation.navigator.backtracked.copy()
        simulation.observe()
    np.testing.assert_array_equal(seen[5], 5)
    np.testing.assert_array_equal(seen[AT], HISTORY)
    np.testing.assert_array_equal(seen[AT - 1], 0)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_history_alone_changes_nothing_and_runs_do_not_depend_on_their_number(fidelity):
    plain, _, simulation = play(lambda k: Decision(ALL), fidelity, history=0)
    kept, _, _ = play(lambda k: Decision(ALL), fidelity)
    np.testing.assert_array_equal(plain, kept)
    with pytest.raises(ValueError, match="keeps no history"):
        simulation.resolve(Decision(ALL, backtrack=DEPTHS))
    errors, _, _ = play(back_at(DEPTHS), fidelity)
    alone, _, _ = play(back_at(DEPTHS[:3]), fidelity, runs=3, threads=2)
    np.testing.assert_array_equal(errors[:, :3], alone)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_partial_resolves_equal_whole_ones(fidelity):
    """Half of the runs resolved after the other half, as where only some lanes are at their last epoch."""
    _, _, whole = play(lambda k: Decision(ALL), fidelity)
    _, _, parts = play(lambda k: Decision(ALL), fidelity)
    whole.resolve(Decision(~ALL, backtrack=DEPTHS))
    for runs in (np.array([1, 3]), np.array([0, 2])):
        parts.resolve(Decision(~ALL[runs], backtrack=DEPTHS[runs]), runs)
    np.testing.assert_array_equal(whole.error, parts.error)
    np.testing.assert_array_equal(whole.navigator.covariance, parts.navigator.covariance)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_reset_puts_the_position_on_the_fix_and_forgets_its_correlations(fidelity):
    _, _, simulation = play(lambda k: Decision(ALL), fidelity)
    runs = np.array([0, 2])
    before = simulation.navigator.error - simulation.epoch.innovation.residual
    variance = np.where(np.isin(np.arange(RUNS), runs), 25.0, 0.0)
    simulation.resolve(Decision(np.isin(np.arange(RUNS), runs), reset=variance))
    # the tolerance is the square of the error, 90 m, over the radius of the Earth
    np.testing.assert_allclose(simulation.error[runs], before[runs], rtol=0, atol=1e-4)
    covariance = simulation.navigator.covariance[runs]
    np.testing.assert_array_equal(covariance[:, 6:9, 6:9], np.broadcast_to(25.0 * np.eye(3), (2, 3, 3)))
    np.testing.assert_array_equal(covariance[:, 6:9, :6], 0.0)
    np.testing.assert_array_equal(covariance[:, 9:, 6:9], 0.0)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_noise_scale_is_an_update_with_that_much_larger_r(fidelity):
    _, _, simulation = play(lambda k: Decision(ALL), fidelity)
    prior, scale = simulation.navigator.covariance.copy(), np.array([1.0, 4.0, 100.0, 1e12])
    simulation.resolve(Decision(ALL, noise_scale=scale))
    r = np.square([3.7, 3.7, 6.0])
    for run in range(RUNS):
        p = prior[run]
        # position is observed directly, so that H P H' is the position's own block
        gain = p[:, 6:9] @ np.linalg.inv(p[6:9, 6:9] + scale[run] * np.diag(r))
        expected = p - gain @ p[6:9]
        size = np.sqrt(np.diag(p))
        np.testing.assert_allclose(
            simulation.navigator.covariance[run] / np.outer(size, size),
            expected / np.outer(size, size),
            rtol=0,
            atol=1e-9,
        )


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_the_unaided_solution_does_not_move_with_the_filter(fidelity):
    """Whatever is decided, filter plus offset is the same solution: that of a run without any fix."""
    _, _, coasting = play(lambda k: Decision(~ALL), fidelity, auxiliary=True)
    decisions = (lambda k: Decision(ALL), back_at(DEPTHS), back_at(DEPTHS, True))
    tolerance = 1e-9 if fidelity == "linear" else 0.02  # m; the offset is of first order
    for decide in decisions:
        _, _, simulation = play(decide, fidelity, auxiliary=True)
        assert np.abs(simulation.navigator.auxiliary_offset).max() > 1.0
        unaided = simulation.error + simulation.navigator.auxiliary_offset
        np.testing.assert_allclose(unaided, coasting.error, rtol=0, atol=tolerance)
    with pytest.raises(RuntimeError, match="demand it"):
        play(lambda k: Decision(ALL), fidelity)[2].navigator.auxiliary_offset  # noqa: B018


def test_shared_gains_refuse_what_they_cannot_follow():
    simulation = Simulation(make_scenario(SCENARIO), None, (), None, RUNS, 0)
    simulation.reset()
    for decision in (Decision(~ALL), Decision(ALL, backtrack=DEPTHS), Decision(ALL, noise_scale=2.0 * ALL)):
        with pytest.raises(ValueError, match="gains are shared"):
            simulation.resolve(decision)
    with pytest.raises(ValueError, match="needs a covariance per run"):
        Demands(history=5)
