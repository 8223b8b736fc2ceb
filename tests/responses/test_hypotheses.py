"""The bank of hypotheses against the joint density of the fixes, written down for every history of a short game."""

import itertools

import numpy as np
import pytest
from scipy import special, stats

from spoofgym.navigation.loose.mean_maps import quiet_offsets
from spoofgym.responses.hypotheses import CLEAN, NUM_STATES, OFFSET, PullKinds, bank_model, empty_bank, start
from spoofgym.responses.hypothesis_step import STAY, TOGGLE, TURN, advance
from spoofgym.scenarios import make_scenario

EPOCHS = 3
KINDS = PullKinds(
    offset=np.array([0.5, 8.0, 3.0]),
    rate=np.array([0.4, 2.0, 0.0]),
    acceleration=np.array([0.1, 0.3, 0.0]),
    walk=np.array([0.05, 0.2, 0.0]),
    begin=np.array([np.log(0.1), np.log(0.05), -np.inf]),
    hidden=0.3,
    none=float(np.log(0.85)),
    end=np.array([np.log(0.2), np.log(0.2), -np.inf]),
    turn=np.array([np.log(0.1), np.log(0.1), -np.inf]),
    last=np.array([np.log(0.7), np.log(0.7), 0.0]),
    disturbance=np.log([0.1, 0.3]),
    undisturbed=np.log([0.9, 0.7]),
)
MULTIPATH = 5.0
HIDDEN = 2


@pytest.fixture(scope="module")
def model():
    return make_scenario("foi-drive").linear_model()


def histories(kind):
    """Every sequence of ways from a kind of hypothesis: (ways, kinds after each, logarithm of the prior)."""
    ways = [STAY, CLEAN, TURN, TOGGLE, 0, 1]
    for chosen in itertools.product(ways, repeat=EPOCHS):
        now, kinds, log_prior, disturbed = kind, [], 0.0, 0
        for way in chosen:
            log_prior += (KINDS.disturbance if way == TOGGLE else KINDS.undisturbed)[disturbed]
            if way == TOGGLE:
                disturbed = 1 - disturbed
            elif now == CLEAN and way in (STAY, 0, 1):
                log_prior += KINDS.none if way == STAY else KINDS.begin[way]
            elif now in (0, 1) and way in (STAY, CLEAN, TURN):
                log_prior += {STAY: KINDS.last, CLEAN: KINDS.end, TURN: KINDS.turn}[way][now]
            elif now == HIDDEN and way == STAY:
                log_prior += 0.0
            else:
                break
            now = now if way in (STAY, TURN, TOGGLE) else way
            kinds.append(now)
        else:
            yield chosen, kinds, log_prior


class Joint:
    """States and fixes as linear maps of independent standard normal numbers."""

    def __init__(self, covariance):
        self.state = root(covariance)
        self.fixes = []

    def carry(self, transition, noise):
        self.state = np.hstack([transition @ self.state, root(noise)])

    def add(self, variance):
        self.state = np.hstack([self.state, root(np.diag(variance))])

    def see(self, observation, noise):
        row = np.hstack([observation @ self.state, root(noise)])
        self.state = np.hstack([self.state, np.zeros((NUM_STATES, len(noise)))])
        self.fixes.append(row)

    def density(self, fixes):
        """Logarithm of the density of all fixes, and mean and covariance of the state given them."""
        width = self.state.shape[1]
        rows = np.vstack([np.pad(row, ((0, 0), (0, width - row.shape[1]))) for row in self.fixes])
        seen, cross = rows @ rows.T, self.state @ rows.T
        gain = np.linalg.solve(seen, cross.T).T
        log_density = stats.multivariate_normal(np.zeros(len(seen)), seen).logpdf(fixes.ravel())
        return log_density, gain @ fixes.ravel(), self.state @ self.state.T - gain @ cross.T


def root(covariance):
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def pull_variance(kind):
    variance = np.zeros(NUM_STATES)
    variance[OFFSET:] = np.repeat([KINDS.offset[kind], KINDS.rate[kind], KINDS.acceleration[kind]], 2) ** 2
    return variance


def explained(model, kind, ways, kinds, fixes):
    """A history's density of the fixes, and the state after them."""
    filter_model = bank_model(model, KINDS, MULTIPATH)
    start_covariance = np.zeros((NUM_STATES, NUM_STATES))
    start_covariance[:15, :15] = model.prior_covariance
    joint = Joint(start_covariance + np.diag(pull_variance(kind) if kind == HIDDEN else np.zeros(NUM_STATES)))
    t = filter_model.interval
    before, disturbed = kind, False
    for k, (way, now) in enumerate(zip(ways, kinds, strict=True)):
        transition = np.zeros((NUM_STATES, NUM_STATES))
        transition[:15, :15] = model.transition[k]
        if before != CLEAN:
            transition[15:, 15:] = np.kron([[1.0, t, t * t / 2], [0.0, 1.0, t], [0.0, 0.0, 1.0]], np.eye(2))
        joint.carry(transition, filter_model.process_noise[k, before + 1])
        if way >= 0:
            joint.add(pull_variance(way))
        elif way == CLEAN:
            joint.state[OFFSET:] = 0.0
        elif way == TURN:
            rates = np.zeros(NUM_STATES)
            rates[OFFSET + 2 : OFFSET + 4] = KINDS.rate.max() ** 2
            joint.add(rates)
        observation = np.zeros((3, NUM_STATES))
        observation[:, :9] = model.observation[k]
        observation[:2, OFFSET : OFFSET + 2] = -quiet_offsets(model, 2)[k] if now == HIDDEN else -np.eye(2)
        disturbed ^= way == TOGGLE
        joint.see(observation, model.measurement_covariance + disturbed * MULTIPATH**2 * np.eye(3))
        before = now
    return joint.density(fixes)


def test_posterior_is_that_of_every_history_of_a_short_game(model):
    """Weights, means and covariances of all histories; nothing is left out where the bank has room for them."""
    fixes = np.random.default_rng(5).normal(0.0, 1.0, (EPOCHS, 3)) + np.array([[0, 0, 0], [2, 1, 0], [5, 2, 0]])
    expected = []
    for kind, prior in ((CLEAN, np.log1p(-KINDS.hidden)), (HIDDEN, np.log(KINDS.hidden))):
        for ways, kinds, log_prior in histories(kind):
            log_density, mean, covariance = explained(model, kind, ways, kinds, fixes)
            expected.append((prior + log_prior + log_density, kinds[-1], mean, covariance))
    bank = empty_bank(1, 2 * len(expected))
    start(bank, np.array([0]), model.prior_covariance, KINDS)
    filter_model = bank_model(model, KINDS, MULTIPATH)
    for k in range(EPOCHS):
        advance(np.array([0]), np.array([k]), fixes[k][None], np.array([True]), filter_model, KINDS, bank)
    log_weight = np.array([item[0] for item in expected])
    order = np.argsort(-log_weight)
    found = bank.log_weight[0][: len(expected)]
    assert np.isneginf(bank.log_weight[0][len(expected) :]).all()
    np.testing.assert_allclose(found, (log_weight - special.logsumexp(log_weight))[order], rtol=1e-6, atol=1e-6)
    for place, item in enumerate(order[:20]):
        _, kind, mean, covariance = expected[item]
        assert bank.kind[0, place] == kind
        np.testing.assert_allclose(bank.mean[0, place], mean, rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(bank.covariance[0, place], covariance, rtol=1e-5, atol=1e-7)


def test_without_pulls_it_is_the_filter_that_uses_every_fix(model):
    never = KINDS._replace(begin=np.full(3, -np.inf), none=0.0, hidden=0.0, disturbance=np.full(2, -np.inf))
    bank, filter_model = empty_bank(1, 2), bank_model(model, never, MULTIPATH)
    start(bank, np.array([0]), model.prior_covariance, never)
    mean, rng = np.zeros(15), np.random.default_rng(1)
    for k in range(40):
        fix = rng.normal(0.0, 2.0, 3)
        advance(np.array([0]), np.array([k]), fix[None], np.array([True]), filter_model, never, bank)
        mean = model.transition[k] @ mean
        factor, gain = model.innovation_factor[k], model.whitened_gain[k]
        innovation = np.linalg.solve(factor, model.observation[k] @ mean[:9] - fix)
        mean = mean - gain.T @ innovation
        np.testing.assert_allclose(bank.mean[0, 0, :15], mean, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(
            bank.covariance[0, 0, :15, :15], model.covariance[k] - gain.T @ gain, rtol=1e-7, atol=1e-12
        )


def test_an_epoch_without_a_fix_teaches_nothing(model):
    bank, filter_model = empty_bank(1, 8), bank_model(model, KINDS, MULTIPATH)
    start(bank, np.array([0]), model.prior_covariance, KINDS)
    before = bank.log_weight.copy()
    advance(np.array([0]), np.array([0]), np.full((1, 3), 99.0), np.array([False]), filter_model, KINDS, bank)
    assert np.array_equal(bank.log_weight, before)
    assert not bank.mean.any()


def test_the_heaviest_hypotheses_are_kept(model):
    rng = np.random.default_rng(2)
    few, many = empty_bank(1, 3), empty_bank(1, 400)
    filter_model = bank_model(model, KINDS, MULTIPATH)
    for bank in (few, many):
        start(bank, np.array([0]), model.prior_covariance, KINDS)
    fix = rng.normal(0.0, 1.0, (1, 3))
    for bank in (few, many):
        advance(np.array([0]), np.array([0]), fix, np.array([True]), filter_model, KINDS, bank)
    kept = np.sort(np.exp(many.log_weight[0]))[::-1]
    heaviest = kept[:3] / kept[:3].sum()
    np.testing.assert_allclose(np.sort(np.exp(few.log_weight[0]))[::-1], heaviest, rtol=1e-12)
