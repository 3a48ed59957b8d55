"""Logs in CSV, and what an import says of them."""

import gzip
import json
import re

import h5py
import numpy as np
import pytest

from cpfls_cli.flightlog.smoothing import low_pass
from cpfls_cli.rotations import body_rate
from tests.builders.studies import VEHICLE, put_file

NAMES = ["t", "roll", "pitch", "yaw", "mx", "my", "mz"]
FIELDS = "each row needs one field for each column name; a field that holds a separator needs quotes"
NOISE = np.random.default_rng(5).standard_normal((2000, 10))


def rows():
    time = np.arange(0.0, 4.0, 0.02)
    angles = [0.2 * np.sin((2 + axis) * time) for axis in range(3)]
    return np.column_stack([time, *angles, *[0.1 * np.cos((3 + axis) * time) for axis in range(3)]])


def table():
    lines = [",".join(NAMES), *(",".join(f"{value:.9g}" for value in row) for row in rows())]
    return "\n".join(lines) + "\n"


@pytest.fixture
def write(tmp_path):
    def call(content, name="log.csv"):
        return put_file(tmp_path / name, content if isinstance(content, bytes) else content.encode())

    return call


@pytest.fixture
def wrong(refuse, log_study, write, tmp_path):
    def call(content, name="log.csv", *words):
        log = write(content, name)
        lines = refuse("import", log_study, log, "-o", tmp_path / "flight.h5", *words)
        return [line.replace(str(log), "LOG") for line in lines]

    return call


def test_a_log_of_another_tool_is_listed_once_and_shortened(wrong):
    """Eighty columns, six of them missing: nearest names where there are any, three at most."""
    names = ["time", "state.roll", "state.pitch", "state.yaw", "roll_cmd", "roll_ref", "roll_std"]
    names += [f"debug_{number}" for number in range(73)]
    lines = wrong(",".join(names) + "\n" + ",".join("0" * len(names)) + "\n")
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
        ("t,t,pitch\n0,1,2\n", "LOG: column 't' appears twice: map t[0] or the next"),
        (",".join(NAMES) + "\n0,0,0,0,0,0,0\n1,0,0\n", f"LOG:3: 3 fields, but 7 column names: {FIELDS}"),
        (",".join(NAMES) + "\n0,0,0,0,0,0,0,0\n", f"LOG:2: 8 fields, but 7 column names: {FIELDS}"),
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


def test_one_value_that_no_flight_has_is_missing_and_said(cpfls, log_study, write, tmp_path):
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


TIME = np.arange(0.0, 4.0, 0.02)
SIGNALS = {
    "attitude": "attitude: {columns: [roll, pitch, yaw], unit: rad}",
    "body_rate": "body_rate: {columns: [p, q, r], unit: rad/s}",
    "body_torque": "body_torque: {columns: [mx, my, mz], unit: N m}",
    "rotor_command": "rotor_command: {columns: [u1, u2, u3, u4], unit: '1'}",
    "rotor_speed": "rotor_speed: {columns: [w1, w2, w3, w4], unit: rad/s}",
}
NO_ATTITUDE = "the flight has no attitude, so reduce and identify will refuse it: map one with import.signals."
NO_ROTATION = "the flight has neither attitude nor body rates: only the balance of its rotors"
NO_TORQUE = "the flight has no torque, so identify will refuse it: map one with import.signals.body_torque"

TORQUE_OPEN = "the flight has rotors and no torque: cpfls vehicle and replay take it as it is; identify will refuse it"


@pytest.fixture
def imported(cpfls, tmp_path):
    """Import a made-up log with some of its signals; give lines, notes and the flight."""

    def call(*signals, source="null"):
        names = ["t", "roll", "pitch", "yaw", "p", "q", "r", "mx", "my", "mz", "u1", "u2", "u3", "u4"]
        names += ["w1", "w2", "w3", "w4"]
        waves = [0.1 * np.sin((2 + number % 3) * TIME) for number in range(9)]
        commands = [0.5 + waves[wave] for wave in range(4)]
        rows = np.column_stack([TIME, *waves, *commands, *(700.0 * command for command in commands)])
        log, config, flight = (tmp_path / name for name in ("log.csv", "study.yaml", "flight.h5"))
        np.savetxt(log, rows, delimiter=",", header=",".join(names), comments="")
        mapped = ", ".join(SIGNALS[signal] for signal in signals)
        config.write_text(f"import: {{signals: {{{mapped}}}, torque_source: {source}}}\n{VEHICLE}")
        result = cpfls.done("import", config, log, "-o", flight, "--force", "-v")
        begin = "cpfls: note: "
        notes = [line.removeprefix(begin) for line in result.stderr.splitlines() if line.startswith(begin)]
        return result.stdout.splitlines(), notes, flight

    return call


@pytest.mark.parametrize(
    ("signals", "source", "wanted"),
    [
        (("body_rate",), "null", [NO_ATTITUDE, NO_TORQUE]),
        (("body_rate", "body_torque"), "column", [NO_ATTITUDE]),
        (("rotor_command",), "null", [NO_ATTITUDE, NO_ROTATION, TORQUE_OPEN]),
        (("attitude", "rotor_speed"), "null", [TORQUE_OPEN]),
        (("attitude",), "null", [NO_TORQUE]),
        (("attitude", "body_torque"), "column", []),
        (("attitude", "rotor_command"), "rotor-command", []),
    ],
)
def test_what_later_stages_will_miss_is_said_and_kept(cpfls, imported, signals, source, wanted):
    _, notes, flight = imported(*signals, source=source)
    assert [note[: len(start)] for note, start in zip(notes, wanted, strict=True)] == wanted
    assert all(note.endswith("cpfls vehicle and replay need rotors instead") for note in notes if NO_TORQUE in note)
    assert [f"cpfls: note: {note}" for note in notes] == cpfls("info", flight, "-v").stderr.splitlines()


@pytest.mark.parametrize("rotors", ["rotor_speed", "rotor_command"])
def test_identify_says_how_rotors_give_the_torque_that_it_lacks(cpfls, imported, refuse, tmp_path, rotors):
    _, _, flight = imported("attitude", rotors)
    config, out = tmp_path / "study.yaml", tmp_path / "out.h5"
    (message,) = refuse("identify", config, flight, "-o", out)
    remedy = re.search(r"--set (import.torque_source=\S+),", message).group(1)
    cpfls.done("import", config, tmp_path / "log.csv", "-o", flight, "--force", "--set", remedy)
    cpfls.done("identify", config, flight, "-o", out, "--set", "identification={population: 4, generations: 1}")


def test_commands_are_shares_of_the_largest_speed_and_it_says_so(imported):
    lines, _, flight = imported("attitude", "rotor_command", source="rotor-command")
    assert "body torque: of vehicle.rotors, speed = command * vehicle.rotor_speed_max_rad_s (1000 rad/s)" in lines
    with h5py.File(flight) as file:
        speed, torque = 1000 * file["rotor_command"][:], file["body_torque"][:]
    # The default vehicle: rotor 2 stands on the right of the body and rotor 4 on its left, at 0.3 m.
    expected = 0.3 * 121.5e-6 * (speed[:, 3] ** 2 - speed[:, 1] ** 2)
    np.testing.assert_allclose(torque[:, 0], expected, rtol=1e-9, atol=1e-12)


def test_measured_speeds_are_named_and_a_column_needs_no_words(imported):
    lines, _, _ = imported("attitude", "rotor_speed", source="rotor-speed")
    assert "body torque: of vehicle.rotors at their measured speeds" in lines
    lines, _, _ = imported("attitude", "body_torque", source="column")
    assert not any("body torque" in line for line in lines)


@pytest.fixture
def notes_of(cpfls, tmp_path):
    """Import a log of forty seconds at 50 Hz with some columns replaced; give its notes and the flight."""
    time = np.arange(2000) / 50
    signals = ("attitude", "body_rate", "rotor_command")

    def call(*words, **changes):
        angles = {name: -0.3 * np.cos((1 + i) * time) / (1 + i) for i, name in enumerate(("roll", "pitch", "yaw"))}
        attitude, slopes = np.column_stack(list(angles.values())), 0.3 * np.sin(np.outer(time, [1, 2, 3]))
        motion = dict(zip("pqr", (body_rate(attitude, slopes) + 0.02 * NOISE[:, :3]).T, strict=True))
        rotors = {f"u{i}": 0.5 + 0.05 * NOISE[:, 5 + i] for i in range(1, 5)}
        columns = {"t": time} | angles | motion | rotors | changes
        log, config, flight = (tmp_path / name for name in ("log.csv", "study.yaml", "flight.h5"))
        table = np.column_stack(list(columns.values()))
        np.savetxt(log, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
        mapped = ", ".join(SIGNALS[signal] for signal in signals)
        config.write_text(f"import: {{signals: {{{mapped}}}, torque_source: rotor-command}}\n{VEHICLE}")
        result = cpfls.done("import", config, log, "-o", flight, "--force", "-v", *words)
        return [line for line in result.stderr.splitlines() if line.startswith("cpfls: note: ")], flight

    return call


def test_a_good_log_has_no_notes(notes_of):
    notes, flight = notes_of()
    assert notes == []
    with h5py.File(flight) as file:
        assert "quality" not in file


def test_motors_slower_than_the_log_are_said(notes_of):
    (note,), _ = notes_of(**{f"u{i}": np.repeat(0.5 + 0.05 * NOISE[:400, i], 5) for i in range(1, 5)})
    assert note.startswith("cpfls: note: rotor_command is updated 10 times a second, but the log has 50 rows a second:")


def test_motors_on_the_ground_are_said_and_the_crop_that_is_named_mends_it(notes_of):
    grounded = {f"u{i}": np.r_[np.full(200, -0.1), 0.5 + 0.05 * NOISE[200:, i]] for i in range(1, 5)}
    (rest, below), _ = notes_of(**grounded)
    assert "rotor_command stands at -0.1 on all rotors from 0.00 s to 3.98 s" in rest
    assert "rotor_command is below zero in 200 of 2000 rows" in below
    crop = rest[rest.index("import.crop_s: ") :].partition(" keeps")[0].replace(": ", "=").replace(" ", "")
    assert notes_of("--set", crop, **grounded)[0] == []


def test_a_dead_and_a_clipped_column_are_said_by_name(notes_of):
    clipped = np.clip(1.6 * np.sin(2 * np.arange(2000) / 50) + 0.02 * NOISE[:, 1], -2, 1.3)
    notes, _ = notes_of(u3=np.full(2000, 0.4), q=clipped, pitch=-0.8 * np.cos(2 * np.arange(2000) / 50))
    assert any("column u3 of import.signals.rotor_command does not change in 2000 rows: dead" in note for note in notes)
    assert any("column q stays at its extreme" in note for note in notes)


def test_a_filter_before_the_log_is_said_and_its_cut_off_is_kept(notes_of):
    notes, flight = notes_of(**dict(zip("pqr", low_pass(0.3 * NOISE[:, :3] + 0.3, 50.0, 12.0, 4).T, strict=True)))
    assert "the spectrum drops sharply: body_rate at about 12 Hz; low-passed before logging" in notes[0]
    with h5py.File(flight) as file:
        assert list(file["cut_off_hz/name"].asstr()) == ["body_rate"]
        assert file["cut_off_hz/value"][0] == pytest.approx(12.0, rel=0.1)
