"""The scripts of docs/how-to/python.md, on files of the packages that they use: the record is that of the same rows as CSV."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy
import pandas
import pytest
from conftest import CHAMBER, MODEL, ROOT

import sagnac

PAGE = ROOT / "docs/how-to/python.md"
#: Each script's folder, in the order of the page.
FOLDERS = ["matlab-5", "matlab-7.3", "hdf5", "tdms", "mdf", "ardupilot", "ros"]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    log = folder / "log.csv"
    pandas.read_csv(CHAMBER / "cycle-1.csv.gz").to_csv(log, index=False)
    make = ROOT / "lab/src/measures/formats/make.py"
    subprocess.run([sys.executable, os.fspath(make), os.fspath(log), os.fspath(folder)], check=True, capture_output=True)
    ros_bag(pandas.read_csv(log), folder / "ros")
    return folder


def ros_bag(log: pandas.DataFrame, folder: Path) -> None:
    """A bag of ROS 2 with an IMU and a thermometer, and its rows as CSV."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    folder.mkdir()
    rates = log["counts"].to_numpy() * numpy.deg2rad(0.15125 / 3600.0) / 5.0
    with Writer(folder / "log_bag", version=9) as writer:
        imu = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
        block = writer.add_connection("/block_temperature", "sensor_msgs/msg/Temperature", typestore=store)
        none = numpy.zeros(9)
        for second, celsius, rate in zip(log["time_s"], log["temperature_c"], rates):
            stamp = kinds["builtin_interfaces/msg/Time"](sec=int(second), nanosec=0)
            header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="gyro")
            vector = kinds["geometry_msgs/msg/Vector3"]
            message = kinds["sensor_msgs/msg/Imu"](
                header=header,
                orientation=kinds["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                orientation_covariance=none,
                angular_velocity=vector(x=0.0, y=0.0, z=float(rate)),
                angular_velocity_covariance=none,
                linear_acceleration=vector(x=0.0, y=0.0, z=-9.8),
                linear_acceleration_covariance=none,
            )
            warmth = kinds["sensor_msgs/msg/Temperature"](header=header, temperature=float(celsius), variance=0.0)
            for connection, of in ((block, warmth), (imu, message)):
                writer.write(connection, int(second) * 10**9, store.serialize_cdr(of, connection.msgtype))
    plain = {"time_ns": (log["time_s"] * 10**9).astype("i8"), "temperature_c": log["temperature_c"], "rate_radps_z": rates}
    pandas.DataFrame(plain).to_csv(folder / "plain.csv", index=False)


def test_every_script_has_a_file() -> None:
    assert len(scripts()) == len(FOLDERS)


def scripts() -> list[str]:
    return re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("folder", FOLDERS)
def test_a_script_gives_the_record_of_the_csv(folder: str, files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(files / folder)
    names: dict[str, Any] = {}
    exec(scripts()[FOLDERS.index(folder)], names)
    plain = files / folder / "plain.csv"
    of_rates = plain.exists()
    keys: dict[str, Any] = {} if of_rates else {"arcsec_per_count": 0.15125, "axis": "z"}
    found, wanted = (
        sagnac.calibrate(run, model=MODEL, **keys).to_dict()
        for run in (names["run"], plain if of_rates else files / "log.csv")
    )
    places = [axis.pop("excluded", None) for record in (found, wanted) for axis in record["axes"]]
    assert found["axes"] == wanted["axes"] and len(places) >= 2
