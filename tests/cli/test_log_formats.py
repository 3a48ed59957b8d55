"""A new format of logs is one reader and one row of the table: the commands then take, name and tell it."""

import json
import sys
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from cpfls_cli.config.load import load_study
from cpfls_cli.flights.recordings import read_flights
from cpfls_cli.logs import formats
from tests.builders.ros_bags import BEGIN_NS, imu, write_bag
from tests.builders.studies import VEHICLE

NAMES = ("t", "roll", "pitch", "yaw", "mx", "my", "mz")
MAGIC = b"FAKE\x00"


def contents(path, wanted):
    """Columns one after the other, eight bytes a number."""
    values = np.frombuffer(path.read_bytes()[len(MAGIC) :]).reshape(len(NAMES), -1)
    columns = dict(zip(NAMES, values, strict=True))
    assert set(wanted) == set(columns)
    return formats.LogContents({"": columns}, warnings=("the logger was tired",))


@pytest.fixture
def fake_format(monkeypatch):
    monkeypatch.setitem(sys.modules, "fake_reader", SimpleNamespace(contents=contents))
    row = formats.LogFormat(suffix=".fake", name="Fake", content="fakes", magic=MAGIC, reader="fake_reader")
    monkeypatch.setattr(formats, "LOG_FORMATS", (*formats.LOG_FORMATS, row))


def write(path):
    time = 0.02 * np.arange(200)
    signals = [0.2 * np.sin((2 + place) * time) for place in range(6)]
    path.write_bytes(MAGIC + np.array([time, *signals]).tobytes())
    return path


@pytest.mark.usefixtures("fake_format")
def test_import_takes_a_log_of_a_new_format(cpfls, log_study, tmp_path):
    log = write(tmp_path / "log.FAKE")
    result = cpfls.done("import", log_study, log, "-o", tmp_path / "flight.h5", "--json")
    assert json.loads(result.stdout)["samples"] == 200
    assert "cpfls: note: the logger was tired" in result.stderr.splitlines()


@pytest.mark.usefixtures("fake_format")
def test_the_gap_workflow_takes_it_as_well(log_study, tmp_path):
    flights = read_flights([write(tmp_path / "log.fake")], load_study(log_study))
    assert [recording.name for recording in flights.recordings] == ["log.fake"]


@pytest.mark.usefixtures("fake_format")
def test_messages_name_a_new_format(refuse, log_study, tmp_path):
    text, other = tmp_path / "log.fake", tmp_path / "log.txt"
    words = ("-o", tmp_path / "flight.h5")
    text.write_text("t,roll\n0,1\n")
    assert refuse("import", log_study, text, *words) == [
        f"{text}: seems to hold CSV, unlike the ending of its name; rename it to end in .csv"
    ]
    assert refuse("import", log_study, other, *words) == [f"{other}: no such file"]
    other.write_text("t\n")
    assert refuse("import", log_study, other, *words) == [
        f"{other}: not a log: its name must end in one of .csv, .csv.gz, .parquet, .ulg, .bin, .log, .bbl, .bfl, .db3,"
        " .mcap, .h5, .hdf5, .mat, .fake, or it must hold one of Parquet, ULog, ArduPilot DataFlash, Betaflight"
        " blackbox, Crazyflie uSD, ROS 2 bag, HDF5, MATLAB, Fake"
    ]
    assert formats.suffixes_in_words().endswith(", .h5, .hdf5, .mat or .fake")
    assert formats.formats_in_words().endswith(", MATLAB, Fake")


@pytest.mark.usefixtures("fake_format")
def test_a_package_of_a_new_format_that_is_missing_is_named(refuse, log_study, tmp_path, monkeypatch):
    row = formats.LogFormat(".fake", "Fake", "fakes", b"", "fake_reader", ("no_such.part",), "fake")
    monkeypatch.setattr(formats, "LOG_FORMATS", (row,))
    log = write(tmp_path / "log.fake")
    (line,) = refuse("import", log_study, log, "-o", tmp_path / "flight.h5")
    assert line == f'{log}: reading .fake needs the package no_such; pip install "cpfls[fake]"'


def test_a_flight_from_hdf5_with_stamps_in_milliseconds(cpfls, tmp_path):
    time = 0.02 * np.arange(200)
    waves = np.sin(np.outer(time, [2, 3, 4, 5, 6, 7]))
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = 1e3 * time
        file["t"].attrs["units"] = "ms"
        file["pose"], file["moment"] = 0.2 * waves[:, :3], waves[:, 3:]
    (tmp_path / "study.yaml").write_text(
        "import:\n  time_column: t\n  signals:\n"
        '    attitude: {columns: ["pose[0]", "pose[1]", "pose[2]"], unit: rad}\n'
        '    body_torque: {columns: ["moment[0]", "moment[1]", "moment[2]"], unit: N m}\n' + VEHICLE
    )
    told = cpfls.told("import", tmp_path / "study.yaml", tmp_path / "log.h5", "-o", tmp_path / "flight.h5")
    assert told["log_rate_hz"] == pytest.approx(50)


@pytest.mark.parametrize("kind", [".db3", ".mcap"])
def test_a_bag_is_imported_on_the_clock_of_its_fastest_topic(kind, cpfls, tmp_path):
    sent = [
        (
            f"/{name}",
            BEGIN_NS + 10_000_000 * number,
            imu(BEGIN_NS + 10_000_000 * number, (number % 7, 1.0, 2.0), (0, 0, 9.81)),
        )
        for number in range(60)
        for name in (["imu", "slow"] if number % 2 else ["imu"])
    ]
    bag = write_bag(tmp_path / "bag", kind, sent)
    columns = ", ".join(f"/imu.angular_velocity.{axis}" for axis in "xyz")
    torque = ", ".join(f"/slow.angular_velocity.{axis}" for axis in "xyz")
    (tmp_path / "study.yaml").write_text(
        "import:\n  time_column: null\n  signals:\n"
        f"    body_rate: {{columns: [{columns}], unit: rad/s}}\n    body_torque: {{columns: [{torque}], unit: N m}}\n"
        '    quaternion: {columns: ["/imu.orientation.w", "/imu.orientation.x", "/imu.orientation.y",'
        ' "/imu.orientation.z"], unit: "1"}\n' + VEHICLE
    )
    told = cpfls.told("import", tmp_path / "study.yaml", bag, "-o", tmp_path / "flight.h5")
    assert told["log_rate_hz"] == pytest.approx(100)


def test_of_the_folder_of_a_bag_the_file_is_asked_for(refuse, log_study, tmp_path):
    write_bag(tmp_path / "bag", ".mcap", [("/imu", BEGIN_NS, imu(BEGIN_NS, (0, 0, 0), (0, 0, 0)))])
    (line,) = refuse("import", log_study, tmp_path / "bag", "-o", tmp_path / "flight.h5")
    assert line.endswith("bag: is a folder, not a file; of a ROS 2 bag name the file in it: bag.mcap")
