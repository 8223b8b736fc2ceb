"""Thresholds of re-use, measured while the filter coasts."""


from functools import partial

import numpy as np
import pytest

from spoofgym.calibration import reuse
from spoofgym.calibration.reuse import LONGEST, SHORTEST, calibrated_reuse, coasting_nis
from spoofgym.detectors.chi_square import quantile
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.receiver import Receiver
from spoofgym.simulation import Simulation

FLIGHT = "liu-flight:imu=tactical"


def over_stated():
    """The filter believes in three times the noise of this receiver."""
    receiver = Receiver(white_sigma=(3.7 / 3.0, 3.7 / 3.0, 2.0))
    return make_scenario(FLIGHT).changed(name="over-stated", receiver=receiver)


def test_a_matched_filter_coasts_with_the_chi_square_quantile(monkeypatch):
    """Exceedances of a run are correlated, at worst wholly: 100 expected in 1000 runs, 53 to 153 with all but 1e-6."""
    monkeypatch.setattr(reuse, "coasting_nis", partial(coasting_nis, runs=1000))
    threshold = calibrated_reuse(make_response("exclude:reuse=5"), make_scenario(FLIGHT), p=0.1).reuse.threshold
    assert quantile(0.1 * 153 / 100, 3) < threshold < quantile(0.1 * 53 / 100, 3)


def test_an_over_stated_variance_needs_a_threshold_of_its_own():
    """In use the NIS is chi-square over nine or so; after 60 epochs the filter's own covariance has grown."""
    scenario = over_stated()
    coasting = coasting_nis(scenario, runs=600)
    assert coasting.shape == (600, LONGEST - SHORTEST + 1)
    using = Simulation(scenario, num_runs=600, seed=1)
    using.reset()
    nis = []
    for _ in range(60):
        using.resolve()
        nis.append(using.observe().innovation.nis)
    assert np.mean(nis) == pytest.approx(3.0 / 9.0, rel=0.15)
    assert np.mean(coasting[:, -1]) > 2.0 * np.mean(nis)
    in_use, coasted = (np.quantile(values, 0.999, method="higher") for values in (nis, coasting))
    assert coasted > 1.5 * in_use
    assert coasted < quantile(1e-3, 3)


def test_every_run_coasts_from_an_epoch_of_its_own():
    """The first run of a game of 20 epochs, by hand: fix 0 is used, all others are left out."""
    scenario = make_scenario("liu-flight:horizon=20")
    measured = coasting_nis(scenario, runs=2, seed=4)
    assert measured.shape == (2, 20 - SHORTEST)
    coasting = Simulation(scenario, num_runs=2, seed=4, demands=Demands(excludes=True))
    coasting.reset()
    for k in range(1, 21):
        coasting.resolve(Decision(np.full(2, k == 1)))
        nis = coasting.observe().innovation.nis
        if k - 1 >= SHORTEST:
            assert measured[0, k - 1 - SHORTEST] == nis[0]


def test_what_needs_no_calibration_stays_as_it_is():
    scenario = make_scenario(FLIGHT)
    for name in ("exclude", "latch", "px4-auto", "always-use", "exclude:reuse=3,reuse_threshold=9"):
        response = make_response(name)
        assert calibrated_reuse(response, scenario) is response


def test_what_cannot_be_calibrated_is_refused():
    with pytest.raises(ValueError, match="too short to coast for 10"):
        coasting_nis(make_scenario("liu-flight:horizon=10"), runs=1)
    with pytest.raises(ValueError, match="p must be greater than 0 and less than 1, got 0"):
        calibrated_reuse(make_response("exclude:reuse=3"), make_scenario(FLIGHT), p=0.0)


def test_the_receiver_of_the_drive_needs_a_threshold_of_its_own(monkeypatch):
    """Its error is 0.6 m where the filter believes in 3 m: in use the NIS is tiny, while coasting it is not."""
    monkeypatch.setattr(reuse, "_KNOWN", {})
    monkeypatch.setattr(reuse, "coasting_nis", partial(coasting_nis, runs=600))
    scenario = make_scenario("foi-drive:receiver=foi")
    using = Simulation(scenario, num_runs=200, seed=2)
    using.reset()
    nis = []
    for _ in range(scenario.timeline.num_epochs):
        using.resolve()
        nis.append(using.observe().innovation.nis)
    response = calibrated_reuse(make_response("exclude-and-backtrack:20,reuse=5"), scenario)
    threshold = response.reuse.threshold
    assert make_response(response.name).reuse.threshold == threshold
    assert threshold > 2.0 * np.quantile(nis, 0.999)
