"""What the columns of an unknown log are: signals, units, axes and frames, each with the reason for the guess."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.arrays import Array
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.agreement import (
    AxisFit,
    TiltFit,
    first_derivative,
    fit_axes,
    fit_rates,
    fit_tilt,
    on_clock,
    rotations_of,
    second_derivative,
    slow,
)
from cpfls_cli.flightlog.airframe import MovedBy, Parameters, airframe_from_motion
from cpfls_cli.flightlog.flown import Flown, find_flown
from cpfls_cli.flightlog.log_table import (
    ROTORS,
    LogTable,
    holding_values,
    make_grid,
    refuse_dead_rotors,
)
from cpfls_cli.flightlog.nameless import OF_A_MATRIX, nameless_signals
from cpfls_cli.flightlog.names import BY_HAND, Named, column_groups, named_signals
from cpfls_cli.flightlog.recognised import Choice, Guess, Recognition, Rival, Sure
from cpfls_cli.flightlog.rotor_columns import RotorColumns, find_rotors
from cpfls_cli.flightlog.settings import SignalMap, SignalName
from cpfls_cli.flightlog.topics import STAMP, Topics
from cpfls_cli.units import STANDARD_GRAVITY, UnitName, known_unit

_DEGREES = 180 / np.pi
_CLEAR, _GOOD = 0.3, 0.6
"""Shares of a signal that another has to explain to say something about it, and to overrule a name."""

_TOLERANCE = 1.4
_TEN = 10.0
"""Wind and clocks change a size, but not from one unit of length to the next."""

_RADIANS_UP_TO, _DEGREES_FROM = 2.0, 10.0
"""Standard deviation of a gyroscope in flight: below the first it reads rad/s, from the second on deg/s."""

_LARGEST_ANGLE = 6.6
_LARGEST_TILT = 1.7
_SENSED: Final[tuple[tuple[float, UnitName, float], ...]] = (
    (STANDARD_GRAVITY, "m/s^2", 1.0),
    (1.0, "g", 1.0),
    (1000.0, "g", 1e-3),
    (2048.0, "g", 1 / 2048),
    (4096.0, "g", 1 / 4096),
)
_NEAR_GRAVITY, _WEIGHT = 1.3, 1.15
_AS_LEVEL = 0.2
_AS_GOOD = 0.02
_CLOSER = 0.4
"""What is left of a velocity in body axes, as a share of what is left in those of the world, that tells the former."""

_TORQUE_HZ, _FOLLOWS = 6.0, 0.3
_LATE_S = (0.0, 0.03, 0.06, 0.09)


def recognise(topics: Topics, units: Mapping[str, str], parameters: Parameters, system: str) -> Recognition:
    """Propose what the columns of a log are.

    Parameters
    ----------
    topics : mapping from topic to mapping from field to array, shape (sample,)
        As a reader gives them: stamps of topics in s, a flat log as one topic without a name.
    units : mapping from column to str
        That the log states.
    parameters : mapping
        Of the autopilot, or of a header.
    system : str
        What wrote the log; empty where that is not known.

    Raises
    ------
    InputError
        If nothing in the log is recognised, or nothing in it flies.
    """
    log = LogTable(topics, units)
    named = named_signals(column_groups(log.names), system)
    candidates = holding_values(log, named)
    if not candidates and log.flat:
        candidates = holding_values(log, nameless_signals(topics[""], log.clock("")))
    if not candidates:
        shown = ", ".join(log.names[:12]) + (", ..." if len(log.names) > 12 else "")
        raise InputError(f"no column is recognised as a signal of a flight (columns: {shown}): {BY_HAND}")
    refuse_dead_rotors(log, named, candidates)
    make_grid(log, candidates)
    return _Recogniser(log, candidates, parameters, system).result()


@dataclass(frozen=True)
class _Attitude:
    """An attitude that may be the right one, as rotations on the grid."""

    rotation: Rotation
    rates: AxisFit | None

    @property
    def explained(self) -> float:
        """Share of the gyroscope that its derivative explains; 0 where there is nothing to explain."""
        return 0.0 if self.rates is None else self.rates.explained

    @property
    def upright(self) -> float:
        """Mean size of the vertical part of the body's third axis: near 1 for what flies level."""
        return float(np.abs(self.rotation.as_matrix()[:, 2, 2]).mean())


class _Recogniser:
    """Goes through the signals in the order in which each helps with the next."""

    def __init__(
        self, log: LogTable, candidates: Mapping[SignalName, list[Named]], parameters: Parameters, system: str
    ) -> None:
        self.log, self.candidates, self.parameters, self.system = log, candidates, parameters, system
        self.rate_hz = 1 / float(log.grid[1] - log.grid[0])
        self.guesses: dict[SignalName, Guess] = {}
        self.choices: dict[str, Choice] = {}
        self.left_out: list[str] = []
        self.warnings: list[str] = []
        self.part = slice(None)
        self.velocity_share, self.velocity_gain = 0.0, 1.0
        self.level: Array | None = None

    def first(self, name: SignalName) -> Named | None:
        """Give the best candidate for a signal."""
        return next(iter(self.candidates.get(name, ())), None)

    def grid(self, named: Named) -> Array:
        """Give a candidate's columns in the part that is flown."""
        return self.log.on_grid(named.group.columns)[self.part]

    def result(self) -> Recognition:
        """Recognise everything."""
        rotors = find_rotors(
            {
                name: [
                    (named, self.log.values(named.group.columns)[0], self.log.without_spikes(named.group.columns))
                    for named in self.candidates.get(name, ())
                ]
                for name in ("rotor_speed", "rotor_command")
            },
            self.parameters,
            self.system,
        )
        flown = self._find_flown(rotors)
        if not flown.flies:
            raise InputError(flown.reasons[0])
        begin, end = flown.span_s or (0.0, np.inf)
        inside = np.flatnonzero((self.log.grid - self.log.grid[0] >= begin) & (self.log.grid - self.log.grid[0] <= end))
        self.part = slice(int(inside[0]), int(inside[-1]) + 1)
        attitude = self._attitude()
        tilt = self._position(attitude)
        if tilt is not None and self._angles_by_tilt(tilt) == "deg":
            attitude = self._attitude("deg")
            tilt = self._position(attitude)
        self._body_rate(attitude)
        self._acceleration(tilt)
        self._frames(tilt)
        self._beside()
        speeds, moved = self._rotors(rotors)
        self._wrench()
        driving = rotors.speed or rotors.command
        return self._gathered(flown, speeds, moved, "" if driving is None else driving.kind)

    def _find_flown(self, rotors: RotorColumns) -> Flown:
        level = None
        found = rotors.command or rotors.speed
        if found is not None:
            values = self.log.on_grid(found.columns.columns, spikes=False)
            level = (found.columns.scale * values + found.columns.offset).mean(axis=1)
            level = level / max(1.0, float(np.quantile(level, 0.98))) if rotors.command is None else level
        self.level = level
        position, gyro = self.first("position"), self.first("body_rate")
        height = None if position is None else self.log.on_grid(position.group.columns)[:, 2]
        if height is not None and position is not None and position.unit == "mm":
            height = height / 1000
        rate = None
        if gyro is not None:
            values = slow_free(self.log.on_grid(gyro.group.columns))
            rate = np.linalg.norm(values, axis=1) / (_DEGREES if gyro.unit == "deg/s" else 1.0)
        return find_flown(self.log.grid - self.log.grid[0], level, height, rate)

    # Attitude and body rate.

    def _attitude(self, unit: UnitName | None = None) -> _Attitude | None:
        gyro = self.first("body_rate")
        measured = None if gyro is None else self.grid(gyro)
        euler = self.first("attitude")
        for named in self.candidates.get("quaternion", ()):
            if euler is not None and euler.known and not named.known:
                break
            values = self.log.values(named.group.columns)[1]
            if float(np.median(np.abs(np.linalg.norm(values, axis=1) - 1))) < 0.05:
                return self._quaternion(named, measured)
        return None if euler is None else self._euler(euler, measured, unit)

    def _angles_by_tilt(self, tilt: TiltFit) -> UnitName | None:
        """Let the tilt decide the unit of angles that could be either: gravity and the lean make the acceleration."""
        guess = self.guesses.get("attitude")
        if guess is None or not guess.rivals:
            return None
        options: tuple[tuple[float, UnitName], ...] = (
            (1.0, "rad"),
            (1000.0, "rad"),
            (1 / _DEGREES, "deg"),
            (1000.0 / _DEGREES, "deg"),
        )
        unit = min(options, key=lambda option: abs(np.log(tilt.gain / option[0])))[1]
        reason = f"{guess.reason}; in {unit} the lean explains the acceleration"
        self.guesses["attitude"] = replace(guess, reason=reason, sure="data", rivals=())
        return unit

    def _quaternion(self, named: Named, measured: Array | None) -> _Attitude:
        time, values = self.log.values(named.group.columns)
        orders = ("wxyz",) if named.group.kind == "wxyz" else ("wxyz", "xyzw")
        tried: dict[tuple[str, bool], _Attitude] = {}
        for key in ((order, inverse) for inverse in (False, True) for order in orders):
            rotation = on_clock(rotations_of(values, *key), time, self.log.grid[self.part])
            tried[key] = _Attitude(rotation, None if measured is None else fit_rates(rotation, measured, self.rate_hz))
        # In another order a quaternion turns about other axes, which a gyroscope whose axes are free cannot tell;
        # but it does not stay level, as what flies does.
        upright = {key: attitude.upright for key, attitude in tried.items()}
        level = [key for key in tried if upright[key] > max(upright.values()) - _AS_LEVEL]
        shares = {key: tried[key].explained for key in level}
        most = max(shares.values())
        equal = [key for key in level if most < _CLEAR or shares[key] > most - _AS_GOOD]
        leaning = {key: self._leaning(tried[key]) for key in equal} if len(equal) > 1 else {}
        as_named = {key: (fit.as_named if (fit := tried[key].rates) is not None else 0.0) for key in equal}
        best = max(equal, key=lambda key: (round(leaning.get(key, 0.0), 1), round(as_named[key], 1)))
        parted = {leaning[key] for key in equal if key[0] != best[0] and leaning[best] > leaning[key] + _AS_LEVEL}
        self._tell_quaternion(named, best, shares, leaning[best] if parted else None)
        return tried[best]

    def _leaning(self, attitude: _Attitude) -> float:
        """Give the share of the acceleration over ground that the lean of an attitude explains."""
        position, velocity = self.first("position"), self.first("velocity")
        if position is not None:
            moving = second_derivative(self.grid(position), self.rate_hz)
        elif velocity is not None:
            moving = first_derivative(self.grid(velocity), self.rate_hz)
        else:
            return 0.0
        return fit_tilt(attitude.rotation, moving, self.rate_hz, self._lift()).explained

    def _tell_quaternion(
        self, named: Named, best: tuple[str, bool], shares: Mapping[tuple[str, bool], float], leaning: float | None
    ) -> None:
        order, inverse = best
        sign = None
        if inverse:
            sign = (1.0, -1.0, -1.0, -1.0) if order == "wxyz" else (-1.0, -1.0, -1.0, 1.0)
        told = shares[best] > _CLEAR
        data = f"its derivative explains {100 * shares[best]:.0f} % of the gyroscope"
        turned = " when turned from world-to-body, as logged, to body-to-world" if inverse else ""
        reason = f"of length 1; {_called(named)}" + (f"; {data}{turned}" if told else "")
        self.guesses["quaternion"] = Guess(
            signal="quaternion",
            columns=SignalMap(columns=named.group.columns, unit="1", sign=sign),
            reason=reason,
            sure="data" if told else "named",
        )
        others = max((share for (own, _), share in shares.items() if own != order), default=None)
        if named.group.kind == "wxyz":
            choice = Choice("quaternion_order", order, "the columns are named by w, x, y, z", "named")
        elif others is None:
            choice = Choice("quaternion_order", order, "in the other order the vehicle would not stay level", "data")
        elif told and others < shares[best] - 0.05:
            next_best = f"{data}, in the other order {100 * others:.0f} %"
            choice = Choice("quaternion_order", order, next_best, "data")
        elif leaning is not None:
            reason = f"in this order alone the lean explains the acceleration ({100 * leaning:.0f} %)"
            choice = Choice("quaternion_order", order, reason, "data")
        elif named.known:
            choice = Choice("quaternion_order", order, f"a log of {named.known}", "named")
        else:
            other = "xyzw" if order == "wxyz" else "wxyz"
            rival = Rival(f"quaternion_order: {other}", "in both the vehicle stays level, and no gyroscope parts them")
            choice = Choice("quaternion_order", order, "the more usual one", "guess", (rival,))
        self.choices["quaternion_order"] = choice

    def _euler(self, named: Named, measured: Array | None, decided: UnitName | None) -> _Attitude:
        time, values = self.log.values(named.group.columns)
        unit, reason, sure, rivals = self._angle_unit(named, values)
        if decided is not None:
            unit, sure, rivals = decided, "data", ()
            reason = f"{_called(named)}; in {unit} the lean explains the acceleration"
        signs = ((1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, -1.0), (1.0, -1.0, -1.0))
        tried = {}
        for sign in signs:
            angles = np.asarray(sign) * values * known_unit(unit).factor
            rotation = on_clock(Rotation.from_euler("ZYX", angles[:, ::-1]), time, self.log.grid[self.part])
            fit = None if measured is None else fit_rates(rotation, measured, self.rate_hz)
            tried[sign] = (rotation, fit)
        shares = {sign: fit.as_named if fit is not None else 0.0 for sign, (_, fit) in tried.items()}
        best = max(shares, key=lambda sign: shares[sign])
        if shares[best] < _CLEAR or shares[signs[0]] > shares[best] - 0.02:
            best = signs[0]
        told = shares[best] > _CLEAR
        if told:
            flipped = [name for name, sign in zip(("roll", "pitch", "yaw"), best, strict=True) if sign < 0]
            turned = f" with {' and '.join(flipped)} reversed" if flipped else ""
            reason += f"; the derivative explains {100 * shares[best]:.0f} % of the gyroscope{turned}"
            sure = "data" if not rivals else sure
        self.guesses["attitude"] = Guess(
            signal="attitude",
            columns=SignalMap(columns=named.group.columns, unit=unit, sign=None if best == signs[0] else best),
            reason=reason,
            sure=sure,
            rivals=rivals,
        )
        rotation, fit = tried[best]
        return _Attitude(rotation, fit)

    def _angle_unit(self, named: Named, values: Array) -> tuple[UnitName, str, Sure, tuple[Rival, ...]]:
        stated = named.unit
        if stated is not None:
            return stated, f"{_called(named)}, which is in {stated}", "named", ()
        largest = np.quantile(np.abs(values), 0.999, axis=0)
        tilt, turn = float(largest[:2].max()), float(largest[2])
        if tilt > _LARGEST_TILT or turn > 20 * _LARGEST_ANGLE:
            return "deg", f"{_called(named)}; reaches {max(tilt, turn):.3g}, so these are degrees", "data", ()
        rival = Rival("unit: deg", f"a flight that never leans by more than {tilt:.2g} degrees would read the same")
        rivals = () if turn > 1.0 and turn <= _LARGEST_ANGLE and tilt > 0.1 else (rival,)
        return "rad", f"{_called(named)}; leans by {tilt:.2g} at most", "data" if not rivals else "guess", rivals

    def _body_rate(self, attitude: _Attitude | None) -> None:
        named = self.first("body_rate")
        if named is None:
            return
        fit = None if attitude is None else attitude.rates
        stated = named.unit
        if fit is not None and fit.explained > _CLEAR:
            unit, scale, agrees = _rate_unit(fit.gain)
            if agrees or stated is None:
                if stated is not None and known_unit(stated).factor != known_unit(unit).factor * scale:
                    self.warnings.append(f"{named.group.pattern} is said to be in {stated}; its size says {unit}")
                self.guesses["body_rate"] = _rates_by_data(named, fit, unit, scale, agrees)
                return
        values = self.grid(named)
        spread = float(np.sqrt(values.var(axis=0).sum()))
        if stated is not None:
            guess: tuple[UnitName, Sure, tuple[Rival, ...]] = (stated, "named", ())
        elif spread < _RADIANS_UP_TO:
            guess = ("rad/s", "data", ())
        elif spread > _DEGREES_FROM:
            guess = ("deg/s", "data", ())
        else:
            rival = Rival("unit: deg/s", f"a spread of {spread:.2g} is possible in both")
            guess = ("rad/s", "guess", (rival,))
        unit, sure, rivals = guess
        size = f"a spread of {spread:.2g} in flight" if stated is None else f"which is in {stated}"
        turned = "" if named.sign is None else "; signs as that log has them"
        none = "; no attitude that turns is there to hold it against"
        self.guesses["body_rate"] = Guess(
            signal="body_rate",
            columns=SignalMap(columns=named.group.columns, unit=unit, scale=named.scale, sign=named.sign),
            reason=f"{_called(named)}, {size}{turned}{none}",
            sure=sure,
            rivals=rivals,
        )

    # Position, velocity and what they say of frames.

    def _position(self, attitude: _Attitude | None) -> TiltFit | None:
        position, velocity = self.first("position"), self.first("velocity")
        moving = None
        if velocity is not None:
            velocity = self._velocity(velocity, position, attitude)
        if position is not None:
            moving = second_derivative(self.grid(position), self.rate_hz)
        elif velocity is not None:
            moving = first_derivative(self.grid(velocity), self.rate_hz)
        tilt = (
            None
            if moving is None or attitude is None
            else fit_tilt(attitude.rotation, moving, self.rate_hz, self._lift())
        )
        if tilt is not None and tilt.explained < _CLEAR:
            tilt = None
        if position is not None:
            self._tell_place("position", position, ("m", "mm"), tilt)
        if velocity is not None:
            self._tell_place("velocity", velocity, ("m/s", "mm/s"), tilt)
        return tilt

    def _lift(self) -> Array | None:
        """Give what grows with the thrust: the rotors' level squared, or the size of what an accelerometer senses."""
        if self.level is not None:
            return np.asarray(self.level[self.part] ** 2)
        for named in self.candidates.get("acceleration", ()):
            size = np.linalg.norm(self.grid(named), axis=1)
            if any(1 / _NEAR_GRAVITY < float(np.median(size)) / level < _NEAR_GRAVITY for level, _, _ in _SENSED):
                return np.asarray(size)
        return None

    def _velocity(self, velocity: Named, position: Named | None, attitude: _Attitude | None) -> Named | None:
        """Give the velocity back where it is that of the world."""
        if position is None:
            return velocity
        derived = first_derivative(self.grid(position), self.rate_hz)
        measured = slow(self.grid(velocity), self.rate_hz)
        world = fit_axes(slow(derived, self.rate_hz), measured)
        if attitude is not None:
            in_body = attitude.rotation.inv().apply(derived)
            body = fit_axes(slow(in_body, self.rate_hz), measured)
            if body.explained > _GOOD and 1 - body.explained < _CLOSER * (1 - world.explained):
                self.left_out.append(
                    f"{velocity.group.pattern}: a velocity in body axes (the position's derivative explains"
                    f" {100 * body.explained:.0f} % there, {100 * world.explained:.0f} % in the world); import.signals"
                    " takes velocities of the world"
                )
                return None
        self.velocity_share, self.velocity_gain = world.explained, world.gain
        return velocity

    def _tell_place(
        self,
        name: Literal["position", "velocity"],
        named: Named,
        units: tuple[UnitName, UnitName],
        tilt: TiltFit | None,
    ) -> None:
        stated = named.unit
        unit: UnitName = stated or units[0]
        sure: Sure = "named"
        reason = f"{_called(named)}"
        rivals: tuple[Rival, ...] = ()
        place = self.guesses.get("position")
        if name == "velocity" and stated is None and place is not None and self.velocity_share > _CLEAR:
            # What it is in follows from the position, whatever else is logged in other units.
            small = known_unit(place.columns.unit).factor / self.velocity_gain < 0.03
            unit, sure = units[1] if small else units[0], place.sure
        elif tilt is not None and stated is None:
            unit = units[1] if tilt.gain > 100 else units[0]
            sure = "data" if 1 / _TEN < tilt.gain / (1000 if unit == units[1] else 1) < _TEN else "guess"
            reason += (
                f"; tilt and gravity explain {100 * tilt.explained:.0f} % of the acceleration in {unit.split('/')[0]}"
            )
        elif stated is None:
            spread = float(np.ptp(self.grid(named), axis=0).max())
            sure = "data" if spread < 50 else "guess"
            reason += f"; ranges over {spread:.3g}"
            rivals = () if sure == "data" else (Rival(f"unit: {units[1]}", "no attitude that leans speaks against it"),)
        else:
            reason += f", which is in {stated}"
        if name == "velocity" and self.velocity_share > _CLEAR:
            reason += f"; the position's derivative explains {100 * self.velocity_share:.0f} % of it"
        columns, sign = _in_world_of_attitude(named.group.columns, tilt)
        if columns != named.group.columns or sign is not None:
            reason += "; turned into the axes of the attitude, as the tilt asks for"
        self.guesses[name] = Guess(
            signal=name,
            columns=SignalMap(columns=columns, unit=unit, scale=named.scale, sign=sign),
            reason=reason,
            sure=sure,
            rivals=rivals,
        )

    # The accelerometer.

    def _acceleration(self, tilt: TiltFit | None) -> None:
        for named in self.candidates.get("acceleration", ()):
            if self._take_acceleration(named, tilt):
                return

    def _take_acceleration(self, named: Named, tilt: TiltFit | None) -> bool:
        values = self.grid(named)
        vertical = float(np.median(values[:, 2]))
        stated = named.unit
        carried = self._carried(tilt)
        sensed = [
            (level, unit, scale)
            for level, unit, scale in _SENSED
            if 1 / _NEAR_GRAVITY < abs(vertical) / (carried * level) < _NEAR_GRAVITY and unit == (stated or unit)
        ]
        world = self._world_acceleration()
        ground = np.array([1.0, 1.0, 0.0 if sensed else 1.0])
        along_world = (
            None
            if world is None
            else fit_axes(slow(ground * world, self.rate_hz, 1.0), slow(ground * values, self.rate_hz, 1.0))
        )
        if sensed:
            # In body axes next to nothing is sensed along x and y in flight; over ground the world's axes have it all.
            of_body = named.frame in ("FLU", "FRD")
            if along_world is not None and along_world.as_named > _GOOD and along_world.gain > 0.5 and not of_body:
                self.left_out.append(
                    f"{named.group.pattern}: an acceleration of the world with gravity in it (the motion explains"
                    f" {100 * along_world.as_named:.0f} %), which import.signals has no word for"
                )
                return False
            self._tell_sensed(named, vertical, carried, sensed[0], tilt)
            return True
        if along_world is None or along_world.explained < _CLEAR:
            self.left_out.append(
                f"{named.group.pattern}: no gravity is in it (z has a median of {vertical:.3g}), and the motion over"
                " ground does not explain it"
            )
            return False
        unit: UnitName = "g" if abs(np.log(along_world.gain * STANDARD_GRAVITY)) < np.log(2) else "m/s^2"
        self.guesses["acceleration"] = Guess(
            signal="acceleration",
            columns=SignalMap(columns=named.group.columns, unit=stated or unit, scale=named.scale),
            reason=f"{_called(named)}; the motion over ground explains {100 * along_world.explained:.0f} %, in"
            f" {stated or unit}, and no gravity is in it",
            sure="data",
        )
        self.choices["acceleration_frame"] = Choice(
            "acceleration_frame", "world", "the acceleration has no gravity in it and follows the motion", "data"
        )
        return True

    def _carried(self, tilt: TiltFit | None) -> float:
        """Give how many times its weight the rotors carry, by the motion; 1 where that says nothing."""
        position = self.first("position")
        if position is None or tilt is None:
            return 1.0
        moving = second_derivative(self.grid(position), self.rate_hz) / (1000.0 if tilt.gain > 100 else 1.0)
        up = tilt.sign[2] * (1.0 if tilt.body == "FLU" else -1.0)
        size = np.linalg.norm(moving + np.array([0.0, 0.0, up * STANDARD_GRAVITY]), axis=1)
        return float(np.median(size)) / STANDARD_GRAVITY

    def _world_acceleration(self) -> Array | None:
        position, velocity = self.first("position"), self.guesses.get("velocity")
        if velocity is not None:
            return first_derivative(self.log.on_grid(velocity.columns.columns)[self.part], self.rate_hz)
        return None if position is None else second_derivative(self.grid(position), self.rate_hz)

    def _tell_sensed(
        self, named: Named, vertical: float, carried: float, sensed: tuple[float, UnitName, float], tilt: TiltFit | None
    ) -> None:
        _, unit, scale = sensed
        up = "FLU" if vertical > 0 else "FRD"
        body = tilt.body if tilt is not None else named.frame if named.frame in ("FLU", "FRD") else None
        sign = None
        weight = "gravity" if 1 / _WEIGHT < carried < _WEIGHT else f"{carried:.2g} times gravity, as it moves"
        reason = f"{_called(named)}; z has a median of {vertical:.3g} in flight: {weight}, in {unit}"
        if body is not None and body != up:
            sign = (-1.0, -1.0, -1.0)
            reason += f", and points the wrong way for {body}, so it is gravity that is logged, not what carries it"
        self.guesses["acceleration"] = Guess(
            signal="acceleration",
            columns=SignalMap(columns=named.group.columns, unit=unit, scale=scale, sign=sign),
            reason=reason,
            sure="data",
        )
        self.choices["acceleration_frame"] = Choice(
            "acceleration_frame", "body-specific-force", f"gravity stays in z (median {vertical:.3g}) in flight", "data"
        )
        if body is None:
            points = "up" if up == "FLU" else "down"
            self.choices["body_frame"] = Choice(
                "body_frame", up, f"the accelerometer reads {vertical:.3g} along z, so z points {points}", "data"
            )

    def _frames(self, tilt: TiltFit | None) -> None:
        """Choose the frames: from the tilt, from the accelerometer, from the kind of log, or as usual."""
        bodies = {_BODY_OF.get(str(named.frame)) for found in self.candidates.values() for named in found[:1]} - {None}
        known = next((named.known for found in self.candidates.values() for named in found[:1] if named.frame), "")
        if tilt is not None:
            reason = f"leaning explains {100 * tilt.explained:.0f} % of the acceleration with body z {_UP[tilt.body]}"
            self.choices["body_frame"] = Choice("body_frame", tilt.body, reason, "data")
            if bodies and tilt.body not in bodies:
                self.warnings.append(
                    f"a log of {known} is in {', '.join(map(str, bodies))}, and its motion says {tilt.body}"
                )
        elif bodies:
            frame = min(map(str, bodies))
            self.choices["body_frame"] = Choice("body_frame", str(frame), f"a log of {known}", "named")
        elif "body_frame" not in self.choices and self.guesses.keys() & _WITH_BODY:
            rival = Rival("body_frame: FRD", "nothing in the log tells y left, z up from y right, z down")
            self.choices["body_frame"] = Choice("body_frame", "FLU", "taken as the usual one", "guess", (rival,))
        if not self.guesses.keys() & {"position", "velocity", "attitude", "quaternion"}:
            return
        body = self.choices["body_frame"].value if "body_frame" in self.choices else "FLU"
        world = {"FLU": "ENU", "FRD": "NED"}[body]
        sure = self.choices["body_frame"].sure if "body_frame" in self.choices else "guess"
        reason = "z of the world points where z of the level body does; x and y of it matter to no model"
        self.choices["world_frame"] = Choice("world_frame", world, reason, sure)

    # The rest.

    def _wrench(self) -> None:
        """Take torque and thrust where the log has no rotors; beside rotors they are what a controller asked for."""
        torque, thrust, rate = self.first("body_torque"), self.first("thrust"), self.guesses.get("body_rate")
        if torque is None:
            return
        if self.guesses.keys() & set(ROTORS) or rate is None:
            self.left_out.append(f"{torque.group.pattern}: looks like a torque that is asked for; the rotors say more")
            return
        turning = first_derivative(self.log.on_grid(rate.columns.columns)[self.part], self.rate_hz)
        shares = [self._follows(turning, self.grid(torque), late) for late in _LATE_S]
        share = max(shares, key=min)
        if not min(share) > _FOLLOWS:
            self.left_out.append(f"{torque.group.pattern}: looks like a torque, and the motion does not follow it")
            return
        scale = (Rival("unit: N mm", "inertia, which no log states, makes the scale"),)
        self.guesses["body_torque"] = Guess(
            signal="body_torque",
            columns=SignalMap(columns=torque.group.columns, unit=torque.unit or "N m"),
            reason=f"{_called(torque)}; the angular acceleration follows it (correlation {share[0]:.2f} about roll,"
            f" {share[1]:.2f} about pitch); a commanded one is what a controller asked for",
            sure="guess" if torque.unit is None else "named",
            rivals=scale if torque.unit is None else (),
        )
        if thrust is not None:
            self.guesses["thrust"] = Guess(
                signal="thrust",
                columns=SignalMap(columns=thrust.group.columns, unit="N"),
                reason=f"{_called(thrust)}; {float(np.median(self.grid(thrust))):.3g} in flight, which has to be the"
                " weight in N",
                sure="guess",
            )

    def _follows(self, turning: Array, torque: Array, late_s: float) -> list[float]:
        """Correlate angular acceleration with a torque some time before, about roll and pitch."""
        steps = round(late_s * self.rate_hz)
        own = slow(turning[steps:], self.rate_hz, _TORQUE_HZ)
        other = slow(torque[: len(torque) - steps], self.rate_hz, _TORQUE_HZ)
        return [_together(own[:, axis], other[:, axis]) for axis in range(2)]

    def _beside(self) -> None:
        voltage = self.first("voltage")
        if voltage is None:
            return
        level = float(np.median(self.grid(voltage)))
        scale = voltage.scale if voltage.known else 1e-3 if level > 1000 else 1.0
        self.guesses["voltage"] = Guess(
            signal="voltage",
            columns=SignalMap(columns=voltage.group.columns, unit="V", scale=scale, required=False),
            reason=f"{_called(voltage)}; {level * scale:.3g} V in flight",
            sure="named",
        )

    def _rotors(self, rotors: RotorColumns) -> tuple[Array | None, MovedBy | None]:
        self.left_out += rotors.left_out
        self.warnings += rotors.warnings
        speeds = None
        for name, found in (("rotor_command", rotors.command), ("rotor_speed", rotors.speed)):
            if found is not None:
                self.guesses[found.signal] = Guess(
                    signal=found.signal,
                    columns=found.columns,
                    reason=found.reason,
                    sure=found.sure,
                    rivals=tuple(Rival(*rival) for rival in found.rivals),
                )
                values = self.log.on_grid(found.columns.columns, spikes=False)[self.part]
                signed = np.asarray(found.columns.sign or np.ones(values.shape[1]))
                factor = known_unit(found.columns.unit).factor
                speeds = factor * signed * (found.columns.scale * values + found.columns.offset)
                if name == "rotor_command" and rotors.command_is == "thrust":
                    speeds = np.sqrt(np.maximum(speeds, 0.0))
        if rotors.command is not None and rotors.command.columns.unit == "1":
            choice = Choice(
                "rotor_command_is",
                rotors.command_is,
                rotors.command_reason,
                rotors.command_sure,
                tuple(Rival(*rival) for rival in rotors.command_rivals),
            )
            self.choices["rotor_command_is"] = choice
        rate = self.guesses.get("body_rate")
        if speeds is None or rate is None:
            return speeds, None
        values = self.log.on_grid(rate.columns.columns)[self.part]
        signed = np.asarray(rate.columns.sign or (1.0, 1.0, 1.0))
        body = known_unit(rate.columns.unit).factor * rate.columns.scale * signed * values
        if self.choices["body_frame"].value == "FRD":
            body = body * np.array([1.0, -1.0, -1.0])
        return speeds, airframe_from_motion(body, speeds, self.rate_hz, rotors.speed is None)

    def _gathered(self, flown: Flown, speeds: Array | None, moved: MovedBy | None, kind: str) -> Recognition:
        order: tuple[SignalName, ...] = (
            "quaternion",
            "attitude",
            "body_rate",
            "acceleration",
            "position",
            "velocity",
            "rotor_speed",
            "rotor_command",
            "body_torque",
            "thrust",
            "voltage",
        )
        signals = tuple(self.guesses[name] for name in order if name in self.guesses)
        rates = {guess.signal: self.log.rate_hz(guess.columns.columns) for guess in signals}
        # An accelerometer is often logged faster than all that matters more.
        clocked = [g for g in signals if g.signal not in ("voltage", "acceleration")] or list(signals)
        base = max(clocked, key=lambda g: rates[g.signal])
        time_column, unit = self.log.time_column, self.log.time_unit
        begin = self.log.clock("")[0] if self.log.flat else 0.0
        if not self.log.flat:
            topic = self.log.parts(base.columns.columns[0])[0]
            time_column, unit = f"{topic}.{STAMP}", "us"
            begin = float(self.log.clock(topic)[0])
        if flown.span_s is not None:
            # import.crop_s counts from the first stamp of the clock.
            off = float(self.log.grid[0]) - float(begin)
            flown = replace(flown, span_s=(max(0.0, round(flown.span_s[0] + off, 2)), round(flown.span_s[1] + off, 2)))
        return Recognition(
            time_column=time_column,
            time_unit=unit,
            signals=signals,
            choices=tuple(self.choices.values()),
            left_out=tuple(self.left_out),
            flown=flown,
            rate_hz=rates[base.signal],
            slowest_s=max(1 / rates[g.signal] for g in signals),
            slowest_but_voltage_s=max(1 / rates[g.signal] for g in signals if g.signal != "voltage"),
            kind=kind,
            moved=moved,
            speeds=speeds,
            warnings=tuple(self.warnings),
        )


_WITH_BODY = {"body_rate", "acceleration", "attitude", "quaternion"}
_BODY_OF: Final = {"FLU": "FLU", "ENU": "FLU", "FRD": "FRD", "NED": "FRD"}
_UP: Final = {"FLU": "up", "FRD": "down"}


def slow_free(values: Array) -> Array:
    """Take the median of each column away."""
    return np.asarray(values - np.median(values, axis=0))


def _together(first: Array, second: Array) -> float:
    """Correlate two signals; 0 where one of them stands still."""
    return float(np.corrcoef(first, second)[0, 1]) if first.std() > 0 and second.std() > 0 else 0.0


def _called(named: Named) -> str:
    pattern = named.group.pattern
    if named.known == OF_A_MATRIX:
        return f"{pattern} of {OF_A_MATRIX}"
    if any(letter.isalnum() for letter in pattern):
        return f"a log of {named.known} calls it {pattern}" if named.known else f"called {pattern}"
    return f"called {', '.join(named.group.columns)}"


def _rate_unit(gain: float) -> tuple[UnitName, float, bool]:
    """Tell the unit of a gyroscope from its size beside the attitude's derivative, and whether the size fits."""
    options: tuple[tuple[float, UnitName, float], ...] = (
        (1.0, "rad/s", 1.0),
        (_DEGREES, "deg/s", 1.0),
        (1000.0, "rad/s", 1e-3),
    )
    size, unit, scale = min(options, key=lambda option: abs(np.log(gain / option[0])))
    return unit, scale, bool(abs(np.log(gain / size)) < np.log(_TOLERANCE))


def _rates_by_data(named: Named, fit: AxisFit, unit: UnitName, scale: float, agrees: bool) -> Guess:
    columns = tuple(named.group.columns[index] for index in fit.order)
    sign = None if fit.sign == (1.0, 1.0, 1.0) else fit.sign
    axes = "" if fit.is_as_named else ", with its axes in this order and with these signs"
    better = f"{fit.times_better:.1f} times better than in any other order or with other signs"
    share = f"{100 * fit.explained:.0f} %"
    gain = f"{fit.gain:.3g}"
    large = "as large" if gain == "1" else f"{gain} times as large"
    size = f" and is {large}, so it is in {unit}" if scale == 1.0 else f", in thousandths of {unit}"
    return Guess(
        signal="body_rate",
        columns=SignalMap(columns=columns, unit=unit, scale=scale, sign=sign),
        reason=f"{_called(named)}; follows the attitude's derivative{axes} ({share}, {better}){size}",
        sure="data" if agrees else "guess",
    )


def _in_world_of_attitude(
    columns: tuple[str, ...], tilt: TiltFit | None
) -> tuple[tuple[str, ...], tuple[float, ...] | None]:
    if tilt is None:
        return columns, None
    ordered = (columns[tilt.order[0]], columns[tilt.order[1]], columns[2])
    return ordered, None if tilt.sign == (1.0, 1.0, 1.0) else tilt.sign
