"""What logs hold: columns, matrices and dates, in each format."""

import gzip
import io
import json
import struct
import subprocess
import sys
import tarfile
import time
import tomllib
import zipfile
from importlib import import_module
from math import isnan
from pathlib import Path

import h5py
import numpy as np
import pyarrow
import pytest
import scipy.io
from pyarrow import parquet

from cpfls_cli import files
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.recognised import LogTable
from cpfls_cli.logs import matrices
from cpfls_cli.logs.csv_log import row_lines
from cpfls_cli.logs.formats import (
    LOG_FORMATS,
    about_flight,
    foreign_file,
    formats_in_words,
    is_log,
    log_contents,
    log_flights,
    suffixes_in_words,
)
from tests.builders import blackbox_logs, ulogs
from tests.builders.dataflash_logs import dataflash
from tests.builders.ros_bags import BEGIN_NS, imu, write_bag
from tests.builders.studies import put_file
from tests.builders.unknown_logs import flight, named

NAME = "log.csv"


def listed(contents):
    return {topic: {field: values.tolist() for field, values in own.items()} for topic, own in contents.topics.items()}


def names(contents):
    return [*contents.topics[""]]


def test_a_csv_is_one_topic_of_all_its_numbers(read):
    contents = read("t,roll,mode,pitch\n0,1,hover,\n1,2,land,5\n")
    np.testing.assert_equal(listed(contents), {"": {"t": [0, 1], "roll": [1, 2], "pitch": [np.nan, 5]}})
    assert contents.warnings == ("columns that hold text are left out: mode",)
    assert (contents.units, contents.parameters, contents.system) == ({}, {}, "")


def test_of_a_csv_only_what_is_wanted_is_read(tmp_path):
    path = put_file(tmp_path / "log.csv", "t,roll,mode\n0,1,hover\n1,2,land\n")
    assert listed(log_contents(path, ["roll"])) == {"": {"t": [], "roll": [1, 2], "mode": []}}
    with pytest.raises(InputError, match=r"log\.csv:2: column 'mode' = 'hover': not a number"):
        log_contents(path, ["mode"])


def test_columns_without_names_that_a_spreadsheet_adds_are_none(tmp_path):
    for filled, warnings in (("", ()), ("5", ("columns without a name are left out",))):
        (tmp_path / "log.csv").write_text(f"t,roll,,\n0,1,{filled},{filled}\n1,2,,\n")
        contents = log_contents(tmp_path / "log.csv")
        assert listed(contents)[""] == {"t": [0, 1], "roll": [1, 2]}
        assert contents.warnings == warnings


@pytest.mark.parametrize(
    "text", ["t, roll, m1, \n0, 1, 2\n1, 2, 3\n", "t,roll,m1\n0,1,2,\n1,2,3,\n", "t,roll,m1,\n0,1,2,\n1,2,3,\n"]
)
def test_a_separator_at_the_end_of_lines_parts_nothing(tmp_path, text):
    (tmp_path / "log.csv").write_text(text)
    contents = log_contents(tmp_path / "log.csv")
    assert {name: own for name, own in listed(contents)[""].items() if name} == {
        "t": [0, 1],
        "roll": [1, 2],
        "m1": [2, 3],
    }
    (tmp_path / "log.csv").write_text("t,roll\n0,1,2\n")
    with pytest.raises(InputError, match="3 fields, but 2 column names"):
        log_contents(tmp_path / "log.csv")


def test_zeros_that_a_card_holds_where_nothing_was_written_are_no_values(tmp_path):
    zeros = "\0" * 512
    (tmp_path / "log.csv").write_text(f"t,roll\n0,1\n{zeros}1,2\n2,3\n{zeros}")
    assert listed(log_contents(tmp_path / "log.csv"))[""] == {"t": [0, 1, 2], "roll": [1, 2, 3]}
    (tmp_path / "log.csv").write_text(f"t,roll\n0,1\n{zeros}t, roll \n0,3\n")
    with pytest.raises(InputError, match=r"log.csv:3: the column names again, of another log: keep one of them"):
        log_contents(tmp_path / "log.csv")


@pytest.mark.parametrize("name", ["log.txt", "log.dat", "log", "log.data"])
def test_a_table_with_a_line_of_names_may_end_otherwise(tmp_path, name):
    (tmp_path / name).write_text("time, theta, m1, f\n0.25, -1.5, 1000, inf\n0.5, 2e-3, 1000, 3\n")
    assert is_log(tmp_path / name)
    assert listed(log_contents(tmp_path / name))[""]["theta"] == [-1.5, 2e-3]
    # A text with commas is none.
    (tmp_path / name).write_text("time, place, and speed\nwere not written, 1, 2, 3\n")
    assert not is_log(tmp_path / name)


def test_of_columns_with_one_name_each_has_a_number(tmp_path):
    path = put_file(tmp_path / "log.csv", "T,roll,T,motor,motor\n0,1,20,5,6\n1,2,30,7,8\n")
    held = {"T[0]": [0, 1], "roll": [1, 2], "T[1]": [20, 30], "motor[0]": [5, 7], "motor[1]": [6, 8]}
    assert listed(log_contents(path)) == {"": held}
    assert listed(log_contents(path, ["T[1]"]))[""]["T[1]"] == [20, 30]
    # A number that another column has is none of theirs.
    path.write_text("t,x,x,x[0]\n0,1,2,3\n1,1,2,3\n")
    assert [*listed(log_contents(path))[""].items()][1:] == [("x[1]", [1, 1]), ("x[2]", [2, 2]), ("x[0]", [3, 3])]
    path.write_text("T,T\n0,1\n")
    # What a config maps is one of them.
    with pytest.raises(InputError, match=r"log\.csv: column 'T' appears twice: map T\[0\] or the next"):
        log_contents(path, ["T"])


def test_arrays_of_numpy_are_named_by_the_texts_with_them(read):
    time, state = np.arange(5) * 0.01, np.arange(15.0).reshape(5, 3)
    texts = {"state_labels": np.array(["x", "vx", "wz"]), "source": np.array("a.ulg"), "odd": np.array([{}, 1])}
    contents = read({"t": time, "X": state, "U": state[:, :2], **texts}, "log.npz")
    columns = zip(("x", "vx", "wz", "U[0]", "U[1]"), state.T[[0, 1, 2, 0, 1]].tolist(), strict=True)
    assert listed(contents) == {"": {"t": time.tolist(), **dict(columns)}}
    assert contents.warnings == ("arrays that are no columns of numbers are left out: odd",)
    # Of two matrices as wide it is not known whose names they are.
    assert "X[0]" in names(read({"t": time, "X": state, "Y": state, "labels": texts["state_labels"]}, "log.npz"))


@pytest.mark.parametrize(
    "texts",
    [
        {"phases": ["takeoff", "hover", "land"]},
        {"labels": ["t", "vx", "wz"]},
        {"labels": ["x", "y", "z"], "names": ["vx", "vy", "vz"]},
        {"labels": ["x", "y", "z"], "columns": ["x", "y"]},
        {"labels": ["x", "y", ""]},
    ],
    ids=["no labels", "of another array", "two lists", "in two lists", "one without a text"],
)
def test_texts_that_may_not_be_names_of_columns_name_none(read, texts):
    state = np.arange(15.0).reshape(5, 3)
    named = {name: np.array(own) for name, own in texts.items()}
    assert names(read({"t": np.arange(5.0), "X": state, **named}, "log.npz")) == ["t", "X[0]", "X[1]", "X[2]"]


def test_a_text_with_each_sample_names_none_of_them(read):
    stamps = np.array([f"10:00:0{second}" for second in range(5)])
    contents = read({"t": np.arange(5.0), "gyro": np.ones((3, 5)), "time_names": stamps}, "log.npz")
    assert names(contents) == ["t", "gyro[0]", "gyro[1]", "gyro[2]"]


def test_an_empty_array_is_no_fault_of_the_others(read):
    assert names(read({"t": np.arange(5.0), "scan": np.empty((5, 0))}, "log.npz")) == ["t"]


def test_a_ulog_holds_topics_and_what_px4_knows_of_the_vehicle(tmp_path):
    path = tmp_path / "log.ulg"
    battery = "uint64_t timestamp;float voltage_v"
    fields = {"battery_status": battery, "battery_status[1]": battery}
    sent = [(0, 0, [12.0]), (500_000, 1, [16.0]), (750_000, 0, [11.5])]
    facts = {"sys_name": "PX4", "ver_sw_release": 0x010E00FF, "CA_ROTOR_COUNT": 4, "MPC_THR_HOVER": 0.5}
    # A parameter that is text is none, which broken files have.
    text = ulogs.message("P", b"\x0bchar[4] ODDtext")
    path.write_bytes(
        ulogs.header() + ulogs.definitions(fields, facts) + text + b"".join(ulogs.data(*row) for row in sent)
    )
    contents = log_contents(path)
    assert listed(contents) == {
        "battery_status": {"timestamp": [0, 0.75], "voltage_v": [12.0, 11.5]},
        "battery_status[1]": {"timestamp": [0.5], "voltage_v": [16.0]},
    }
    assert contents.parameters == {"CA_ROTOR_COUNT": 4.0, "MPC_THR_HOVER": 0.5}
    assert contents.system == "PX4 1.14.0"


LONG = "a broken ULog file: its message 'a' would take more than 65535"
MATLAB = b"MATLAB 5.0 MAT-file".ljust(126)
REFUSED = {
    # Before they are listed.
    "ulog, a long array": (
        "log.ulg", ulogs.ulog([(0, 0, [1.0])], {"a": "uint64_t timestamp;float[100000000] x"}), LONG,
    ),
    "ulog, long by nesting": (
        "log.ulg",
        ulogs.ulog([(0, 0, [1.0])], {"a": "uint64_t timestamp;b[1000] x", "b": "c[1000] x", "c": "float[1000] x"}),
        LONG,
    ),
    "ulog, within itself": (
        "log.ulg",
        ulogs.ulog([(0, 0, [1.0])], {"a": "uint64_t timestamp;a x"}),
        "a broken ULog file: one of its messages contains itself",
    ),
    "ulog, header cut": ("log.ulg", ulogs.header()[:10], "a broken ULog file: "),
    "ulog, header alone": (
        "log.ulg", ulogs.header(), "a ULog file without samples: was the logger stopped at once, or the file cut off?",
    ),
    "ulog, no data": (
        "log.ulg", ulogs.header() + ulogs.definitions({"a": "uint64_t timestamp"}), "a ULog file without samples: ",
    ),
    "ulog, unknown flag": (
        "log.ulg", ulogs.header() + ulogs.message("B", bytes(8) + b"\x80" + bytes(31)), "a broken ULog file: ",
    ),
    "ulog, encrypted": (
        "log.ulg",
        b"ULogEnc\x01" + bytes(100),
        "is encrypted: decrypt it first, as PX4's Tools/decrypt_ulog.py does",
    ),
    "matlab, empty": ("log.mat", b"", "an empty file: nothing was logged, or the copy failed"),
    "matlab, broken": ("log.mat", MATLAB + b"IM" + b"\x0f\0\0\0\xff\xff\0\0broken", "cannot be read as MATLAB: "),
    "hdf5, cut": ("log.h5", b"\x89HDF\r\n\x1a\n" + bytes(30), "cannot be read as HDF5: "),
    "matlab, under another ending": ("log.h5", MATLAB, "cannot be read as MATLAB: "),
    "numpy, no archive": ("log.npz", b"broken", "cannot be read as NumPy: "),
}  # fmt: skip


@pytest.mark.parametrize(("name", "content", "message"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_read_is_refused(read, tmp_path, name, content, message):
    with pytest.raises(InputError) as caught:
        read(content, name)
    assert str(caught.value).startswith(f"{tmp_path / name}: {message}")


def test_a_ulog_whose_last_message_is_longer_than_the_file_is_refused_in_time(tmp_path):
    """Back by all of such a message, the reader would come to the same place of the definitions again and again."""
    path = tmp_path / "log.ulg"
    described = ulogs.message("F", f"{'a' * 77}:uint64_t timestamp;".encode())
    assert len(described) == 100
    path.write_bytes(ulogs.header() + 200 * described + struct.pack("<HB", 51 + 150 * 100, 0) + bytes(50))
    run = [sys.executable, "-m", "cpfls_cli", "look", str(path)]
    said = subprocess.run(run, capture_output=True, text=True, check=False, timeout=60)
    assert "a ULog file without samples: was the logger stopped at once, or the file cut off?" in said.stderr


def test_what_a_small_file_cannot_hold_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_PLAIN", 1 << 16)
    text, table, bytes_of_eight = tmp_path / "log.csv.gz", tmp_path / "log.parquet", tmp_path / "log.h5"
    text.write_bytes(gzip.compress(b"t,roll\n" + b"1,0\n" * (1 << 20)))
    with pytest.raises(InputError, match=r"log\.csv\.gz: holds more than .* MB of text: damaged, or not a log"):
        log_contents(text)
    parquet.write_table(pyarrow.table({"t": np.zeros(1 << 22)}), table)
    with pytest.raises(InputError, match=r"log\.parquet: claims 0\.0336 GB of numbers, far more"):
        log_contents(table)
    # A byte each in the file, eight in memory.
    with h5py.File(bytes_of_eight, "w") as file:
        file.create_dataset("t", (1 << 18,), "u1", chunks=(1 << 12,))
    with pytest.raises(InputError, match=r"log\.h5: claims 0\.0021 GB of numbers"):
        log_contents(bytes_of_eight)


ROOT = Path(__file__).parents[3]


def test_each_row_has_a_reader_and_an_extra_that_installs_its_package():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for form in LOG_FORMATS:
        assert callable(import_module(form.reader).contents)
        installed = [requirement.partition(">")[0] for requirement in extras.get(form.extra, ())]
        assert {module.partition(".")[0] for module in form.packages} == set(installed)


def test_no_format_hides_another():
    """The first suffix that fits decides, and so do the first bytes."""
    for number, form in enumerate(LOG_FORMATS):
        for other in LOG_FORMATS[number + 1 :]:
            assert not form.suffix or not other.suffix.endswith(form.suffix)
            assert form.reader == other.reader or not form.magic or not other.magic.startswith(form.magic)


@pytest.mark.parametrize("name", ["a.csv", "a.CSV.GZ", "b/a.parquet", "a.b.ULG", "a.BIN", "a.mat"])
def test_a_log_is_known_by_its_name(name):
    assert is_log(Path(name))


@pytest.mark.parametrize("name", ["a.h5", "a.gz", "csv", "a.csv.zip", ""])
def test_other_names_are_no_logs(name):
    assert not is_log(Path(name))


HEADER = b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n"


@pytest.mark.parametrize("first", [b"\xbc\x02\x00", HEADER, b"\xff\xff" + HEADER])
def test_binary_logs_are_known_by_their_first_bytes_whatever_their_name(tmp_path, first):
    for name in ("log00", "LOG.TXT", "log.tar.gz", "study.h5", "log.ulg", "log.csv"):
        (tmp_path / name).write_bytes(first)
        assert is_log(tmp_path / name)
    (tmp_path / "other").write_bytes(b"t,roll\n0,1\n")
    assert not is_log(tmp_path / "other")


def test_an_hdf5_file_is_a_log_if_it_is_not_of_this_program(tmp_path):
    for name, attributes, is_one in (
        ("a.h5", {}, True),
        ("b.hdf5", {"format": 2}, True),
        ("c.h5", {"format": "cpfls/flight"}, False),
    ):
        with h5py.File(tmp_path / name, "w") as file:
            file.attrs.update(attributes)
        assert is_log(tmp_path / name) == is_one


def test_the_page_on_import_describes_every_format():
    page = (ROOT / "docs" / "import.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:-1] for line in page.splitlines() if line.startswith("|")]
    for form in LOG_FORMATS:
        (row,) = [row for row in rows if (f"`{form.suffix}`" if form.suffix else "none") in row[0]]
        assert form.name in row[1]
        assert (f'`pip install "cpfls[{form.extra}]"`' if form.extra else " ") in row[3]


def test_words():
    suffixes = ".csv, .csv.gz, .parquet, .ulg, .bin, .px4log, .log, .bbl, .bfl, Crazyflie uSD"
    suffixes += ", .bag, .db3, .mcap, .h5, .hdf5, .mat, .npz, .json or .jsonl"
    assert suffixes_in_words() == suffixes
    formats = "CSV, Parquet, ULog, ArduPilot DataFlash, PX4 sdlog2, Betaflight blackbox, Crazyflie uSD, ROS 1 bag"
    formats += ", ROS 2 bag, HDF5, MATLAB, NumPy, JSON"
    assert formats_in_words() == formats


def test_json_holds_columns_or_records_also_one_a_line(read):
    columns = {"": {"t": [0, 1], "imu/gyro_x": [1, np.nan], "imu/q[0]": [1, 3], "imu/q[1]": [2, 4]}}
    table = '{"t": [0, 1], "mode": "a", "imu": {"gyro_x": [1, null], "q": [[1, 2], [3, 4]]}}'
    records = ['{"t": 0, "mode": "a", "imu": {"gyro_x": 1, "q": [1, 2]}}', '{"t": 1, "imu": {"q": [3, 4]}}']
    for content, name in (
        (table, "log.json"),
        (f"[{','.join(records)}]", "log.json"),
        ("\n".join(records), "log.jsonl"),
        # A last line that was cut.
        ("\n".join([*records, '{"t": 2, "im']), "log.jsonl"),
    ):
        np.testing.assert_equal(listed(read(content, name)), columns)


@pytest.mark.parametrize(
    "content",
    [
        '[["t", "x"], [0, 1], [1, 3]]',
        # As pandas writes columns, and rows.
        '{"t": {"0": 0, "1": 1}, "x": {"0": 1, "1": 3}}',
        '{"0": {"t": 0, "x": 1}, "1": {"t": 1, "x": 3}}',
        '{"t": ["0", "1"], "x": ["1.0", "3"]}',
        '{"t": ["1970-01-01T00:00:00Z", "1970-01-01T00:00:01Z"], "x": [1, 3]}',
        '[{"t": "00:00:00", "x": "1", "mode": "a"}, {"t": "00:00:01", "x": "3", "mode": ""}]',
        # What parts lines elsewhere is text here.
        '{"t": 0, "x": 1, "mode": "a\u2028b"}\n{"t": 1, "x": 3}\n',
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_json_of_other_forms(tmp_path, content, encoding):
    (tmp_path / "log.json").write_text(content, encoding)
    columns = log_contents(tmp_path / "log.json").topics[""]
    np.testing.assert_equal({name: columns[name] for name in ("t", "x")}, {"t": [0, 1], "x": [1, 3]})


def test_what_is_no_number_in_a_list_of_json_is_missing_and_samples_are_along_the_longer_axis(read):
    huge = "9" * 5000
    columns = listed(read(f'{{"t": [0, 1, 2], "w": [1, "off", {huge}], "q": [[1, 2, 3], [4, 5, 6]]}}', "log.json"))[""]
    np.testing.assert_equal(columns, {"t": [0, 1, 2], "w": [1, np.nan, np.inf], "q[0]": [1, 2, 3], "q[1]": [4, 5, 6]})


def test_lists_of_records_in_json_keep_their_stamps(read):
    """A T next to them is no clock, a stamp that repeats costs its row, and between two turns lies no angle."""
    stamps = [0.01 * row for row in range(100)]
    imu = [{"T": 20 + row % 2, "time": stamp, "w": row} for row, stamp in enumerate(stamps)]
    imu[50]["time"] = imu[49]["time"]
    pose = [{"time": stamp + 0.005, "yaw": 179 if row < 50 else -179, "mode": "a"} for row, stamp in enumerate(stamps)]
    late = [{"time": 5 + stamp, "w": 0} for stamp in stamps]
    contents = read(json.dumps({"imu": imu, "pose": pose, "late": late}), "log.json")
    columns = contents.topics[""]
    assert names(contents) == ["time", "imu/T", "imu/w", "pose/yaw"]
    assert contents.warnings == ("of other stamps than most, or of none that rise, and left out: late/w",)
    np.testing.assert_allclose(columns["time"], [stamp + 0.005 for stamp in stamps])
    assert np.isfinite(columns["imu/w"]).sum() >= 98
    assert set(np.abs(columns["pose/yaw"])) == {179}


def test_lists_of_json_that_come_more_often_than_their_clock_are_named(read):
    groups = {
        "battery": [0.1 * row for row in range(100)],
        "imu": [0.01 * row for row in range(500)],
        "gps": [7 + 0.2 * row for row in range(10)],
    }
    contents = read(json.dumps({name: {"t": own, name: own} for name, own in groups.items()}), "log.json")
    assert len(contents.topics[""]["imu"]) == 100
    assert contents.warnings == ("come more often than the stamps that most meet, and are thinned: imu",)


def test_lists_of_json_with_stamps_each_are_laid_on_those_of_the_longest(read):
    """As a Crazyflie's client writes what comes in several packets, next to cameras of another clock."""
    late, slow = 1000 + 10 * np.arange(100) + 4, 1000 + 50 * np.arange(20)
    signals = {
        "imu.w_x": {"time": (late - 4).tolist(), "data": list(range(100))},
        "imu.w_z": {"time": late.tolist(), "data": (0.5 * late).tolist()},
        "motor.m1": {"time": slow.tolist(), "data": slow.tolist()},
    }
    cameras = {"time": list(range(9000, 9150)), "x": list(range(150)), "yaw": list(range(150))}
    contents = read(json.dumps({"drone": signals, "mocap": cameras, "end_time": 7}), "log.json")
    clock, *own = contents.topics[""].values()
    assert names(contents) == ["time", "drone/imu.w_x", "drone/imu.w_z", "drone/motor.m1"]
    np.testing.assert_array_equal(clock, late - 4)
    np.testing.assert_array_equal(own[0], range(100))
    # By the stamps, not by the rows.
    np.testing.assert_allclose(own[1][1:], 0.5 * clock[1:])
    assert np.flatnonzero(np.isfinite(own[2])).tolist() == list(range(0, 100, 5))
    assert contents.warnings == ("of other stamps than most, or of none that rise, and left out: mocap/x, mocap/yaw",)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ('{"mass": 0.8, "name": "a"}', r"holds no numbers over time: write lists of numbers by name"),
        ("[]", r"holds no numbers over time: "),
        ('{"t": [0, 1', r"cannot be read as JSON \(.*line 1 column 12.*\): damaged, cut short or not strict"),
        ('[{"t": 0},\n{"t": 1},\n{"t', r"cannot be read as JSON \(.*line 3 column 2.*\): damaged"),
        ('{"t": 0}\n{"t": 1}\nnone\n{"t": 3}', r"cannot be read as JSON \(line 3: Expecting value\): damaged"),
        (5000 * "[", r"is nested too deeply for a log: write lists"),
        ("t,x\n0,1\n", r"holds no JSON, .*; a table with a line of column names has to end in \.csv"),
        ("", r"an empty file: nothing was logged"),
    ],
)
def test_json_that_holds_no_log_is_refused(read, content, why):
    with pytest.raises(InputError, match=rf"log\.json: {why}"):
        read(content, "log.json")


def test_a_reader_and_its_package_are_loaded_only_when_used(tmp_path):
    (tmp_path / "log.csv").write_text("t,roll\n0,1\n1,2\n")
    code = (
        "import sys\n"
        "from pathlib import Path\n"
        "from cpfls_cli.logs.formats import read_log\n"
        "assert 'numpy' not in sys.modules\n"
        "from cpfls_cli.flightlog.settings import ImportSettings\n"
        f"print(read_log(Path({str(tmp_path / 'log.csv')!r}), ImportSettings()).columns['t'].tolist())\n"
        "assert not {'pyarrow', 'pyulog', 'cpfls_cli.logs.parquet_log', 'cpfls_cli.logs.ulog'} & sys.modules.keys()\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[0.0, 1.0]\n"


ROWS = [[0.0, 1.5, -2.0], [0.5, 2.5, 3e-3], [1.0, 3.5, 4.0]]


def _rows(separator, decimal="."):
    return "".join(separator.join(str(x).replace(".", decimal) for x in row) + "\n" for row in ROWS)


@pytest.mark.parametrize(
    "text",
    [
        "time,p,q\n" + _rows(","),
        "time;p;q\n" + _rows(";"),
        "time;p;q\n" + _rows(";", ","),
        "time\tp\tq\n" + _rows("\t", ","),
        "time p q\n" + _rows("  "),
        "# a flight, on a windy day\n// of 2024\ntime,p,q\n" + _rows(","),
        "# time,p,q\n" + _rows(","),
        "# time p q\n" + _rows(" "),
        "# a flight\n# time,p,q\n" + _rows(" "),
        "% time\tp\tq\n" + _rows("\t"),
        ("time,p,q\n" + _rows(",")).replace("\n", "\r\n"),
        "\ufefftime,p,q\n" + _rows(","),
    ],
    ids=lambda text: text[:12].replace("\n", " "),
)
def test_separators_decimal_commas_and_remarks(read, text):
    own = read(text)
    assert list(own.topics[""]) == ["time", "p", "q"]
    np.testing.assert_array_equal(np.column_stack(list(own.topics[""].values())), ROWS)


def test_names_in_a_remark_are_those_of_rows_with_some_words(read):
    """As `rostopic echo -p` writes messages."""
    own = read("%time,header.frame_id,child,pose.x,pose.y,pose.z\n1630747466824311984,world,cf2,0.5,-1,2e-3\n")
    assert own.topics[""]["pose.z"].tolist() == [2e-3]
    assert own.topics[""]["time"].tolist() == [1630747466824311984.0]
    assert own.warnings == ("columns that hold text are left out: child, header.frame_id",)
    # A remark of another length names nothing.
    own = read("# a flight\ntime,x\n1,2\n")
    assert list(own.topics[""]) == ["time", "x"]
    # Columns may be numbered below it.
    own = read("# indoor, quad, monday\ntime,0,1\n1,2,3\n")
    assert list(own.topics[""]) == ["time", "0", "1"]


def test_names_with_spaces_are_of_commas(read):
    own = read("time (us), gyroADC[0], vbat latest (V)\n1, 2, 3\n")
    assert list(own.topics[""]) == ["time (us)", "gyroADC[0]", "vbat latest (V)"]


@pytest.mark.parametrize(
    "first",
    [
        "2024-05-01T12:00:59.5Z",
        "2024-05-01 12:00:59.5 UTC",
        "2024-05-01 12:00:59.5",
        "2024/05/01 12:00:59.5",
        "12:00:59.5",
        "7:00:59.5",
    ],
)
def test_dates_and_times_of_day_are_stamps_in_seconds(read, first):
    second = first.replace("00:59.5", "01:00.75")
    own = read(f"time,p\n{first},1\n{second},2\n")
    assert own.units == {"time": "s"}
    assert np.diff(own.topics[""]["time"]) == pytest.approx(1.25)


def test_a_table_of_one_value_a_row_is_refused(read):
    with pytest.raises(InputError, match=r"log\.csv: holds one value a row, named by key: give each a column"):
        read("t,key,Value\n0.5,gyro_x,1\n0.5,gyro_y,2\n")


@pytest.mark.parametrize(("seconds", "parts"), [("stamp.sec", "stamp.nanosec"), ("secs", "nsecs")])
def test_nanoseconds_that_ros_counts_apart_are_added_to_their_seconds(tmp_path, seconds, parts):
    path = put_file(tmp_path / NAME, f"{seconds},{parts},p\n7,900000000,1\n8,100000000,2\n".encode())
    for own in (log_contents(path), log_contents(path, {seconds}), *log_flights(path)):
        assert own.topics[""][seconds] == pytest.approx([7.9, 8.1])
        assert own.units == {seconds: "s"}


@pytest.mark.parametrize("below", ["[s],[rad/s],[rad/s]\n", "True , True , True \n", "\n,,\n"])
def test_words_below_the_names_are_no_samples(read, below):
    contents = read(f"time,p,q\n{below}0,1,2\n0.5,3,4\n")
    assert listed(contents) == {"": {"time": [0.0, 0.5], "p": [1.0, 3.0], "q": [2.0, 4.0]}}


def test_words_in_two_rows_are_no_units(read):
    assert names(read("time,mode,note\nnever,hover,a\nnever,land,b\n0.5,1,2\n")) == []


def test_words_before_the_numbers_of_each_line_are_no_names(read):
    with pytest.raises(
        InputError, match=r"log\.csv: each line says what its numbers are \(time, Gyro\): leave the words"
    ):
        read("time; 0,02; Gyro; -0,1; 0,2; 0,0\ntime; 0,04; Gyro; -0,1; 0,3; 0,1\n")


def test_a_log_without_names_says_where_they_go(read):
    with pytest.raises(InputError, match=r"has no line of column names, line 1 holds 3 numbers: put a line above it"):
        read(_rows(","))
    with pytest.raises(InputError, match="line 1 holds 3 numbers"):
        read("1008.24,10901,acc.z,0.01\n1008.25,10902,acc.z,0.02\n")
    with pytest.raises(InputError, match="line 1 holds 3 numbers"):
        read("12:00:59.468,65535,74\n12:01:00.521,65535,62\n")
    with pytest.raises(InputError, match=r"line 1 holds 9 numbers: write a line for each sample, not for each signal"):
        read(f"{','.join(map(str, range(9)))}\n" * 4)
    with pytest.raises(InputError, match="line 1 holds 1 number: put"):
        read("0.5\n0.6\n")
    with pytest.raises(InputError, match=r"log\.csv:2: 3 fields, but 1 column names: line 1 has to name each column"):
        read("flight\n0.5,1,2\n0.6,2,3\n")
    # Columns may be numbered.
    assert [*read("time,0,1,2,3\n0.5,4,3,2,1\n0.6,5,4,3,2\n").topics[""]] == ["time", "0", "1", "2", "3"]


def test_a_column_that_is_empty_at_first_may_hold_words(read):
    own = read("time,mode,p\n0,,\n1,HOLD,\n2,HOLD,3\n")
    assert list(own.topics[""]) == ["time", "p"]
    np.testing.assert_array_equal(own.topics[""]["p"], [np.nan, np.nan, 3.0])


def test_a_last_line_that_was_cut_is_left_out_and_no_other_one(read):
    np.testing.assert_array_equal(read("time,p,q\n0,1,2\n1,2,3\n2,3").topics[""]["time"], [0.0, 1.0])
    with pytest.raises(InputError, match=r"log\.csv:3: 2 fields, but 3 column names: each row needs"):
        read("time,p,q\n0,1,2\n1,2\n2,3,4\n")


def test_lists_of_numbers_in_fields_are_columns(read):
    # As pandas writes arrays: Python's lists, NumPy's arrays over two lines, one that is absent, and a matrix.
    rows = '0,"[1.0, -2e-3]","[1. 2.\n 3. ]","[[1, 0], [0, 1]]",hover\n1,,"[4. 5. 6.]","[[0, 1], [1, 0]]",climb\n'
    own = read("t,p,w,R,mode\n" + rows)
    assert list(own.topics[""]) == [
        "t",
        *(f"{n}[{i}]" for n, size in (("p", 2), ("w", 3), ("R", 4)) for i in range(size)),
    ]
    values = np.column_stack(list(own.topics[""].values()))
    np.testing.assert_array_equal(values[0], [0, 1, -2e-3, 1, 2, 3, 1, 0, 0, 1])
    np.testing.assert_array_equal(values[1], [1, np.nan, np.nan, 4, 5, 6, 0, 1, 1, 0])


@pytest.mark.parametrize("odd", ['"[1, 2, 3]"', "[0]", "None", "nan", "5", "", "[WARN] hot", '"[1, None]"'])
def test_a_list_of_another_length_is_absent_and_moves_no_other_one(read, odd):
    own = read(f't,p,q\n0,"[1, 2]","[3, 4]"\n1,{odd},"[5, 6]"\n2,"[7, 8]",{odd}\n')
    values = np.column_stack(list(own.topics[""].values()))
    np.testing.assert_array_equal(values, [[0, 1, 2, 3, 4], [1, np.nan, np.nan, 5, 6], [2, 7, 8, np.nan, np.nan]])


@pytest.mark.parametrize(
    "words", ["[INFO] armed", "[2024-01-01 10:00:00]", '"[1, None]"', f'"[{", ".join(51 * "1")}]"']
)
def test_text_in_brackets_and_scans_are_no_columns(read, words):
    assert list(read(f"t,p\n0,{words}\n1,{words}\n").topics[""]) == ["t"]


def test_lists_between_numbers_with_decimal_commas_are_read(read):
    values = np.column_stack(list(read("t;p;q\n0,5;[1.5, 2.5];1,25\n1,5;[3.5, 4.5];1,5\n").topics[""].values()))
    np.testing.assert_array_equal(values, [[0.5, 1.5, 2.5, 1.25], [1.5, 3.5, 4.5, 1.5]])


def test_fields_in_quotes_may_hold_another_separator(read):
    np.testing.assert_array_equal(read('time,places,p\n0,"[1;2]",3\n1,"[2;3]",4\n').topics[""]["p"], [3.0, 4.0])


@pytest.mark.parametrize(
    ("name", "topic"),
    [
        ("11_02_33_vehicle_air_data_0.csv", "vehicle_air_data"),
        ("battery_status_1.csv.gz", "battery_status"),
        ("log_vehicle_attitude_setpoint_0.csv", "vehicle_attitude_setpoint"),
        ("test_vehicle_flight_1.csv", ""),
        ("vehicle_attitude.csv", ""),
        ("myvehicle_attitude_0.csv", ""),
    ],
)
def test_what_has_no_flight_and_the_name_of_a_topic_of_px4_is_called_so(name, topic):
    said = f"by its name {topic} alone, one topic of a log of PX4 as ulog2csv writes them: give the log .*: " * bool(
        topic
    )
    with pytest.raises(InputError, match=f"{name}: {said}no flight in it$"), about_flight(Path(name)):
        raise InputError("no flight in it")


def test_what_comes_behind_a_slash_names_a_clock_in_a_group_alone():
    time = np.linspace(0.0, 5.0, 500)
    assert LogTable({"": {"data/x": np.cos(time), "data/t": time}}, {}).time_column == "data/t"
    assert LogTable({"": {"gear deg/sec": 3 * time, "log_time": time}}, {}).time_column == "log_time"
    assert LogTable({"": {"imu.gx": np.cos(time), "imu.ts [s]": time}}, {}).time_column == "imu.ts [s]"
    assert LogTable({"": {"T[0]": time, "roll": np.cos(time), "T[1]": 3 * time}}, {}).time_column == "T[0]"


@pytest.mark.parametrize(
    ("text", "lines", "wrong"),
    [
        ("# remark\ntime,p\n0,1\n\n1,{}\n", [3, 5], 5),
        ('time,p,q\n0,1,"[1\n2]"\n1,2,"[3\n4]"\n2,{},"[5\n6]"\n', [2, 4, 6], 6),
    ],
    ids=["remarks and empty lines", "fields of several lines"],
)
def test_lines_are_counted_past_what_is_no_row(read, tmp_path, text, lines, wrong):
    assert row_lines(put_file(tmp_path / "log.csv", text.format(2))) == lines
    with pytest.raises(InputError, match=rf"log\.csv:{wrong}: column 'p' = 'x': not a number"):
        read(text.format("x"), wanted={"time", "p"})


AT = 1_683_108_000.0
"""2023-05-03 10:00 UTC."""


@pytest.fixture
def flown(read):
    return lambda name, content: read(content, name).flown_at


@pytest.mark.parametrize(("answer", "at"), [([0, 5], AT), ([0], None)])
def test_of_px4_by_its_receiver_once_that_knows(flown, answer, at):
    fields = {"sensor_gps": "uint64_t timestamp;uint64_t time_utc_usec"}
    rows = [
        ulogs.message("D", struct.pack("<HQQ", 0, ulogs.BEGIN + since * 10**6, int(AT + since) * 10**6 if since else 0))
        for since in answer
    ]
    begins = flown("log.ulg", ulogs.ulog([], fields) + b"".join(rows))
    assert begins == at if at else isnan(begins)


@pytest.mark.parametrize("names", [("TimeUS,GWk,GMS", "QHI"), ("TimeUS,Week,TimeMS", "QHI")])
def test_of_ardupilot_by_weeks_of_gps(flown, names):
    columns, letters = names
    # GPS counts leap seconds, 18 of them since it began.
    week, second = divmod(AT + 18 - 315_964_800, 604_800)
    rows = [("GPS", (1_000_000, 0, 0)), ("GPS", (3_000_000, int(week), int(1000 * (second + 2))))]
    assert flown("log.bin", dataflash({"GPS": (letters, columns)}, rows)) == pytest.approx(AT, abs=1e-5)


SAID = ["2023-05-03T10:00:00.000+00:00", "2023-05-03T12:00:00.000+02:00", "2023-05-03T10:00"]
UNSET = ["0000-01-01T00:00:00.000+00:00", "1970-01-01T00:00:00.000+00:00", "soon"]


@pytest.mark.parametrize(("said", "at"), [*((said, AT) for said in SAID), *((said, np.nan) for said in UNSET)])
def test_of_betaflight_by_its_header_unless_its_clock_was_never_set(flown, said, at):
    lines = blackbox_logs.header() + f"H Log start datetime:{said}\n".encode()
    frames = b"".join(blackbox_logs.frames(blackbox_logs.flight()))
    assert flown("log.bbl", lines + frames) == pytest.approx(at, abs=0, nan_ok=True)


def test_of_a_bag_by_the_recorder(tmp_path):
    sent = [("/imu/data", BEGIN_NS + 10**7 * row, imu(BEGIN_NS, (0, 0, 0), (0, 0, 9.8))) for row in range(3)]
    assert log_contents(write_bag(tmp_path / "bag", ".mcap", sent)).flown_at == pytest.approx(1e-9 * BEGIN_NS)


def test_of_a_table_by_nothing(flown):
    assert isnan(flown("log.csv", b"t,a\n0,1\n1,2\n"))


TIME = np.arange(5) * 0.02
RATE = np.arange(15.0).reshape(5, 3)


def hdf5(path, **options):
    with h5py.File(path, "w", **options) as file:
        file["t"] = (1e3 * TIME).astype("i8")
        file["t"].attrs["units"] = "ms"
        file["imu/rate"] = RATE.astype("f4")
        file["imu/rate"].attrs["unit"] = b"rad/s"
        file["imu/turned"] = RATE.T
        file["imu/row"] = TIME[None, :]
        file["imu/valid"] = TIME > 0.03
        file["imu/name"] = "a gyroscope"
        file["imu/mass"] = 0.5
        file["imu/images"] = np.zeros((5, 8, 8))
        file["imu/wide"] = np.zeros((500, 65))
        file["#refs#/a"] = TIME


def columns_of(contents):
    return {name: values.tolist() for name, values in contents.topics[""].items()}


@pytest.mark.parametrize("name", ["log.h5", "log.HDF5"])
def test_columns_of_hdf5_are_paths(tmp_path, name):
    hdf5(tmp_path / name)
    contents = log_contents(tmp_path / name)
    assert columns_of(contents) == (
        {"t": TIME.tolist(), "imu/row": TIME.tolist(), "imu/valid": [0, 0, 1, 1, 1]}
        | {f"imu/rate[{axis}]": RATE[:, axis].tolist() for axis in range(3)}
        | {f"imu/turned[{axis}]": RATE[:, axis].tolist() for axis in range(3)}
    )
    # Stamps that state their unit are in seconds.
    assert contents.units == {"t": "s"} | {f"imu/rate[{axis}]": "rad/s" for axis in range(3)}


def test_only_what_is_wanted_is_read(tmp_path):
    hdf5(tmp_path / "log.h5")
    columns = columns_of(log_contents(tmp_path / "log.h5", ["imu/rate[1]", "none"]))
    assert {name for name, values in columns.items() if values} == {f"imu/rate[{axis}]" for axis in range(3)}
    assert {"t", "imu/turned[0]"} <= columns.keys()


@pytest.mark.parametrize("version", ["4", "5"])
def test_columns_of_matlab_are_paths(tmp_path, version):
    data = {"t": TIME[:, None], "rate": RATE, "mass": 0.5}
    nested = (
        {}
        if version == "4"
        else {"log": {"imu": {"acc": RATE.T, "name": "a"}, "cells": np.array([1, "b"], dtype=object)}}
    )
    scipy.io.savemat(tmp_path / "log.mat", data | nested, format=version)
    expected = {"t": TIME.tolist()} | {f"rate[{axis}]": RATE[:, axis].tolist() for axis in range(3)}
    if version == "5":
        expected |= {f"log/imu/acc[{axis}]": RATE[:, axis].tolist() for axis in range(3)}
    assert columns_of(log_contents(tmp_path / "log.mat")) == expected


def test_structures_with_stamps_of_their_own_are_topics(read, tmp_path):
    fast, slow = 0.01 * np.arange(400.0), 0.1 * np.arange(40.0)
    data = {
        "att": {"time": fast, "roll": np.sin(fast)},
        "out": {"time_ms": 5e3 + 1e3 * slow, "c1": np.cos(slow)},
        # Two sensors in turn, with the stamps of one.
        "imu": {"time": np.repeat(fast, 2), "accX": np.zeros(800)},
    }
    contents = read(data, "log.mat")
    assert contents.warnings == ("of few rows, or without stamps that rise from row to row, and left out: imu",)
    assert {topic: list(fields) for topic, fields in contents.topics.items()} == {
        "att": ["timestamp", "roll"],
        "out": ["timestamp", "c1"],
    }
    np.testing.assert_allclose(contents.topics["out"]["timestamp"], 5 + slow)
    again = log_contents(tmp_path / "log.mat", {"att.roll", "out.c1"})
    np.testing.assert_array_equal(again.topics["att"]["roll"], np.sin(fast))
    # Names that no topic has are those of columns.
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.update({f"{group}.0/{name}": own for group in ("att", "out") for name, own in data[group].items()})
    assert set(log_contents(tmp_path / "log.h5").topics) == {""}
    # Groups of one length are on one clock, whose name says so.
    assert set(read({"att": data["att"], "more": {"time": fast, "x": fast}}, "log.mat").topics) == {""}


def test_stamps_of_structures_are_on_one_clock(read):
    own = flight(seconds=20.0)
    fast, x = 5000 + 0.01 * np.arange(6000.0), np.sin(np.arange(6000.0))
    data = {
        # Another clock under the name of the stamps of topics.
        "att": {"time": fast, "roll": x, "timestamp": 1e15 + 1e6 * fast},
        "imu": {"time": 1e3 * fast, "accX": x},
        # Seconds, whose steps are those of milliseconds.
        "bat": {"time": fast[::100], "v": x[::100]},
        "gps": {"time": fast[::200], "h": x[::200]},
        "baro": {"time": np.where(np.arange(3000) == 7, np.nan, fast[::2]), "p": x[::2]},
        # Whose first row is at no known time.
        "own": named(np.hstack([own.rate, own.angles]), "gyro_x", "gyro_y", "gyro_z", "roll", "pitch", "yaw"),
        "seq": {"number": 0.5 * np.arange(6000.0), "c1": x},
    }
    contents = read(data, "log.mat")
    assert contents.warnings[0].endswith("left out: own, seq")
    assert {topic: len(fields["timestamp"]) for topic, fields in contents.topics.items()} == {
        "att": 6000,
        "imu": 6000,
        "bat": 60,
        "gps": 30,
        "baro": 2999,
    }
    for fields in contents.topics.values():
        np.testing.assert_allclose(fields["timestamp"][[0, -1]], [5000, 5059.5], atol=1.6)
    assert list(contents.topics["att"]) == ["timestamp", "roll"]


def structure(time, values, label="", block="model/To Workspace"):
    return {"time": time[:, None], "signals": {"values": values, "label": label}, "blockName": block}


def test_what_simulink_logs_with_time_is_on_one_clock(read):
    time = np.arange(40) * 0.005
    several = np.array(
        [
            {"values": RATE[:5, :2], "label": "motors"},
            {"values": RATE[:5, :1], "label": "<p>"},
            {"values": RATE[:5, 1:2], "label": "<p>", "blockName": "model/pa"},
        ],
        dtype=object,
    )
    states = np.arange(480.0).reshape(40, 12)
    data = {
        "rt_estim": structure(time, states),
        "estimatedStates_rt": structure(time, states),
        "rt_yout": {"time": time[35:, None], "signals": several},
        "rt_u": structure(time[::10], np.arange(4.0)[:, None]),
        "gain": 2.0,
    }
    contents = read(data, "log.mat")
    columns = contents.topics[""]
    assert columns["time"].tolist() == time.tolist()
    assert contents.units == {"time": "s"}
    assert columns["rt_estim/gyro_x"].tolist() == states[:, 9].tolist()
    assert columns["rt_estim/yaw"].tolist() == columns["rt_estimatedStates/yaw"].tolist() == states[:, 3].tolist()
    nothing = [np.nan] * 35
    np.testing.assert_equal(columns["rt_yout/motors[1]"], [*nothing, *RATE[:, 1]])
    np.testing.assert_equal(columns["rt_yout/p"], [*nothing, *RATE[:, 0]])
    np.testing.assert_equal(columns["rt_yout/pa"], [*nothing, *RATE[:, 1]])
    known = np.isfinite(columns["rt_u"])
    assert np.flatnonzero(known).tolist() == [0, 10, 20, 30]
    assert columns["rt_u"][known].tolist() == [0, 1, 2, 3]
    assert contents.system == "Parrot minidrone"


def test_of_structures_only_those_with_time_are_laid_on_a_clock(read):
    """One without it, one that has only the names of such, a vector that is a column, and a time of the file's own."""
    time = np.arange(40) * 0.005
    upright = np.arange(120.0).reshape(3, 1, 40)
    data = {
        "time": np.arange(90.0),
        "own": {"time": time, "signals": {"gyro": time + 1.0}},
        "bare": {"time": [], "signals": {"values": time + 2.0, "label": ""}},
        "upright": structure(time, upright),
    }
    columns = read(data, "log.mat").topics[""]
    assert columns["time"].tolist() == data["time"].tolist()
    assert columns["upright/time"].tolist() == columns["own/time"].tolist() == time.tolist()
    assert columns["own/signals/gyro"].tolist() == (time + 1.0).tolist()
    assert columns["bare/signals/values"].tolist() == (time + 2.0).tolist()
    assert columns["upright[1]"].tolist() == upright[1, 0].tolist()


def test_zeros_that_fill_a_buffer_of_matlab_and_the_last_state_are_left_out(read):
    filled = np.concatenate([1.0 + np.arange(30.0), np.zeros(500)])
    columns = read({"timer": filled, "pos": np.outer([1.0, 0.0, 2.0], filled)}, "log.mat").topics[""]
    assert {len(values) for values in columns.values()} == {30}
    columns = read({"t": 1.0 + np.arange(30.0), "x": np.ones((3, 31))}, "log.mat").topics[""]
    assert {len(values) for values in columns.values()} == {30}


def test_of_as_good_names_the_clock_is_the_one_that_most_columns_are_as_long_as():
    columns = {"t": np.arange(900) * 0.01, "u": np.ones(900), "time": np.arange(600) * 0.005}
    log = LogTable({"": columns | {f"rate[{axis}]": np.ones(600) for axis in range(3)}}, {})
    assert log.time_column == "time"


def test_matlab_is_read_whatever_its_name_ends_in(tmp_path):
    scipy.io.savemat(tmp_path / "log.mat", {"t": TIME[:, None]})
    (tmp_path / "log.mat").rename(tmp_path / "log.h5")
    assert columns_of(log_contents(tmp_path / "log.h5")) == {"t": TIME.tolist()}


def test_matlab_of_version_7_3_is_hdf5_behind_a_line_of_text(tmp_path):
    path = tmp_path / "log.mat"
    hdf5(path, userblock_size=512)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    assert columns_of(log_contents(path))["imu/rate[2]"] == RATE[:, 2].tolist()


def test_what_keeps_hdf5_busy_for_ever(tmp_path, monkeypatch):
    hdf5(tmp_path / "log.h5")
    # As damage does, where HDF5 follows addresses in a circle.
    monkeypatch.setattr(matrices, "_PROBE", "while True: pass")
    monkeypatch.setattr(matrices, "longest_read_s", lambda _: 0.3)
    with pytest.raises(InputError, match=r"log\.h5: damaged: HDF5 did not finish reading it within"):
        log_contents(tmp_path / "log.h5")
    assert not matrices.is_log(tmp_path / "log.h5")


def test_a_file_without_columns(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["name"] = "nothing"
    with pytest.raises(InputError, match=r"log\.h5: holds no vectors or matrices of numbers: .* or what was is empty$"):
        log_contents(tmp_path / "log.h5")


def test_a_table_of_matlab_with_a_vector_and_alone(tmp_path):
    def element(kind: int, own: bytes) -> bytes:
        return struct.pack("<II", kind, len(own)) + own + bytes(-len(own) % 8)

    # An object of one of MATLAB's own classes: it has neither a shape nor a name of its own that SciPy reads.
    numbers = element(
        14,
        element(6, struct.pack("<II", 13, 0))
        + element(5, struct.pack("<ii", 2, 1))
        + element(1, b"")
        + element(6, struct.pack("<II", 1, 2)),
    )
    table = element(
        14,
        element(6, struct.pack("<II", 17, 0))
        + element(1, b"log")
        + element(1, b"MCOS")
        + element(1, b"table")
        + numbers,
    )
    scipy.io.savemat(tmp_path / "log.mat", {"gyro_x": np.arange(5.0)})
    with (tmp_path / "log.mat").open("ab") as file:
        file.write(table)
    assert list(log_contents(tmp_path / "log.mat").topics[""]) == ["gyro_x"]
    (tmp_path / "log.mat").write_bytes((tmp_path / "log.mat").read_bytes()[:128] + table)
    with pytest.raises(InputError, match=r"log\.mat: holds objects or tables, which MATLAB alone reads: save"):
        log_contents(tmp_path / "log.mat")


def test_an_object_of_matlab_in_hdf5_is_no_column(tmp_path):
    with h5py.File(tmp_path / "log.mat", "w") as file:
        # MATLAB leaves six numbers that point to where it keeps an object.
        file.create_dataset("run", data=np.arange(6, dtype=np.uint32)[None]).attrs["MATLAB_object_decode"] = 3
        file["#refs#/a"] = np.zeros((100, 3))
        file["#subsystem#/MCOS"] = np.zeros((1, 5))
    with pytest.raises(InputError, match=r"log\.mat: holds objects or tables, which MATLAB alone reads: save"):
        log_contents(tmp_path / "log.mat")
    with h5py.File(tmp_path / "log.mat", "a") as file:
        file["gyro_x"] = np.arange(20.0)
    assert list(log_contents(tmp_path / "log.mat").topics[""]) == ["gyro_x"]


def test_an_artifact_of_this_program_is_no_log(tmp_path):
    hdf5(tmp_path / "flight.h5")
    with h5py.File(tmp_path / "flight.h5", "a") as file:
        file.attrs["format"] = "cpfls/flight"
    with pytest.raises(InputError, match=r"flight\.h5: is an artifact of this program \(cpfls/flight\), not a log"):
        log_contents(tmp_path / "flight.h5")


def test_a_file_that_states_more_than_memory_may_hold_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_PLAIN", 1 << 20)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("t", (10**9,), "f8", chunks=(1 << 16,))
    scipy.io.savemat(tmp_path / "log.mat", {"t": np.zeros(3 << 20)}, do_compression=True)
    with pytest.raises(InputError, match=r"log\.h5: claims 8 GB of numbers, far more"):
        log_contents(tmp_path / "log.h5")
    np.savez_compressed(tmp_path / "log.npz", t=np.zeros(3 << 20))
    for name in ("log.mat", "log.npz"):
        with pytest.raises(InputError, match=r"holds more than .* GB of numbers in .* MB: damaged, or not a log"):
            log_contents(tmp_path / name)


def archive(**members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as packed:
        for name, content in members.items():
            packed.writestr(name.replace("_", "/", 1).replace("__", "."), content)
    return stream.getvalue()


def tape():
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as packed:
        packed.addfile(tarfile.TarInfo("log.bin"), io.BytesIO())
    return stream.getvalue()


def array():
    stream = io.BytesIO()
    np.save(stream, np.zeros(3))
    return stream.getvalue()


TELEMETRY = b"".join(struct.pack(">Q", 14 * 10**14 + 10**5 * i) + b"\xfe\x09" + bytes(15) for i in range(9))


@pytest.mark.parametrize(
    ("name", "content", "what", "way"),
    [
        ("a.bin", bytes(999), "a file that begins with zeros", "take it from the device again"),
        ("a.tlog", TELEMETRY, "telemetry of MAVLink", "the log that the autopilot writes itself"),
        ("a.bin", TELEMETRY, "telemetry of MAVLink", "the log that the autopilot writes itself"),
        ("a.rlog", TELEMETRY[8:], "telemetry of MAVLink", "the log that the autopilot writes itself"),
        ("a.zip", archive(a="x"), "a zip archive", "unpack it first"),
        ("a.ulg", archive(a="x"), "a zip archive", "unpack it first"),
        ("a.bin.gz", b"\x1f\x8b\x08" + bytes(9), "data compressed by gzip", "unpack it first"),
        ("a.tar", tape(), "a tar archive", "unpack it first"),
        ("a.xlsx", archive(xl_book="x"), "a spreadsheet", "save its table as CSV"),
        ("a.npy", array(), "an array of NumPy", "a name for each column"),
        ("a.zip", archive(log_t__npy="x"), "arrays of NumPy", "let its name end in .npz"),
        ("a.txt", b"\n  _Vind,_kias |  pitch,__deg | _roll,__deg |\n", "text whose columns are parted by |", "as CSV"),
        (
            "a.csv",
            "\ufeffTime (s),ESC signal (\u00b5s),Thrust (N)\n".encode(),
            "a log of a thrust stand",
            "of a flight",
        ),
        ("a.txt", b"0+0i\t-0.5+0i\t1e-3-2i\n0+0i\t0+0i\t1+0i\n", "a table of numbers without names", "names each"),
        ("a.ulg", b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS", "git lfs pull"),
        ("a.DAT", bytes(16) + b"BUILD 2019", "a .DAT of DJI", "to CSV"),
        ("a.gpx", b'<?xml version="1.0"?>\n<gpx version="1.1">', "a GPX track", "log of the autopilot"),
        ("a.kml", b"<kml>", "a KML track", "log of the autopilot"),
        ("a.csv", b"<!DOCTYPE html>\n<html>a,b", "a web page", "save the log itself"),
        ("a.csv", b'{"t": 1,\n', "JSON", "let its name end in .json"),
        ("a.log", b"[2024-06-13 11:56:33.1] [0x7f] Time [s], x [m]\n", "text with a stamp before each line", "as CSV"),
        ("a.log", b"2025-08-14 15:48:34,661 - INFO - Position: x=2, y=0\n", "text with a stamp before each", "as CSV"),
        ("a.csv", b"2025-08-14 15:48:34.661 DEBUG: x=2,y=0\n", "text with a stamp before each line", "as CSV"),
        (
            "a.csv",
            b"Date,Time,1RSS(dB),Alt(m),Alt(m)\n",
            "telemetry that a radio logs",
            "log that the flight controller",
        ),
        ("a.log", b"#DroneDeploy\t2.7\n", "a log of an app", "the log that the autopilot writes"),
        ("a.txt", b'[{"t": 1}]', "JSON", "let its name end in .json"),
        ("a.txt", b'{"note": "kp: 1, ki: 2, kd: 3", "t": [0, 1]}', "JSON", "let its name end in .json"),
        (
            "a.csv",
            b"layout:\n  dim: []\ndata:\n- 0.5\n- 0.25\n---\nlayout:\n",
            "YAML, as `ros2 topic echo`",
            "ros2 bag record",
        ),
        ("a.yaml", b"time: 1.5\r\nroll: 0.1\r\n---\r\ntime: 1.6\r\n", "YAML, as `ros2 topic echo`", "ros2 bag record"),
        ("a.data", b"0.5 12 IMU_GYRO 0.1 0.2 0.3\n", "a log of Paparazzi", "write its numbers as CSV"),
        ("a.txt", b"0.5 12 -0.1 1e-3 0.3\n0.6 12 0 0 0\n", "a table of numbers without names", "names each column"),
        (
            "a.txt",
            b"0,11,88,0,058,0\n0,02,11,9,0,058,0\n",
            "a table whose rows have different numbers of commas",
            "write points",
        ),
        ("a.log", b"1,2,3,4,\r\n", "a table of numbers without names", "let its name end in .csv"),
        (
            "a.dat",
            b"# rows: 2\n# columns: 2\n 1.5 0\n 1.6 1\n",
            "a table of numbers without names",
            "names each column",
        ),
        (
            "a.txt",
            b"# t roll pitch\n0.1 2 3\n0.2 2 3\n",
            "a table whose names stand in a remark",
            "let its name end in",
        ),
        ("a.txt", b"Today\n\nax |ay|az|\n+0.1 |-0.2|+9.6|\n", "text whose columns are parted by |", "as CSV"),
        ("a.pkl", b"(lp0\n(dp1\nS'ps'\n", "a pickle of Python", "save its numbers"),
        ("a.dat", 999 * b"0.25 ", "a table of numbers without names", "let its name end in .csv"),
        ("a.dat", b"12.1 -0.5\n12.2 0.25\n", "a table of numbers without names", "names each column"),
        ("a.dat", b"12.1 -0.5 1\n12.2 0.25 1\n", "a table of numbers without names", "names each column"),
        ("a.txt", b"\n(0.5, -1.0, 1000, 1)\n(0.4, -1e-3, 1000, 1)\n", "a table of numbers without names", "brackets"),
        ("a.txt", 99 * b"(0.5, -1.0, 1000, 0.25)\n", "a table of numbers without names", "names each column"),
        (
            "a.txt",
            b"Thr= 31\tMODE A \t Roll= -2.5\t Pitch= 0.1 M1= 1038\n",
            "text that names each number",
            "write its numbers as CSV",
        ),
        ("a.log", b"t:0.1, x:2e-3, y: 3\n", "text that names each number in each line", "write its numbers as CSV"),
        ("a.txt", b"1357298 [info] link: ok batt: 0.94 yaw:89.5 z:0.2\n", "text that names each number", "as CSV"),
        ("a.txt", b"Stamp: 9.5, Place: (9.5, -8, 1e3), Angles: (1, -2, 3)\n", "text that names each number", "as CSV"),
        ("a.pkl", b"\x80\x04\x95\xb6\0", "a pickle of Python", "as .npz or CSV, with a name for each column"),
        ("a.bin", b"", "an empty file", "the copy failed"),
        ("a.log", b"", "an empty file", "the copy failed"),
        ("a.ulg", b"", "an empty file", "the copy failed"),
        ("a.pdf", b"%PDF-1.4", "a PDF", "the log that it shows"),
        ("a.jpg", b"\xff\xd8\xff\xe0", "a picture", "the log that it shows"),
    ],
)
def test_a_file_that_is_no_log_is_named_with_the_way_to_one(tmp_path, name, content, what, way):
    path = put_file(tmp_path / name, content)
    with pytest.raises(InputError) as caught:
        log_contents(path)
    said = str(caught.value)
    assert said.startswith(f"{path}: {what}")
    assert way in said


@pytest.mark.parametrize("begins", [b"1, 2, 3, ", b"x= 1, y= 2", b"1 2", b"(1, 2, 3)", b"1\t, 2", 300 * b"1 "])
def test_what_begins_as_numbers_and_goes_on_otherwise_is_said_at_once(tmp_path, begins):
    """Some of these took four seconds and more."""
    path = put_file(tmp_path / "a.txt", begins.ljust(1000) + b"?")
    begun = time.process_time()
    assert foreign_file(path) is None
    assert time.process_time() - begun < 0.5


@pytest.mark.parametrize("line", ["t,x\n0,1\n", "2025-08-14 15:48:34.1,0.1\n", "2025-08-14 15:48:34 UTC,0.1\n"])
def test_a_log_is_no_foreign_file(tmp_path, line):
    assert foreign_file(put_file(tmp_path / "a.csv", line)) is None


def test_numbers_with_names_in_a_remark_are_none_of_each_line(tmp_path):
    assert foreign_file(put_file(tmp_path / "a.dat", "# mass: 1, arm: 0.2, cells: 4\nt,x\n0,1\n")) is None
