"""Filters in expectation: the compiled recursion against matrices, and the maps that invert and transpose it."""

import numpy as np
import pytest

from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean import LooseMeanFilter, expected_sequence
from spoofgym.navigation.loose.mean_maps import expected_columns, final_response, offsets_of
from spoofgym.parallel import RunSlices
from spoofgym.scenarios import make_scenario

FLIGHT = "liu-flight:horizon=12,onset=300"
ROBOT = "song-robot:horizon=12"
DRIVE = "foi-drive"
EPOCHS = 12


def loose_model(scenario: str = FLIGHT) -> LinearModel:
    return make_scenario(scenario).linear_model()


def offsets(runs: int, epochs: int = EPOCHS) -> np.ndarray:
    return np.random.default_rng(4).normal(0.0, 5.0, (epochs, runs, 3))


def by_matrices(model: LinearModel, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Liu's eqs 32-34 as they are printed, with the gain K = U L⁻¹ and a solver for L."""
    error, whitened = np.zeros(15), []
    for k, deviation in enumerate(deviations, start=1):
        error = model.transition[k] @ error
        residual = model.observation[k] @ error[:9] - deviation
        gain = np.linalg.solve(model.innovation_factor[k].T, model.whitened_gain[k]).T
        whitened.append(np.linalg.solve(model.innovation_factor[k], residual))
        error = error - gain @ residual
    return np.array(whitened), error


@pytest.mark.parametrize("scenario", [FLIGHT, ROBOT, DRIVE])
def test_a_sequence_is_the_printed_recursion(scenario: str) -> None:
    model = loose_model(scenario)
    sent = offsets(1, model.num_epochs)[:, 0]
    rates = np.diff(sent, axis=0, prepend=np.zeros((1, 3))) / np.diff(model.time)[:, None]
    whitened, error = expected_sequence(model, sent)
    expected, last = by_matrices(model, np.hstack((sent, rates))[:, : model.dimension])
    np.testing.assert_allclose(whitened, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(error, last, rtol=1e-9, atol=1e-12)
    assert np.abs(last[6:8]).max() > 0.1


@pytest.mark.parametrize("threads", [1, 2])
def test_a_game_epoch_by_epoch_is_the_sequence_bit_for_bit(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LooseMeanFilter, "grain", 2)
    model, runs = loose_model(), 5
    played = LooseMeanFilter(model, runs, RunSlices(threads))
    held, sent = np.zeros((runs, 3)), offsets(runs)
    told = []
    for k in range(EPOCHS + 1):
        offset = sent[k - 1] if k else held
        played.advance(np.full(runs, k), offset, held, np.full(runs, 1.0))
        told.append(played.whitened.copy())
        held = offset
    for run in range(runs):
        whitened, error = expected_sequence(model, sent[:, run])
        np.testing.assert_array_equal(np.array(told)[1:, run], whitened)
        np.testing.assert_array_equal(played.error[run], error)


def test_the_coming_innovation_comes_where_the_offset_is_held() -> None:
    model = loose_model()
    played = LooseMeanFilter(model, 1, RunSlices(1))
    one, held, now = np.ones(1), np.array([[3.0, -2.0, 1.0]]), np.zeros(1, dtype=np.int64)
    played.advance(now, np.zeros((1, 3)), np.zeros((1, 3)), one)
    played.advance(now + 1, held, np.zeros((1, 3)), one)
    coming = played.coming.copy()
    played.advance(now + 2, held, held, one)
    np.testing.assert_array_equal(played.whitened, coming)
    played.reset(np.array([0]))
    assert not played.whitened.any()
    assert not played.position_error.any()


def test_offsets_cause_the_innovations_they_were_made_for() -> None:
    model = loose_model()
    wanted = np.random.default_rng(5).normal(size=(EPOCHS, 3))
    sent = offsets_of(model, wanted)
    np.testing.assert_allclose(expected_sequence(model, sent)[0], wanted, rtol=1e-9, atol=1e-10)
    played = LooseMeanFilter(model, 1, RunSlices(1))
    held = np.zeros((1, 3))
    played.advance(np.array([0]), held, held, np.ones(1))
    for k in range(1, EPOCHS + 1):
        offset = played.offset_for(np.array([k]), wanted[k - 1 : k])
        np.testing.assert_allclose(offset[0], sent[k - 1], rtol=1e-9, atol=1e-9)
        played.advance(np.array([k]), offset, held, np.ones(1))
        held = offset


def test_columns_and_their_transpose_agree_with_the_sequence() -> None:
    model, sent = loose_model(), offsets(4)
    whitened, error = expected_columns(model, iter(sent.transpose(0, 2, 1)), 4)
    response = final_response(model, np.eye(15), EPOCHS)
    for run in range(4):
        one, last = expected_sequence(model, sent[:, run])
        np.testing.assert_allclose(whitened[..., run], one, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(error[:, run], last, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(np.einsum("skm,km->s", response, one), last, rtol=1e-8, atol=1e-10)


def test_no_offset_makes_every_innovation_of_ranges() -> None:
    played = make_scenario("kujur-flight:horizon=4,onset=60").family.mean_filter(1, RunSlices(1))
    with pytest.raises(ValueError, match="no offset for every innovation of its ranges"):
        played.offset_for(np.ones(1, dtype=np.int64), np.zeros((1, 3)))
