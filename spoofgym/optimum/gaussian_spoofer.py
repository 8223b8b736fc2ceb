"""A lower bound of the value of the duel: a spoofer that draws its pull at random.

With probability `clean` nobody attacks. Else the pull begins with the game and is one of several Gaussian processes
(`pull_process`). Given the process, the error of the unaided solution and the pull are jointly Gaussian, so the
posterior of the error given all fixes is that of a Kalman filter over both. Over several processes it is a mixture,
with weights by the likelihoods. No defender does better than the estimate with the least expected payoff under this
mixture, whatever it may do. So its payoff bounds the value of the duel from below. The shares of the processes are
those at which it is largest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import linalg, special

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.linear_model import LinearModel, semidefinite_factor
from spoofgym.navigation.loose.mean_maps import check_position_fix
from spoofgym.optimum.play import HORIZONTAL
from spoofgym.optimum.pull_process import PullProcess, no_pull

OWNER = "Gaussian spoofer"
NEGLIGIBLE = 1e-3
"""A pull with a smaller share is not looked at."""
PLACES = 21
"""Places at which the best estimate is looked for."""
STEPS = 30
"""Of the ascent to the worst shares."""
THINNED = 6
"""The ascent looks at every sixth epoch."""


class Loss(NamedTuple):
    """What an error is worth, and what it is expected to be worth under a Gaussian posterior.

    Attributes:
        of: from errors, m, to what they are worth.
        expected: from the distance of an estimate to a mean, m, and the variance per axis, m².
    """

    of: Callable[[Floats], Floats]
    expected: Callable[[Floats, Floats], Floats]


def error_loss(cap: float) -> Loss:
    """The horizontal error, clipped; its expectation is taken as √(d² + π σ²/2), exact for d = 0 without the cap."""
    return Loss(
        lambda error: np.minimum(error, cap),
        lambda distance, variance: np.minimum(np.sqrt(distance**2 + 0.5 * np.pi * variance), cap),
    )


def beyond_loss(limit: float) -> Loss:
    """Whether the error exceeds a limit; its square is taken as normal with its own mean and variance."""
    return Loss(
        lambda error: np.where(error > limit, 1.0, 0.0),
        lambda distance, variance: special.ndtr(
            (distance**2 + 2.0 * variance - limit**2) / (2.0 * np.sqrt(variance * (distance**2 + variance)))
        ),
    )


@dataclass(frozen=True)
class LowerBound:
    """What no defender can keep the harm below.

    Attributes:
        value: mean payoff of the best estimate over games and epochs.
        deviation: 1 sigma of it, from the games.
        clean: its part in clean games, a mean over these.
        attacked: its part in attacked games.
        shares: of the attacked games that each pull has, by its name, summing to 1.
        rate: per axis, that the pulls with a share exceed in at most one of a thousand games, m/s.
    """

    value: float
    deviation: float
    clean: float
    attacked: float
    shares: dict[str, float]
    rate: float


class Posterior(NamedTuple):
    """What the fixes of N games tell under each of J hypotheses; K epochs.

    Attributes:
        mean: of the horizontal error of the unaided solution, (J, N, K, 2), m.
        variance: per axis, mean of both, (J, K), m².
        log_likelihood: of the fixes up to each epoch, (J, N, K).
        error: what it really is, (N, K, 2), m.
    """

    mean: Floats
    variance: Floats
    log_likelihood: Floats
    error: Floats


def draw_games(
    model: LinearModel, pull: PullProcess, games: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Draw games in which the fixes are pulled.

    Args:
        model: of the game.
        pull: of the spoofer.
        games: N.
        rng: random numbers.

    Returns:
        The unaided solution minus the fix, (N, K+1, 3), m; horizontal errors of the unaided solution, (N, K+1, 2), m;
        the pulls, (N, K+1, 2), m.
    """

    def normal(covariance: Floats) -> Floats:
        return rng.standard_normal((games, len(covariance))) @ semidefinite_factor(covariance).T

    epochs = model.num_epochs + 1
    error, state = normal(model.prior_covariance), normal(pull.covariance)
    fixes, errors, pulls = np.empty((games, epochs, 3)), np.empty((games, epochs, 2)), np.empty((games, epochs, 2))
    for k in range(epochs):
        error = error @ model.transition[k].T + normal(model.process_noise[k])
        state = state @ pull.transition[k].T + normal(pull.noise[k])
        pulls[:, k] = state @ pull.observation[k].T
        fixes[:, k] = error[:, :9] @ model.observation[k].T + normal(model.measurement_covariance)
        fixes[:, k, :2] -= pulls[:, k]
        errors[:, k] = error[:, HORIZONTAL]
    return fixes, errors, pulls


def infer(model: LinearModel, pull: PullProcess, fixes: Floats) -> tuple[Floats, Floats, Floats]:
    """The Kalman filter over the error of the unaided solution and a pull.

    Args:
        model: of the game.
        pull: that is assumed.
        fixes: of N games, (N, K+1, 3), m.

    Returns:
        Means of the horizontal error (N, K, 2), variances per axis (K,), and log likelihoods (N, K), of epochs 1..K.
    """
    games, epochs, m = fixes.shape
    mean, covariance = (
        np.zeros((games, NUM_INERTIAL + len(pull.covariance))),
        linalg.block_diag(model.prior_covariance, pull.covariance),
    )
    means, variances, likelihood = np.empty((games, epochs, 2)), np.empty(epochs), np.empty((games, epochs))
    for k in range(epochs):
        transition = linalg.block_diag(model.transition[k], pull.transition[k])
        mean = mean @ transition.T
        covariance = transition @ covariance @ transition.T + linalg.block_diag(model.process_noise[k], pull.noise[k])
        observation = np.zeros((m, mean.shape[1]))
        observation[:, :9] = model.observation[k]
        observation[:2, NUM_INERTIAL:] = -pull.observation[k]
        innovation = observation @ covariance @ observation.T + model.measurement_covariance
        factor = np.linalg.cholesky(innovation)
        whitened = np.linalg.solve(factor, (fixes[:, k] - mean @ observation.T).T).T
        gain = np.linalg.solve(factor, observation @ covariance)
        mean, covariance = mean + whitened @ gain, covariance - gain.T @ gain
        covariance = 0.5 * (covariance + covariance.T)
        means[:, k] = mean[:, HORIZONTAL]
        variances[k] = 0.5 * np.trace(covariance[HORIZONTAL, HORIZONTAL])
        likelihood[:, k] = -0.5 * np.sum(whitened**2, axis=1) - np.log(np.diag(factor)).sum()
    return means[:, 1:], variances[1:], np.cumsum(likelihood, axis=1)[:, 1:]


def posteriors(
    model: LinearModel, pulls: Sequence[PullProcess], games: int, rng: np.random.Generator
) -> list[Posterior]:
    """Draw games of every pull, and infer the error in each under every pull.

    Args:
        model: of the game.
        pulls: the hypotheses, J.
        games: N, of each.
        rng: random numbers.

    Returns:
        What the games of each pull tell.
    """
    drawn = [draw_games(model, pull, games, rng)[:2] for pull in pulls]
    fixes = np.concatenate([fixes for fixes, _ in drawn])
    means, variances, likelihoods = zip(*[infer(model, pull, fixes) for pull in pulls], strict=True)
    mean, variance, likelihood = np.stack(means), np.stack(variances), np.stack(likelihoods)
    parts = [slice(place * games, (place + 1) * games) for place in range(len(pulls))]
    return [
        Posterior(mean[:, part], variance, likelihood[:, part], errors[:, 1:])
        for part, (_, errors) in zip(parts, drawn, strict=True)
    ]


def best_estimate(found: Posterior, log_share: Floats, loss: Loss) -> Floats:
    """The estimate with the least expected loss, (N, K, 2), m, among places on a line.

    The line goes from the mean of a clean game to the mean of an attacked one.

    Args:
        found: of N games.
        log_share: logarithms of the prior probabilities of the hypotheses, (J,); clean first.
        loss: what is least.
    """
    evidence = found.log_likelihood + log_share[:, None, None]
    weight, if_attacked = special.softmax(evidence, axis=0), special.softmax(evidence[1:], axis=0)
    attacked = np.sum(if_attacked[..., None] * found.mean[1:], axis=0)
    variance = found.variance[:, None]
    least, best = np.full(weight.shape[1:], np.inf), np.empty_like(attacked)
    for place in np.linspace(0.0, 1.0, PLACES):
        estimate = (1.0 - place) * found.mean[0] + place * attacked
        distance = np.linalg.norm(found.mean - estimate, axis=3)
        expected = np.sum(weight * loss.expected(distance, variance), axis=0)
        better = expected < least
        least[better], best[better] = expected[better], estimate[better]
    return best


def risks(games: Sequence[Posterior], shares: Floats, loss: Loss) -> list[Floats]:
    """What the best estimate costs in every game of every hypothesis, (N,) each.

    Args:
        games: of each hypothesis.
        shares: prior probabilities of the hypotheses, (J,).
        loss: of an error.
    """
    log_share = np.log(shares)
    return [
        loss.of(np.linalg.norm(found.error - best_estimate(found, log_share, loss), axis=2)).mean(axis=1)
        for found in games
    ]


def worst_shares(games: Sequence[Posterior], clean: float, loss: Loss) -> Floats:
    """The shares of the hypotheses at which the best estimate costs most, by multiplicative ascent, (J,).

    The least expected loss is concave in the shares, and its slope along each is the risk under that hypothesis.
    """
    shares = np.append(clean, np.full(len(games) - 1, (1.0 - clean) / (len(games) - 1)))
    best, worst = shares, -np.inf
    for _ in range(STEPS):
        risk = np.array([game.mean() for game in risks(games, shares, loss)])
        if shares @ risk > worst:
            best, worst = shares, float(shares @ risk)
        attacked = shares[1:] * np.exp((risk[1:] - risk[1:].mean()) / max(float(risk[1:].std()), 1e-12))
        shares = np.append(clean, (1.0 - clean) * attacked / attacked.sum())
        shares = np.maximum(shares, 1e-12)
    return best


def lower_bound(
    model: LinearModel,
    loss: Loss,
    pulls: Sequence[PullProcess],
    clean: float = 0.5,
    games: int = 200,
    seed: int = 0,
) -> LowerBound:
    """What no defender of the duel can keep the harm below, against a spoofer that draws its pull.

    The shares are found on games of their own, and the value is that of others. The estimate is looked for among
    places on a line: one that were better still would lower the value.

    Args:
        model: of the game, whose process noise is the true one.
        loss: of an error, by `error_loss` or `beyond_loss`.
        pulls: from which the spoofer draws.
        clean: share of games in which nobody attacks, between 0 and 1.
        games: N, of each hypothesis.
        seed: of the random numbers.

    Raises:
        ValueError: m is not 3, there is no pull, or an argument is out of range.
    """
    check_position_fix(model, "the Gaussian spoofer")
    if not pulls:
        raise ValueError(f"{OWNER}: at least one pull is needed, got none")
    clean = validation.probability(OWNER, "clean", clean)
    games = validation.whole(OWNER, "games", games, 2)
    every = (no_pull(model), *pulls)
    rng = np.random.default_rng(validation.whole(OWNER, "seed", seed, 0))
    shares = worst_shares([_thinned(found) for found in posteriors(model, every, games, rng)], clean, loss)
    costs = risks(posteriors(model, every, games, rng), shares, loss)
    mean = np.array([cost.mean() for cost in costs])
    deviation = np.array([cost.std(ddof=1) for cost in costs]) / np.sqrt(games)
    attacked = shares[1:] / shares[1:].sum()
    return LowerBound(
        value=float(shares @ mean),
        deviation=float(np.linalg.norm(shares * deviation)),
        clean=float(mean[0]),
        attacked=float(attacked @ mean[1:]),
        shares={pull.name: float(share) for pull, share in zip(pulls, attacked, strict=True)},
        rate=max(_rate(model, pull, rng) for pull, share in zip(pulls, attacked, strict=True) if share > NEGLIGIBLE),
    )


def _rate(model: LinearModel, pull: PullProcess, rng: np.random.Generator) -> float:
    """The rate per axis that a pull exceeds in one of a thousand games, m/s."""
    _, _, offsets = draw_games(model, pull, 1000, rng)
    rates = np.abs(np.diff(offsets, axis=1)).max(axis=(1, 2)) / float(model.time[1] - model.time[0])
    return float(np.quantile(rates, 0.999))


def _thinned(found: Posterior) -> Posterior:
    """Every sixth epoch."""
    part = slice(THINNED - 1, None, THINNED)
    mean, variance, log_likelihood, error = found
    return Posterior(mean[:, :, part], variance[:, part], log_likelihood[:, :, part], error[:, part])
