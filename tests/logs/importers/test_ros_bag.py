"""Bags of ROS 1 and ROS 2, written by rosbags: the drive comes back, with the velocity beside the fixes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spoofgym.logs.importers.recording import Options
from tests.logs.importers.drive import drive, imported

pytest.importorskip("rosbags")
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

START = 1_700_000_000.0
FLU = np.array([1.0, -1.0, -1.0])


def messages(types: Any, one: bool) -> list[tuple[float, str, Any]]:
    """The drive's messages: time, topic, message."""
    true = drive()

    def make(kind: str, *values: Any) -> Any:
        return types[kind](*values)

    def header(time: float) -> Any:
        nano = round((START + time) * 1e9)
        stamp = make("builtin_interfaces/msg/Time", nano // 10**9, nano % 10**9)
        return make("std_msgs/msg/Header", *((0,) if one else ()), stamp, "base_link")

    def vector(values: np.ndarray) -> Any:
        return make("geometry_msgs/msg/Vector3", *values.tolist())

    rows = []
    unknown = np.zeros(9)
    still = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    for k, time in enumerate(true.time):
        parts = (still, unknown, vector(true.rate[k] * FLU), unknown, vector(true.force[k] * FLU), unknown)
        rows.append((time, "/imu/data", make("sensor_msgs/msg/Imu", header(time), *parts)))
    for k, time in enumerate(true.fix_time):
        status = make("sensor_msgs/msg/NavSatStatus", 0 if k else -1, 1)
        place = true.place[k].tolist()
        covariance = np.diag([4.0, 9.0, 16.0]).ravel()  # east, north, up
        rows.append((time, "/fix", make("sensor_msgs/msg/NavSatFix", header(time), status, *place, covariance, 2)))
        enu = vector(true.velocity[k, [1, 0, 2]] * [1.0, 1.0, -1.0])
        twist = make("geometry_msgs/msg/Twist", enu, vector(np.zeros(3)))
        known = make("geometry_msgs/msg/TwistWithCovariance", twist, 0.04 * np.eye(6).ravel())
        rows.append((time, "/fix_velocity", make("geometry_msgs/msg/TwistWithCovarianceStamped", header(time), known)))
    return sorted(rows, key=lambda row: row[0])


def bag(path: Path, one: bool, more: str | None = None) -> Path:
    """Written as ROS 1 or ROS 2; ``more`` is a second topic with the same fixes."""
    store = get_typestore(Stores.ROS1_NOETIC if one else Stores.ROS2_HUMBLE)
    writer: Any = Writer1(path) if one else Writer2(path, version=9)
    encode: Callable[..., Any] = store.serialize_ros1 if one else store.serialize_cdr
    with writer:
        connections: dict[str, Any] = {}
        for time, topic, message in messages(store.types, one):
            for name in (topic, *([more] if more and topic == "/fix" else [])):
                kind = message.__msgtype__
                if name not in connections:
                    connections[name] = writer.add_connection(name, kind, typestore=store)
                writer.write(connections[name], round((START + time) * 1e9), encode(message, kind))
    return path


@pytest.mark.parametrize("one", [True, False], ids=["ROS 1", "ROS 2"])
def test_a_drive_comes_back(tmp_path: Path, one: bool) -> None:
    recording, log = imported(bag(tmp_path / ("drive.bag" if one else "drive"), one), tmp_path / "log")
    assert recording.axes == "flu"
    np.testing.assert_allclose(log.imu_time - START, drive().time, atol=2e-6)
    np.testing.assert_allclose(log.angular_rate[:, 2], -drive().rate[:, 2], atol=1e-8)
    np.testing.assert_allclose(log.specific_force[:, 1], drive().force[:, 0], atol=1e-7)
    np.testing.assert_allclose(log.fixes.time - START, drive().fix_time[1:], atol=2e-6)
    assert log.fixes.velocity is not None
    np.testing.assert_allclose(log.fixes.velocity[:, :2], drive().velocity[1:][:, [1, 0]], atol=1e-8)
    assert log.fixes.position_sigma is not None
    assert log.fixes.velocity_sigma is not None
    np.testing.assert_allclose(log.fixes.position_sigma[0], [2.0, 3.0, 4.0])
    np.testing.assert_allclose(log.fixes.velocity_sigma[0], 0.2)
    assert f"1 of {len(drive().fix_time)} NavSatFix have no fix" in recording.problems[0]


def test_of_several_topics_one_must_be_named(tmp_path: Path) -> None:
    path = bag(tmp_path / "drive.bag", True, more="/other/fix")
    with pytest.raises(ValueError, match="several topics have NavSatFix: /fix, /other/fix; --fix-topic chooses one"):
        imported(path, tmp_path / "log")
    recording, _ = imported(path, tmp_path / "log", Options(fix_topic="/other/fix"))
    assert recording.remarks["topics"] == "/imu/data, /other/fix"
    with pytest.raises(ValueError, match="no topic '/none' with Imu; there are: /imu/data"):
        imported(path, tmp_path / "again", Options(imu_topic="/none"))


@pytest.mark.parametrize("length", [13, 200, 5000, 40_000])
def test_a_bag_that_is_cut_is_refused_in_one_line(tmp_path: Path, length: int) -> None:
    path = bag(tmp_path / "drive.bag", True)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(ValueError, match=r"drive\.bag"):
        imported(path, tmp_path / "log")
    assert not (tmp_path / "log").exists()
