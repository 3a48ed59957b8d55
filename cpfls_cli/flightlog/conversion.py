"""Conversion of a log's columns: selected by name, in SI, in body FLU and world ENU."""

from collections.abc import Collection, Container, Mapping
from dataclasses import fields, replace
from difflib import get_close_matches
from typing import Literal

import numpy as np

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError, SettingError
from cpfls_cli.flightlog.agreement import rotations_of
from cpfls_cli.flightlog.repair import continuous_attitude
from cpfls_cli.flightlog.settings import SETPOINTS, ColumnMap, ImportSettings, SignalMap
from cpfls_cli.units import STANDARD_GRAVITY, to_si
from cpfls_cli.words import some

_SUFFICIENT_SIGNALS = ("attitude", "quaternion", "body_rate", "rotor_speed", "rotor_command")
_WORLD_SIGNALS = ("position", "velocity", "acceleration")
_BODY_SIGNALS = ("body_rate", "body_torque")
_SCALAR_SIGNALS = ("thrust", "voltage")
_MOST_NEAREST, _MOST_LISTED = 3, 20
# Likeness of names by difflib that is worth a hint, and that of names of so many letters.
_ALIKE, _ALIKE_SHORT, _SHORT_NAME = 0.5, 0.7, 2
# Names that are far apart, so that the nearest one would mislead: of actuator_motors it is actuator_controls, which is
# what mixers get and no command of a rotor.
_SAME_IN_PX4 = (
    ("actuator_motors.control", "actuator_outputs.output"),
    ("vehicle_angular_velocity.xyz", "sensor_combined.gyro_rad"),
    ("vehicle_acceleration.xyz", "sensor_combined.accelerometer_m_s2"),
)
BodyFrame = Literal["FLU", "FRD"]
WorldFrame = Literal["ENU", "NED"]
_BODY = {"FLU": np.eye(3), "FRD": np.diag([1.0, -1.0, -1.0])}
_WORLD = {"ENU": np.eye(3), "NED": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])}


def present_choices(columns: Container[str], settings: ImportSettings) -> ImportSettings:
    """Take for each signal the first of its maps whose columns the log holds; a signal without one stays as it is."""
    signals = {}
    for name, signal in settings.signals.items():
        present = [choice for choice in signal.choices if all(column in columns for column in choice.columns)]
        values = {each.name: getattr(present[0], each.name) for each in fields(ColumnMap)} if present else {}
        signals[name] = replace(signal, **values, otherwise=()) if present else signal
    return replace(settings, signals=signals)


def drop_absent_signals(columns: Collection[str], settings: ImportSettings) -> ImportSettings:
    """Leave out the optional signals whose columns the log does not hold; what is left has to describe a flight.

    A signal with some of its columns stays, so that the missing ones are named like those of a required signal, unless
    all that is missing is of topics that the log lacks.
    """
    topics = {column.partition(".")[0] for column in columns}

    def lacks(signal: SignalMap) -> bool:
        missing = [column for column in signal.columns if column not in columns]
        lost = ["." in column and column.partition(".")[0] not in topics for column in missing]
        return len(missing) == len(signal.columns) or (bool(lost) and all(lost))

    absent = [name for name, signal in settings.signals.items() if not signal.required and lacks(signal)]
    if not absent:
        return settings
    present = {name: signal for name, signal in settings.signals.items() if name not in absent}
    if not any(name in present for name in _SUFFICIENT_SIGNALS):
        raise InputError(
            f"import.signals: a flight needs one of {', '.join(_SUFFICIENT_SIGNALS)}; the log has no columns of"
            f" {', '.join(absent)}"
        )
    try:
        return replace(settings, signals=present)
    except SettingError as error:
        raise InputError(f"import.{error.key}: {error}; the log has no columns of {', '.join(absent)}") from None


def select_columns(columns: Mapping[str, Array], settings: ImportSettings) -> tuple[Array, dict[str, Array], float]:
    """Take the stamps of a log, s from 0, and its mapped columns by signal, shape (sample, column), SI, with signs.

    Last comes the stamp, s, that times are counted from. Frames and order are those of the log. Columns that are
    missing, empty or of unequal length are refused; the message names all of them, the config key of each and the
    nearest columns of the log.
    """
    _require_present(columns, settings)
    stamps = np.asarray(columns[str(settings.time_column)], dtype=float)
    finite = stamps[np.isfinite(stamps)]
    if len(finite) < 2:
        raise InputError(f"import.time_column: {settings.time_column!r} holds fewer than two time stamps")
    # In their own unit first: a date in s has few digits left for its fractions.
    time: Array = to_si(stamps - finite[0], settings.time_unit)
    for name, signal in settings.signals.items():
        unlike = next((size for column in signal.columns if (size := len(columns[column])) != len(time)), None)
        if unlike is not None:
            raise InputError(f"import.signals.{name}.columns: {unlike} values for {len(time)} time stamps")
    signals: dict[str, Array] = {}
    for name, signal in settings.signals.items():
        values = np.column_stack([np.asarray(columns[column], dtype=float) for column in signal.columns])
        values[~np.isfinite(values)] = np.nan
        signals[name] = to_si(as_mapped(values, signal), signal.unit)
    return time, signals, float(to_si(finite[0], settings.time_unit))


def as_mapped(values: Array, columns: ColumnMap) -> Array:
    """Give columns of a log as a map makes them: shape (sample, column) to (sample, axis or rotor), in its unit."""
    sign = np.ones(len(columns.columns)) if columns.sign is None else np.array(columns.sign)
    with np.errstate(over="ignore"):
        # What overflows is reported as a value that no flight has.
        scaled: Array = sign * (columns.scale * values + columns.offset)
    if columns.mixer is None:
        return scaled
    mixed = scaled @ np.array(columns.mixer).T
    # A motor gives no more than all it has and no less than nothing, whatever the mixer adds up to.
    return np.clip(mixed, 0.0, 1.0) if columns.unit == "1" else np.asarray(mixed)


def _require_present(columns: Mapping[str, Array], settings: ImportSettings) -> None:
    if not settings.signals:
        raise InputError("import.signals: no signal is mapped to columns of the log; `cpfls init LOG` finds them")
    wanted = [("import.time_column", str(settings.time_column), "")]
    for name, signal in settings.signals.items():
        tried = ", nor all columns of any entry of otherwise" if signal.otherwise else ""
        wanted += [(f"import.signals.{name}.columns", column, tried) for column in signal.columns]
    absent = [(key, name, tried, _hint(name, columns)) for key, name, tried in wanted if name not in columns]
    missing = [f"{key}: the log has no column {name!r}{tried}{hint}" for key, name, tried, hint in absent]
    if not all(hint for *_, hint in absent):
        missing.append(f"import.signals: {columns_in_words(columns)}")
    if missing:
        raise InputError("\n".join(missing))


def _hint(name: str, columns: Mapping[str, Array]) -> str:
    """Name the nearest columns, by the whole name or by its part after the last dot."""
    stem, bracket, index = name.partition("[")
    for versions in _SAME_IN_PX4:
        others = [f"{other}{bracket}{index}" for other in versions if stem in versions and other != stem]
        if any(other in columns for other in others):
            return f" (PX4 of this version has {', '.join(other for other in others if other in columns)})"
    whole = {column.lower(): column for column in columns}
    last = {column.lower().rpartition(".")[2]: column for column in columns}
    # Two letters are alike by chance.
    cutoff = _ALIKE if len(name) > _SHORT_NAME else _ALIKE_SHORT
    nearest = [
        by_name[match]
        for by_name in (last, whole)
        for match in get_close_matches(name.lower(), by_name, n=_MOST_NEAREST, cutoff=cutoff)
    ]
    shown = ", ".join(list(dict.fromkeys(nearest))[:_MOST_NEAREST])
    return f" (nearest: {shown})" if nearest else ""


def columns_in_words(columns: Collection[str]) -> str:
    """Say once what the log holds; of a log of topics, which has hundreds of columns, its topics."""
    of_topics = all("." in column for column in columns)
    names = sorted({column.partition(".")[0] for column in columns}) if of_topics else list(columns)
    what = "topics" if of_topics else "columns"
    return f"the log has the {what} {some(names, _MOST_LISTED) or 'none'}; `cpfls init LOG` proposes the mapping"


def to_program_frames(signals: Mapping[str, Array], settings: ImportSettings) -> dict[str, Array]:
    """Convert signals, shape (time, column), SI, in the log's frames, to those of `Flight`, by its names.

    Those are roll, pitch, yaw, body vectors in FLU and world vectors in ENU.
    """
    # Quaternion, Euler rates and Euler torque are attitude and body vectors too, in the log's own frames.
    own = dict(signals)
    if "quaternion" in own:
        own["attitude"] = attitude_from_quaternion(own.pop("quaternion"), settings.quaternion_order)
    if "attitude_rate" in own:
        own["body_rate"] = rotations.body_rate(own["attitude"], own.pop("attitude_rate"))
    if "torque" in own:
        own["body_torque"] = rotations.body_torque(own["attitude"], own.pop("torque"))
    if "rotor_command" in own and settings.rotor_command_is == "thrust":
        # Thrust goes with the square of the speed; a share below 0 gives none.
        own["rotor_command"] = np.sqrt(np.maximum(own["rotor_command"], 0.0))
    sensed = own.pop("acceleration") if settings.acceleration_frame != "world" and "acceleration" in own else None
    own |= {name: own[name][:, 0] for name in _SCALAR_SIGNALS if name in own}
    own |= {name: body_to_flu(own[name], settings.body_frame) for name in _BODY_SIGNALS if name in own}
    own |= {name: world_to_enu(own[name], settings.world_frame) for name in _WORLD_SIGNALS if name in own}
    if "attitude" in own:
        own["attitude"] = attitude_to_enu_flu(own["attitude"], settings.body_frame, settings.world_frame)
    if sensed is not None:
        own["specific_force"] = body_to_flu(sensed, settings.body_frame)
        if "attitude" in own:
            own["acceleration"] = acceleration_from_specific_force(own["attitude"], own["specific_force"])
    return own


def setpoints_to_program_frames(signals: Mapping[str, Array], settings: ImportSettings) -> dict[str, Array]:
    """Convert setpoints, shape (time, column), SI, NaN where nothing is asked for, as what they are setpoints of.

    They are named as in `SETPOINTS`: attitude is roll, pitch, yaw, also of a quaternion; thrust and sticks as logged.
    """
    named: dict[str, Array] = {short: signals[name] for name, short in SETPOINTS.items() if name in signals}
    named |= {name: world_to_enu(named[name], settings.world_frame) for name in _WORLD_SIGNALS if name in named}
    if "body_rate" in named:
        named["body_rate"] = body_to_flu(named["body_rate"], settings.body_frame)
    if "attitude" in named:
        attitude = np.full((len(named["attitude"]), 3), np.nan)
        known = np.isfinite(named["attitude"]).all(axis=1)
        own = named["attitude"][known]
        if len(own):
            if settings.signals["setpoint_attitude"].unit == "1":
                own = attitude_from_quaternion(own, settings.quaternion_order)
            attitude[known] = continuous_attitude(attitude_to_enu_flu(own, settings.body_frame, settings.world_frame))
        named["attitude"] = attitude
    return named


def body_to_flu(vectors: Array, frame: BodyFrame) -> Array:
    """Convert body vectors, shape (time, 3), to front, left, up (FLU)."""
    return np.asarray(vectors @ _BODY[frame].T)


def world_to_enu(vectors: Array, frame: WorldFrame) -> Array:
    """Convert world vectors, shape (time, 3), to east, north, up (ENU)."""
    return np.asarray(vectors @ _WORLD[frame].T)


def attitude_to_enu_flu(attitude: Array, body: BodyFrame, world: WorldFrame) -> Array:
    """Convert roll, pitch, yaw between frames, ``R_enu,flu = R_enu,world R R_body,flu``.

    Both are of shape (time, 3), rad, intrinsic ZYX, the result without jumps of roll and yaw. A vehicle that heads
    north has yaw 0 in NED and a quarter turn in ENU.
    """
    if (body, world) == ("FLU", "ENU"):
        return attitude
    return euler_angles(_WORLD[world] @ rotations.rotation_matrix(attitude) @ _BODY[body].T)


def attitude_from_quaternion(quaternion: Array, order: Literal["wxyz", "xyzw"]) -> Array:
    """Convert quaternions from body to world, shape (time, 4), of any length, to `euler_angles`."""
    return euler_angles(rotations_of(quaternion, order).as_matrix())


def euler_angles(rotation: Array) -> Array:
    """Extract `rotations.euler_angles`, roll and yaw without jumps; both arbitrary where the pitch is +-90 degrees."""
    return continuous_attitude(rotations.euler_angles(rotation))


def acceleration_from_specific_force(attitude: Array, specific_force: Array) -> Array:
    """Convert specific force, m/s^2, body FLU, to acceleration, ``a = R f - g e_z``, m/s^2, world ENU."""
    acceleration: Array = rotations.multiply(rotations.rotation_matrix(attitude), specific_force)
    acceleration[:, 2] -= STANDARD_GRAVITY
    return acceleration
