"""The file of estimated noises: what is written is read again, and what is wrong in it is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.log_noise import read_noise, write_noise
from tests.logs.known_noise import TRUE


def test_what_is_written_is_read(tmp_path: Path) -> None:
    noise = replace(TRUE, position_floor=(0.1, 0.0, 0.3))
    path = tmp_path / "noise.toml"
    path.write_text(write_noise(noise, {"log": 'a "drive"', "begin_s": 1.5}), encoding="utf-8")
    assert read_noise(path) == noise


def test_densities_and_sigmas() -> None:
    noise = replace(TRUE, velocity_floor=(0.0, 0.3, 0.0))
    np.testing.assert_allclose(noise.density[[0, 5, 8, 9, 14]], np.square([5e-3, 0.08, 0.2, 2e-4, 1e-2]))
    stated = np.array([[1.0, 2.0, 3.0, 0.2, 0.8, 0.5]])
    np.testing.assert_allclose(noise.fix_sigma(stated), [[0.4, 0.8, 2.1, 0.06, 0.5, 0.4]])
    np.testing.assert_allclose(noise.fix_sigma(stated[:, :3]), [[0.4, 0.8, 2.1]])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("gyro_noise", "gyro_nose", "unknown key 'gyro_nose'; valid are gyro_noise, accelerometer_noise"),
        ("gyro_noise = 0.005\n", "", "missing: 'gyro_noise'"),
        ("gyro_noise = 0.005", "gyro_noise = -1", "noise: gyro_noise must be"),
        ("gyro_noise = 0.005", "gyro_noise = ", "not valid TOML"),
        ("position_scale = [0.4, 0.4, 0.7]", "position_scale = [0.4, 0.4]", "position_scale must be three numbers"),
        ("position_scale = [0.4, 0.4, 0.7]", "position_scale = [0, 0.4, 0.7]", "position_scale or position_floor must"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = write_noise(TRUE, {})
    assert old in text
    (tmp_path / "noise.toml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=message) as refused:
        read_noise(tmp_path / "noise.toml")
    assert "noise.toml" in str(refused.value)


def test_a_missing_file_says_what_writes_it(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"noise\.toml is missing; spoofgym estimate-noise"):
        read_noise(tmp_path / "noise.toml")
