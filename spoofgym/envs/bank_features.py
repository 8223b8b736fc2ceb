"""What a defender sees of a bank of hypotheses: what it expects of every choice, and what it makes of the spoofer.

The bank is that of the response `multiple-hypothesis`. It looks at the unaided inertial solution, so that nothing it
says of the spoofer depends on what the defender has decided. With these entries a defender that learns begins where
the Bayesian one stands, and can learn where that one is too sure, or looks too short a way ahead.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.envs.observation import Field
from spoofgym.fitting import fit_response
from spoofgym.responses import make_response
from spoofgym.responses.appraisal import USED, Sight, appraise, blank_appraisal
from spoofgym.responses.base import given
from spoofgym.responses.multiple_hypothesis import KIND, MultipleHypothesis
from spoofgym.responses.solutions import NO_LIMIT
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation

OWNER = "bank of hypotheses"
LEAST_ODDS = 1e-12


def make_bank(specification: str) -> MultipleHypothesis:
    """The response whose bank is shown.

    Raises:
        ValueError: the specification is not of a `multiple-hypothesis`, an option of it is not valid, or it has a
            limit, which no entry tells of.
    """
    response = make_response(specification)
    if not isinstance(response, MultipleHypothesis):
        raise ValueError(f"a bank is spelled {KIND} or {KIND}:OPTION=VALUE,..., got {specification!r}")
    if response.limit != NO_LIMIT:
        raise ValueError(f"the entries of a bank are errors in metres: leave limit out of {specification!r}")
    return response


def bank_fields(depths: Runs, error_scale: float) -> tuple[Field, ...]:
    """The entries, in order.

    Args:
        depths: the depth table, (D,), epochs.
        error_scale: metres of error that make a reward of -1.
    """
    fine = 0.1 * error_scale
    return (
        *(Field(f"expected error {when}, fix {done}", "m", 2.0 * fine)
          for done in ("used", "left out") for when in ("now", "ahead")),
        Field("expected gain of exclusion", "m", fine),
        Field("depth of the least expected error", "epochs", 20.0),
        *(Field(f"expected loss at depth {depth}", "m", fine) for depth in depths),
        Field("probability of a pull", "1", 0.0),
        Field("log odds of a pull", "1", 5.0),
        Field("probability of multipath", "1", 0.0),
        Field("expected pull", "m", error_scale),
        Field("expected rate of the pull", "m/s", fine),
        Field("spread of the hypotheses", "m", error_scale),
    )


class BankFeatures:
    """The entries of N lanes.

    Attributes:
        fields: the entries, in order.
        depths: the depth table, (D,), epochs.
        appraisal: of the present epoch of every lane; its solutions are the fix used, and each depth of the table.
        gain: how much less the error of the best exclusion is than that of using the fix, by expectation, (N,), m.
        place: the depth of that exclusion, its place in the table, (N,).
    """

    def __init__(self, scenario: Scenario, simulation: Simulation, bank: str) -> None:
        """Look at a simulation through the bank of a specification.

        Raises:
            ValueError: it is no bank, or needs what the scenario does not give.
        """
        self._bank = make_bank(bank)
        fit_response(OWNER, self._bank, scenario, simulation.num_runs)
        self._simulation = simulation
        self.depths: Runs = np.array(scenario.depth_table, dtype=np.int64)
        self.fields = bank_fields(self.depths, scenario.defender_scale)
        self.appraisal = blank_appraisal(simulation.num_runs, len(self.depths))
        self.gain = np.zeros(simulation.num_runs)
        self.place = np.zeros(simulation.num_runs, dtype=np.int64)

    def reset(self, lanes: Runs) -> None:
        """Forget the games of these lanes."""
        self._bank.reset(lanes)

    def update(self, lanes: Runs, excluding: Flags) -> Floats:
        """See the present epoch of lanes (n,), all of which may be ``excluding`` (N,); the raw entries, (n, F)."""
        epoch = self._simulation.epoch
        solutions = self._bank.see(epoch, lanes)
        sight = Sight(epoch.index, given(epoch), self._bank.rows, self.depths)
        appraise(lanes, sight, self._bank.model, self._bank.bank, solutions, self.appraisal)
        error = self.appraisal.error[lanes].mean(axis=2)
        used, left_out = error[:, USED], error[:, USED + 1 :]
        # whoever is excluding already reads no depth
        open_to = np.where(excluding[lanes, None] & (self.depths > 0), np.inf, left_out)
        self.place[lanes], self.gain[lanes] = open_to.argmin(axis=1), used - open_to.min(axis=1)
        return self._raw(lanes, left_out)

    def shown(self, lanes: Runs) -> Floats:
        """What the bank says of the spoofer and of multipath, whatever the defender does: the last entries, (n, 6)."""
        appraisal = self.appraisal
        pulled = appraisal.pulled[lanes]
        odds = np.log(np.maximum(pulled, LEAST_ODDS) / np.maximum(1.0 - pulled, LEAST_ODDS))
        pull, rate = np.hypot(*appraisal.pull[lanes].T), np.hypot(*appraisal.rate[lanes].T)
        return np.column_stack([pulled, odds, appraisal.disturbed[lanes], pull, rate, appraisal.spread[lanes]])

    def _raw(self, lanes: Runs, left_out: Floats) -> Floats:
        errors = self.appraisal.error[lanes]
        return np.column_stack(
            [
                errors[:, USED],
                errors[:, USED + 1],
                self.gain[lanes],
                self.depths[self.place[lanes]],
                left_out - left_out.min(axis=1, keepdims=True),
                self.shown(lanes),
            ]
        )
