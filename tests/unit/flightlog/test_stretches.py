"""What of a log is no flight: rotors at rest or below zero, columns that are dead, clipped or at a standstill."""

import numpy as np
import pytest

from cpfls_cli.flightlog.importing import read_signals
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap

TIME = np.arange(1000) / 50
NOISE = 0.02 * np.random.default_rng(3).standard_normal((1000, 7))
FLIES = (TIME >= 3.0) & (TIME < 17.0)
ROTORS = ("m0", "m1", "m2", "m3")


def log(rest=0.0, **changes):
    rates = {f"w{axis}": np.sin((1 + axis) * TIME) + NOISE[:, axis] for axis in range(3)}
    speeds = {name: np.where(FLIES, 600 + 500 * NOISE[:, 3 + i], rest) for i, name in enumerate(ROTORS)}
    return {"t": TIME} | rates | speeds | changes


def warnings(columns, **changes):
    signals = {
        "body_rate": SignalMap(columns=("w0", "w1", "w2"), unit="rad/s"),
        "rotor_command": SignalMap(columns=ROTORS, unit="rad/s"),
    }
    return list(read_signals(columns, ImportSettings(signals=signals, torque_source=None, **changes)).warnings)


@pytest.mark.parametrize(("rest", "level"), [(0.0, "0 rad/s"), (150.0, "150 rad/s")])
def test_rotors_at_rest_are_said_with_place_and_crop(rest, level):
    (warning,) = warnings(log(rest))
    assert warning.startswith(
        f"rotor_command stands at {level} on all rotors from 0.00 s to 2.98 s, from 17.00 s to 19.98"
    )
    assert "import.crop_s: [3, 16.98] keeps the longest part without it" in warning
    assert warnings(log(rest), crop_s=(3.0, 16.98)) == []


def test_commands_below_zero_are_no_rotor_speeds():
    rest, below = warnings(log(-100.0))
    assert rest.startswith("rotor_command stands at -100 rad/s on all rotors from 0.00 s")
    assert below.startswith("rotor_command is below zero in 300 of 1000 rows, down to -100 rad/s in column m0")
    assert "check import.signals.rotor_command.scale, offset and sign" in below


def flying(**changes):
    always = {name: 600 + 500 * NOISE[:, 3 + i] for i, name in enumerate(ROTORS)}
    return log() | always | changes


def test_one_rotor_below_zero_in_flight_is_no_rest():
    speed = flying()["m2"]
    speed[500:510] = -40.0 + 1e-3 * NOISE[500:510, 1]
    (warning,) = warnings(flying(m2=speed))
    assert warning.startswith("rotor_command is below zero in 10 of 1000 rows, down to -40 rad/s in column m2")


def test_a_flight_that_flies_throughout_is_not_warned_of():
    assert warnings(flying()) == []


def test_dead_columns_are_named_once():
    one, two = warnings(flying(w2=0 * TIME, m0=0 * TIME + 5, m3=0 * TIME))
    assert one.startswith("column w2 of import.signals.body_rate does not change in 1000 rows: dead")
    assert two.startswith("columns m0, m3 of import.signals.rotor_command do not change in 1000 rows: dead")


def test_a_clipped_gyroscope_is_named_with_its_limit():
    rate = 2 * np.sin(8 * TIME) + NOISE[:, 0]
    (warning,) = warnings(flying(w0=np.clip(rate, -1.7, 1.9)))
    assert warning == f"column w0 is clipped at 1.9 rad/s, for {int((rate >= 1.9).sum())} samples: the rest is lost"


def test_a_signal_that_falls_silent_is_said_with_place():
    silent = {f"w{axis}": np.where((TIME > 5) & (TIME < 7), 0.1, flying()[f"w{axis}"]) for axis in range(3)}
    (warning,) = warnings(flying(**silent))
    assert warning.startswith("body_rate does not change on any axis from 5.02 s to 6.98 s: its source was silent")
    # One axis of three is not the whole sensor.
    assert warnings(flying(w0=silent["w0"])) == []


def test_what_is_written_with_few_digits_and_hardly_moves_is_not_silent():
    """In quiet hover rates of two decimals repeat on all axes for seconds."""
    calm = np.abs(TIME - 6) < 1.5
    quiet = {f"w{axis}": np.round(np.where(calm, 0.004, flying()[f"w{axis}"]), 2) for axis in range(3)}
    after = np.flatnonzero(calm)[-1] + 1
    for values in quiet.values():
        values[after] = 0.01
    assert warnings(flying(**quiet)) == []
    # What goes on elsewhere was silent.
    quiet["w0"][after] = 0.05
    (warning,) = warnings(flying(**quiet))
    assert warning.startswith("body_rate does not change on any axis")
