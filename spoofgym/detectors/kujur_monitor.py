"""The two monitors of Kujur 2024 together: one sees long attacks by their tracking error, one sees short attacks."""

from __future__ import annotations

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors import cpi_theory
from spoofgym.detectors.cpi import UP, Cpi, unit_vector
from spoofgym.detectors.ensemble import Ensemble
from spoofgym.detectors.separation_bank import DEFAULT_P_FA, DEFAULT_P_MD, DEFAULT_WINDOW, SeparationBank
from spoofgym.geodesy import AXES
from spoofgym.navigation.interface import Epoch
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.tracking_response import projected_response
from spoofgym.specification import spell

DEFAULT_P_MD_CPI = 1e-7


class KujurMonitor(Ensemble):
    """Alarm where the cumulative innovation or the bank of separations alarms, both over n epochs (section 5).

    An attack that has lasted for n epochs is seen by its tracking error (`Cpi`), for which n is chosen large enough
    (`minimum_epochs`). A shorter one began within the windows of the bank (`SeparationBank`), whose coasting it has not
    touched: it is seen, or the error is within the protection level. The statistic is the larger of both over its
    threshold, against 1. Each monitor has half of P_FA; the equal split is ours.

    Args:
        n: epochs: terms of the cumulative innovation, and length and number of the windows of separation.
        direction: ``up``, ``east`` or ``north``.
        p_fa: probability of a false alarm at an epoch, of both together; 1e-5 with nothing given.
        p_md_cpi: required probability of not seeing an attack that has lasted for n epochs.
        p_md_ss: probability that the error is beyond the protection level without an alarm, to one side.
        arl0: average run length between false alarms, epochs; a factor on both thresholds, and so in PL, is then
            calibrated.

    Raises:
        ValueError: p_fa and arl0 are both given, or a value is out of range.
    """

    kind = "kujur-monitor"

    def __init__(
        self,
        n: int = DEFAULT_WINDOW,
        direction: str = UP,
        p_fa: float | None = None,
        p_md_cpi: float = DEFAULT_P_MD_CPI,
        p_md_ss: float = DEFAULT_P_MD,
        arl0: float | None = None,
    ) -> None:
        validation.at_most_one(self.kind, p_fa=p_fa, arl0=arl0)
        self.n = validation.epochs(self.kind, "n", n, 1, validation.LONGEST_TABLE)
        self.direction = validation.one_of(self.kind, "direction", direction, AXES)
        self.p_fa = validation.probability(self.kind, "p_fa", DEFAULT_P_FA if p_fa is None else p_fa) / 2.0
        self.p_md_cpi = validation.probability(self.kind, "p_md_cpi", p_md_cpi)
        validation.probability(self.kind, "p_md_ss", p_md_ss)
        cumulative = Cpi(self.n, self.direction, p_fa=self.p_fa)
        members = [cumulative, SeparationBank(self.n, self.direction, self.p_fa, p_md_ss)]
        super().__init__(members, 1.0 if arl0 is None else None, arl0)
        self._name = spell(
            self.kind,
            n=None if n == DEFAULT_WINDOW else self.n,
            direction=None if direction == UP else direction,
            p_fa=None if p_fa == DEFAULT_P_FA else p_fa,
            arl0=arl0,
            p_md_cpi=None if p_md_cpi == DEFAULT_P_MD_CPI else p_md_cpi,
            p_md_ss=None if p_md_ss == DEFAULT_P_MD else p_md_ss,
        )

    def update(self, epoch: Epoch) -> Floats:
        """The larger of both over its threshold, (N,); the protection level takes the calibrated factor over."""
        self.bank.scale = 1.0 if self.threshold is None else self.threshold
        return super().update(epoch)

    @property
    def bank(self) -> SeparationBank:
        """The monitor by separation."""
        bank = self.members[1]
        assert isinstance(bank, SeparationBank)
        return bank

    @property
    def protection_level(self) -> Floats:
        """PL after the present epoch, (N,), m."""
        return self.bank.protection_level

    @property
    def coasting_sigma(self) -> Floats:
        """σ_coast of the oldest window, (N,), m."""
        return self.bank.coasting_sigma

    @property
    def recovery_depth(self) -> Runs:
        """As `SeparationBank.recovery_depth`; the cumulative innovation does not count there, (N,)."""
        return self.bank.recovery_depth

    def minimum_epochs(self, model: TightModel, sigma: float, time: float) -> int | None:
        """The shortest n whose cumulative innovation has the required P_MD, epochs; None where the model has too few.

        With the exact response of the filter to the tracking error; the paper leaves its feedback out.

        Args:
            model: the filter; the spoofing begins at its epoch 1.
            sigma: σ_t of the tracking error along the direction, m.
            time: τ, its correlation time, s; 0 = white.

        Raises:
            ValueError: a value is out of range.
        """
        response = projected_response(model, unit_vector(self.kind, self.direction))
        tracking = cpi_theory.gauss_markov_covariance(model.num_epochs, sigma, time, model.dynamics.interval)
        return cpi_theory.minimum_epochs(
            self.p_md_cpi,
            lambda n: cpi_theory.missed_detection(self.p_fa, response[:n, :n], tracking[:n, :n]),
            model.num_epochs,
        )
