"""A flight that stays in its file: whoever reads it must find the very file that was opened."""

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import Study, resolved_yaml
from cpfls_cli.errors import InputError
from cpfls_cli.files import seal_of
from cpfls_cli.flights import playback, recordings
from cpfls_cli.flights import training as sources
from cpfls_cli.flights.flight import MOTION, Imported, Simulated
from cpfls_cli.store import Origin, write


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


SAMPLES = 30


def write_flight(path, samples):
    rng = np.random.default_rng(2)
    signals = {name: rng.normal(size=(samples, 3)) for name in (*MOTION, "torque")}
    flight = simulated(time=np.arange(samples) / 10, **signals)
    write(path, flight, Origin(stage="simulate", seed=1, config=resolved_yaml(Study())))


@pytest.fixture
def source(tmp_path, monkeypatch):
    """As a worker gets it: pickled here, and read there."""
    monkeypatch.setattr(sources, "IN_MEMORY", 10)
    write_flight(tmp_path / "flight.h5", SAMPLES)
    opened = sources.part_of(sources.flight_source(tmp_path / "flight.h5"), slice(5, 20))
    return pickle.loads(pickle.dumps(opened))


def test_it_is_read_where_the_same_file_lies(source):
    assert source.path.is_absolute()
    (part,) = source.chunks()
    np.testing.assert_array_equal(part.time, np.arange(5, 20) / 10)


def another_size(path):
    path.write_bytes(path.read_bytes() + b"x")


def another_length(path):
    size, sealed = path.stat().st_size, len(seal_of(b""))
    write_flight(path, SAMPLES - 3)
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


PERIOD_S = 0.5


def driven(path, *, unit="V", voltage=(12.5, 10.0), commands=None):
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
    flight = imported(time=PERIOD_S * np.arange(90), **signals)
    write(path, flight, Origin(stage="import", seed=1, config=resolved_yaml(study), inputs=inputs))
    return path


@pytest.mark.parametrize(
    ("unit", "voltage", "said"),
    [
        ("V", (12.5, -0.3), "voltage is 0 or less at 3 of 90 samples, so it is not used: drop these rows, or check"),
        ("1", (0.9, 0.0), "voltage is 0 or less at 1 of 90 samples"),
        (
            "1",
            (12.5, 10.0),
            r"12\.5 times that of a full battery, so it is not used: set import\.signals",
        ),
    ],
)
@pytest.mark.parametrize("read", [recordings.read_flights, playback.flights_to_play])
def test_a_voltage_that_no_battery_has_is_not_used_and_said(tmp_path, unit, voltage, said, read):
    path = driven(tmp_path / "flight.h5", unit=unit, voltage=voltage)
    if read is recordings.read_flights:
        found = read([path], Study())
        parts, warnings = [each.signals for each in found.recordings], found.warnings
    else:
        (found,) = read([path], Study())
        parts, warnings = found.parts, found.warnings
    assert [part.voltage for part in parts] == [None] * len(parts)
    assert len(re.findall(said, " ".join(warnings))) == 1
    assert "taken as that of a full battery" not in " ".join(warnings)


@pytest.mark.parametrize(("unit", "shares"), [("1", True), ("rad/s", False), (None, False)])
def test_a_flight_to_play_says_whether_its_commands_are_shares_of_a_full_speed(tmp_path, unit, shares):
    path = driven(tmp_path / "flight.h5", commands=unit)
    (flight,) = playback.flights_to_play([path], Study())
    assert flight.shares is shares


def test_an_import_says_what_is_wrong_with_a_voltage(tmp_path):
    flight = recordings.read_flight(driven(tmp_path / "flight.h5", voltage=(12.5, 0.0)), Study())
    assert "voltage is 0 or less at 1 of 90" in " ".join(recordings.doubts_on_voltage(flight.signals, flight.units))
