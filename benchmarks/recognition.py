"""How many signals `cpfls init` maps right in logs of others, without a hand on them.

Folders are searched for logs of the sets below, by the names of their files; what is right is what each set says of
itself (or PX4, ArduPilot and Betaflight of their logs), written down here. A signal counts as right where columns,
unit with factor, and signs are; a key where its value is. "Guessed" are those of which `cpfls init` itself says that
nothing in the log decides; a wrong one among them that names the right one as its rival counts as listed. Rotors count
as right where all of them have their corner and their way to turn. The position of a rotor in metres is not judged.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import isclose
from pathlib import Path

from benchmarks.shared.measure import program, table
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.proposal import Proposal, known_log, propose
from cpfls_cli.flightlog.recognised import Guess
from cpfls_cli.flightlog.settings import SETPOINTS
from cpfls_cli.logs.formats import log_contents
from cpfls_cli.units import known_unit

Truth = tuple[str, str, float]
"""Columns, unit, and the factor on what is logged."""

SI = {
    "attitude": "rad", "quaternion": "1", "body_rate": "rad/s", "acceleration": "m/s^2", "position": "m",
    "velocity": "m/s", "rotor_speed": "rad/s", "setpoint_position": "m", "setpoint_velocity": "m/s",
    "setpoint_attitude": "1", "setpoint_body_rate": "rad/s", "setpoint_thrust": "1", "sticks": "1",
}  # fmt: skip
FLU = {"body_frame": "FLU", "world_frame": "ENU"}
FRD = {"body_frame": "FRD", "world_frame": "NED"}
CRAZYFLIE = ("front right", 1), ("rear right", -1), ("rear left", 1), ("front left", -1)
PX4 = ("front right", 1), ("rear left", 1), ("front left", -1), ("rear right", -1)
BETAFLIGHT = ("rear right", -1), ("front right", 1), ("rear left", 1), ("front left", -1)
NEUROBEM = ("rear right", -1), ("front right", 1), ("rear left", 1), ("front left", -1)
HUMMINGBIRD = ("front left", -1), ("front right", 1), ("rear right", -1), ("rear left", 1)


@dataclass(frozen=True)
class LogSet:
    """Logs of one kind by patterns of their names, and what is right.

    Signals are columns with spaces between them, a minus before a reversed one, the name of the file as ``@``, alone in
    SI or with unit and factor. Rotors are corner and way to turn of each, empty where the set does not say; a setpoint
    that is left out is none that is wrong.
    """

    names: tuple[str, ...]
    signals: Mapping[str, str | Truth]
    keys: Mapping[str, str] = field(default_factory=dict)
    rotors: tuple[tuple[str, int], ...] = ()
    setpoints: Mapping[str, str | Truth] = field(default_factory=dict)


def columns(pattern: str, places: Iterable[object]) -> str:
    return " ".join(pattern.replace("*", str(place)) for place in places)


def nose_up(pattern: str) -> str:
    return " ".join(f"{sign}{pattern.replace('*', axis)}" for sign, axis in zip(("", "-", ""), ANGLES, strict=True))


ANGLES = ("roll", "pitch", "yaw")
XYZ, WXYZ, ONE_TO_FOUR, ZERO_TO_THREE = "xyz", "wxyz", range(1, 5), range(4)
NANODRONE = {
    "quaternion": columns("q*", WXYZ),
    "body_rate": columns("w*", XYZ),
    "position": "x y z",
    "velocity": columns("v*", XYZ),
}
PX4_SIGNALS: dict[str, str | Truth] = {
    "quaternion": columns("vehicle_attitude.q[*]", ZERO_TO_THREE),
    "body_rate": columns("vehicle_angular_velocity.xyz[*]", range(3)),
    "acceleration": columns("sensor_combined.accelerometer_m_s2[*]", range(3)),
    "position": columns("vehicle_local_position.*", XYZ),
    "velocity": columns("vehicle_local_position.v*", XYZ),
    "rotor_command": (columns("actuator_motors.control[*]", ZERO_TO_THREE), "1", 1.0),
    "voltage": ("battery_status.voltage_v", "V", 1.0),
}
ARDUPILOT_SIGNALS: dict[str, str | Truth] = {
    "attitude": ("ATT.Roll ATT.Pitch ATT.Yaw", "deg", 1.0),
    "body_rate": columns("IMU.Gyr*", "XYZ"),
    "acceleration": columns("IMU.Acc*", "XYZ"),
    "position": columns("NKF1.P*", "NED"),
    "velocity": columns("NKF1.V*", "NED"),
    "rotor_command": (columns("RCOU.C*", ONE_TO_FOUR), "1", 1e-3),
}
SETS = {
    "RotorPy (CSV)": LogSet(
        ("none.csv", "drag.csv", "com.csv"),
        {
            "attitude": "phi theta psi",
            "body_rate": columns("w*", XYZ),
            "acceleration": columns("a*", XYZ),
            "position": "x y z",
            "velocity": columns("v*", XYZ),
            "rotor_speed": columns("om*", ONE_TO_FOUR),
            "rotor_command": (columns("omcmd*", ONE_TO_FOUR), "rad/s", 1.0),
        },
        FLU | {"acceleration_frame": "world"},
        HUMMINGBIRD,
    ),
    "arpl, Crazyflie (CSV)": LogSet(
        ("log10_*.csv", "log15_*.csv", "log16_*.csv"),
        {
            "body_rate": columns("w*", XYZ),
            "acceleration": columns("sf*", XYZ),
            "rotor_command": (columns("u*", ONE_TO_FOUR), "1", 1.0),
        },
        {"body_frame": "FLU", "acceleration_frame": "body-specific-force", "rotor_command_is": "speed"},
        CRAZYFLIE,
    ),
    "CrazyPAD (CSV)": LogSet(
        ("normal_flight__E9*.csv", "add_weight_*.csv"),
        {
            "position": columns("stateEstimate.*", XYZ),
            "velocity": columns("stateEstimate.v*", XYZ),
            "acceleration": (columns("stateEstimate.a*", XYZ), "g", 1.0),
            "rotor_command": (columns("motor.m*", ONE_TO_FOUR), "1", 1 / 65536),
            "voltage": ("pm.vbatMV", "V", 1e-3),
        },
        {"world_frame": "ENU", "acceleration_frame": "world", "rotor_command_is": "thrust"},
        CRAZYFLIE,
    ),
    "CrazyPAD (uSD)": LogSet(
        ("*__E8_log??",),
        {
            "position": columns("fixedFrequency.stateEstimate.*", XYZ),
            # Its pitch is that of the nose up.
            "body_rate": nose_up("fixedFrequency.controller.r_*"),
        },
        FLU,
        setpoints={
            "setpoint_attitude": (nose_up("fixedFrequency.controller.*"), "deg", 1.0),
            "setpoint_body_rate": (nose_up("fixedFrequency.controller.*Rate"), "deg/s", 1.0),
        },
    ),
    "crazyswarm2, Lee (CSV)": LogSet(
        ("log45.csv", "log119.csv", "log149.csv"),
        {
            "attitude": columns("ctrlLee_rpy*", XYZ),
            "body_rate": columns("ctrlLee_omega*", XYZ),
            "position": columns("stateEstimateZ_*", XYZ),
            "velocity": columns("stateEstimateZ_v*", XYZ),
            "body_torque": (columns("ctrlLee_torque*", XYZ), "N m", 1.0),
            "thrust": ("ctrlLee_thrustSi", "N", 1.0),
        },
        FLU,
        setpoints={
            "setpoint_position": columns("ctrltargetZ_*", XYZ),
            "setpoint_velocity": columns("ctrltargetZ_v*", XYZ),
        },
    ),
    "nano-drone, prepared (CSV)": LogSet(
        ("square_20251017_run[123].csv",),
        NANODRONE
        | {
            "acceleration": columns("a*_body", XYZ),
            "rotor_speed": columns("m*_rads", ONE_TO_FOUR),
            "voltage": ("Vbat", "V", 1.0),
        },
        FLU | {"quaternion_order": "wxyz", "acceleration_frame": "body-specific-force"},
        CRAZYFLIE,
    ),
    "nano-drone, raw (Parquet)": LogSet(
        ("*_20251017_run?.parquet",),
        # The benchmark counts six pole pairs, which its files do not say.
        NANODRONE | {"rotor_speed": (columns("m*_erpm", ONE_TO_FOUR), "rpm", 1 / 6), "voltage": ("Vbat", "V", 1.0)},
        FLU | {"quaternion_order": "wxyz"},
        CRAZYFLIE,
    ),
    "NeuroBEM, without names (.mat)": LogSet(
        ("bemnn*.mat",),
        {
            "quaternion": columns("@[*]", range(7, 11)),
            "body_rate": columns("@[*]", range(4, 7)),
            "acceleration": columns("@[*]", range(11, 14)),
            "position": columns("@[*]", range(17, 20)),
            "rotor_speed": columns("@[*]", range(20, 24)),
        },
        FLU | {"quaternion_order": "xyzw", "acceleration_frame": "body-specific-force"},
        NEUROBEM,
    ),
    "PX4 1.15, simulated (ULog)": LogSet(
        ("sample_px4_events.ulg",),
        PX4_SIGNALS,
        FRD | {"quaternion_order": "wxyz", "acceleration_frame": "body-specific-force", "rotor_command_is": "speed"},
        PX4,
        {
            "setpoint_position": columns("trajectory_setpoint.position[*]", range(3)),
            "setpoint_velocity": columns("trajectory_setpoint.velocity[*]", range(3)),
            "setpoint_attitude": columns("vehicle_attitude_setpoint.q_d[*]", ZERO_TO_THREE),
            "setpoint_body_rate": columns("vehicle_rates_setpoint.*", ANGLES),
            "setpoint_thrust": "-vehicle_rates_setpoint.thrust_body[2]",
        },
    ),
    "ArduPilot 3.4 (DataFlash)": LogSet(
        ("ap_0036.bin", "0036.bin"),
        ARDUPILOT_SIGNALS,
        FRD | {"acceleration_frame": "body-specific-force"},
        PX4,
        {
            "setpoint_attitude": (columns("ATT.Des*", ("Roll", "Pitch", "Yaw")), "deg", 1.0),
            "setpoint_body_rate": (columns("RATE.*Des", "RPY"), "deg/s", 1.0),
            "sticks": (columns("RCIN.C*", (1, 2, 4, 3)), "1", 1 / 500),
        },
    ),
    "Betaflight 3.1 (blackbox)": LogSet(
        ("pa_*.BBL",),
        {
            "body_rate": (columns("gyroADC[*]", range(3)), "deg/s", 1.0),
            "acceleration": (columns("accSmooth[*]", range(3)), "g", 1.0),
            "rotor_command": (columns("motor[*]", ZERO_TO_THREE), "1", 1 / 1909),
            "voltage": ("vbatLatest", "V", 1.0),
        },
        {"body_frame": "FLU", "acceleration_frame": "body-specific-force"},
        BETAFLIGHT,
        {
            "setpoint_body_rate": (columns("setpoint[*]", range(3)), "deg/s", 1.0),
            "setpoint_thrust": ("setpoint[3]", "1", 1e-3),
            "sticks": (columns("rcCommand[*]", range(3)), "1", 1 / 500),
        },
    ),
}
REFUSED = {
    "sample.ulg": "the rotors",
    "sample_appended_multiple.ulg": "the rotors",
    "sample_logging_tagged_and_default_params.ulg": "the rotors",
    "sample_log_small.ulg": "is not a multirotor",
}
"""Logs of pyulog in which no multirotor flies, and a part of what has to be said."""


def main(folders: list[Path]) -> None:
    files = {path.name: path for folder in folders for path in sorted(folder.rglob("*")) if path.is_file()}
    rows = []
    for name, own in SETS.items():
        count: Counter[str] = Counter()
        for path in files.values():
            if any(path.match(pattern) for pattern in own.names):
                for wrong in judge(path, own, count):
                    print(f"{name}: {path.name}: {wrong}", file=sys.stderr)
        if count["logs"]:
            of = {what: f"{count[f'{what} right']} of {count[what]}" if count[what] else "-" for what in OF}
            rows.append((name, count["logs"], of["signals"], count["guessed"], count["listed"], *list(of.values())[1:]))
    if not rows:
        sys.exit("no log of a known set in these folders")
    columns = "set | logs | signals right | of them guessed | wrong, the right one listed | keys right"
    table("recognition", f"{columns} | rotors | setpoints", rows)
    for path in files.values():
        if path.name in REFUSED:
            said = refusal(path)
            print(f"\n{path.name}: {'refused as it has to be' if REFUSED[path.name] in said else 'WRONG'}: {said}")


def proposed(path: Path) -> Proposal:
    own = log_contents(path)
    return propose([known_log(path.name, own.topics, own.units, own.parameters, own.system)], None, None)


def refusal(path: Path) -> str:
    try:
        proposed(path)
    except InputError as error:
        return str(error)
    return "taken for a flight"


def judge(path: Path, own: LogSet, count: Counter[str]) -> Iterator[str]:
    """Count what is mapped right in a log, and say what is not."""
    count.update({"logs": 1, "signals": len(own.signals), "keys": len(own.keys), "rotors": bool(own.rotors)})
    try:
        proposal = proposed(path)
    except InputError as error:
        yield str(error)
        return
    guesses: dict[str, Guess] = {guess.signal: guess for guess in proposal.signals}
    for signal, truth in own.signals.items():
        if (guess := guesses.get(signal)) is None:
            yield f"{signal} is missing"
        elif wrong := wrong_map(truth, signal, guess, path):
            _, unit, factor = stated(truth, signal)
            count["listed"] += any(rival.text in (f"unit: {unit}", f"scale: {factor:.6g}") for rival in guess.rivals)
            yield wrong
        else:
            count.update({"signals right": 1, "guessed": guess.sure == "guess"})
    for key, value in own.keys.items():
        found = next((choice.value for choice in proposal.choices if choice.key == key), None)
        count["keys right"] += found == value
        yield from [] if found == value else [f"{key} is {found}, not {value}"]
    if own.rotors:
        found = tuple((rotor.name, rotor.spin) for rotor in (proposal.airframe.rotors if proposal.airframe else ()))
        count["rotors right"] += found == own.rotors
        yield from [] if found == own.rotors else [f"rotors {found}"]
    for signal in SETPOINTS.keys() & guesses.keys() & own.setpoints.keys():
        wrong = wrong_map(own.setpoints[signal], signal, guesses[signal], path)
        count.update({"setpoints": 1, "setpoints right": wrong is None})
        yield from [wrong] if wrong else []
    extra = guesses.keys() - own.signals.keys() - own.setpoints.keys()
    yield from (f"{signal} is mapped, and the set has none" for signal in extra)


OF = ("signals", "keys", "rotors", "setpoints")


def stated(truth: str | Truth, signal: str) -> Truth:
    return (truth, SI[signal], 1.0) if isinstance(truth, str) else truth


def wrong_map(truth: str | Truth, signal: str, guess: Guess, path: Path) -> str | None:
    """Say how a signal is mapped; None where that is right."""
    names, unit, factor = stated(truth, signal)
    own = guess.columns
    same = isclose(known_unit(own.unit).factor * own.scale, known_unit(unit).factor * factor, rel_tol=1e-6)
    sign = own.sign or (1.0,) * len(own.columns)
    found = [f"{'-' * (way < 0)}{column}" for way, column in zip(sign, own.columns, strict=True)]
    if found == names.replace("@", path.stem).split() and same:
        return None
    return f"{signal} is {own.columns} {own.unit} x {own.scale:.6g} {own.sign or ''}"


if __name__ == "__main__":
    program(main)
