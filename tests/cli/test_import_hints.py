"""What an import says of a log beyond its values: what later stages will miss, and what the torque was made of."""

import h5py
import numpy as np
import pytest

from cpfls_cli.flightlog.smoothing import low_pass
from cpfls_cli.rotations import body_rate
from tests.builders.studies import VEHICLE

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
    again = cpfls("info", flight, "-v").stderr.splitlines()
    assert [f"cpfls: note: {note}" for note in notes] == again


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


NOISE = np.random.default_rng(5).standard_normal((2000, 10))


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
    filtered = low_pass(0.3 * NOISE[:, :3] + 0.3, 50.0, 12.0, 4)
    notes, flight = notes_of(**dict(zip("pqr", filtered.T, strict=True)))
    assert "the spectrum drops sharply: body_rate at about 12 Hz; low-passed before logging" in notes[0]
    with h5py.File(flight) as file:
        assert list(file["cut_off_hz/name"].asstr()) == ["body_rate"]
        assert file["cut_off_hz/value"][0] == pytest.approx(12.0, rel=0.1)
