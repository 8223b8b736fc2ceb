"""Each aid by itself: H is the derivative of its residual, its options are checked, and so is its spelling."""

import math

import numpy as np
import pandas as pd
import pytest
from pyins import transform
from pyins.error_model import InsErrorModel
from pyins.measurements import BodyVelocity
from scipy.spatial.transform import Rotation

from spoofgym.geodesy import displace
from spoofgym.mechanization import attitude_matrix
from spoofgym.navigation.aids import AIDS, IN_THE_AIR, Place, make_aids, spell_aids
from spoofgym.navigation.aids.aid_set import AidSet, Readings, in_turn
from spoofgym.scenarios import make_scenario

RNG = np.random.default_rng(0)
NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
EVERY = "barometer+magnetometer:dip=70/declination=-12+wheel-speed+zero-velocity"


def places(n):
    """Vehicles with all attitudes but the vertical, somewhere in Europe."""
    angles = RNG.uniform([-math.pi, -1.2, -math.pi], [math.pi, 1.2, math.pi], (n, 3))
    attitude = attitude_matrix(*angles[:, [1, 0, 2]].T)
    position = np.column_stack([RNG.uniform(0.5, 1.0, n), RNG.uniform(0.0, 0.5, n), RNG.uniform(0.0, 3e3, n)])
    return Place(attitude, 20.0 * RNG.standard_normal((n, 3)), position)


def moved(place, error):
    """The place that filters with these errors (n, 9) believe in: C <- (I - [φ x]) C, exactly turned."""
    turned = np.array([rotation(-phi) @ c for phi, c in zip(error[:, :3], place.attitude, strict=True)])
    return Place(turned, place.velocity + error[:, 3:6], displace(place.position, error[:, 6:9]))


def rotation(vector):
    return Rotation.from_rotvec(vector).as_matrix()


@pytest.mark.parametrize("aid", make_aids("test", EVERY), ids=lambda aid: aid.kind)
def test_the_residual_of_the_truth_is_zero_and_its_derivative_is_h(aid):
    place = places(40)
    reading = aid.read(place)
    if aid.kind == "wheel-speed":  # the truth neither skids nor leaves the road
        place = place._replace(velocity=np.einsum("nij,j->ni", place.attitude, [0.0, 20.0, 0.0]))
        reading = aid.read(place)
    np.testing.assert_allclose(aid.residual(place, reading), 0.0, atol=1e-12)
    observation = aid.observe(place, reading)
    assert observation.shape == (40, aid.dimension, 9 + aid.num_states)
    for state, step in enumerate(np.repeat([1e-6, 1e-3, 1e-2], 3)):
        error = np.zeros((40, 9))
        error[:, state] = step
        twice = aid.residual(moved(place, error), reading) - aid.residual(moved(place, -error), reading)
        np.testing.assert_allclose(twice / (2.0 * step), observation[:, :, state], rtol=1e-6, atol=1e-6)


def test_wheels_observe_the_body_velocity_as_pyins_does():
    """`BodyVelocity` of pyins 1.0: z = v_body - measured, with its own error model of the velocity."""
    place = places(1)
    speed = place.attitude[0] @ np.array([0.0, 14.0, 0.0])
    place = place._replace(velocity=speed[None])
    to_frd = NED_OF_ENU  # body right, forward, up to forward, right, down is the same exchange
    matrix = NED_OF_ENU @ place.attitude[0] @ to_frd.T
    roll, pitch, heading = transform.mat_to_rph(matrix)
    ned = NED_OF_ENU @ speed
    latitude, longitude, height = place.position[0]
    row = {"lat": np.degrees(latitude), "lon": np.degrees(longitude), "alt": height}
    row |= {"VN": ned[0], "VE": ned[1], "VD": ned[2], "roll": roll, "pitch": pitch, "heading": heading}
    pva = pd.Series(row)
    data = pd.DataFrame({"VX": [13.0], "VY": [0.0], "VZ": [0.0]}, index=[0.0])
    theirs, h, r = BodyVelocity(data, 0.3).compute_matrices(0.0, pva, InsErrorModel())
    (aid,) = make_aids("test", "wheel-speed:sigma=0.3/lateral=0.3/vertical=0.3")
    ours = aid.residual(place, np.array([[13.0]]))[0]
    np.testing.assert_allclose(theirs, ours * [1.0, 1.0, -1.0], atol=1e-9)
    np.testing.assert_allclose(np.diag(r), np.square(aid.noise))
    # velocity columns of H, in its own axes: theirs turns with the attitude error, so only what is common is compared
    velocity = aid.observe(place, np.array([[13.0]]))[0, :, 3:6] @ NED_OF_ENU.T
    assert any(np.allclose(h[:, k : k + 3], velocity * np.array([[1.0], [1.0], [-1.0]])) for k in range(h.shape[1] - 2))


def test_a_heading_is_within_half_a_turn():
    (aid,) = make_aids("test", "magnetometer:declination=179")
    place = places(200)
    angles = np.linspace(-9.0, 9.0, 200)
    turned = [rotation(np.array([0.0, 0.0, angle])) @ c for angle, c in zip(angles, place.attitude, strict=True)]
    other = place._replace(attitude=np.array(turned))
    residual = aid.residual(other, aid.read(place))
    assert np.all(np.abs(residual) <= math.pi)
    turn = (-angles + math.pi) % (2.0 * math.pi) - math.pi
    np.testing.assert_allclose(residual[:, 0], turn, atol=1e-9)


def test_spelling_comes_back_as_it_was_given():
    given = "barometer:sigma=2/walk=0+wheel-speed:scale=1e-05/rate=10+zero-velocity"
    aids = make_aids("test", given)
    assert spell_aids(aids) == given
    assert spell_aids(make_aids("test", spell_aids(aids))) == given
    assert spell_aids(make_aids("test", "barometer:sigma=0.5/rate=1")) == "barometer"
    assert spell_aids(()) is None
    assert make_aids("test", None) == ()
    scenario = make_scenario("liu-flight:horizon=5,aids=barometer:gate=0.01+magnetometer")
    assert scenario.name == "liu-flight:horizon=5,aids=barometer:gate=0.01+magnetometer"
    assert make_scenario("liu-flight:horizon=5").name == "liu-flight:horizon=5"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("baro", "test: aids: unknown aid 'baro'; nearest: 'barometer'|unknown aid 'baro'"),
        ("barometer:sigma=0", "barometer: sigma must be a finite number greater than 0, got 0"),
        ("barometer:gate=0.7", "gate"),
        ("barometer:colour=red", "aid 'barometer' has no option 'colour'"),
        ("barometer+barometer:rate=2", "test: aids: 'barometer' is there twice"),
        ("wheel-speed:rate=0", "rate"),
        ("magnetometer:dip=90", "dip"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(text, message):
    with pytest.raises(ValueError, match=message) as caught:
        make_aids("test", text)
    assert "\n" not in str(caught.value)


def test_an_aeroplane_has_no_wheels_on_the_road():
    with pytest.raises(ValueError, match=r"unknown aid 'wheel-speed'.*valid names: barometer, magnetometer"):
        make_aids("liu-flight", "wheel-speed", IN_THE_AIR)
    with pytest.raises(ValueError, match="aids do not go together with fixes that are made from ranges"):
        make_scenario("liu-flight:noise=ranges,aids=barometer")


@pytest.mark.parametrize(
    ("aids", "message"),
    [
        ("barometer:rate=3+magnetometer:rate=2", "must be a whole multiple of every other, got 2 Hz of magnetometer"),
        ("barometer:rate=40", "40 Hz must divide the IMU's 100 Hz"),
    ],
)
def test_rates_that_do_not_fit_are_refused(aids, message):
    with pytest.raises(ValueError, match=message):
        make_scenario(f"liu-flight:horizon=5,aids={aids}")


def test_measurements_come_by_time_and_as_the_aids_are_named():
    readings = [Readings(np.array(moments), np.zeros((len(moments), 1))) for moments in ([2, 4, 9], [1, 4], [])]
    aid, own = in_turn(readings)
    np.testing.assert_array_equal(aid, [1, 0, 0, 1, 0])
    for got, expected in zip(own, ([1, 2, 4], [0, 3], []), strict=True):
        np.testing.assert_array_equal(got, expected)


def test_states_and_rows_stand_one_after_the_other():
    aids = AidSet(make_aids("test", EVERY))
    assert aids.names == tuple(AIDS)
    assert aids.first_state == (0, 1, 2, 5)
    assert aids.num_states == 5
    assert aids.first_row == (0, 1, 2, 5)
    assert aids.num_rows == 8
    assert aids.most_rows == 3
    whole = aids.whole_rows(2, np.arange(36.0).reshape(1, 3, 12))
    assert whole.shape == (1, 3, 20)
    np.testing.assert_array_equal(whole[0, :, 17:20], np.arange(36.0).reshape(3, 12)[:, 9:])
    np.testing.assert_array_equal(whole[0, :, 9:17], 0.0)
