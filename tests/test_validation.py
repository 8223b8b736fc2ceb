"""What is valid is accepted as a plain number; all else is refused with owner, argument, value and what is valid."""

from decimal import Decimal

import numpy as np
import pytest

from spoofgym import validation

NO_NUMBERS = (
    float("nan"), float("inf"), "5", b"5", True, np.bool_(True), None, [1.0], np.array([1.0]), 1j, np.complex128(1.0),
    10**400, object(), np.array("x"), Decimal(1),
)  # fmt: skip
CHECKS = (
    validation.finite, validation.non_negative, validation.zero_or_above, validation.above, validation.probability,
    validation.share, validation.average_run_length, validation.time, validation.epochs, validation.runs,
    validation.hour,
)  # fmt: skip


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
def test_no_number_is_refused_by_name(check, value):
    with pytest.raises(ValueError, match=r"^ramp: rate must be .*, got "):
        check("ramp", "rate", value)


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2.0), np.int64(2), np.array(2.0), np.longdouble(2)])
def test_numbers_of_every_kind_become_plain_ones(value):
    for check in (validation.finite, validation.above):
        assert type(check("ramp", "rate", value)) is float
    assert type(validation.epochs("windowed", "n", value)) is int
    assert validation.epochs("windowed", "n", value) == 2


@pytest.mark.parametrize(
    ("check", "value", "message"),
    [
        (validation.finite, 2e9, "a finite number, from -1e\\+09 to 1e\\+09, got 2000000000.0"),
        (validation.non_negative, -1, "a finite number, 0 or more, got -1"),
        (validation.above, 0.0, "a finite number greater than 0, got 0.0"),
        (validation.above, 1e-300, "a finite number greater than 0, from 1e-09 to 1e\\+09, got 1e-300"),
        (validation.zero_or_above, 1e-300, "a finite number greater than 0, from 1e-09"),
        (validation.probability, 1e-310, "greater than 0 and less than 1, from 1e-300 to 1"),
        (validation.average_run_length, 1.0, "a finite number greater than 1, got 1.0"),
        (validation.epochs, 10**30, "a whole number, 1 or more, 10000 at most, got 1000000000000000000000000000000"),
        (validation.epochs, 1.5, "a whole number, 1 or more, got 1.5"),
        (validation.runs, 0, "a whole number, 1 or more, got 0"),
        (validation.hour, 25, "a finite number, from 0 to 24, got 25"),
        (validation.seed, -1, "a non-negative integer or None, got -1"),
    ],
)
def test_what_lies_out_of_range_is_told_the_range(check, value, message):
    arguments = ("ramp", value) if check is validation.seed else ("ramp", "rate", value)
    with pytest.raises(ValueError, match=rf"^ramp: \w+ must be {message}"):
        check(*arguments)


def test_zero_is_one_of_zero_or_above():
    assert validation.zero_or_above("ramp", "time", 0) == 0.0


@pytest.mark.parametrize("value", [2**70, np.uint64(7), 0, None])
def test_seeds_of_any_size_are_kept(value):
    assert validation.seed("ramp", value) == value


@pytest.mark.parametrize("value", [1.0, "1", True, -1, np.float64(1.0), [1]])
def test_other_seeds_are_refused(value):
    with pytest.raises(ValueError, match="ramp: seed must be a non-negative integer or None"):
        validation.seed("ramp", value)


@pytest.mark.parametrize("values", [(1.0, 2.0), "abc", None, (1.0, 2.0, np.nan), (1.0, 2.0, 1j), [[1.0, 2.0, 3.0]]])
def test_what_is_no_triple_is_refused(values):
    with pytest.raises(ValueError, match=r"^receiver: lever_arm must be "):
        validation.triple("receiver", "lever_arm", values)


def test_names_and_truth_values():
    assert validation.one_of("ramp", "axis", "east", ("east", "north")) == "east"
    for value in (None, 5, np.array(["east"]), ["east"], "up"):
        with pytest.raises(ValueError, match="ramp: axis must be one of east, north, got "):
            validation.one_of("ramp", "axis", value, ("east", "north"))
    assert validation.boolean("ramp", "split", np.bool_(True)) is True
    for value in (1, "true", None):
        with pytest.raises(ValueError, match="ramp: split must be True or False, got "):
            validation.boolean("ramp", "split", value)


def test_numbers_in_messages_keep_their_digits():
    assert validation.written(1732876800.25) == "1732876800.25"
    assert validation.written(1.73e9) == "1730000000"
    assert validation.written(0.1 + 0.2) == "0.3"
    assert validation.written(25.9) == "25.9"


def test_long_values_are_cut_in_messages():
    assert len(validation.shown("x" * 10_000)) < 120
    assert "int" in validation.shown(10**5000)
    assert validation.shown(np.zeros((2, 2))) == "array([[0., 0.], [0., 0.]])"


def test_an_argument_is_put_before_what_its_parts_refuse():
    with pytest.raises(ValueError, match=r"^Spoofer-v0: detector: snapshot: threshold"), validation.argument(
        "Spoofer-v0", "detector"
    ):
        validation.above("snapshot", "threshold", -1)
    with pytest.raises(TypeError, match=r"^Spoofer-v0: detector: no"), validation.argument("Spoofer-v0", "detector"):
        raise TypeError("no")
