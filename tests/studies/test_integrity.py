"""Protection levels from P and from solution separation, clean and under a replica that climbs slowly.

False-failure probabilities of the random tests are below 1e-7 each.
"""

import json

import numpy as np
import pytest
from scipy import stats

from spoofgym.scenarios import make_scenario
from spoofgym.studies import integrity as integrity_study
from spoofgym.studies.integrity import (
    BANK,
    CLEAN,
    FROM_P,
    FROM_P_TESTED,
    MONITOR,
    REPLICAS,
    SLOW,
    SLOWER,
    main,
    multiplier,
    play,
)

USERS = (FROM_P, FROM_P_TESTED, BANK, MONITOR)
FALSE_FAILURE = 1e-8
RUNS = 40
HORIZON = 900


def flight(horizon):
    return make_scenario(f"kujur-flight:horizon={horizon}")


@pytest.fixture(scope="module")
def spoofed():
    return play(SLOW, RUNS, 300, flight(HORIZON))


def test_a_level_from_p_holds_without_spoofing():
    """At most 2e-6 at each of 900 epochs of 40 runs: five or more runs would be misled with 2e-8."""
    result = play(CLEAN, RUNS, 100, flight(HORIZON)).result(FROM_P)
    assert result.misled.events <= 4
    assert result.failed.events == 0  # ten sigma
    assert result.availability == 1.0


def test_a_level_from_p_misleads_under_a_slow_replica(spoofed):
    """90 m of error at the end, five of sigma, and a level that is what it was."""
    result = spoofed.result(FROM_P)
    assert result.misled.share == 1.0
    assert result.hazardously_misled.share == 1.0
    assert result.failed.share == 1.0
    assert result.availability == 1.0
    clean = play(CLEAN, 2, 0, flight(HORIZON))
    np.testing.assert_allclose(spoofed.level[FROM_P][0], clean.level[FROM_P][0], rtol=1e-12)


@pytest.mark.parametrize("user", [BANK, MONITOR])
def test_a_level_by_separation_holds_until_its_alarm(spoofed, user):
    """30 s move the position by 6 m, nine sigma of the separation, against a threshold of five.

    So a run is silent at the end of a window with 2e-4 at most, and at the ends of three windows, which share no
    innovation, with 1e-11. Misled are at most 2e-6 of the runs at each of the first 60 epochs, and of later ones those
    that are silent yet: 4e-4 in all, so that four or more of 40 would be misled with 3e-9.
    """
    assert spoofed.alarm[user][:, 179:].all()
    result = spoofed.result(user)
    assert result.misled.events <= 3
    assert result.failed.events <= 3


def test_shares_at_an_epoch_are_those_that_the_levels_promise():
    """With a P_MD of 0.05: exactly twice that from P without spoofing, at most twice that by separation with it."""
    runs, p_md = 1000, 0.05
    clean, replica = (play(signals, runs, 700, flight(20), p_md) for signals in (CLEAN, SLOW))
    beyond = int((np.abs(clean.error[:, -1]) > clean.level[FROM_P][:, -1]).sum())
    assert stats.binomtest(beyond, runs, 2.0 * p_md).pvalue > FALSE_FAILURE
    for user in (BANK, MONITOR):
        for k in (4, 9, 19):
            misled = np.abs(replica.error[:, k]) > replica.level[user][:, k]
            misled &= ~replica.alarm[user][:, k]
            assert stats.binom.sf(int(misled.sum()) - 1, runs, 2.0 * p_md) > FALSE_FAILURE


def test_a_climb_that_outlasts_the_windows_misleads_the_bank_too():
    """The coasting of 30 s ago has been spoofed as well; all but a few runs are misled, we ask for half."""
    result = play(SLOWER, 20, 40, flight(2 * HORIZON)).result(BANK)
    assert result.misled.events >= 10


def test_an_alarm_is_held(spoofed):
    for user in USERS:
        assert (np.diff(spoofed.alarm[user].astype(int), axis=1) >= 0).all()
    assert not spoofed.alarm[FROM_P].any()


def test_multiplier_is_the_normal_quantile():
    assert multiplier(1e-6) == pytest.approx(stats.norm.isf(1e-6), rel=1e-12)


def test_a_run_does_not_depend_on_its_batch(monkeypatch):
    whole = play(SLOW, 5, 9, flight(15))
    monkeypatch.setattr(integrity_study, "BATCH", 2)
    parts = play(SLOW, 5, 9, flight(15))
    np.testing.assert_array_equal(parts.error, whole.error)
    for user in USERS:
        np.testing.assert_array_equal(parts.level[user], whole.level[user])


def test_the_command_prints_a_line_for_all_and_draws(capsys, tmp_path):
    pytest.importorskip("matplotlib")
    figure = tmp_path / "new" / "stanford.png"
    given = ["--scenario", "kujur-flight:horizon=60", "--runs", "2", "--figure", str(figure)]
    assert main(given) == 0
    text = capsys.readouterr().out
    for replica in REPLICAS:
        assert replica.words in text
    for user in USERS:
        assert sum(line.strip().startswith(user) for line in text.splitlines()) == len(REPLICAS)
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_any_scenario_is_taken_with_the_monitors_that_fit(capsys):
    assert main(["--scenario", "foi-drive:horizon=60", "--runs", "3", "--climb", "3", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    rows = {(row["signals"], row["user"]): row for row in report["rows"]}
    assert {user for _, user in rows} == {FROM_P, FROM_P_TESTED}
    assert rows["clean", FROM_P]["misleading_information"]["events"] == 0
    assert rows["3 m/s", FROM_P]["misleading_information"]["share"] == 1.0


def test_the_level_of_fixes_holds_as_it_promises():
    """400 clean runs, P_MD 0.05 to one side: the last epoch's share beyond the level is twice that."""
    played = play(CLEAN, 400, 5, make_scenario("foi-drive:horizon=20"), 0.05)
    beyond = int((np.abs(played.error[:, -1]) > played.level[FROM_P][:, -1]).sum())
    assert stats.binomtest(beyond, 400, 0.1).pvalue > FALSE_FAILURE


def test_what_was_played_is_shown_after_ctrl_c(monkeypatch, capsys):
    played = []

    def interrupted(replica, *arguments, **options):
        if played:
            raise KeyboardInterrupt
        played.append(replica)
        return play(replica, *arguments, **options)

    monkeypatch.setattr(integrity_study, "play", interrupted)
    assert main(["--scenario", "foi-drive:horizon=10", "--runs", "2", "--climb", "3"]) == 130
    printed = capsys.readouterr()
    assert "clean" in printed.out
    assert printed.err.splitlines()[-1] == "interrupted"


@pytest.mark.parametrize("runs", ["0", "-3", "many"])
def test_no_runs_are_refused(runs, capsys):
    with pytest.raises(SystemExit):
        main(["--runs", runs])
    assert f"expected a whole number, 1 or more, got '{runs}'" in capsys.readouterr().err
