"""What N runs of any filter share: results do not depend on threads, and fixes taken back equal fixes left out.

The IMU's biases drift, so that a true bias, or noise, that is carried twice or by another thread shows.
"""

import numpy as np
import pytest

from spoofgym.navigation.batch import FilterBatch
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.parallel import RunSlices
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.imu import GRADES
from spoofgym.streams import RunStreams

EPOCHS, AT, DEPTH = 6, 4, 3
OWN = Demands(excludes=True, history=DEPTH, auxiliary=True)
SHARED = Demands(auxiliary=True)
LOOSE = "liu-flight:horizon=10,onset=300,imu={}"
TIGHT = "kujur-flight:horizon=10,onset=120,imu={}"
TUNED = "shadmehri-flight:filter=self-tuning,window=2,guard=all"
NAVIGATORS = (
    (LOOSE, "linear", SHARED),
    (LOOSE, "linear", OWN),
    (LOOSE, "strapdown", OWN),
    (TUNED, "linear", OWN),
    (TUNED, "strapdown", OWN),
    ("song-robot", "linear", Demands(excludes=True, history=DEPTH)),
    (TIGHT, "linear", SHARED),
    (TIGHT, "linear", OWN),
    (TIGHT, "strapdown", OWN),
)
NAMES = ("state", "attitude", "velocity", "position", "bias", "covariance", "true_bias", "auxiliary", "credit")


def built(scenario, fidelity, demands, num_runs, threads=1):
    family = make_scenario(scenario.format("industrial") if "{}" in scenario else scenario).family
    navigator = family.navigator(fidelity, demands, 0, num_runs, RunSlices(threads))
    assert isinstance(navigator, FilterBatch)
    return family, navigator


def play(family, navigator, decide):
    """All that can be seen of a few epochs, and the arrays of the navigator after them."""
    num_runs = len(navigator.index)
    streams, runs = RunStreams.from_seed(3, num_runs), np.arange(num_runs)
    initial = family.draw_initial(runs, 0, streams)
    navigator.reset(runs, initial, streams)
    noise = family.draw_receiver_noise(runs, initial, 0, streams)
    seen = []
    for k in range(EPOCHS):
        navigator.propagate()
        innovation = navigator.innovate(noise[:, k])
        seen += [innovation.residual.copy(), innovation.whitened.copy(), innovation.nis.copy()]
        navigator.resolve(decide(k, num_runs))
        seen.append(navigator.error.copy())
    return seen, {name: getattr(navigator, name).copy() for name in NAMES if hasattr(navigator, name)}


def every(k, num_runs):
    return Decision(np.ones(num_runs, dtype=bool))


def taken_back(k, num_runs):
    """Depths from 0 to one more than the history holds."""
    depths = np.arange(num_runs) % (DEPTH + 2)
    return Decision(np.full(num_runs, k != AT), depths if k == AT else None)


def left_out(k, num_runs):
    depths = np.minimum(np.arange(num_runs) % (DEPTH + 2), DEPTH)
    return Decision((k < AT - depths) | (k > AT))


@pytest.mark.parametrize(("scenario", "fidelity", "demands"), NAVIGATORS)
def test_results_do_not_depend_on_threads(scenario, fidelity, demands, monkeypatch):
    decide = taken_back if demands.history else every
    family, navigator = built(scenario, fidelity, demands, 200)
    monkeypatch.setattr(type(navigator), "grain", 1)
    monkeypatch.setattr(type(navigator), "carry_grain", 1)
    alone, arrays = play(family, navigator, decide)
    for threads in (2, 8):
        family, navigator = built(scenario, fidelity, demands, 200, threads)
        several, others = play(family, navigator, decide)
        for one, other in zip(several, alone, strict=True):
            np.testing.assert_array_equal(one, other)
        for name, array in arrays.items():
            np.testing.assert_array_equal(others[name], array, err_msg=name)


@pytest.mark.parametrize(("scenario", "fidelity", "demands"), NAVIGATORS)
def test_a_navigator_assigns_no_attribute_after_it_is_built(scenario, fidelity, demands, monkeypatch):
    """Then no method that threads call on slices of runs does."""
    family, navigator = built(scenario, fidelity, demands, 5)

    def refuse(self, name, value):
        raise AssertionError(f"{name} is assigned")

    monkeypatch.setattr(FilterBatch, "__setattr__", refuse)
    play(family, navigator, taken_back if demands.history else every)


GRADED = [
    (scenario.format(grade), fidelity)
    for scenario in (LOOSE, TIGHT)
    for fidelity in ("linear", "strapdown")
    for grade in GRADES
]


@pytest.mark.parametrize(("scenario", "fidelity"), [*GRADED, (TUNED, "linear"), (TUNED, "strapdown")])
def test_fixes_taken_back_equal_fixes_left_out_with_every_imu(scenario, fidelity):
    back, arrays = play(*built(scenario, fidelity, OWN, 5), taken_back)
    out, others = play(*built(scenario, fidelity, OWN, 5), left_out)
    for one, other in zip(back[4 * AT + 3 :], out[4 * AT + 3 :], strict=True):
        np.testing.assert_array_equal(one, other)
    for name in arrays.keys() - {"auxiliary"}:  # the unaided solution is carried by differences that round
        np.testing.assert_array_equal(arrays[name], others[name], err_msg=name)
