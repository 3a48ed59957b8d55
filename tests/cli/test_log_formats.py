"""A format of logs is one reader and one row of the table; one flight is the same in all of them."""

import gzip
import json
import sys
from functools import partial
from types import SimpleNamespace

import h5py
import numpy as np
import pyarrow
import pytest
import scipy.io
import yaml
from pyarrow import parquet

from cpfls_cli.config.load import load_study
from cpfls_cli.flights.recordings import read_flights
from cpfls_cli.logs import formats
from cpfls_cli.logs.formats import LOG_FORMATS
from tests.builders import ros_bags, ulogs
from tests.builders.dataflash_logs import dataflash
from tests.builders.ros_bags import BEGIN_NS, imu, write_bag
from tests.builders.studies import VEHICLE
from tests.builders.usd_logs import usd

NAMES = ("t", "roll", "pitch", "yaw", "mx", "my", "mz")
MAGIC = b"FAKE\x00"


def contents(path, wanted):
    """Columns one after the other, eight bytes a number."""
    columns = dict(zip(NAMES, np.frombuffer(path.read_bytes()[len(MAGIC) :]).reshape(len(NAMES), -1), strict=True))
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
    result = cpfls.done("import", log_study, write(tmp_path / "log.FAKE"), "-o", tmp_path / "flight.h5", "--json")
    assert json.loads(result.stdout)["samples"] == 200
    assert "cpfls: note: the logger was tired" in result.stderr.splitlines()


@pytest.mark.usefixtures("fake_format")
def test_the_gap_workflow_takes_it_as_well(log_study, tmp_path):
    flights = read_flights([write(tmp_path / "log.fake")], load_study(log_study))
    assert [flight.name for flight in flights.flights] == ["log.fake"]


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
        f"{other}: not a log: its name must end in one of .csv, .csv.gz, .parquet, .ulg, .bin, .px4log, .log, .bbl,"
        " .bfl, .bag, .db3, .mcap, .h5, .hdf5, .mat, .npz, .json, .jsonl, .fake, or it must hold one of Parquet, ULog,"
        " ArduPilot DataFlash, PX4 sdlog2, Betaflight blackbox, Crazyflie uSD, ROS 1 bag, ROS 2 bag, HDF5, MATLAB,"
        " Fake, or a line of column names above numbers"
    ]
    assert formats.suffixes_in_words().endswith(", .json, .jsonl or .fake")
    assert formats.formats_in_words().endswith(", NumPy, JSON, Fake")


@pytest.mark.usefixtures("fake_format")
def test_a_package_of_a_new_format_that_is_missing_is_named(refuse, log_study, tmp_path, monkeypatch):
    row = formats.LogFormat(".fake", "Fake", "fakes", b"", "fake_reader", ("no_such.part",), "fake")
    monkeypatch.setattr(formats, "LOG_FORMATS", (row,))
    log = write(tmp_path / "log.fake")
    (line,) = refuse("import", log_study, log, "-o", tmp_path / "flight.h5")
    assert line == f'{log}: reading .fake needs the package no_such; pip install "cpfls[fake]"'


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
    summary = cpfls.summary("import", tmp_path / "study.yaml", bag, "-o", tmp_path / "flight.h5")
    assert summary["log_rate_hz"] == pytest.approx(100)


def test_of_the_folder_of_a_bag_the_file_is_asked_for(refuse, log_study, tmp_path):
    write_bag(tmp_path / "bag", ".mcap", [("/imu", BEGIN_NS, imu(BEGIN_NS, (0, 0, 0), (0, 0, 0)))])
    (line,) = refuse("import", log_study, tmp_path / "bag", "-o", tmp_path / "flight.h5")
    assert line.endswith("bag: is a folder, not a file; of a ROS 2 bag name the file in it: bag.mcap")


STEPS_US = 5_000 * np.arange(400)
TIME = 1e-6 * STEPS_US
SIGNALS = {
    "attitude": 0.2 * np.sin(np.outer(TIME, [2, 3, 4])),
    "body_rate": 0.2 * np.outer(np.ones(len(TIME)), [2, 3, 4]) * np.cos(np.outer(TIME, [2, 3, 4])),
    "body_torque": 0.01 * np.cos(np.outer(TIME, [1, 2, 3])),
}
UNITS = {"attitude": "rad", "body_rate": "rad/s", "body_torque": "N m"}
TABLE = np.hstack(list(SIGNALS.values()))
PLAIN = {name: [f"{name}_{axis}" for axis in "xyz"] for name in SIGNALS}
INDEXED = {name: [f"{name}[{axis}]" for axis in range(3)] for name in SIGNALS}
ROWS = [(int(stamp), row.tolist()) for stamp, row in zip(STEPS_US, TABLE, strict=True)]


def below(topic, names):
    return {signal: [f"{topic}.{name}" for name in own] for signal, own in names.items()}


def csv():
    head = ",".join(["t", *(name for own in PLAIN.values() for name in own)])
    return "\n".join([head, *(f"{1e-6 * stamp!r},{','.join(map(repr, row))}" for stamp, row in ROWS)]).encode()


def arrays(save):
    """Write the signals as matrices, by a function that takes a path and a dict."""
    return lambda path: save(path, {"t": TIME, **SIGNALS})


def listed(path):
    """Write the signals as lists, or as a record a line."""
    columns = {"t": TIME.tolist(), **{name: values.tolist() for name, values in SIGNALS.items()}}
    rows = (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))
    path.write_text(json.dumps(columns) if path.suffix == ".json" else "\n".join(map(json.dumps, rows)))


def hdf5(path, data):
    with h5py.File(path, "w") as file:
        for name, values in data.items():
            file[name] = values


def table(path):
    columns = {
        name: values
        for own, matrix in zip(PLAIN.values(), SIGNALS.values(), strict=True)
        for name, values in zip(own, matrix.T, strict=True)
    }
    parquet.write_table(pyarrow.table({"t": TIME, **columns}), path)


def ulog(path):
    fields = {"flight": "uint64_t timestamp;" + ";".join(f"float[3] {name}" for name in SIGNALS)}
    path.write_bytes(ulogs.ulog([(stamp, 0, row) for stamp, row in ROWS], fields))


def ardupilot(path, *, text=False):
    names = ",".join(["TimeUS", *(f"{name[-1]}{name[5]}{axis}" for name in SIGNALS for axis in range(3))])
    rows = [("FLT", (stamp + 9, *map(float, row))) for stamp, row in ROWS]
    path.write_bytes(dataflash({"FLT": ("Q" + "f" * 9, names)}, rows, text=text))


def crazyflie(path):
    variables = {name: "f" for own in below("log", PLAIN).values() for name in own}
    path.write_bytes(usd({"fixed": variables}, [("fixed", stamp, row) for stamp, row in ROWS]))


def bag(path):
    """Three topics, each with messages of three numbers."""
    types = ros_bags.STORE.types
    stamped, vector = types["geometry_msgs/msg/Vector3Stamped"], types["geometry_msgs/msg/Vector3"]
    header, clock = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    sent = [
        (f"/{name}", when, stamped(header(clock(when // 10**9, when % 10**9), ""), vector(*SIGNALS[name][number])))
        for number, when in enumerate((ros_bags.BEGIN_NS + 1000 * STEPS_US).tolist())
        for name in SIGNALS
    ]
    ros_bags.write_bag(path.parent / path.stem, path.suffix, sent).rename(path)


OF_TOPICS = {name: [f"/{name}.vector.{axis}" for axis in "xyz"] for name in SIGNALS}
ARDUPILOT = {name: [f"FLT.{name[-1]}{name[5]}{axis}" for axis in range(3)] for name in SIGNALS}
WRITERS = {
    "log.csv": (lambda path: path.write_bytes(csv()), "t", PLAIN),
    "log.csv.gz": (lambda path: path.write_bytes(gzip.compress(csv())), "t", PLAIN),
    "log.parquet": (table, "t", PLAIN),
    "log.ulg": (ulog, None, below("flight", INDEXED)),
    "log.bin": (ardupilot, None, ARDUPILOT),
    "log.log": (partial(ardupilot, text=True), None, ARDUPILOT),
    "log00": (crazyflie, None, below("fixed.log", PLAIN)),
    "log.bag": (bag, None, OF_TOPICS),
    "log.db3": (bag, None, OF_TOPICS),
    "log.mcap": (bag, None, OF_TOPICS),
    "log.h5": (arrays(hdf5), "t", INDEXED),
    "log.hdf5": (arrays(hdf5), "t", INDEXED),
    "log.mat": (arrays(scipy.io.savemat), "t", INDEXED),
    "log.npz": (arrays(lambda path, data: np.savez(path, **data)), "t", INDEXED),
    "log.json": (listed, "t", INDEXED),
    "log.jsonl": (listed, "t", INDEXED),
}
BEGINS = {
    "log.ulg": 1e-6 * ulogs.BEGIN,
    "log.bin": 9e-6,
    "log.log": 9e-6,
    "log.bag": 1e-9 * ros_bags.BEGIN_NS,
    "log.db3": 1e-9 * ros_bags.BEGIN_NS,
    "log.mcap": 1e-9 * ros_bags.BEGIN_NS,
}
"""Stamps with which logs begin that do not begin at 0, s."""
# Whole numbers and no attitude, and messages of PX4 alone: formats of their own in tests/unit/logs.
ELSEWHERE = {".bbl", ".bfl", ".px4log"}


def test_every_format_is_among_them():
    written = {name.removeprefix("log") for name in WRITERS} - {"00"} | {""}
    assert {form.suffix for form in LOG_FORMATS} == written | ELSEWHERE


@pytest.mark.parametrize("name", WRITERS)
def test_the_same_flight_comes_back(cpfls, tmp_path, name):
    write, time, columns = WRITERS[name]
    write(tmp_path / name)
    signals = {signal: {"columns": own, "unit": UNITS[signal]} for signal, own in columns.items()}
    # What was asked for comes the same way: here it is what was flown.
    signals |= {f"setpoint_{signal}": {**signals[signal], "required": False} for signal in ("attitude", "body_rate")}
    (tmp_path / "study.yaml").write_text(
        VEHICLE + yaml.safe_dump({"import": {"time_column": time, "signals": signals}})
    )
    cpfls.done("import", tmp_path / "study.yaml", tmp_path / name, "-o", tmp_path / "flight.h5")
    with h5py.File(tmp_path / "flight.h5") as file:
        assert file["inputs/log"].attrs["name"] == name
        assert len(file["time"]) == len(TIME)
        np.testing.assert_allclose(file["time"], TIME, atol=1e-8)
        # A date in s is known to a quarter of a microsecond.
        assert float(file["begins"][()]) == pytest.approx(BEGINS.get(name, 0.0), abs=5e-7, rel=0)
        for signal, values in SIGNALS.items():
            # Most logs keep seven digits.
            np.testing.assert_allclose(file[signal], values, atol=1e-6, err_msg=signal)
        for signal in ("attitude", "body_rate"):
            np.testing.assert_allclose(file[f"setpoint_{signal}"], SIGNALS[signal], atol=1e-6, err_msg=signal)
