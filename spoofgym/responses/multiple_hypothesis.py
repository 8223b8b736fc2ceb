"""A response that weighs hypotheses about the spoofer and takes the solution with the least expected error."""

from __future__ import annotations

import inspect

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.facts import COASTING, INERTIAL_SOLUTION, LINEAR_MODEL, FilterFacts
from spoofgym.navigation.interface import Decision, Demands, Epoch
from spoofgym.responses.base import Response, given
from spoofgym.responses.hypotheses import Bank, BankModel, PullKinds, bank_model, empty_bank, start
from spoofgym.responses.hypothesis_step import advance
from spoofgym.responses.solutions import Choice, Solutions, carry_past, choose, look_ahead
from spoofgym.specification import spell

KIND = "multiple-hypothesis"
MULTIPATH = (600.0, 15.0)
"""Mean time until a burst of multipath begins, and mean length of it, s."""


class MultipleHypothesis(Response):
    """The Bayesian defender: it holds hypotheses about the spoofer, and chooses what is best on average over them.

    A bank of Kalman filters on the unaided inertial solution (`spoofgym.responses.hypotheses`) tells how probable it is
    that the fixes have been pulled since any epoch, and where the vehicle is then. In every epoch the defender compares
    the solutions that it can have: with the present fix, without it, and without the fixes of the last n epochs. It
    takes the one whose expected horizontal error, now and a while ahead, is least. It follows no alarm.

    Decisions do not touch the unaided solution, and what lies between it and any other solution is known. Only its own
    error is not, and the bank's mixture tells it.

    Args:
        hypotheses: M, kept in every epoch.
        history: epochs that can be taken back.
        onset: mean time until a pull begins, s.
        end: mean length of a pull, s.
        turn: mean time until a pull turns, s.
        ahead: how far to look ahead, s.
        slow: 1 sigma of the rate of a slow pull, per axis, m/s.
        fast: 1 sigma of the rate of a fast pull, per axis, m/s.
        jump: 1 sigma of the offset with which a fast pull begins, per axis, m.
        curve: 1 sigma of the acceleration, per axis, as a share of that of the rate, 1/s.
        walk: 1 sigma by which the rate changes in a second, per axis, as a share of its own sigma.
        multipath: 1 sigma that it adds to each axis of a fix, m; a burst comes every 600 s and lasts 15 s, on average.
        hidden: probability that a hidden pull has begun with the game: a mixture of the attacks that move the position
            most per unit of noncentrality (`quiet_offsets`), which look like inertial drift.
        amplitude: 1 sigma of its two amplitudes, the roots of their noncentralities.
        limit: alert limit, m: the solution is taken that is least likely to be farther from the truth, now and a while
            ahead, and not the one with the least expected error; 0 = none.

    Raises:
        ValueError: a value out of range.
    """

    kind = KIND
    needs = (INERTIAL_SOLUTION, LINEAR_MODEL, COASTING)

    def __init__(
        self,
        hypotheses: int = 12,
        history: int = 60,
        onset: float = 120.0,
        end: float = 60.0,
        turn: float = 60.0,
        ahead: float = 10.0,
        slow: float = 0.5,
        fast: float = 2.5,
        jump: float = 20.0,
        curve: float = 0.05,
        walk: float = 0.1,
        multipath: float = 6.0,
        hidden: float = 0.1,
        amplitude: float = 4.0,
        limit: float = 0.0,
    ) -> None:
        self.hypotheses = validation.epochs(KIND, "hypotheses", hypotheses, 2)
        self.history = validation.epochs(KIND, "history", history, 0, validation.LONGEST_TABLE)
        self.onset = validation.above(KIND, "onset", onset)
        self.end = validation.above(KIND, "end", end)
        self.turn = validation.above(KIND, "turn", turn)
        self.ahead = validation.non_negative(KIND, "ahead", ahead)
        self.slow = validation.above(KIND, "slow", slow)
        self.fast = validation.above(KIND, "fast", fast)
        self.jump = validation.non_negative(KIND, "jump", jump)
        self.curve = validation.non_negative(KIND, "curve", curve)
        self.walk = validation.non_negative(KIND, "walk", walk)
        self.multipath = validation.non_negative(KIND, "multipath", multipath)
        self.hidden = validation.share(KIND, "hidden", hidden)
        self.amplitude = validation.above(KIND, "amplitude", amplitude)
        self.limit = validation.non_negative(KIND, "limit", limit)
        self.demands = Demands(excludes=True, history=self.history, auxiliary=True)

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        options = inspect.signature(type(self)).parameters
        given = {key: getattr(self, key) for key, option in options.items() if getattr(self, key) != option.default}
        return spell(KIND, **given)

    def know(self, facts: FilterFacts) -> None:
        """Learn the filter's model, of which every hypothesis runs a copy.

        Raises:
            ValueError: pulls would begin, turn or end in every other epoch, or the fixes are not a position alone and
                pulls may be hidden.
        """
        model, interval = facts.model(0), facts.interval
        self._kinds = self._pulls(interval)
        self._model = bank_model(model, self._kinds, self.multipath)
        self._prior = model.prior_covariance
        self._rows = look_ahead(model, round(self.ahead / interval))

    def _pulls(self, interval: float) -> PullKinds:
        for name, mean in (("onset", self.onset), ("end", self.end), ("turn", self.turn)):
            if mean <= 2.0 * interval:
                raise ValueError(f"{KIND}: {name} must be longer than two epochs of {interval:g} s, got {mean:g}")
        begins, ends, turns = interval / self.onset, interval / self.end, interval / self.turn
        toggles = np.minimum(interval / np.array(MULTIPATH), 0.5)
        rate = np.array([self.slow, self.fast])
        return PullKinds(
            offset=np.array([0.0, self.jump, self.amplitude]),
            rate=np.append(rate, 0.0),
            acceleration=np.append(self.curve * rate, 0.0),
            walk=np.append(self.walk * rate, 0.0),
            begin=np.array([np.log(begins / 2.0), np.log(begins / 2.0), -np.inf]),
            hidden=self.hidden,
            none=float(np.log1p(-begins)),
            end=np.array([np.log(ends), np.log(ends), -np.inf]),
            turn=np.array([np.log(turns), np.log(turns), -np.inf]),
            last=np.array([np.log1p(-ends - turns), np.log1p(-ends - turns), 0.0]),
            disturbance=np.log(toggles),
            undisturbed=np.log1p(-toggles),
        )

    def bind(self, num_runs: int) -> None:
        """Allocate the hypotheses and solutions of ``num_runs`` runs."""
        super().bind(num_runs)
        bank = empty_bank(num_runs, self.hypotheses)
        self._mean, self._covariance, self._log_weight, self._pull, self._disturbed = bank
        self._bank = bank
        self._past = np.zeros((num_runs, self.history + 1, NUM_INERTIAL))

    def reset(self, runs: Runs) -> None:
        """Begin without a pull in these runs."""
        start(self._bank, runs, self._prior, self._kinds)
        self._past[runs] = 0.0

    @property
    def bank(self) -> Bank:
        """The hypotheses of every run, as `see` left them."""
        return self._bank

    @property
    def model(self) -> BankModel:
        """The filter of the hypotheses."""
        return self._model

    @property
    def rows(self) -> Floats:
        """From an error to the horizontal position now and a while ahead, (K+1, 4, 15)."""
        return self._rows

    def see(self, epoch: Epoch, runs: Runs) -> Solutions:
        """Let the bank see the present fix of some runs; the solutions that a defender can choose, of all runs."""
        view, innovation = epoch.view, epoch.innovation
        assert view is not None
        auxiliary = view.auxiliary
        fixes = innovation.residual + np.einsum(
            "nmi,ni->nm", self._model.observation[epoch.index, 0, :, :NUM_INERTIAL], auxiliary
        )
        correction = np.einsum("nmi,nm->ni", view.fix_gain, innovation.whitened)
        solutions = Solutions(auxiliary, correction, self._past, np.minimum(epoch.index, self.history))
        advance(runs, epoch.index, fixes, given(epoch), self._model, self._kinds, self._bank)
        carry_past(runs, epoch.index, self._model.transition, view.backtracked, solutions)
        return solutions

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Let the bank see the fix, and choose."""
        n = len(epoch.index)
        every = np.arange(n)
        solutions = self.see(epoch, every)
        choice = Choice(np.zeros(n, dtype=bool), np.zeros(n, dtype=np.int64), np.zeros(n))
        choose(every, epoch.index, given(epoch), self._rows, self._bank, solutions, self.limit, choice)
        return Decision(choice.use, choice.backtrack)
