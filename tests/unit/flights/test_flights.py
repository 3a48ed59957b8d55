"""Flights: where they come from, and what is computed from their signals."""

import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import Study, resolved_yaml
from cpfls_cli.effects.signals import RecordedFlight, Signals, as_slow_as_rotors, stretch_of
from cpfls_cli.errors import InputError
from cpfls_cli.files import seal_of
from cpfls_cli.flightlog.results import MOTION, Flight, Imported
from cpfls_cli.flightlog.stretches import SILENT
from cpfls_cli.flights import playback, recordings
from cpfls_cli.flights import training as sources
from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.flights.recordings import ReadFlight, signals_of
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.report.content import Form
from cpfls_cli.simulation.inverse import flyability
from cpfls_cli.simulation.model import Simulated
from cpfls_cli.stage import loaded
from cpfls_cli.store import Origin, write
from cpfls_cli.trajectory.planning import plan
from cpfls_cli.trajectory.settings import TrajectorySettings, WaypointSettings
from cpfls_cli.vehicle.rotors import body_wrench
from cpfls_cli.vehicle.settings import Unknown, VehicleSettings
from cpfls_cli.weak_form.windows import FEWEST_SAMPLES, common_windows

TIME = np.arange(3.0)
THREE = np.zeros((3, 3))
SAMPLES = 20
LENGTH = 30
PERIOD_S = 0.5


@pytest.mark.parametrize(
    ("signals", "lacks"),
    [
        ({}, ("attitude", "rotation", "torque")),
        ({"body_rate": THREE}, ("attitude", "torque")),
        ({"body_rate": THREE, "body_torque": THREE}, ("attitude",)),
        ({"attitude": THREE}, ("torque",)),
        ({"attitude": THREE, "body_torque": THREE}, ()),
        ({"attitude": THREE, "torque": THREE}, ()),
    ],
)
def test_what_later_commands_will_miss(signals, lacks):
    assert Flight(time=TIME, **signals).lacks == lacks


def test_a_flight_turns_where_roll_or_pitch_goes_round():
    def turns(axis, angle):
        attitude = THREE + np.where(np.arange(3) == axis, angle, 0.0) * TIME[:, None]
        return Flight(time=TIME, attitude=attitude, attitude_rate=THREE).turns

    assert [turns(axis, 3.2) for axis in range(3)] == [True, True, False]
    assert not turns(0, 3.1)


def trajectory(**settings):
    asked = TrajectorySettings(**settings)
    planned = plan(asked, 9.81)
    return PlannedPath.of(planned, flyability(vars(planned), VehicleSettings(), asked.tilt_max_rad), asked)


def test_the_paper_s_move_shows_its_printed_maxima():
    peaks = {peak.name: peak.largest for peak in trajectory().peaks}
    printed = {"pop": 2 * np.pi, "crackle": 2, "snap": 1, "jerk": 1, "acceleration": 2, "velocity": 8}
    assert peaks == pytest.approx({**printed, "displacement": 64}, rel=1e-3)


@pytest.mark.parametrize("duration_s", [48.0, 54.86])
def test_the_first_leg_is_the_first_sixteen_seconds(duration_s):
    time, curves = trajectory(duration_s=duration_s).first_leg()
    assert time[-1] == pytest.approx(16.0, abs=0.1)
    assert curves["displacement"][-1] == pytest.approx(64.0)
    assert np.trapezoid(curves["velocity"], time) == pytest.approx(64.0, rel=1e-4)
    assert curves["velocity"].min() >= -1e-9


def test_the_first_leg_ends_at_the_second_point_or_is_the_whole_path():
    points = tuple(WaypointSettings(position_m=place) for place in ((1.0, 2.0, 3.0), (4.0, 6.0, 3.0), (40.0, 6.0, 3.0)))
    time, curves = trajectory(path="waypoints", waypoints=points).first_leg()
    assert time[-1] == pytest.approx(16.0)
    assert curves["displacement"][-1] == pytest.approx(5.0)
    time, curves = replace(trajectory(), legs=()).first_leg()
    assert len(time) == 5487
    assert curves["displacement"].max() == pytest.approx(64.0)


def read(vehicle, speed, **changes):
    """Read a flight that states what such speeds give."""
    wrench = body_wrench(vehicle, speed)
    stated = {"thrust": wrench.thrust, "body_torque": wrench.body_torque} | changes
    known = {"time": np.arange(SAMPLES) / 100, "body_rate": np.ones((SAMPLES, 3))} | stated
    known = {name: values for name, values in known.items() if values is not None}
    return signals_of(ReadFlight("flight.csv", known, {}, ()), known, Study(vehicle=vehicle))


def test_a_flight_knows_over_what_its_slow_channels_are_averaged():
    known = {"time": np.arange(SAMPLES) / 100, "body_rate": np.ones((SAMPLES, 3)), "body_torque": np.ones((SAMPLES, 3))}
    slow = {"updated_hz": {"quaternion": 10.0, "body_rate": 50.0}, "repeated": ("body_rate",)}
    flight, _ = signals_of(ReadFlight("flight.csv", known, {}, (), **slow), known, Study())
    assert (flight.attitude_spans, flight.body_rate_spans) == ((0.1, 0.1), (0.02,))
    kept = RecordedFlight.of(flight, "given").flight(flight.vehicle, 0.0)
    assert (kept.attitude_spans, kept.body_rate_spans) == ((0.1, 0.1), (0.02,))


@pytest.mark.parametrize(("hz", "repeated", "span_s"), [(10.0, True, 0.1), (10.0, False, 0.1), (125.0, True, 0.0)])
def test_rotors_that_are_logged_rarely_lie_on_straight_lines(hz, repeated, span_s):
    time = 0.001 * np.arange(4000)
    updates = time[:: round(1000 / hz)]
    speed = 500 + 50 * np.sin(updates[:, None] + np.arange(4))
    rows = np.searchsorted(updates, time, side="right") - 1
    lines = np.column_stack([np.interp(time, updates, each) for each in speed.T])
    known = {"time": time, "body_rate": np.zeros((4000, 3)), "rotor_speed": speed[rows] if repeated else lines}
    slow = {"updated_hz": {"rotor_speed": hz}, "repeated": ("rotor_speed",) * repeated}
    flight, _ = signals_of(ReadFlight("flight.csv", known, {}, (), **slow), known, Study())
    assert flight.rotor_span_s == pytest.approx(span_s)
    assert RecordedFlight.of(flight, "given").flight(flight.vehicle, 0.0).rotor_span_s == flight.rotor_span_s
    # A fast controller holds its command.
    expected = lines if span_s else speed[rows]
    np.testing.assert_allclose(flight.rotor_speed[:3900], expected[:3900])


def test_commands_of_measured_speeds_lie_on_lines_as_these_do():
    time = 0.01 * np.arange(4000)
    held = 500 + 50 * np.sin(time // 0.1 * 0.1)[:, None] * np.ones(4)
    known = {"time": time, "body_rate": np.zeros((4000, 3)), "rotor_speed": held, "rotor_command": held}
    slow = ("rotor_speed", "rotor_command")
    read = ReadFlight("flight.csv", known, {}, (), updated_hz=dict.fromkeys(slow, 10.0), repeated=slow)
    flight, _ = signals_of(read, known, Study())
    np.testing.assert_array_equal(flight.rotor_command, flight.rotor_speed)
    assert np.abs(flight.rotor_speed[:3900, 0] - 500 - 50 * np.sin(time[:3900])).max() < 1.0


def test_motion_is_averaged_as_lines_between_updates_average_rotors():
    time, turn = 0.01 * np.arange(2000), 2 * np.pi * 2.0
    wave = np.sin(turn * time)[:, None] * np.ones(3)
    flight = Signals(time=time, body_rate=wave, velocity=wave, vehicle=VehicleSettings(), rotor_span_s=0.1)
    averaged = as_slow_as_rotors(flight)
    for own in (averaged.body_rate, averaged.velocity):
        np.testing.assert_allclose(own[100:-100], np.sinc(2.0 * 0.1) ** 2 * wave[100:-100], atol=2e-3)
    assert as_slow_as_rotors(replace(flight, rotor_span_s=0.0)).body_rate is flight.body_rate
    # Through full turns.
    turned = np.column_stack([0 * time, 0 * time, time])
    jumping = as_slow_as_rotors(replace(flight, attitude=(turned + np.pi) % (2 * np.pi) - np.pi)).attitude
    np.testing.assert_allclose(jumping[100:-100], turned[100:-100], atol=1e-9)
    # As of a log with so many rows.
    assert common_windows([flight], GapSettings()).weight.size == FEWEST_SAMPLES * 10
    # Shorter windows in the config would not help.
    with pytest.raises(InputError, match=r"4 s are too short; 16 windows of 0.8 s, 8 updates of rotors .* every 0.1 s"):
        common_windows([stretch_of(flight, slice(0, 400))], GapSettings())


@pytest.fixture
def speed():
    return np.random.default_rng(1).uniform(300.0, 600.0, (SAMPLES, 4))


def test_the_commands_are_those_that_give_the_wrench_and_no_rotor_pushes_down(speed):
    signals, notes = read(VehicleSettings(), speed)
    np.testing.assert_allclose(signals.rotor_speed, speed, rtol=1e-9)
    assert signals.commanded
    assert "four rotors of the config" in " ".join(notes)
    vehicle = VehicleSettings()
    thrust = body_wrench(vehicle, speed).thrust
    thrust[:3] = 0.0
    signals, notes = read(vehicle, speed, thrust=thrust)
    assert f"at 3 of {SAMPLES} samples" in " ".join(notes)
    assert (signals.rotor_speed[:3] == 0).any(axis=1).all()


@pytest.mark.parametrize("unknown", [name for name in get_args(Unknown) if name.endswith("factor")])
def test_rotors_of_unknown_factors_are_asked_for_nothing(unknown, speed):
    signals, notes = read(replace(VehicleSettings(), unknown=(unknown,)), speed)
    assert signals.rotor_speed is None
    assert signals.stated_thrust is not None
    assert not notes


def test_torque_without_thrust_and_six_rotors_show_no_commands(speed):
    signals, _ = read(VehicleSettings(), speed, thrust=None)
    assert signals.rotor_speed is None
    assert signals.stated_torque is not None
    vehicle = VehicleSettings()
    six = replace(vehicle, rotors=(*vehicle.rotors, *vehicle.rotors[:2]))
    signals, _ = read(six, np.hstack([speed, speed[:, :2]]))
    assert signals.rotor_speed is None


def simulated(**given):
    """Make a simulated flight of its signals."""
    return Simulated(**({"noise_std": {}, "infeasible": (), "effects": {}} | given))


def imported(**given):
    """Make a flight of a log that nothing is said of."""
    time = given["time"]
    counts = {key: {} for key in ("dropped", "missing", "spikes", "suspected_spikes", "saturated")}
    rate = 1 / (time[1] - time[0])
    said = {
        "samples_read": len(time),
        "samples": len(time),
        "gaps": 0,
        "longest_gap_s": 1 / rate,
        "span_s": (0.0, float(time[-1])),
        "first_stamp_s": 0.0,
        "crop_s": None,
        "log_rate_hz": rate,
        "rate_hz": rate,
        "cut_off_hz": {},
        "updated_hz": {},
        "parameters": {},
        "stated": {},
    }
    return Imported(**(counts | said | given))


def test_rows_beyond_a_gap_are_said_with_what_they_are_a_share_of(tmp_path):
    flight = imported(time=np.arange(10) / 10, dropped={"gap": 6, "crop": 8}, samples_read=24)
    write(tmp_path / "flight.h5", flight, Origin(stage="import", seed=1, config=resolved_yaml(Study())))
    said = loaded("import_").report(tmp_path / "flight.h5", Form.MARKDOWN)
    assert "24 rows; 6 of these, 38 % of what import.crop_s keeps, are beyond a gap and left out" in said


def write_flight(path, samples):
    rng = np.random.default_rng(2)
    signals = {name: rng.normal(size=(samples, 3)) for name in (*MOTION, "torque")}
    flight = simulated(time=np.arange(samples) / 10, **signals)
    write(path, flight, Origin(stage="simulate", seed=1, config=resolved_yaml(Study())))


@pytest.fixture
def source(tmp_path, monkeypatch):
    """As a worker gets it: pickled here, and read there."""
    monkeypatch.setattr(sources, "IN_MEMORY", 10)
    write_flight(tmp_path / "flight.h5", LENGTH)
    return pickle.loads(pickle.dumps(sources.part_of(sources.flight_source(tmp_path / "flight.h5"), slice(5, 20))))


def test_it_is_read_where_the_same_file_lies(source):
    assert source.path.is_absolute()
    (part,) = source.chunks()
    np.testing.assert_array_equal(part.time, np.arange(5, 20) / 10)


def another_size(path):
    path.write_bytes(path.read_bytes() + b"x")


def another_length(path):
    size, sealed = path.stat().st_size, len(seal_of(b""))
    write_flight(path, LENGTH - 3)
    content = path.read_bytes()[:-sealed].ljust(size - sealed, b"\0")
    path.write_bytes(content + seal_of(content))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (Path.unlink, "no such file"),
        (another_size, "another file, with [0-9]+ bytes instead of"),
        (another_length, "another file, with 27 samples instead of 30"),
    ],
)
def test_another_file_is_refused_with_path_and_remedy(source, change, said):
    change(source.path)
    with pytest.raises(InputError, match=f"{source.path}: {said}.*put the same file there on each"):
        next(source.chunks())


def driven(path, *, unit="V", voltage=(12.5, 10.0), commands=None, warnings=()):
    """A flight with a battery that sags, of a log with body torque, or with commands in a unit in its place."""
    rng = np.random.default_rng(4)
    mapped = {"voltage": {"columns": ["u"], "unit": unit}, "body_torque": {"columns": ["a", "b", "c"], "unit": "N m"}}
    source = "column" if commands is None else "rotor-command"
    if commands is not None:
        mapped["rotor_command"] = {"columns": ["k", "l", "m", "n"], "unit": commands}
        del mapped["body_torque"]
    config = parse_config(resolved_yaml(Study()), "own") | {"import": {"signals": mapped, "torque_source": source}}
    study = validate(config, "own")
    inputs = {"log": InputFile("log.csv", "0" * 64, "CSV")}
    signals = {name: rng.normal(size=(90, 3)) for name in ("attitude", "body_rate")}
    name, columns = ("body_torque", 3) if commands is None else ("rotor_command", 4)
    signals[name] = rng.uniform(0.2, 0.8, size=(90, columns))
    signals["voltage"] = np.linspace(*voltage, 90)
    flight = replace(imported(time=PERIOD_S * np.arange(90), **signals), warnings=warnings)
    write(path, flight, Origin(stage="import", seed=1, config=resolved_yaml(study), inputs=inputs))
    return path


@pytest.mark.parametrize(
    ("unit", "voltage", "said"),
    [
        ("V", (12.5, -0.3), "voltage is 0 or less at 3 of 90 samples, so it is not used: drop these rows, or check"),
        ("1", (0.9, 0.0), "voltage is 0 or less at 1 of 90 samples"),
        ("1", (12.5, 10.0), r"12\.5 times that of a full battery, so it is not used: set import\.signals"),
    ],
)
@pytest.mark.parametrize("read", [recordings.read_flights, playback.flights_to_play])
def test_a_voltage_that_no_battery_has_is_not_used_and_said(tmp_path, unit, voltage, said, read):
    path = driven(tmp_path / "flight.h5", unit=unit, voltage=voltage)
    if read is recordings.read_flights:
        found = read([path], Study())
        parts, warnings = list(found.flights), found.warnings
    else:
        (found,) = read([path], Study())
        parts, warnings = found.parts, found.warnings
    assert [part.voltage for part in parts] == [None] * len(parts)
    assert len(re.findall(said, " ".join(warnings))) == 1
    assert "taken as that of a full battery" not in " ".join(warnings)


@pytest.mark.parametrize(("unit", "shares"), [("1", True), ("rad/s", False), (None, False)])
def test_a_flight_to_play_says_whether_its_commands_are_shares_of_a_full_speed(tmp_path, unit, shares):
    (flight,) = playback.flights_to_play([driven(tmp_path / "flight.h5", commands=unit)], Study())
    assert flight.shares is shares


def test_an_import_says_what_is_wrong_with_a_voltage(tmp_path):
    flight = recordings.read_flight(driven(tmp_path / "flight.h5", voltage=(12.5, 0.0)), Study())
    assert "voltage is 0 or less at 1 of 90" in " ".join(recordings.doubts_on_voltage(flight.signals, flight.units))


def test_a_flight_says_again_where_its_log_was_silent_and_nothing_else_of_it(tmp_path):
    own = ("rotor 1 is below zero", f"body_rate does not change on any axis from 1.0 s to 2.0 s: {SILENT}")
    path = driven(tmp_path / "flight.h5", commands="1", warnings=own)
    assert recordings.read_flight(path, Study()).warnings == own[1:]
