"""Exclusion, backtracking and re-use: hand-made alarms, and a plain loop over each run."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from spoofgym.detectors.chi_square import quantile
from spoofgym.navigation.interface import Demands
from spoofgym.responses import RESPONSES, make_response
from spoofgym.responses.onset import WINDOW

EXCLUDING = [
    "exclude",
    "exclude:reuse=3",
    "latch",
    "exclude-and-backtrack:7",
    "exclude-and-backtrack:20,reuse=5",
    "exclude-and-backtrack:20,reuse=2,reuse_threshold=3.5",
    "constant-velocity-start:4,longest=30",
    "constant-velocity-start:4,longest=30,reuse=3",
    "onset-depth",
    "onset-depth:margin=0,window=12,reuse=3",
]
EVERY = [*EXCLUDING, "px4-auto", "px4-dead-reckoning", "ardupilot-glitch", "ardupilot-clip"]


def flags(text):
    return np.array([letter == "x" for letter in text])


def alarms(scripts, text, **arrays):
    """A quiet script of one run with these alarms: x = alarm."""
    script = scripts.quiet(len(text), 1)
    script.alarm[:, 0] = flags(text)
    return script


def use(row):
    """Which fixes are used: u, and which are left out: dot."""
    return "".join("u" if value else "." for value in row[:, 0])


# --- hand-made sequences ----------------------------------------------------------------------------------------------


def test_an_exclusion_backtracks_once_at_its_first_epoch(scripts):
    script = alarms(scripts, "   xxx  x   ")
    decisions = scripts.play(make_response("exclude-and-backtrack:7"), script)
    assert use(decisions.use) == "uuu...uu.uuu"
    assert decisions.backtrack[:, 0].tolist() == [0, 0, 0, 7, 0, 0, 0, 0, 7, 0, 0, 0]


def test_exclude_never_backtracks(scripts):
    decisions = scripts.play(make_response("exclude"), alarms(scripts, "   xxx  x   "))
    assert use(decisions.use) == "uuu...uu.uuu"
    assert not decisions.backtrack.any()


def test_a_latch_never_uses_gnss_again(scripts):
    assert use(scripts.play(make_response("latch"), alarms(scripts, "   x      x  ")).use) == "uuu.........."


def test_gnss_is_used_again_after_consecutive_consistent_fixes(scripts):
    """Consistent fixes count from the epoch after the alarm, an inconsistent one starts the count anew."""
    script = alarms(scripts, "   x            ")
    script.residual[6, 0, 0] = 20.0
    assert use(scripts.play(make_response("exclude:reuse=3"), script).use) == "uuu......uuuuuuu"
    script.residual[6] = 0.0
    assert use(scripts.play(make_response("exclude:reuse=3"), script).use) == "uuu...uuuuuuuuuu"


def test_the_threshold_of_a_consistent_fix_is_the_chi_square_quantile(scripts):
    """NIS = residual² / 4 on one axis, just below and just above the quantile at 1e-3."""
    for dimension in (3, 6):
        edge = np.sqrt(4.0 * quantile(1e-3, dimension))
        for factor, expected in ((0.999, "u.u"), (1.001, "u..")):
            script = scripts.quiet(3, 1, dimension)
            script.alarm[1] = True
            script.residual[2, 0, 0] = factor * edge
            assert use(scripts.play(make_response("exclude:reuse=1"), script).use) == expected
    given = scripts.quiet(3, 1)
    given.alarm[1] = True
    given.residual[2, 0, 0] = 3.0  # NIS 2.25
    assert use(scripts.play(make_response("exclude:reuse=1,reuse_threshold=2.2"), given).use) == "u.."
    assert use(scripts.play(make_response("exclude:reuse=1,reuse_threshold=2.3"), given).use) == "u.u"


def test_an_alarm_that_outlasts_the_reuse_is_old_until_it_ends_or_a_fix_disagrees(scripts):
    script = alarms(scripts, "  xxxxxxxxx  xx ")
    response = "exclude-and-backtrack:4,reuse=2"
    decisions = scripts.play(make_response(response), script)
    assert use(decisions.use) == "uu..uuuuuuuuu..u"
    assert decisions.backtrack[:, 0].nonzero()[0].tolist() == [2, 13]
    script.residual[7, 0, 0] = 20.0
    decisions = scripts.play(make_response(response), script)
    assert use(decisions.use) == "uu..uuu..uuuu..u"
    assert decisions.backtrack[:, 0].nonzero()[0].tolist() == [2, 7, 13]


def test_an_outage_neither_begins_nor_ends_an_exclusion(scripts):
    """The alarm begins in the outage, and counts where the fix comes back; without one GNSS is simply used again."""
    script = alarms(scripts, "                ")
    script.available[3:8] = False
    for response in ("exclude-and-backtrack:7", "onset-depth", "constant-velocity-start:4", "exclude:reuse=3"):
        decisions = scripts.play(make_response(response), script)
        assert use(decisions.use) == "uuu.....uuuuuuuu"
        assert not decisions.backtrack.any()
    script = alarms(scripts, "     xxxxx       ")
    script.available[3:8] = False
    decisions = scripts.play(make_response("exclude-and-backtrack:7"), script)
    assert use(decisions.use) == "uuu.......uuuuuuu"
    assert decisions.backtrack[:, 0].nonzero()[0].tolist() == [8]


def test_epochs_without_a_fix_do_not_count_for_reuse(scripts):
    script = alarms(scripts, "  x               ")
    script.available[4:9] = False
    # epochs 3, 9 and 10 are the three consistent fixes
    assert use(scripts.play(make_response("exclude:reuse=3"), script).use) == "uu........uuuuuuuu"


def test_the_onset_depth_is_the_estimate_and_a_margin(scripts):
    """Without noise: six leaning epochs, the last of which alarms."""
    script = scripts.quiet(60, 1)
    script.residual[40:46, 0, 1] = 4.0
    script.alarm[45] = True
    decisions = scripts.play(make_response("onset-depth"), script)
    assert decisions.backtrack[45].tolist() == [8]
    assert np.count_nonzero(decisions.backtrack) == 1
    assert scripts.play(make_response("onset-depth:margin=0"), script).backtrack[45].tolist() == [6]


def test_a_constant_velocity_start_goes_back_before_the_turn(scripts):
    """A turn of 6 deg/s from epoch 30 to 38, and an alarm at 45."""
    script = scripts.quiet(60, 1)
    heading = np.radians(6.0) * np.clip(np.arange(60) - 30, 0, 8)
    script.velocity[:, 0, 0], script.velocity[:, 0, 1] = 20.0 * np.sin(heading), 20.0 * np.cos(heading)
    script.alarm[45] = True

    def depth(response):
        return int(scripts.play(make_response(response), script).backtrack[45, 0])

    # the velocity is constant again from epoch 38 to 39 on, so since 3 s at epoch 41; before, up to epoch 30
    assert depth("constant-velocity-start:3") == 3  # starts from epoch 41
    assert depth("constant-velocity-start:4") == 14  # epoch 40 is too early after the turn: from epoch 30
    assert depth("constant-velocity-start:4,hold=2") == 4
    assert depth("constant-velocity-start:4,longest=14") == 14
    assert depth("constant-velocity-start:4,longest=13") == 4  # epoch 30 is too far: n
    assert depth("constant-velocity-start:4,acceleration=2.2") == 4  # 20 m/s at 6 deg/s is 2.09 m/s²
    assert depth("constant-velocity-start:4,acceleration=2.0") == 14


def test_the_hold_of_a_constant_velocity_is_in_seconds(scripts):
    """Epochs of 0.5 s and a change of speed at epoch 30: 3 s later is epoch 36."""
    script = scripts.quiet(60, 1, interval=0.5)
    script.velocity[30:, 0, 1] = 25.0
    script.alarm[40] = True
    for n, expected in ((3, 3), (4, 10)):
        decisions = scripts.play(make_response(f"constant-velocity-start:{n}"), script)
        assert decisions.backtrack[40].tolist() == [expected]


def test_a_new_episode_has_no_past_velocity(scripts):
    """Reset at epoch 30: the stretch before it is no start, so the depth is n; the other run finds it."""
    script = scripts.quiet(60, 2)
    script.velocity[29:, :, 1] += 2.0 * np.arange(31.0)[:, None]
    script.alarm[40] = True
    decisions = scripts.play(make_response("constant-velocity-start:4"), script, [(30, [1])])
    assert decisions.backtrack[40].tolist() == [40 - 29 - 1, 4]


def test_a_new_episode_counts_consistent_fixes_anew(scripts):
    """Reset after two of three consistent fixes: the next exclusion needs three again."""
    script = alarms(scripts, " x     x        ")
    decisions = scripts.play(make_response("exclude:reuse=3"), script, [(4, [0])])
    assert use(decisions.use) == "u...uuu...uuuuuu"


def test_a_vehicle_at_rest_has_a_constant_velocity(scripts):
    script = scripts.quiet(40, 1)
    script.velocity[:] = 1e-3 * np.random.default_rng(0).standard_normal(script.velocity.shape)
    script.alarm[30] = True
    decisions = scripts.play(make_response("constant-velocity-start:5"), script)
    assert decisions.backtrack[30].tolist() == [5]


# --- against a plain loop over one run --------------------------------------------------------------------------------


def plain_depth(response, script, k):
    """The depth of a backtrack at epoch k of run 0, from the whole past."""
    kind = response.kind
    if kind == "exclude-and-backtrack":
        return response.n
    if kind == "onset-depth":
        past = script.whitened()[: k + 1, 0, :2]
        scores = [float(np.sum(past[-n:].sum(axis=0) ** 2)) / n for n in range(1, min(response.window, len(past)) + 1)]
        return (int(np.argmax(scores)) + 1 if max(scores) > 0 else 0) + response.margin
    if kind == "constant-velocity-start":
        for depth in range(response.n, response.longest + 1):
            start = k - depth - 1
            first = start - round(response.hold)
            if first < 0:
                break
            steps = np.diff(script.velocity[first : start + 1, 0, :2], axis=0)
            if (np.hypot(*steps.T) < response.acceleration).all():
                return depth
        return response.n
    return 0


def plain_decisions(response, script):
    """use and backtrack of run 0, decided epoch by epoch."""
    excluding = old = False
    count, used, depths = 0, [], []
    rule = response.reuse
    kind = type(rule).__name__
    nis = (script.whitened() ** 2).sum(axis=-1)
    for k in range(len(script.time)):
        fix, alarm = bool(script.available[k, 0]), bool(script.alarm[k, 0])
        agrees = nis[k, 0] < (getattr(rule, "threshold", None) or quantile(1e-3, script.residual.shape[-1]))
        was, depth = excluding, 0
        if was and fix:
            if kind == "AlarmGone":
                excluding = alarm
            elif kind == "Consistent":
                count = count + 1 if agrees else 0
                if count >= rule.epochs:
                    excluding, count, old = False, 0, alarm
        old = old and alarm and agrees
        if fix and not was and alarm and not old:
            excluding, depth = True, plain_depth(response, script, k)
        used.append(fix and not excluding)
        depths.append(depth)
    return used, depths


@pytest.mark.parametrize("name", EXCLUDING)
@pytest.mark.parametrize("dimension", [3, 6])
def test_every_run_decides_as_a_plain_loop_does(scripts, name, dimension):
    script = scripts.eventful(150, 5, dimension, seed=6)
    decisions = scripts.play(make_response(name), script)
    for run in range(5):
        used, depths = plain_decisions(make_response(name), script.of([run]))
        assert decisions.use[:, run].tolist() == used
        assert decisions.backtrack[:, run].tolist() == depths
    assert 0 < np.count_nonzero(decisions.use) < decisions.use.size


# --- what holds for every response ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", EVERY)
def test_a_run_does_not_depend_on_the_others(scripts, name):
    script = scripts.eventful(120, 6, 3, seed=7)
    whole = scripts.play(make_response(name), script)
    for runs in ([2], [0, 5, 3]):
        part = scripts.play(make_response(name), script.of(runs))
        for key, values in vars(part).items():
            np.testing.assert_array_equal(getattr(whole, key)[:, runs], values)


@pytest.mark.parametrize("name", EVERY)
def test_a_reset_of_some_runs_begins_them_anew(scripts, name):
    """Runs 1 and 4 are reset at epoch 40: they decide as in an episode that begins there, the others go on."""
    script = scripts.eventful(100, 6, 3, seed=8)
    plain, restarted = (scripts.play(make_response(name), script, restarts) for restarts in ((), [(40, [1, 4])]))
    later = type(script)(*(array[40:] for array in vars(script).values()))
    fresh = scripts.play(make_response(name), later.of([1, 4]))
    for key, values in vars(restarted).items():
        np.testing.assert_array_equal(values[:, [0, 2, 3, 5]], getattr(plain, key)[:, [0, 2, 3, 5]])
        np.testing.assert_array_equal(values[:40], getattr(plain, key)[:40])
        np.testing.assert_array_equal(values[40:, [1, 4]], getattr(fresh, key))


@pytest.mark.parametrize("name", EVERY)
def test_the_memory_of_fewer_runs_is_taken_over(scripts, name):
    """A copy of a response that has seen 50 epochs of two runs hands them over, as the simulation does."""
    script = scripts.eventful(100, 5, 3, seed=9)
    runs = np.array([3, 0])
    whole = make_response(name)
    expected = scripts.play(copy.copy(whole), script.of(runs)).use
    scripts.play(whole, type(script)(*(array[:50] for array in vars(scripts.eventful(50, 5, 3, seed=1)).values())))
    part = copy.copy(whole)
    scripts.play(part, type(script)(*(array[:50] for array in vars(script.of(runs)).values())))
    whole.take(runs, part)
    for k in range(50, 100):
        assert np.array_equal(whole.decide(script.epoch(k), script.alarm[k]).use[runs], expected[k])


@pytest.mark.parametrize("name", EVERY)
def test_a_fix_that_is_not_given_is_not_used(scripts, name):
    script = scripts.eventful(120, 5, 3, seed=10)
    decisions = scripts.play(make_response(name), script)
    assert not (decisions.use & ~script.available).any()
    assert not decisions.backtrack[~script.available].any()


@pytest.mark.parametrize("name", EVERY)
def test_demands_hold_the_deepest_backtrack(scripts, name):
    response = make_response(name)
    deepest = int(scripts.play(response, scripts.eventful(300, 8, 3, seed=11)).backtrack.max())
    assert response.demands.excludes
    assert deepest <= response.demands.history
    expected = {"onset-depth": WINDOW + 2, "exclude-and-backtrack:7": 7, "constant-velocity-start:4,longest=30": 30}
    assert response.demands == Demands(excludes=True, history=expected.get(name, response.demands.history))
    assert (response.demands.history > 0) == (deepest > 0)


def test_names_are_canonical_and_build_the_same_response():
    for written, canonical in {
        "exclude:5": "exclude:reuse=5",
        "exclude-and-backtrack": "exclude-and-backtrack:20",
        "exclude-and-backtrack:n=12,reuse_threshold=9,reuse=4": "exclude-and-backtrack:12,reuse=4,reuse_threshold=9",
        "constant-velocity-start:hold=3,n=8": "constant-velocity-start:8",
        "onset-depth:2,window=30": "onset-depth:window=30",
    }.items():
        assert make_response(written).name == canonical
        assert make_response(canonical).name == canonical
    for name in RESPONSES:
        assert make_response(make_response(name).name).name == make_response(name).name


def test_a_threshold_is_set_in_a_copy():
    response = make_response("exclude:reuse=4")
    changed = response.with_reuse_threshold(12.5)
    assert changed.name == "exclude:reuse=4,reuse_threshold=12.5"
    assert response.name == "exclude:reuse=4"
    with pytest.raises(ValueError, match="latch: reuse_threshold needs reuse"):
        make_response("latch").with_reuse_threshold(1.0)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("exclude:reuse=-1", "exclude: reuse must be a whole number, 0 or more, got -1"),
        ("exclude:reuse_threshold=4", "exclude: reuse_threshold needs reuse"),
        ("exclude:reuse=2,reuse_threshold=0", "reuse_threshold must be a finite number greater than 0, got 0"),
        ("exclude-and-backtrack:0", "n must be a whole number, 1 or more, got 0"),
        ("exclude-and-backtrack:2.5", "n must be a whole number"),
        ("constant-velocity-start:20,longest=19", "longest must be a whole number, 20 or more, got 19"),
        ("constant-velocity-start:hold=0", "hold must be a finite number greater than 0"),
        ("constant-velocity-start:acceleration=-1", "acceleration must be a finite number greater than 0"),
        ("onset-depth:margin=-1", "margin must be a whole number, 0 or more, got -1"),
        ("onset-depth:window=0", "window must be a whole number, 1 or more, got 0"),
        ("latch:5", "takes no value"),
        ("px4-auto:position_gate=0.5", "px4-auto: position_gate must be 1 sigma or more, got 0.5"),
        ("ardupilot-glitch:glitch_radius=0", "glitch_radius must be a finite number greater than 0"),
        ("ardupilot-clip:height_gate=nan", "height_gate must be a finite number"),
    ],
)
def test_bad_values_are_refused(name, message):
    with pytest.raises(ValueError, match=message):
        make_response(name)


def test_an_epoch_without_a_view_is_refused_where_it_is_needed(scripts):
    epoch = replace(scripts.quiet(1, 2).epoch(0), view=None)
    for name in ("constant-velocity-start", "ardupilot-glitch"):
        response = make_response(name)
        response.bind(2)
        response.reset(np.arange(2))
        with pytest.raises(ValueError, match="view of the filter"):
            response.decide(epoch, np.zeros(2, dtype=bool))
