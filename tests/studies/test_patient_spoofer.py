"""The patient spoofer: its profile, and what the command says of who lets it in."""

import numpy as np
import pytest

from spoofgym.navigation.interface import Clock
from spoofgym.studies.patient_spoofer import (
    DRAWN,
    JUMP,
    PATIENCE,
    RATE,
    RESPONSES,
    PatientSpoofer,
    main,
    play,
)
from spoofgym.timeline import Timeline


def test_it_jumps_waits_and_drags_off():
    spoofer = PatientSpoofer(jump=40.0, patience=8.0, rate=2.0, direction=0.0, onset=105.0)
    spoofer.bind(Timeline.steady(100.0, 1.0, 50), 1)
    time = np.array([100.0, 105.0, 106.0, 113.0, 114.0, 123.0])
    offset = np.array([spoofer.offset(Clock(np.array([int(t) - 100]), np.array([t])))[0] for t in time])
    assert offset[:, 1].tolist() == [0.0, 0.0, 40.0, 40.0, 42.0, 60.0]
    assert not offset[:, [0, 2]].any()
    assert spoofer.name == "patient-spoofer:40,patience=8,rate=2,direction=0,onset=105"
    with pytest.raises(ValueError, match="patience must be a finite number, 0 or more, got -1"):
        PatientSpoofer(patience=-1.0)


def test_a_reset_lets_it_in_and_a_latch_does_not():
    """Eight seconds after the last good fix the filter is where the spoofer is; dead reckoning never uses a fix."""
    reset, latched = (play(name, 20, seed=1) for name in ("px4-auto", "px4-dead-reckoning"))
    assert reset.time[0] == 1.0
    assert (reset.reset.argmax(axis=1) == 7).all()
    assert not reset.used[:, :7].any()
    offset = JUMP + RATE * (reset.time[-1] - PATIENCE)
    assert reset.error[:, 7] == pytest.approx(JUMP, abs=25.0)
    assert reset.error[:, -1] == pytest.approx(offset, abs=25.0)
    assert not latched.reset.any()
    assert not latched.used.any()
    assert np.array_equal(latched.error[:, :7], reset.error[:, :7])
    assert latched.error[:, -1].max() < 0.5 * reset.error[:, -1].min()


def test_the_command_prints_a_row_per_response_and_draws(capsys, tmp_path):
    pytest.importorskip("matplotlib")
    figure = tmp_path / "new" / "figure.png"
    main(["--runs", "3", "--figure", str(figure)])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("|")[1].strip() for line in lines if line.startswith("| `")] == [f"`{r}`" for r in RESPONSES]
    assert set(DRAWN) <= set(RESPONSES)
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_no_runs_are_refused(capsys):
    with pytest.raises(SystemExit):
        main(["--runs", "0"])
    assert "expected a whole number, 1 or more, got '0'" in capsys.readouterr().err
