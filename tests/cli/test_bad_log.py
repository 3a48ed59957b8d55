"""Logs in CSV: good ones of every dialect, and wrong ones with a message that names file, row and column."""

import gzip
import json

import h5py
import numpy as np
import pytest

from tests.builders.studies import VEHICLE

NAMES = ["t", "roll", "pitch", "yaw", "mx", "my", "mz"]


def rows():
    time = np.arange(0.0, 4.0, 0.02)
    angles = [0.2 * np.sin((2 + axis) * time) for axis in range(3)]
    torques = [0.1 * np.cos((3 + axis) * time) for axis in range(3)]
    return np.column_stack([time, *angles, *torques])


def table(delimiter=",", names=NAMES):
    lines = [delimiter.join(names), *(delimiter.join(f"{value:.9g}" for value in row) for row in rows())]
    return "\n".join(lines) + "\n"


@pytest.fixture
def write(tmp_path):
    def call(content, name="log.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return call


@pytest.fixture
def wrong(refuse, log_study, write, tmp_path):
    def call(content, name="log.csv", *words):
        log = write(content, name)
        lines = refuse("import", log_study, log, "-o", tmp_path / "flight.h5", *words)
        return [line.replace(str(log), "LOG") for line in lines]

    return call


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (table(), "log.csv"),
        (table(";"), "log.csv"),
        (table("\t"), "log.csv"),
        (table().replace("\n", "\r\n"), "log.csv"),
        ("\ufeff" + table(), "log.csv"),
        (gzip.compress(table().encode()), "log.csv.gz"),
    ],
    ids=["comma", "semicolon", "tab", "crlf", "bom", "gzip"],
)
def test_every_dialect_gives_the_same_flight(cpfls, log_study, write, tmp_path, content, name):
    flight = tmp_path / "flight.h5"
    summary = cpfls.told("import", log_study, write(content, name), "-o", flight)
    assert summary["samples"] == 200
    assert not any(summary["dropped"].values())
    assert summary["rate_hz"] == pytest.approx(50.0)
    with h5py.File(flight) as file:
        np.testing.assert_allclose(file["attitude"], rows()[:, 1:4], atol=1e-8)
        np.testing.assert_allclose(file["body_torque"], rows()[:, 4:], atol=1e-8)
        assert file["inputs/log"].attrs["name"] == name
        assert file["inputs/log"].attrs["format"] == name.rsplit(".", 1)[-1]


def test_a_log_of_another_tool_is_listed_once_and_shortened(wrong):
    """Eighty columns, six of them missing: nearest names where there are any, three at most."""
    names = ["time", "state.roll", "state.pitch", "state.yaw", "roll_cmd", "roll_ref", "roll_std"]
    names += [f"debug_{number}" for number in range(73)]
    content = ",".join(names) + "\n" + ",".join("0" * len(names)) + "\n"
    lines = wrong(content)
    assert len(lines) == 8
    assert lines[1].endswith("no column 'roll' (nearest: state.roll, roll_std, roll_ref)")
    assert lines[2].endswith("no column 'pitch' (nearest: state.pitch)")
    assert lines[4].endswith("no column 'mx'")
    assert lines[-1].startswith("LOG: import.signals: the log has the columns time, state.roll, ")
    assert "debug_12 and 60 more; `cpfls init LOG` proposes" in lines[-1]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "LOG: is empty; a log starts with a line of column names"),
        ("\n\n", "LOG: is empty; a log starts with a line of column names"),
        (",".join(NAMES) + "\n", "LOG: holds column names but no samples"),
        ("t,t,pitch\n0,1,2\n", "LOG: column 't' appears twice"),
        (",".join(NAMES) + "\n0,0,0,0,0,0,0\n1,0,0\n", "LOG:3: 3 fields, but 7 column names"),
        (",".join(NAMES) + "\n0,0,0,0,0,0,0,0\n", "LOG:2: 8 fields, but 7 column names"),
        (",".join(NAMES) + "\n0,0,up,0,0,0,0\n", "LOG:2: column 'pitch' = 'up': not a number"),
        (",".join(NAMES) + "\n0,0,\x00,0,0,0,0\n", "LOG:2: column 'pitch' = '\\x00': not a number"),
        (",".join(NAMES) + "\n0,0,1_000,0,0,0,0\n", "LOG:2: column 'pitch' = '1_000': not a number"),
        (",".join(NAMES) + "\n0,0,\uff11,0,0,0,0\n", "LOG:2: column 'pitch' = '\uff11': not a number"),
        (";".join(NAMES) + "\n0;0.5;0;0;0;0;0\n1;0,5;0;0;0;0;0\n", "LOG:3: column 'roll' = '0,5': not a number"),
    ],
)
def test_wrong_table(wrong, content, message):
    assert wrong(content) == [message]


def changed(column, value, row=slice(None)):
    """Write a log in which values of one column are others."""
    lines = [line.split(",") for line in table().splitlines()]
    for line in lines[1:][row]:
        line[NAMES.index(column)] = value
    return "\n".join(",".join(line) for line in lines) + "\n"


def test_one_value_that_no_flight_has_is_missing_and_told(cpfls, log_study, write, tmp_path):
    flight = tmp_path / "flight.h5"
    result = cpfls.done("import", log_study, write(changed("mx", "1e308", slice(40, 41))), "-o", flight, "--json")
    assert json.loads(result.stdout)["missing"] == {"mx": 1}
    assert (
        "body_torque: column 'mx' holds 1 of 200 values that no flight has, the first 1e+308 in row 41 "
        "(beyond 1e+06 N m): taken as missing"
    ) in result.stderr
    cpfls.done("check", flight)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (changed("my", "9e18"), "import.signals.body_torque: column 'my' holds 200 of 200 values that no flight has"),
        (changed("t", "0"), "the log has fewer than two rows with increasing time stamps"),
        (
            "\n".join([",".join(NAMES), *(f"{4e-12 * row},0,0,0,0,0,0" for row in range(50))]) + "\n",
            "import.time_column: the median step is 4e-12 s in 1.96e-10 s of 50 rows, which no log has",
        ),
    ],
)
def test_values_that_no_flight_has_are_refused(wrong, content, message):
    (line,) = wrong(content)
    assert line.startswith(f"LOG: {message}")


QUATERNIONS = """\
import:
  time_column: t
  signals:
    quaternion: {columns: [qw, qx, qy, qz], unit: "1"}
  torque_source: null
"""


@pytest.mark.parametrize("zeros", [slice(0, 3), slice(60, 64)])
def test_quaternions_without_a_length_are_missing(cpfls, log_study, write, tmp_path, zeros):
    log_study.write_text(QUATERNIONS + VEHICLE)
    turn = np.arange(200) / 200
    values = np.column_stack([0.02 * np.arange(200), np.cos(turn), 0 * turn, 0 * turn, np.sin(turn)])
    values[zeros, 1:] = 0.0
    lines = "\n".join(",".join(map(str, row)) for row in values)
    flight = tmp_path / "flight.h5"
    result = cpfls.done("import", log_study, write("t,qw,qx,qy,qz\n" + lines + "\n"), "-o", flight)
    rows = zeros.stop - zeros.start
    assert f"quaternion: {rows} rows are 0 0 0 0, not an attitude: taken as missing" in result.stderr
    with h5py.File(flight) as file:
        first = 0 if zeros.start else rows
        np.testing.assert_allclose(file["attitude"][:, 2], 2 * turn[first:], atol=1e-3)


@pytest.mark.parametrize(
    "content", [b"\x89HDF\r\n\x1a\n" + bytes(range(256)), table().encode("utf-16"), b"t," + b"x" * 200_000]
)
def test_binary_junk(wrong, content):
    (line,) = wrong(content)
    assert line.startswith("LOG: not a CSV file: ")


@pytest.mark.parametrize(
    "content",
    [b"t,roll\n0,1\n", gzip.compress(table().encode())[:-40], gzip.compress(table().encode())[:200] + b"junk" * 50],
    ids=["plain text", "truncated", "corrupt"],
)
def test_corrupt_gzip(wrong, content):
    (line,) = wrong(content, "log.csv.gz")
    assert line.startswith("LOG: ")


def test_config_without_signals(refuse, study, write, tmp_path):
    log = write(table())
    (line,) = refuse("import", study, log, "-o", tmp_path / "flight.h5")
    assert line.startswith(f"{log}: import.signals: no signal is mapped")


@pytest.mark.parametrize("dry_run", [(), ("--dry-run",)])
@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("lowpass_hz", "25.0", "is not below half of the log's rate, 25 Hz"),
        ("delay_s", "100.0", "longer than the flight, 3.98 s"),
        ("rate_hz", "1000000000000.0", "does not suit 3.98 s of flight at 50 Hz"),
        ("rate_hz", "0.001", "does not suit 3.98 s of flight at 50 Hz"),
        ("crop_s", "[5.0, 9.0]", "leaves 0 rows of a log of 3.98 s"),
        ("delay_max_s", "3.5", "too long to estimate a delay on"),
    ],
)
def test_a_key_that_does_not_suit_the_log_is_named(wrong, key, value, message, dry_run):
    estimate = ("--set", "import.delay_s=estimate") if key == "delay_max_s" else ()
    (line,) = wrong(table(), "log.csv", "--set", f"import.{key}={value}", *estimate, *dry_run)
    assert line.startswith(f"LOG: import.{key} = ")
    assert f": {message}" in line


def test_a_header_without_an_end(wrong):
    (line,) = wrong(gzip.compress(b"a" * (1 << 21)), "log.csv.gz")
    assert line == "LOG: not a CSV file: its first line, the column names, does not end"
