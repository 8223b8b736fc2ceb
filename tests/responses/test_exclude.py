"""The registry, and the responses that need no memory."""

from __future__ import annotations

import numpy as np
import pytest

from spoofgym.navigation.interface import Demands, Epoch, Innovation
from spoofgym.responses import RESPONSES, make_response
from spoofgym.responses.exclude import Exclude


def decisions(name, alarms):
    """``use`` (K, N) after alarms (K, N)."""
    response = make_response(name)
    response.bind(alarms.shape[1])
    response.reset(np.arange(alarms.shape[1]))
    n = alarms.shape[1]
    innovation = Innovation(np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros(n))
    used = []
    for k, alarm in enumerate(alarms):
        before = alarm.copy()
        used.append(response.decide(Epoch(np.full(n, k), np.full(n, float(k)), innovation), alarm).use)
        np.testing.assert_array_equal(alarm, before)
    return np.array(used)


ALARMS = np.random.default_rng(0).random((50, 7)) < 0.3


def test_exclude_leaves_the_fix_out_while_the_alarm_lasts():
    alarms = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=bool)
    assert decisions("exclude", alarms).tolist() == [[True, False], [False, False], [False, True], [True, True]]
    np.testing.assert_array_equal(decisions("exclude", ALARMS), ~ALARMS)


def test_latch_leaves_every_fix_out_from_the_first_alarm_on():
    np.testing.assert_array_equal(decisions("latch", ALARMS), ~np.logical_or.accumulate(ALARMS, axis=0))


def test_always_use_uses_every_fix():
    used = decisions("always-use", ALARMS)
    assert used.dtype == bool
    assert used.shape == ALARMS.shape
    assert used.all()
    assert make_response("always-use").demands == Demands()


@pytest.mark.parametrize("name", ["always-use", "exclude", "latch"])
def test_a_run_does_not_depend_on_the_others(name):
    np.testing.assert_array_equal(decisions(name, ALARMS)[:, 2:3], decisions(name, ALARMS[:, 2:3]))


def test_make_response_takes_objects():
    response = Exclude()
    assert make_response(response) is response
    assert {"always-use", "exclude", "latch", "exclude-and-backtrack", "onset-depth"} <= set(RESPONSES)


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match=r"unknown response 'ignore'; valid names: always-exclude, .*, exclude"):
        make_response("ignore")
    with pytest.raises(ValueError, match="takes no value"):
        make_response("always-use:5")
    with pytest.raises(TypeError, match="response must be a specification"):
        make_response(None)
