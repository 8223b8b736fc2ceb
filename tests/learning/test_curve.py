"""The learning curve of a run folder."""

import pytest

from spoofgym.evaluation.learning_curve import RETURNS as NAMES
from spoofgym.evaluation.learning_curve import RETURNS_FILE, final_learner, read_rows
from spoofgym.learning.curve import LearningCurve

pytestmark = pytest.mark.xdist_group("run folders")  # one worker: the uninterrupted runs are made once


def test_a_curve_goes_on_after_the_checkpoint_that_a_run_goes_on_from(tmp_path):
    curve = LearningCurve(tmp_path, 0)
    for played in (100, 200, 300):
        curve.note(0, played, played, played / 100)
    curve.save()
    again = LearningCurve(tmp_path, 200)  # the third rollout was not kept, and is played again
    again.note(0, 300, 300, 9.0)
    again.save()
    assert [row["mean_return"] for row in read_rows(tmp_path / RETURNS_FILE, NAMES)] == [1.0, 2.0, 9.0]
    begun = LearningCurve(tmp_path, 0)  # without a checkpoint the run starts again
    begun.save()
    assert read_rows(tmp_path / RETURNS_FILE, NAMES) == []


def test_a_damaged_curve_is_named_when_a_run_goes_on(tmp_path):
    (tmp_path / RETURNS_FILE).write_text('[{"steps": "many"}]')
    with pytest.raises(ValueError, match=f"{RETURNS_FILE} is damaged"):
        LearningCurve(tmp_path, 100)


@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_a_training_writes_the_curve_of_its_learners(name, uninterrupted):
    """That a resumed run has the same curve, bit for bit, is among what tests of run folders compare."""
    path, _, _ = uninterrupted(name)
    rows = read_rows(path / RETURNS_FILE, NAMES)
    assert {row["trial"] for row in rows} == ({0, 1} if name == "spoofer" else {0})
    assert [row["played"] for row in rows] == sorted({row["played"] for row in rows})
    last = final_learner(rows)
    assert [row["steps"] for row in last] == sorted({row["steps"] for row in last})
    assert last[-1] == rows[-1]
