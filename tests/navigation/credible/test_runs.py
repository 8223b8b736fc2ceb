"""The credible filter: against one run of matrices, its linear model, backtracking, and the rules of its anchor."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from spoofgym.attacks import make_attack
from spoofgym.attacks.base import Attack
from spoofgym.navigation.credible.kalman import settled_covariance
from spoofgym.navigation.credible.runs import AuxiliaryRule
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.navigation.kalman import correct_error
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

SHORT = "song-robot:horizon=40"


class FilterOfMatrices:
    """Song's eqs 7 to 10 for one run in positions, not errors: x = [e, n, v_e, v_n], one joint update per sample."""

    def __init__(self, tuning, position, velocity, rule):
        self.tuning, self.rule = tuning, rule
        self.x = np.concatenate([position, velocity])
        pp, pv, vv = settled_covariance(tuning)
        self.p = np.kron([[pp, pv], [pv, vv]], np.eye(2))
        self.auxiliary = np.array(position)
        self.trust = 10**6

    def sample(self, moved, fix=None, scale=1.0):
        """One odometer sample; with a fix the credible update, without one the auxiliary update."""
        t, q = self.tuning.step, self.tuning.acceleration**2
        f = np.kron([[1.0, t], [0.0, 1.0]], np.eye(2))
        self.x = f @ self.x
        self.p = f @ self.p @ f.T + q * np.kron([[t**3 / 3.0, t**2 / 2.0], [t**2 / 2.0, t]], np.eye(2))
        self.auxiliary = self.auxiliary + moved
        h = np.eye(2, 4)
        z, r = [self.auxiliary], [self.tuning.auxiliary_sigma**2] * 2
        if fix is not None:
            z, r = [self.auxiliary, fix], r + [scale * self.tuning.fix_sigma**2] * 2
        h = np.vstack([h] * len(z))
        gain = self.p @ h.T @ np.linalg.inv(h @ self.p @ h.T + np.diag(r))
        self.x = self.x + gain @ (np.concatenate(z) - h @ self.x)
        self.p = (np.eye(4) - gain @ h) @ self.p

    def end_of_epoch(self, used):
        self.trust = self.trust + 1 if used else 0
        if used and self.rule.anchoring != "free" and self.trust >= (
            self.rule.credit if self.rule.anchoring == "credited" else 1
        ):
            self.auxiliary = self.x[:2].copy()


@pytest.mark.parametrize("auxiliary", ["anchored", "credited", "free"])
def test_it_is_the_filter_of_the_paper(auxiliary):
    """Positions of three runs, fixes left out and weighted at random, against the truth plus the navigator's error."""
    scenario = make_scenario(f"{SHORT},auxiliary={auxiliary},odometer=set-b")
    attack = make_attack("ramp:0.4,direction=30,onset=12")
    simulation = Simulation(scenario, attack, (), None, 3, 5, demands=Demands(excludes=True))
    simulation.restart(np.arange(3))
    navigator, motion, samples = simulation.navigator, scenario.truth.motion(), scenario.family.tuning.samples
    oracles = [
        FilterOfMatrices(
            scenario.family.tuning,
            motion.position[0] + state[:2],
            motion.velocity[0] + state[2:4],
            scenario.family.rule,
        )
        for state in navigator.state
    ]
    rng = np.random.default_rng(1)
    for k in range(41):
        simulation.observe()
        use = (rng.random(3) < 0.7) & (k not in range(16, 22))
        scale = np.where(rng.random(3) < 0.5, 1.0, 2.5)
        end = (k + 1) * samples
        deviation = navigator._deviation.copy()
        simulation.resolve(Decision(use, noise_scale=scale))
        for i, oracle in enumerate(oracles):
            fix = motion.position[end] + deviation[i, :2]
            for j in range(k * samples, end):
                last = j == end - 1 and use[i]
                oracle.sample(navigator.displacement[i, j], fix if last else None, scale[i])
            oracle.end_of_epoch(use[i])
            got = np.concatenate([navigator.error[i, :2] + motion.position[end], navigator.velocity_error[i, :2]])
            np.testing.assert_allclose(got[:2], oracle.x[:2], atol=1e-9)
            np.testing.assert_allclose(got[2:] + motion.velocity[end], oracle.x[2:], atol=1e-9)
            np.testing.assert_allclose(
                navigator.auxiliary_offset[i, :2], oracle.auxiliary - oracle.x[:2], atol=1e-9
            )
            np.testing.assert_allclose(navigator.position_covariance[i, :2, :2], oracle.p[:2, :2], atol=1e-12)


def test_the_innovation_is_prediction_minus_fix():
    scenario = make_scenario(SHORT)
    simulation = Simulation(scenario, make_attack("jump:onset=20,axes=enu"), (), None, 4, 0)
    simulation.reset()
    for _ in range(21):
        simulation.resolve()
        epoch = simulation.observe()
    deviation = simulation.navigator._deviation
    np.testing.assert_array_equal(epoch.innovation.residual, simulation.error - deviation)
    assert (np.abs(epoch.innovation.residual) > 10.0).all()
    np.testing.assert_array_equal(epoch.innovation.residual[:, 2], -deviation[:, 2])
    sigma = np.sqrt(np.diagonal(epoch.innovation.covariance, axis1=1, axis2=2))
    np.testing.assert_allclose(sigma[:, 2], 0.59)
    np.testing.assert_allclose(epoch.innovation.whitened * sigma, epoch.innovation.residual)
    np.testing.assert_allclose(epoch.innovation.nis, np.square(epoch.innovation.whitened).sum(axis=1))
    simulation.resolve()
    assert (simulation.error[:, 2] == 0.0).all()


def test_the_height_is_a_normal_number_and_the_nis_nearly_chi_square():
    """Standing still with white noise. A correct height leaves its interval in 1e-8 of the cases; the mean of the nis
    would be 3, but S counts on an odometer that errs.
    """
    scenario = make_scenario("song-robot:data=static,noise=white,odometer=table-1")
    simulation = Simulation(scenario, None, (), None, 200, 0)
    simulation.reset()
    nis = []
    for _ in range(300):
        simulation.resolve()
        nis.append(simulation.observe().innovation)
    height = np.array([innovation.whitened[:, 2] for innovation in nis])
    low, high = chi2.ppf([5e-9, 1.0 - 5e-9], height.size) / height.size
    assert low < np.square(height).mean() < high
    assert 2.0 < np.mean([innovation.nis for innovation in nis]) < 3.3


@pytest.mark.parametrize("auxiliary", ["anchored", "credited", "free"])
def test_the_linear_model_is_exact(auxiliary):
    """Spoofed minus clean, on the same noise, is what Φ, H and the gains of the 15 states make of the offsets."""
    scenario = make_scenario(f"{SHORT},auxiliary={auxiliary}")
    model = scenario.linear_model()
    spoofed = Simulation(scenario, make_attack("slow-change:onset=3"), (), None, 2, 0)
    clean = Simulation(scenario, None, (), None, 2, 0)
    spoofed.reset(), clean.reset()
    error = np.zeros((2, 15))
    for k in range(1, 41):
        spoofed.resolve(), clean.resolve()
        np.testing.assert_allclose((spoofed.error - clean.error)[:, :2], error[:, 6:8], atol=1e-11)
        velocity = spoofed.navigator.velocity_error - clean.navigator.velocity_error
        np.testing.assert_allclose(velocity[:, :2], error[:, 3:5], atol=1e-11)
        change = spoofed.observe().innovation.whitened - clean.observe().innovation.whitened
        for i in range(2):
            prior = model.transition[k] @ error[i]
            residual = model.observation[k] @ prior[:9] - spoofed.offset[i]
            whitened = np.linalg.solve(model.innovation_factor[k], residual)
            np.testing.assert_allclose(change[i], whitened, atol=1e-11)
            correct_error(model.whitened_gain[k], whitened, prior)
            error[i] = prior
    np.testing.assert_allclose(spoofed.epoch.innovation.covariance[0], model.innovation_covariance[0], rtol=1e-9)
    for k in range(2):
        after = model.covariance[k] - model.whitened_gain[k].T @ model.whitened_gain[k]
        again = model.transition[k] @ after @ model.transition[k].T + model.process_noise[k]
        np.testing.assert_allclose(again, model.covariance[k], atol=1e-12)


@pytest.mark.parametrize("sigma", [0.59, 2.0])
def test_the_filter_lags_as_the_papers_does(sigma):
    """Behind a drag-off of 0.707 m/s by (107.73 - 103.84) m = 5.5 s, whatever sigma, once it has settled."""
    model = make_scenario(f"song-robot:sigma={sigma}").linear_model()
    error = np.zeros(15)
    for k in range(1, 200):
        error = model.transition[k] @ error
        residual = model.observation[k] @ error[:9] - np.array([k, 0.0, 0.0])
        correct_error(model.whitened_gain[k], np.linalg.solve(model.innovation_factor[k], residual), error)
    assert -residual[0] == pytest.approx(5.5, abs=0.05)


def test_a_standing_start_is_stationary():
    """Error and receiver noise of 2000 runs that stand still, at epoch 0 and 100 epochs later.

    A correct variance leaves its interval in 1e-8 of the cases.
    """
    runs = 2000
    simulation = Simulation(make_scenario("song-robot:data=static,odometer=table-1"), None, (), None, runs, 0)
    simulation.reset()
    factor = simulation.scenario.family.start_factor
    variance, shared = (factor[6] ** 2).sum(), (factor[6] * factor[21]).sum()
    simulation.resolve()
    first = simulation.error[:, :2]
    for _ in range(100):
        simulation.observe()
        simulation.resolve()
    low, high = chi2.ppf([5e-9, 1.0 - 5e-9], runs) / runs
    for error in (first, simulation.error[:, :2]):
        ratio = np.square(error).mean(axis=0) / variance
        assert (ratio > low).all()
        assert (ratio < high).all()
    assert 0.0 < shared < variance


def play(use, seed=3, num_runs=2, name=SHORT, backtrack=None, threads=1):
    """Errors after each epoch of decisions (K,)."""
    demands = Demands(excludes=True, history=20)
    simulation = Simulation(
        make_scenario(name), make_attack("ramp:1,onset=8"), (), None, num_runs, seed, demands=demands, threads=threads
    )
    simulation.reset()
    errors = []
    for k, used in enumerate(use):
        depth = np.full(num_runs, 0 if backtrack is None else backtrack.get(k, 0))
        simulation.resolve(Decision(np.full(num_runs, used), depth))
        errors.append(np.concatenate([simulation.error, simulation.navigator.auxiliary_offset], axis=1))
        if k < len(use) - 1:
            simulation.observe()
    return np.array(errors)


@pytest.mark.parametrize("auxiliary", ["anchored", "credited", "free"])
def test_backtracking_is_leaving_out(auxiliary):
    """To the last bit, and again from the rewritten history; the first 17 epochs used, then twelve taken back."""
    name = f"{SHORT},auxiliary={auxiliary}"
    back = play([True] * 17 + [False] * 3 + [True] * 6 + [False] * 4, name=name, backtrack={17: 12, 26: 4})
    out = play([True] * 5 + [False] * 15 + [True] * 2 + [False] * 8, name=name)
    np.testing.assert_array_equal(back[17:20], out[17:20])
    np.testing.assert_array_equal(back[26:], out[26:])
    assert np.abs(back[16] - out[16]).max() > 1.0


def test_depth_is_cut_and_needs_a_history():
    simulation = Simulation(make_scenario(SHORT), None, (), None, 1, 0, demands=Demands(excludes=True, history=20))
    simulation.reset()
    for _ in range(3):
        simulation.resolve()
        simulation.observe()
    simulation.resolve(Decision(np.array([False]), np.array([10])))
    assert simulation.navigator.backtracked.tolist() == [3]
    bare = Simulation(make_scenario(SHORT), None, (), None, 1, 0)
    bare.reset()
    with pytest.raises(ValueError, match="keeps no history"):
        bare.resolve(Decision(np.array([False]), np.array([1])))


def test_a_reset_jumps_to_the_fix():
    simulation = Simulation(make_scenario(SHORT), make_attack("jump"), (), None, 2, 0)
    simulation.reset()
    simulation.resolve()
    simulation.observe()
    simulation.resolve(Decision(np.ones(2, dtype=bool), reset=np.array([4.0, 0.0])))
    navigator = simulation.navigator
    np.testing.assert_array_equal(navigator.error[0, :2], navigator._deviation[0, :2])
    assert navigator.position_covariance[0, 0, 0] == 4.0
    assert (navigator.auxiliary_offset == 0.0).all()
    assert np.hypot(*navigator.error[1, :2]) < 10.0


def test_when_the_auxiliary_position_is_anchored():
    """Epochs 1-3 used, 4-6 left out, then used: `anchored` at each used, `credited` from the fifth in a row on."""
    use = [True] * 4 + [False] * 3 + [True] * 8
    anchored = {
        kind: (np.abs(play(use, name=f"{SHORT},auxiliary={kind}")[:, 0, 3:5]) == 0.0).all(axis=1)
        for kind in ("anchored", "credited", "free")
    }
    np.testing.assert_array_equal(anchored["anchored"], use)
    np.testing.assert_array_equal(anchored["credited"], [True] * 4 + [False] * 7 + [True] * 4)
    assert not anchored["free"].any()


class ThirdRunOnly(Attack):
    """A jump in run 2 of as many as there are."""

    name = "third"

    def offset(self, clock):
        return 5.0 * (np.arange(self._num_runs) == 2)[:, None] * np.ones(3)


def test_a_restarted_auxiliary_position_is_the_filters_in_these_runs_alone():
    simulation = Simulation(
        make_scenario(f"{SHORT},auxiliary=free,odometer=set-b"), None, (), None, 3, 1, demands=Demands(auxiliary=True)
    )
    simulation.reset()
    for _ in range(5):
        simulation.resolve()
        simulation.observe()
    before, error = simulation.navigator.auxiliary_offset, simulation.navigator.error
    simulation.navigator.restart_auxiliary(np.array([0, 2]))
    after = simulation.navigator.auxiliary_offset
    assert before[:, :2].all()
    np.testing.assert_array_equal(after[[0, 2]], 0.0)
    np.testing.assert_array_equal(after[1], before[1])
    np.testing.assert_array_equal(simulation.navigator.error, error)


def test_runs_are_bit_identical_for_any_number_and_threads():
    use = [True] * 10 + [False] * 5 + [True] * 10
    back = {12: 3}
    whole = play(use, seed=0, num_runs=600, backtrack=back)
    np.testing.assert_array_equal(play(use, seed=0, num_runs=600, backtrack=back, threads=2), whole)
    np.testing.assert_array_equal(play(use, seed=7, num_runs=1, backtrack=back)[:, 0], whole[:, 7])
    np.testing.assert_array_equal(play(use, seed=590, num_runs=10, backtrack=back), whole[:, 590:])


def test_runs_do_not_touch_each_other():
    spoofed = Simulation(make_scenario(SHORT), ThirdRunOnly(), (), None, 4, 0)
    clean = Simulation(make_scenario(SHORT), None, (), None, 4, 0)
    for simulation in (spoofed, clean):
        simulation.reset()
        for _ in range(20):
            simulation.resolve()
            simulation.observe()
    same = (spoofed.navigator.state == clean.navigator.state).all(axis=1)
    assert same.tolist() == [True, True, False, True]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"anchoring": "loose"}, "anchoring must be one of anchored, credited, free, got 'loose'"),
        ({"credit": 0}, "credit must be a whole number, 1 or more, got 0"),
    ],
)
def test_bad_rules_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        AuxiliaryRule(**values)


def test_bad_tunings_are_refused():
    tuning = make_scenario(SHORT).family.tuning
    with pytest.raises(ValueError, match="credible filter: fix_sigma must be a finite number greater than 0, got 0"):
        dataclasses.replace(tuning, fix_sigma=0.0)
