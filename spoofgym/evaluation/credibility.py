"""What Song et al. (2021) measure a navigation algorithm by, in the usual orientation.

Here an alarm is positive: a false alarm is an alarm on a clean fix, a missed detection a spoofed fix without one. The
paper calls normal positive, so that what it names the false-alarm rate (eq 13) is everyone's missed detection, and its
missing-alarm rate (eq 14) everyone's false alarm. Accuracy, and the sum of both, are the same either way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Flags, Floats


def deviation(values: Floats) -> Floats:
    """The paper's "1σ positioning accuracy" of a series, (N, T) -> (N,): the standard deviation about the mean.

    It does not see a constant error. The paper gives no formula; its own tables tell: 13.47 m of the error norm under a
    jump of 28 m in half of the time is this, where the root mean square is 20 m.
    """
    return np.asarray(np.std(values, axis=1))


def deterioration(spoofed: Floats, clean: Floats) -> Floats:
    """γ = σ̃ / σ: 1σ accuracy under attack over that without (Song 2021, eq 34), (N,)."""
    return np.asarray(spoofed / clean)


def credibility(receiver: Floats, algorithm: Floats) -> Floats:
    """ζ = (γ_g - γ) / γ_g of an algorithm beside the receiver's own γ_g (Song 2021, eq 35), (N,).

    1 where an attack changes nothing, 0 where the algorithm suffers like the receiver.
    """
    return np.asarray((receiver - algorithm) / receiver)


@dataclass(frozen=True)
class DecisionRates:
    """Of each run, (N,).

    Attributes:
        accuracy: right decisions over all fixes (Song 2021, eq 12).
        false_alarm: alarms over clean fixes; 0 where there is none (the paper's P_MD, eq 14).
        missed: no alarm over spoofed fixes; 0 where there is none (the paper's P_FA, eq 13).
    """

    accuracy: Floats
    false_alarm: Floats
    missed: Floats


def decision_rates(alarm: Flags, spoofed: Flags) -> DecisionRates:
    """Count the decisions on the fixes of each run.

    Args:
        alarm: (N, T).
        spoofed: (N, T), or (T,) for all runs.
    """
    truth = np.broadcast_to(spoofed, alarm.shape)

    def share(events: Flags, among: Flags) -> Floats:
        return np.asarray((events & among).sum(axis=1) / np.maximum(among.sum(axis=1), 1))

    return DecisionRates(np.mean(alarm == truth, axis=1), share(alarm, ~truth), share(~alarm, truth))
