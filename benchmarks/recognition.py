"""Print how many signals `cpfls init` maps right in logs of others, without a hand on them.

    python -m benchmarks.recognition FOLDER...

Folders are searched for logs of the sets below, by the names of their files; what is right is what each set says of
itself (or PX4, ArduPilot and Betaflight of their logs), written down here. A signal counts as right where columns,
unit with factor, and signs are; a key where its value is. "Guessed" are those of which `cpfls init` itself says that
nothing in the log decides; a wrong one among them that names the right one as its rival counts as listed. Rotors count
as right where all of them have their corner and their way to turn. The position of a rotor in metres is not judged.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isclose
from pathlib import Path

from benchmarks.shared.measure import table
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.proposal import KnownLog, known_log, propose
from cpfls_cli.flightlog.recognised import Guess
from cpfls_cli.flightlog.settings import SETPOINTS
from cpfls_cli.logs.formats import log_contents
from cpfls_cli.units import known_unit

Truth = tuple[str, str, float]
"""Columns, unit, and the factor on what is logged."""

SI = {
    "attitude": "rad",
    "quaternion": "1",
    "body_rate": "rad/s",
    "acceleration": "m/s^2",
    "position": "m",
    "velocity": "m/s",
    "rotor_speed": "rad/s",
    "setpoint_position": "m",
    "setpoint_velocity": "m/s",
    "setpoint_attitude": "1",
    "setpoint_body_rate": "rad/s",
    "setpoint_thrust": "1",
    "sticks": "1",
}
FLU = {"body_frame": "FLU", "world_frame": "ENU"}
FRD = {"body_frame": "FRD", "world_frame": "NED"}
CRAZYFLIE = ("front right", 1), ("rear right", -1), ("rear left", 1), ("front left", -1)
PX4 = ("front right", 1), ("rear left", 1), ("front left", -1), ("rear right", -1)
BETAFLIGHT = ("rear right", -1), ("front right", 1), ("rear left", 1), ("front left", -1)
NEUROBEM = ("rear right", -1), ("front right", 1), ("rear left", 1), ("front left", -1)
HUMMINGBIRD = ("front left", -1), ("front right", 1), ("rear right", -1), ("rear left", 1)


@dataclass(frozen=True)
class LogSet:
    """Logs of one kind, and what is right.

    Attributes
    ----------
    names : tuple of str
        Patterns of the files' names.
    signals : mapping from signal to (columns, unit, factor) or columns
        Columns with spaces between them, a minus before a reversed one, the name of the file as ``@``; alone they are
        in SI.
    rotors : tuple
        Corner and way to turn of each; empty where the set does not say.
    setpoints : mapping
        As `signals`; one that is left out is none that is wrong.
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
        FRD
        | {
            "quaternion_order": "wxyz",
            "acceleration_frame": "body-specific-force",
            "rotor_command_is": "speed",
        },
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


@dataclass
class Count:
    """Signals, keys, rotors of a set, and setpoints that are mapped: how many, and how many are right."""

    logs: int = 0
    signals: int = 0
    right: int = 0
    guessed: int = 0
    listed: int = 0
    keys: int = 0
    keys_right: int = 0
    rotors: int = 0
    rotors_right: int = 0
    setpoints: int = 0
    setpoints_right: int = 0
    wrong: list[str] = field(default_factory=list)


def main(folders: Sequence[Path]) -> None:
    files = [path for folder in folders for path in sorted(folder.rglob("*")) if path.is_file()]
    rows = []
    for name, own in SETS.items():
        count = Count()
        for path in {path.name: path for path in files if any(path.match(pattern) for pattern in own.names)}.values():
            judge(path, own, count)
        if count.logs:
            rows.append(row(name, count))
            for wrong in count.wrong:
                print(f"{name}: {wrong}", file=sys.stderr)
    if not rows:
        sys.exit("no log of a known set in these folders; call it as: python -m benchmarks.recognition FOLDER...")
    header = (
        "set",
        "logs",
        "signals right",
        "of them guessed",
        "wrong, the right one listed",
        "keys right",
        "rotors",
        "setpoints",
    )
    table("recognition", header, rows)
    for path in {path.name: path for path in files}.values():
        if path.name in REFUSED:
            said = refusal(path)
            print(f"\n{path.name}: {'refused as it has to be' if REFUSED[path.name] in said else 'WRONG'}: {said}")


def row(name: str, count: Count) -> tuple[str, ...]:
    rotors = f"{count.rotors_right} of {count.rotors}" if count.rotors else "-"
    setpoints = f"{count.setpoints_right} of {count.setpoints}" if count.setpoints else "-"
    return (
        name,
        str(count.logs),
        f"{count.right} of {count.signals}",
        str(count.guessed),
        str(count.listed),
        f"{count.keys_right} of {count.keys}",
        rotors,
        setpoints,
    )


def known(path: Path) -> KnownLog:
    own = log_contents(path)
    return known_log(path.name, own.topics, own.units, own.parameters, own.system)


def refusal(path: Path) -> str:
    try:
        propose([known(path)], None, None)
    except InputError as error:
        return str(error)
    return "taken for a flight"


def judge(path: Path, own: LogSet, count: Count) -> None:
    count.logs += 1
    count.signals += len(own.signals)
    count.keys += len(own.keys)
    count.rotors += bool(own.rotors)
    try:
        proposal = propose([known(path)], None, None)
    except InputError as error:
        count.wrong.append(f"{path.name}: {error}")
        return
    guesses = {guess.signal: guess for guess in proposal.signals}
    for signal, truth in own.signals.items():
        judge_signal(path, signal, truth, guesses.get(signal), count)  # type: ignore[call-overload]
    for key, value in own.keys.items():
        choice = next((choice for choice in proposal.choices if choice.key == key), None)
        right = choice is not None and choice.value == value
        count.keys_right += right
        count.wrong += [] if right else [f"{path.name}: {key} is {choice and choice.value}, not {value}"]
    if own.rotors:
        found = tuple((rotor.name, rotor.spin) for rotor in (proposal.airframe.rotors if proposal.airframe else ()))
        count.rotors_right += found == own.rotors
        count.wrong += [] if found == own.rotors else [f"{path.name}: rotors {found}"]
    for signal in SETPOINTS.keys() & guesses.keys() & own.setpoints.keys():
        count.setpoints += 1
        wrong = wrong_map(own.setpoints[signal], signal, guesses[signal], path)
        count.setpoints_right += wrong is None
        count.wrong += [] if wrong is None else [f"{path.name}: {wrong}"]
    extra = [signal for signal in guesses if signal not in own.signals and signal not in own.setpoints]
    count.wrong += [f"{path.name}: {signal} is mapped, and the set has none" for signal in extra]


def judge_signal(path: Path, signal: str, truth: str | Truth, guess: Guess | None, count: Count) -> None:
    log = path.name
    if guess is None:
        count.wrong.append(f"{log}: {signal} is missing")
        return
    wrong = wrong_map(truth, signal, guess, path)
    count.right += wrong is None
    count.guessed += wrong is None and guess.sure == "guess"
    if wrong is not None:
        _, unit, factor = stated(truth, signal)
        listed = any(rival.text in (f"unit: {unit}", f"scale: {factor:.6g}") for rival in guess.rivals)
        count.listed += listed
        count.wrong.append(f"{log}: {wrong}")


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
    if len(sys.argv) < 2:
        sys.exit(f"folders of logs are missing; call it as: {(__doc__ or '').split(chr(10))[2].strip()}")
    main([Path(folder) for folder in sys.argv[1:]])
