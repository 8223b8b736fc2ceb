from __future__ import annotations

import json
import math
from typing import get_args

import numpy as np
import pymap3d
import pytest
from scipy import stats

from spoofgym.attacks.profiles import Ramp
from spoofgym.navigation.interface import Decision, Demands, Epoch, Innovation
from spoofgym.optimum.play import expected_play
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.foi_drive import foi_trajectory
from spoofgym.simulation import Simulation
from spoofgym.studies.reproduce import foi_games, foi_r_5687, liu_2018, rows
from spoofgym.studies.reproduce.__main__ import main
from spoofgym.studies.reproduce.foi_azimuth import DEGREES, RADIANS, fitted_offsets, largest_offset
from spoofgym.studies.reproduce.foi_tables import ATTACKS, TABLE_3, TABLE_5, TABLE_9, Attacked
from spoofgym.studies.reproduce.papers import reproduce
from spoofgym.studies.reproduce.rows import Reproduction, Row
from spoofgym.studies.reproduce.table import number
from spoofgym.studies.reproduce.tracks import Tracks, play
from spoofgym.studies.reproduce.verdict import NEVER, rounded

VERDICTS = {"reproduced", "compatible", "partly", "not reproduced"}


# ---- rows


def test_a_row_counts_where_the_paper_has_it_and_no_other_row_decides():
    row = rows.number_row("x", rounded(5), np.array([4.0, 5.0, 6.0]))
    assert (row.basis, row.counted) == ("printed", True)
    assert not rows.again(row).counted
    assert [rows.on(basis, row).counted for basis in get_args(rows.Basis)] == [True, True, False, False, False, False]
    said = rows.statement_row("x", "so", np.ones(3, dtype=bool), np.arange(3.0), "why")
    assert (said.basis, said.counted, said.verdict) == ("words", True, "reproduced")


def test_a_tally_has_every_published_figure_once():
    row = rows.number_row("x", rounded(5), np.array([4.0, 5.0, 6.0]))
    far = rows.number_row("y", rounded(50), np.array([4.0, 5.0, 6.0]))
    listing = rows.Listing("g", (row, far, rows.again(far), rows.on("calibrated", row)))
    grid = rows.Grid("h", ("", "a"), (("line", (row, None)),))
    report = Reproduction("p", "t", 3, 0, False, (), (listing, rows.each(rows.again, grid)))
    assert report.tally("printed") == {"reproduced": 1, "compatible": 0, "partly": 0, "not reproduced": 1}
    assert report.tally("calibrated")["reproduced"] == 1
    assert not any(report.tally("words").values())
    assert [row.repeats for row in report.rows] == [False, False, True, False, True]


def test_an_event_shows_its_times_and_is_judged_from_its_onset():
    row = rows.event_row("x", rounded(131), np.array([160.0, 161.0, math.inf]))
    assert (row.value, row.interval, row.verdict) == (161.0, (160.0, NEVER), "partly")
    assert rows.event_row("x", rounded(131), np.array([160.0, 161.0]), origin=125.0).verdict == "not reproduced"
    for late, verdict in ((21.0, "reproduced"), (30.0, "partly"), (45.0, "not reproduced")):
        late_row = rows.event_row("x", rounded(117), 95.0 + np.array([late, late]), origin=95.0)
        assert late_row.verdict == verdict, "22 s after the onset"


@pytest.mark.parametrize(("successes", "trials"), [(0, 40), (1, 40), (29, 40), (40, 40)])
def test_wilson_interval_is_that_of_scipy(successes, trials):
    expected = stats.binomtest(successes, trials).proportion_ci(method="wilson")
    np.testing.assert_allclose(rows.wilson_interval(successes, trials), (expected.low, expected.high), atol=1e-12)


def test_numbers_keep_three_digits():
    given = (3784.2, 101.0, 99.96, 12.34, 0.00838, 4.4951e-4, 0.0, "never", None)
    assert [number(v) for v in given] == ["3784", "101", "100", "12.3", "0.00838", "4.50e-4", "0", "never", "–"]


# ---- our reading of the attack


@pytest.mark.parametrize("scenario", [1, 2, 4, 7])
@pytest.mark.parametrize("units", [RADIANS, DEGREES])
def test_our_reading_against_a_loop_in_the_earth_fixed_frame(scenario, units):
    attack, truth = ATTACKS[scenario], foi_trajectory()
    azimuth = math.radians(attack.azimuth) if units == RADIANS else attack.azimuth
    spoofed, largest = None, 0.0
    for second in range(round(attack.start), round(attack.end)):
        sample = second * round(truth.rate)
        latitude, longitude, height = truth.position[sample]
        true = np.array(pymap3d.geodetic2ecef(latitude, longitude, height, deg=False))
        i = second - attack.start
        share = i / attack.growth if i <= attack.growth else max(1.0 - (i - attack.growth) / 45.0, 0.0)
        error = math.exp(math.log(azimuth + 1.0) * share) - 1.0
        error = error if units == RADIANS else math.radians(error)
        east, north, up = truth.velocity[sample]
        u, v, w = pymap3d.enu2uvw(east, north, up, latitude, longitude, deg=False)
        direction, speed = math.atan2(v, u) - error, math.hypot(u, v)
        step = np.array([speed * math.cos(direction), speed * math.sin(direction), w])
        spoofed = true if spoofed is None else spoofed + step
        largest = max(largest, float(np.linalg.norm(spoofed - true)))
    # the axes turn by 6e-4 rad along the drive, which changes the offset by as much
    assert largest_offset(attack, units, 0.0) == pytest.approx(largest, rel=2e-3)


def test_only_radians_reach_the_published_errors_of_thirty_degrees():
    for scenario, published in ((3, 178.0), (4, 369.0)):
        directions = np.radians(np.arange(0.0, 360.0, 45.0))
        radians, degrees = (
            np.array([largest_offset(ATTACKS[scenario], u, d) for d in directions]) for u in (RADIANS, DEGREES)
        )
        assert (degrees < 0.75 * published).all()
        assert (np.abs(radians / published - 1.0) < 0.25).all()


def test_our_reading_begins_at_the_true_position():
    np.testing.assert_allclose(fitted_offsets(ATTACKS[3])[0], 0.0, atol=1e-9)


# ---- figures read from tracks


def tracks_of(alarm, used, error, start=90.0):
    """One-axis tracks of N runs, one epoch per second from ``start``."""
    alarm, used, error = np.array(alarm, dtype=bool), np.array(used, dtype=bool), np.array(error, dtype=float)
    n, epochs = error.shape
    vectors = np.zeros((n, epochs, 3))
    vectors[:, :, 1] = error
    flat, bias = np.zeros((n, epochs)), np.zeros((n, epochs, 6))
    time = start + np.arange(epochs)
    return Tracks(time, vectors, vectors, flat, 10.0 * vectors, vectors, bias, alarm, used, vectors, {})


def test_figures_of_a_run():
    attack = Attacked(92.0, 96.0, 1.0, 1.0)
    # seconds      90 91 92 93 94 95 96 97 98 99
    alarm = np.array([[1, 0, 0, 0, 1, 1, 1, 0, 0, 0], [0] * 10, [0] * 10, [0] * 10])
    used = np.array([[0, 1, 1, 1, 0, 0, 0, 1, 1, 1], [1] * 10, [1] * 9 + [0], [1, 1, 1, 1, 1, 0, 1, 1, 1, 1]])
    error = np.array([[0, 0, 0, 1, 2, 3, 4, 3, 2, 1], [0] * 10, [2] * 10, [-3] + [0] * 9])
    ours = foi_games.figures(tracks_of(alarm, used, error), attack)
    np.testing.assert_array_equal(ours.first_alarm, [94.0, math.inf, math.inf, math.inf])
    np.testing.assert_array_equal(ours.receiver_error, [20.0, math.inf, math.inf, math.inf])
    np.testing.assert_array_equal(ours.reuse, [1.0, 0.0, math.inf, 0.0])
    np.testing.assert_allclose(ours.rmse, [math.sqrt(4.4), 0.0, 2.0, math.sqrt(0.9)])
    np.testing.assert_array_equal(ours.largest, [4.0, 0.0, 2.0, 3.0])
    used[0, 5] = 1  # spoofed, and used after the alarm at 94 s
    again = foi_games.spoofed_after_alarm(tracks_of(alarm, used, error), attack)
    np.testing.assert_array_equal(again, [1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("exponent", [0.7, 1.2, 2.5])
def test_growth_of_a_power_law_is_found(exponent):
    attack, epochs = ATTACKS[1], 161
    time = 90.0 + np.arange(epochs)
    alarm = ((time >= 102.0) & (time < 210.0))[None]
    error = np.where(alarm, 2.0 + 0.04 * np.maximum(time - 102.0, 0.0) ** exponent, 1.0)
    found = foi_games.growth(tracks_of(alarm, ~alarm, error), 1)
    assert attack.end == 190.0
    assert found.time[0] == 108.0
    assert found.exponent[0] == pytest.approx(exponent, abs=1e-4)
    assert found.factor[0] == pytest.approx(0.04, rel=1e-3)
    assert found.growth[0] == pytest.approx(0.04 * 107.0**exponent, rel=1e-12)


def test_alarms_before_the_arming_are_not_heard():
    response = foi_games.Armed(make_response("exclude"))
    response.bind(3)
    innovation = Innovation(np.zeros((3, 3)), np.zeros((3, 3, 3)), np.zeros((3, 3)), np.zeros(3))
    epoch = Epoch(np.full(3, 20), np.array([41.0, 42.0, 43.0]), innovation)
    assert response.decide(epoch, np.ones(3, dtype=bool)).use.tolist() == [True, False, False]


# ---- tracks of a simulation

SHORT = "liu-flight:onset=800,horizon=20"


def short(runs: int, seed: int = 3) -> Simulation:
    """A short flight in which fixes can be taken back."""
    demands = Demands(excludes=True, history=12)
    return Simulation(make_scenario(SHORT), Ramp(2.0, onset=802.0), (), None, runs, seed, demands=demands)


def take_back(time, runs):
    """Take back the last 5 epochs at 810 s, and the last 3 of those at 812 s; coast from there on."""
    depth = {810.0: 5, 812.0: 3}.get(time, 0)
    return Decision(np.full(runs, time < 810.0), np.full(runs, depth))


def coast(time, runs):
    """Leave out what `take_back` takes back."""
    return Decision(np.full(runs, time < 805.0))


def test_recomputed_epochs_are_those_of_a_run_without_their_fixes():
    back, without = play(short(3), take_back), play(short(3), coast)
    np.testing.assert_allclose(back.recomputed, without.error, rtol=1e-9, atol=1e-9)
    rewritten = slice(back.at(805.0), back.at(810.0))
    assert np.abs(back.error[:, rewritten] - without.error[:, rewritten]).min(axis=2).max() > 0.01
    np.testing.assert_allclose(back.error[:, back.at(810.0) :], without.error[:, back.at(810.0) :], atol=1e-9)


def test_receiver_error_is_noise_and_offset():
    spoofed = play(short(3), coast)
    simulation = short(3)
    simulation.attack = None
    clean = play(simulation, coast)
    offset = (spoofed.receiver_error - clean.receiver_error)[:, :, 0]
    ramp = 2.0 * np.maximum(spoofed.time - 802.0, 0.0)
    np.testing.assert_allclose(offset, np.broadcast_to(ramp, offset.shape), atol=1e-9)


def test_run_i_does_not_depend_on_the_number_of_runs():
    few, many = play(short(2), take_back), play(short(5), take_back)
    for name in ("error", "residual", "nis", "receiver_error", "recomputed"):
        np.testing.assert_array_equal(getattr(few, name), getattr(many, name)[:2])


# ---- the papers


def check_report(report: Reproduction) -> dict[str, Row]:
    """What holds for every paper; the rows by their items."""
    text = json.dumps(report.as_json(), allow_nan=False)
    parsed = json.loads(text)
    assert parsed["schema_version"] == 1
    assert parsed["paper"] == report.paper
    assert parsed["quick"] is True
    for row in parsed["rows"]:
        assert set(row) == {
            *("group", "item", "paper_value", "value", "interval", "verdict", "reason", "basis", "counted")
        }
        assert row["verdict"] in VERDICTS
        assert row["reason"].endswith(".")
        assert row["interval"] is None or len(row["interval"]) == 2
    items = {row.item: row for row in report.rows}
    assert len(items) == len(report.rows), "items must be unique"
    return items




@pytest.fixture(scope="module")
def liu():
    return reproduce(liu_2018.PAPER, 4, 0, True)


def test_liu_rows(liu):
    items = check_report(liu)
    relative = [row for item, row in items.items() if item.startswith("relative change")]
    assert len(relative) == 15
    assert all(row.value < 0.5 for row in relative)
    # the mean of the closed form, which knows neither strapdown nor noise
    model = make_scenario(liu_2018.SCENARIO).linear_model()
    for rate, name in ((0.3, "0.3 m/s: error in longitude at 1100 s, m"), (12.4, "12.4 m/s: error in longitude")):
        offsets = np.zeros((model.num_epochs, 3))
        offsets[:, 0] = rate * np.maximum(model.time[1:] - 800.0, 0.0)
        expected = expected_play(model, offsets, 25.9).final_error[0]
        row = next(row for item, row in items.items() if item.startswith(name))
        # four runs of 0.7 m each: 6 sigma of their median; and the square of 3.8 km over the earth's radius
        assert row.value == pytest.approx(expected, abs=2.5 + 1e-3 * expected)
    assert items["0.3 m/s: eq 34 against the nonlinear filter, largest difference in % of the peak"].value < 1.0
    gain = items["gain by backtracking: error without it minus error with it, m"]
    assert "unspoofed run 0 m" in gain.reason, "backtracking to before the onset leaves nothing of the attack"


def test_liu_rows_on_fixes_from_ranges(liu):
    """R stands for errors that stay: without an attack the bound is broken, and slow ramps are not seen."""
    items = {row.item: row for row in liu.rows if row.item.startswith("ranges, ")}
    assert len(items) == 8
    statistic = items["ranges, not spoofed: mean of the normalised innovation squared; 3 where R is right"]
    assert statistic.value < 0.5
    assert statistic.verdict == "not reproduced"
    for rate, share in ((0.3, 0.0), (0.5, 0.0), (1, 1.0)):
        assert items[f"ranges, {rate:g} m/s: share of runs that the snapshot test detects"].value == share
    final = items["ranges, 12.4 m/s: error in longitude at 1100 s, m (2 nautical miles)"]
    # 3.8 km with white noise; four runs of 2.7 m each
    assert final.value == pytest.approx(3785.0, abs=15.0)


def test_liu_backtracking_equals_flying_without_an_attack():
    attacked, clean = (liu_2018.coasting_error(3, 7, rate, 50) for rate in (1.0, 0.0))
    np.testing.assert_allclose(attacked, clean, rtol=1e-12)
    assert (np.abs(liu_2018.coasting_error(3, 7, 1.0, 0) - clean) > 1.0).all()


@pytest.mark.slow
def test_foi_rows(monkeypatch):
    """All games of tables 3, 5 and 9; of those that vary the process noise the two ends, with one setting."""
    monkeypatch.setattr(foi_r_5687, "NOISES", (1.0, 1000.0))
    monkeypatch.setattr(foi_r_5687, "SETTING_ORDER", (6,))
    report = reproduce(foi_r_5687.PAPER, 4, 0, True)
    items = check_report(report)
    for name, table in (("table 3", TABLE_3), ("table 5", TABLE_5), ("table 9", TABLE_9)):
        assert sum(item.startswith(f"{name}, ") and "recomputed" not in item for item in items) == 5 * len(table)
    assert items["table 9, scenario 5, k=5, back 20: largest error, m"].verdict == "not reproduced"
    for scenario in range(1, 5):
        alarm = items[f"table 5, scenario {scenario}, k=5, back 20: first alarm, s"]
        assert 95.0 < alarm.value < 120.0
    item = "process noise x {}, k=5, back 20: runs that never use GNSS again, % (95 % interval)"
    assert items[item.format(1)].value > 25.0 > items[item.format(1000)].value


def test_command_writes_json_alone_to_stdout(capsys):
    assert main(["liu-2018", "--quick", "--runs", "2", "--json", "-"]) == 0
    captured = capsys.readouterr()
    report = json.loads(captured.out)
    assert (report["paper"], report["runs"], report["quick"]) == ("liu-2018", 2, True)
    assert "quick" in captured.err


def test_tables_fit_100_columns_and_lose_nothing(liu, capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(liu_2018, "groups", lambda runs, seed, quick: iter(liu.groups))
    path = tmp_path / "new" / "rows.json"
    assert main(["liu-2018", "--quick", "--json", str(path)]) == 0
    out = capsys.readouterr().out
    assert max(len(line) for line in out.splitlines()) <= 100
    assert "…" not in out
    assert len(json.loads(path.read_text())["rows"]) > 60


@pytest.mark.parametrize("arguments", [["nobody-1999"], ["liu-2018", "--runs", "0"], ["liu-2018", "--seed", "-1"]])
def test_command_refuses_what_it_does_not_know(arguments, capsys):
    with pytest.raises(SystemExit) as error:
        main(arguments)
    assert error.value.code == 2
    assert "error" in capsys.readouterr().err
