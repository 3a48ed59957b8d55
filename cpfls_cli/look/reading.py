"""Any log of a multirotor as a `LogFlight`: what the import recognises, what only `look` asks for, what drives it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation, uniform_filter1d

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.autopilots.motors import MixerRule, ThrustCurve, factor_mix
from cpfls_cli.autopilots.parameters import Autopilot, version_of
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.airframe import Airframe
from cpfls_cli.flightlog.conversion import (
    BodyFrame,
    WorldFrame,
    as_mapped,
    attitude_from_quaternion,
    attitude_to_enu_flu,
)
from cpfls_cli.flightlog.crash import ALIVE
from cpfls_cli.flightlog.names import column_groups, named_signals
from cpfls_cli.flightlog.proposal import KnownLog, airframe_of
from cpfls_cli.flightlog.recognised import Guess, Recognition
from cpfls_cli.flightlog.recognition import recognise
from cpfls_cli.flightlog.repair import unwrap_angles
from cpfls_cli.flightlog.settings import SignalName
from cpfls_cli.flightlog.stated_vehicle import FAST_HZ, Parameters, forward_flight, log_faster
from cpfls_cli.flightlog.topics import REBUILT, Topics, column_names
from cpfls_cli.look.columns import FRD, LookedLog, along_each, on_clock
from cpfls_cli.look.flight import LogFlight, Samples
from cpfls_cli.units import SPEED_UNITS, STANDARD_GRAVITY, known_unit
from cpfls_cli.words import joined

_OF_OUTPUT, _FAST_HZ, _SLOWEST_HZ = 0.7, 40.0, 4.0
"""Times as fast as the output of the rate loop that rotors have to be logged to be taken before it, and Hz; and Hz
below which a command says nothing of motion."""

_LARGEST: Final = 0.999
"""Quantile of speeds that is taken for the largest."""

_OLD_FULL, _FULL = 4500.0, 3.0
"""Full command of ArduCopter before 3.4, and the root mean square that no commands of the versions since have."""


@dataclass(frozen=True)
class Rotors:
    """Commands of rotors as a log holds them, shares of full, and where they are; measured speeds in rad/s."""

    samples: Samples | None
    guess: Guess | None
    airframe: Airframe | None
    speeds: Samples | None = None

    @property
    def source(self) -> str:
        """``logged``, ``rebuilt`` of what goes into a mixer, or empty where there are none."""
        if self.samples is None or self.guess is None:
            return ""
        rebuilt = self.guess.columns.mixer is not None or self.guess.columns.columns[0].startswith(f"{REBUILT}.")
        return "rebuilt" if rebuilt else "logged"

    def layout(self) -> tuple[Array, Array | None] | None:
        """Give places, shape (rotor, 2), forward and right as shares of the arm, and spins; None where not known."""
        rotors = () if self.airframe is None else self.airframe.rotors
        known = self.samples or self.speeds
        if not rotors or (known is not None and known.values.shape[1] != len(rotors)):
            return None
        places = np.array([rotor.direction for rotor in rotors]) * [1.0, -1.0]
        spins = np.array([rotor.spin for rotor in rotors], dtype=float)
        return places / float(np.hypot(*places.T).max()), spins if spins.all() else None

    def thrusts(self, curve: ThrustCurve) -> Samples | None:
        """Give shares of full thrust, shape (sample, rotor): of commands, or else of the largest measured speeds."""
        if self.samples is None:
            of_largest = self.speeds and as_shares(self.speeds)
            return of_largest and of_largest._replace(values=of_largest.values**2)
        asks_speeds = self.guess is not None and self.guess.columns.unit in SPEED_UNITS
        values = self.samples.values**2 if asks_speeds else curve.thrust(self.samples.values)
        return self.samples._replace(values=values)


def as_shares(speeds: Samples) -> Samples:
    """Give speeds of rotors as shares of the largest."""
    most = float(np.quantile(speeds.values.max(axis=1), _LARGEST))
    return speeds._replace(values=np.clip(speeds.values / most, 0.0, 1.0) if most > 0 else speeds.values)


class Driving(NamedTuple):
    """What acts on a vehicle.

    `command`: about roll, pitch and yaw, shares of the full command; `source`: where that is known from; places and
    spins as `LogFlight` has them.
    """

    command: Samples | None
    source: str
    places: Array | None
    spins: Array | None


def find_driving(
    log: LookedLog, rotors: Rotors, autopilot: Autopilot | None, parameters: Parameters, torque: Samples | None = None
) -> Driving:
    """Find what acts about each axis: rotors that are logged fast, or else what the rate loop puts out.

    Rotors come first since they hold what limits make of the output. `torque`: that a controller asks for in a log of
    no known autopilot, N m.
    """
    output, (places, spins) = _output(log, autopilot), rotors.layout() or (None, None)
    if output is None and torque is not None:
        size = np.abs(torque.values)
        output = Samples(torque.time, torque.values / size.max(), f"{torque.source} as shares of the largest")
    own = None
    if places is not None and spins is not None:
        own = _by_rotors(rotors, places, spins, autopilot, parameters)
    if own is not None and spins is not None and output is not None and along_each(own, output)[0][2] < -_FOLLOWS:
        # All propellers turn the other way than is usual.
        spins, own = -spins, own._replace(values=own.values * [1.0, 1.0, -1.0])
    least_hz = _SLOWEST_HZ if output is None else max(_OF_OUTPUT * output.rate_hz, _FAST_HZ)
    fast = own is not None and own.rate_hz >= least_hz
    if own is not None and fast and (output is None or rotors.source == "logged"):
        words = f"{rotors.source} rotors" if rotors.samples is not None else "speeds of rotors"
        return Driving(own, f"{words}, {own.source}", places, spins)
    source = "" if output is None else f"output of the rate loop, {output.source}"
    return Driving(output, source, places, spins)


def _output(log: LookedLog, autopilot: Autopilot | None) -> Samples | None:
    if autopilot is not None and autopilot.name == "betaflight":
        return _sum_of_terms(log)
    found = next(log.found("output"), None)
    if found is not None and found.source.startswith("RATE.") and float(np.sqrt(np.mean(found.values**2))) > _FULL:
        found = found._replace(values=found.values / _OLD_FULL)
    return found if found is not None and float(np.ptp(found.values)) > 0 else None


def _sum_of_terms(log: LookedLog) -> Samples | None:
    """Add the terms of a PID of Betaflight, in thousandths; a log holds those that its gains need."""
    total: Samples | None = None
    for term in "PIDFS":
        for axis in range(3):
            part = log.samples((f"axis{term}[{axis}]",))
            if part is not None:
                total = total or Samples(part.time, np.zeros((len(part.time), 3)), "axisP, I, D, F")
                total.values[:, axis] += part.values[:, 0] * FRD[axis] / 1000
    return total


def _by_rotors(
    rotors: Rotors, places: Array, spins: Array, autopilot: Autopilot | None, parameters: Parameters
) -> Samples | None:
    thrusts = rotors.thrusts(_curve(rotors, autopilot, parameters))
    rows = np.column_stack([np.ones(len(spins)), places, spins])
    if thrusts is None or np.linalg.matrix_rank(rows, tol=1e-6) < rows.shape[1]:
        return None
    rule = autopilot.mixer if autopilot else MixerRule("peak", 1.0, 1.0)
    columns = factor_mix(rule, places, spins, inverse=rule.by == "power")
    return thrusts._replace(values=(thrusts.values @ np.linalg.pinv(columns).T)[:, 1:])


def _curve(rotors: Rotors, autopilot: Autopilot | None, parameters: Parameters) -> ThrustCurve:
    """Give what the autopilot takes thrust to be of the signal that is logged."""
    known = autopilot.in_log(parameters) if autopilot else {}
    # PX4 bends what it sends to motors, behind this topic.
    straight = rotors.guess is not None and rotors.guess.columns.columns[0].startswith("actuator_motors")
    if autopilot is None or not known or straight:
        return ThrustCurve()
    curve = autopilot.law(autopilot.of_log(known)).curve
    # The range that Betaflight's header states begins where motors idle.
    return replace(curve, low=0.0, high=1.0) if autopilot.name == "betaflight" else curve


_DEGREES: Final = 180 / np.pi
_MOST_HZ: Final = 1000.0
_GAP_STEPS, _GAP_S, _AROUND_S = 2.5, 0.01, 0.01
"""Steps and s without a sample from which on there is a gap, and s on both of its sides that are not used."""

_P_SCALE: Final = 0.032029
"""Of Betaflight from 3 on: share of a thousand that a P of 1 gives for an error of 1 deg/s."""

_CLOSE, _SAME_SIZE = 0.9, 0.1
"""Correlation from which on two signals are of one motion, and by which their sizes may differ."""

_FOLLOWS: Final = 0.6
"""Correlation from which on one signal is another one's, but for its sign and size."""

_DEBUG_GYRO: Final = 6
"""Of Betaflight's debug_mode: what the gyroscope reads before filters, in deg/s."""

_REST_S, _STILL_RAD_S, _MISREADS = 2.0, 0.05, 0.05
"""How far from a flight, and for how long at least, it stands, s; the rate below which it does; and the share by which
an accelerometer that reads wrong there shows no hover."""

_LEAST_V, _LARGEST_V, _LEAST_A = 2.0, 100.0, 1.0
"""Of any battery of a multirotor; and the current below which none flies: one of 27 g takes 2 A of one cell, and more
cells are for larger ones."""
_BODY: Final[tuple[SignalName, ...]] = ("body_rate", "setpoint_body_rate", "sticks", "acceleration", "body_torque")
_SURFACES: Final = ("aileron", "elevator", "rudder", "elevon")  # Which move an airplane.
_OLD_GAINS: Final = ("RATE_RLL_", "RATE_PIT_", "RATE_YAW_")
"""Of ArduCopter before 3.4."""


def read_flight(
    name: str,
    topics: Topics,
    units: Mapping[str, str],
    parameters: Parameters,
    system: str,
    recognition: Recognition | None = None,
) -> LogFlight:
    """Read the signals of a log as its reader gives it.

    Parameters
    ----------
    topics, units, parameters, system
        As `LogContents` has them.
    recognition : Recognition or None
        What `recognise` takes the log for, where that is known.

    Raises
    ------
    InputError
        If the log holds no flight of a multirotor, or no body rates: what it is, and what is missing.
    """
    recognition = recognition or recognise(topics, units, parameters, system)
    # Commands that are rebuilt stand in a topic of their own.
    rebuilt = recognition.rebuilt
    held = topics if rebuilt is None else {**topics, REBUILT: rebuilt.topic}
    return _Reader(name, LookedLog(held, units, system), recognition, parameters).flight()


class _Reader:
    """One log, and what it was taken for."""

    def __init__(self, name: str, log: LookedLog, recognition: Recognition, parameters: Parameters) -> None:
        self.name, self.log, self.recognition, self.parameters = name, log, recognition, parameters
        self.system = log.system
        wrote = (own for own in AUTOPILOTS.values() if self.system and own.firmware.wrote(self.system))
        self.autopilot = next(wrote, None)

    def flight(self) -> LogFlight:
        """Gather all signals on one clock."""
        rate = self._rate(gyroscope := self._gyroscope())
        speeds, commands = self.signal("rotor_speed"), self.signal("rotor_command")
        guess = self.recognition.signal("rotor_command")
        asks_speeds = guess is not None and guess.columns.unit in SPEED_UNITS
        commands = as_shares(commands) if commands is not None and asks_speeds else commands
        rotors = Rotors(commands, guess, self._airframe(), speeds)
        driving = find_driving(self.log, rotors, self.autopilot, self.parameters, self.signal("body_torque"))
        attitude = self._as_angles(self.recognition.signal("quaternion") or self.recognition.signal("attitude"))
        asked = self._as_angles(self.recognition.signal("setpoint_attitude"))
        setpoint, sticks = self._rate_setpoint(gyroscope), self._sticks()
        thrust = rotors.samples or next(self.log.found("collective"), None) or rotors.thrusts(ThrustCurve())
        if driving.command is None and not any((rotors.samples, speeds, setpoint, asked, sticks)):
            faster = log_faster("rotors or setpoints", FAST_HZ, self.system, parameters=self.parameters)
            raise InputError(f"holds motion, but neither rotors nor anything that was asked of them is known: {faster}")
        if thrust is not None and float(thrust.values.max()) < ALIVE:
            raise InputError(f"no flight in it: the thrust that is asked for ({thrust.source}) stays at 0")
        clock = _clock(rate, driving.command)
        (height, climb), force, gaps = self._heights(), self._force(), _gaps(rate, driving.command)
        on, command = (on_clock(each, clock, 3, cubic=True) for each in (rate, driving.command))
        forward = forward_flight(self.log.table.topics, clock) if self.recognition.winged else None
        whole = np.isfinite(on).all(axis=1) & ~_within(clock, gaps, _AROUND_S) & (forward is None or ~forward)
        flown = self._flown(clock)
        felt, reads = _felt(flown, on, on_clock(force, clock, 3), 1 / float(clock[1] - clock[0]))
        voltage, current = self._load(clock, flown)
        return LogFlight(
            name=self.name,
            autopilot=self.autopilot.name if self.autopilot else "",
            system=self.system,
            parameters=self.parameters,
            rate_hz=1 / float(clock[1] - clock[0]),
            time=clock,
            body_rate=on,
            command=command,
            command_source=driving.source,
            rate_setpoint=on_clock(setpoint, clock, 3, cubic=True),
            unfollowed="setpoint_body_rate" in self.recognition.unfollowed,
            stick=on_clock(sticks, clock, 3),
            attitude_setpoint=on_clock(asked, clock, 3),
            attitude=on_clock(attitude, clock, 3),
            collective=on_clock(thrust, clock, 1).mean(axis=1),
            voltage=voltage,
            current=current,
            height=on_clock(height, clock, 1)[:, 0],
            climb_rate=on_clock(climb, clock, 1)[:, 0],
            specific_force=felt,
            relative=asks_speeds or (speeds is not None and thrust is not None and thrust.source == speeds.source),
            flown=flown,
            usable=flown & whole & (np.isfinite(command).all(axis=1) | (driving.command is None)),
            rotors=rotors.samples or Samples(np.empty(0), np.empty((0, 0))),
            rotors_source=rotors.source,
            rotor_speed=speeds,
            places=driving.places,
            spins=driving.spins,
            gyroscope=gyroscope,
            gyroscope_unfiltered=self._unfiltered(gyroscope, rate),
            accelerometer=force,
            reads_at_rest=reads,
            gaps_s=gaps,
            gains=_gains(self.autopilot, self.parameters),
        )

    def _airframe(self) -> Airframe | None:
        columns = frozenset(column_names(self.log.table.topics))
        known = KnownLog(self.name, self.recognition, self.parameters, self.system, columns)
        return airframe_of([known])[0] if self.recognition.rotors else None

    def signal(self, name: SignalName) -> Samples | None:
        """Give what is recognised, in SI, that of the body in axes forward, right, down; None where it is not."""
        guess = next((own for own in self.recognition.signals if own.signal == name), None)
        return None if guess is None else self._mapped(guess)

    def _mapped(self, guess: Guess) -> Samples | None:
        samples = self.log.samples(guess.columns.columns)
        if samples is None:
            return None
        values = known_unit(guess.columns.unit).factor * as_mapped(samples.values, guess.columns)
        if guess.signal in _BODY and self.recognition.choice("body_frame") != "FRD":
            values = values[:, :3] * FRD
        return samples._replace(values=np.asarray(values))

    # The gyroscope and its filters.

    def _gyroscope(self) -> Samples:
        found = self.signal("body_rate")
        if found is None:
            faster = log_faster("body rates", FAST_HZ, self.system, parameters=self.parameters)
            held = ", ".join(guess.signal.replace("_", " ") for guess in self.recognition.signals)
            surfaces = [own for own in self.log.table.names if own.lower() in _SURFACES]
            held += f"; {joined(surfaces)} are no rotors" if surfaces else ""
            known = named_signals(column_groups(self.log.table.names))
            for group in [own.group for own in known if own.signal == "body_rate"][:1]:
                values = self.log.table.values(group.columns)[1]
                derived = "are derivatives of angles, or wrong: as rates of the body they do not fit the attitude"
                if self.signal("attitude") is None:
                    derived = "may be derivatives of angles; what a gyroscope reads is best called gyro_x and so on"
                other = derived if group.derivative else "are no rates of the body"
                still = "never change" if len(values) else "hold no samples"
                held += f"; {joined(group.columns)} {other if np.diff(values, axis=0).any() else still}"
            raise InputError(f"a log without a gyroscope (it holds {held}): {faster}")
        return found

    def _rate(self, gyroscope: Samples) -> Samples:
        """Take the rate that the control law works with: that behind filters, where it comes at least as fast as it."""
        found = next(self.log.found("rate"), None)
        if found is None or found.source == gyroscope.source:
            return gyroscope
        if found.source.startswith("RATE."):
            # Old ones are in other units; the gyroscope of the same name is behind the same filters.
            return gyroscope if gyroscope.rate_hz >= found.rate_hz else self._in_unit_of_rates(found, gyroscope)
        return found

    def _in_unit_of_rates(self, samples: Samples, gyroscope: Samples) -> Samples:
        """Scale columns of RATE by the unit of the rates in the same topic."""
        rates = next(self.log.found("rate"), samples)
        return samples._replace(values=_unit_by(rates, gyroscope) * samples.values)

    def _unfiltered(self, gyroscope: Samples, rate: Samples) -> Samples | None:
        found = [_fifo(self.log), *self.log.found("raw")]
        if self.parameters.get("debug_mode") == _DEBUG_GYRO:
            debug = self.log.samples(tuple(f"debug[{axis}]" for axis in range(3)))
            found.append(None if debug is None else debug._replace(values=debug.values * FRD / _DEGREES))
        same = [own for own in found if own is not None and own.source != rate.source and _same_motion(own, gyroscope)]
        return max(same, key=lambda own: own.rate_hz, default=None)

    # What was asked.

    def _rate_setpoint(self, gyroscope: Samples) -> Samples | None:
        found = self.signal("setpoint_body_rate")
        if found is not None:
            return found
        found = next(self.log.found("setpoint_body_rate", "setpoint"), None)
        if found is not None:
            return self._in_unit_of_rates(found, gyroscope) if found.source.startswith("RATE.") else found
        return self._setpoint_of_p_term(gyroscope)

    def _setpoint_of_p_term(self, gyroscope: Samples) -> Samples | None:
        """Rebuild the setpoint of Betaflight 3, which is not logged, from the error that P acts on."""
        version = version_of(self.system)
        term = self.log.samples(tuple(f"axisP[{axis}]" for axis in range(3)))
        rows = self.autopilot.in_log(self.parameters) if self.autopilot else {}
        gains = [rows.get(f"p_{axis}", 0.0) for axis in ("roll", "pitch", "yaw")]
        throttle = self.log.samples(("rcCommand[3]",))
        if term is None or version is None or not (3, 0) <= version < (4, 0) or min(gains) <= 0 or throttle is None:
            return None
        cut = float(self.parameters.get("tpa_rate", self.parameters.get("dynThrPID", 0)) or 0) / 100
        begin = float(self.parameters.get("tpa_breakpoint", 1650) or 1650)
        weaker = 1 - cut * np.clip((throttle.values - begin) / max(2000 - begin, 1.0), 0, 1)
        weaker = np.column_stack([weaker, weaker, np.ones_like(weaker)])
        error = term.values / (_P_SCALE * np.array(gains) * np.maximum(weaker, 0.1)) * FRD / _DEGREES
        return Samples(term.time, error + gyroscope.values, "rebuilt from axisP and gyroADC")

    def _sticks(self) -> Samples | None:
        found = self.signal("sticks")
        # Of PX4 forward is positive, which lowers the nose.
        sign = [1.0, -1.0, 1.0] if self.system.startswith("PX4") else [1.0, 1.0, 1.0]
        return None if found is None else found._replace(values=found.values[:, :3] * sign)

    def _battery(self) -> tuple[Samples | None, Samples | None]:
        """Give voltage and current; old logs have hundredths of both, and what is not measured is about 0."""
        voltage = self.signal("voltage") or next(self.log.found("battery_voltage"), None)
        current = next(self.log.found("current"), None)
        level = np.nan if voltage is None else float(np.median(voltage.values))
        if level < _LEAST_V or (current is not None and not float(current.values.max()) > 0):
            current = None
        if level > _LARGEST_V:
            voltage, current = (own and own._replace(values=own.values / 100) for own in (voltage, current))
        return None if level < _LEAST_V else voltage, current

    def _load(self, clock: Array, flown: BoolArray) -> tuple[Array, Array]:
        """Give voltage and current on a clock; a current that carries no vehicle is not known."""
        voltage, current = (on_clock(own, clock, 1)[:, 0] for own in self._battery())
        known = current[flown & np.isfinite(current)]
        none = len(known) > 0 and float(np.median(known)) < _LEAST_A
        return voltage, np.full_like(current, np.nan) if none else current

    # Where it is.

    def _as_angles(self, guess: Guess | None) -> Samples | None:
        """Give roll, pitch and yaw of a body forward, right, down in a world north, east, down."""
        own = None if guess is None else self._mapped(guess)
        if own is None or guess is None:
            return None
        values = own.values
        quaternion = values.shape[1] == 4
        rows = np.abs(values).sum(axis=1) > 0 if quaternion else np.ones(len(values), dtype=bool)
        order: Literal["wxyz", "xyzw"] = "xyzw" if self.recognition.choice("quaternion_order") == "xyzw" else "wxyz"
        body: BodyFrame = "FRD" if self.recognition.choice("body_frame") == "FRD" else "FLU"
        world: WorldFrame = "NED" if self.recognition.choice("world_frame") == "NED" else "ENU"
        if rows.sum() < 2:
            return None
        angles = attitude_from_quaternion(values[rows], order) if quaternion else values
        angles = attitude_to_enu_flu(angles, body, world) * [1.0, -1.0, -1.0] + [0.0, 0.0, np.pi / 2]
        angles[:, [0, 2]] = np.column_stack([unwrap_angles(angles[:, axis]) for axis in (0, 2)])
        return Samples(own.time[rows], angles, own.source)

    def _heights(self) -> tuple[Samples | None, Samples | None]:
        """Give height and its rate, upward."""
        up = -1.0 if self.recognition.choice("world_frame") == "NED" else 1.0
        place, velocity = self.signal("position"), self.signal("velocity")
        height = next(self.log.found("height"), None)
        if place is not None:
            height = place._replace(values=up * place.values[:, 2:])
        if height is not None:
            height = height._replace(values=height.values - height.values[0])
        if velocity is not None:
            return height, velocity._replace(values=up * velocity.values[:, 2:])
        return height, None

    def _force(self) -> Samples | None:
        senses = self.recognition.choice("acceleration_frame") == "body-specific-force"
        return self.signal("acceleration") if senses else None

    def _flown(self, clock: Array) -> BoolArray:
        flown = self.recognition.flown
        if not flown.stretches_s or (flown.span_s is None and len(flown.stretches_s) < 2):
            return np.ones(len(clock), dtype=bool)
        return _within(clock, np.array(flown.stretches_s) + self.recognition.counted_from_s, 0.0)


# Clocks.


def _clock(rate: Samples, command: Samples | None) -> Array:
    both = [rate] if command is None else [rate, command]
    hz = min(_MOST_HZ, 2 * min(own.rate_hz for own in both))
    begin, end = max(own.time[0] for own in both), min(own.time[-1] for own in both)
    if end - begin < 2 / hz:
        raise InputError("body rates and commands are not logged at the same time")
    return np.arange(begin, end, 1 / hz)


def _gaps(*signals: Samples | None) -> Array:
    """List where a signal lacks samples, begin and end, in order and joined where they overlap; a sample parts two."""
    found: list[tuple[float, float]] = []
    for own in (each for each in signals if each is not None):
        steps = np.diff(own.time)
        lost = np.flatnonzero(steps > max(_GAP_STEPS * float(np.median(steps)), _GAP_S))
        found += zip(own.time[lost].tolist(), own.time[lost + 1].tolist(), strict=True)
    joined: list[list[float]] = []
    for begin, end in sorted(found):
        if joined and begin < joined[-1][1]:
            joined[-1][1] = max(end, joined[-1][1])
        else:
            joined.append([begin, end])
    return np.array(joined, dtype=float).reshape(-1, 2)


def _felt(flown: BoolArray, rate: Array, force: Array, rate_hz: float) -> tuple[Array, float]:
    """Give the specific force, NaN where its sensor reads wrong, and what it reads at rest, in gravity.

    The latter is NaN where the vehicle never stands for long.
    """
    near = binary_dilation(flown, iterations=max(1, round(_REST_S * rate_hz)))
    still = np.linalg.norm(rate - np.nanmedian(rate, axis=0), axis=1) < _STILL_RAD_S
    # Noise and vibration make a force longer, and not its mean.
    mean = uniform_filter1d(np.nan_to_num(force), max(1, round(rate_hz)), axis=0)
    sizes = np.linalg.norm(mean, axis=1)[~near & still & np.isfinite(force).all(axis=1)]
    if len(sizes) <= _REST_S * rate_hz:
        return force, np.nan
    reads = float(np.median(sizes)) / STANDARD_GRAVITY
    return np.full_like(force, np.nan) if abs(reads - 1) > _MISREADS else force, reads


def _within(clock: Array, spans: Array, around_s: float) -> BoolArray:
    inside = np.zeros(len(clock), dtype=bool)
    for begin, end in spans:
        inside[np.searchsorted(clock, begin - around_s) : np.searchsorted(clock, end + around_s, "right")] = True
    return inside


# One signal held against another.


def _unit_by(samples: Samples, gyroscope: Samples) -> float:
    """Give 1, or 0.01 where a rate is logged in hundredths of its unit, by its size against the gyroscope."""
    along, factor = along_each(samples, gyroscope)
    close = np.abs(factor[along > _FOLLOWS])
    return 0.01 if len(close) and float(np.median(close)) < 0.1 else 1.0


def _same_motion(samples: Samples, gyroscope: Samples) -> bool:
    """Tell whether a signal is of the motion of the gyroscope, in one unit and in the same axes."""
    along, factor = along_each(samples, gyroscope)
    close = along > _CLOSE
    return bool(close.any() and (np.abs(factor[close] - 1) < _SAME_SIZE).all())


def _fifo(log: LookedLog) -> Samples | None:
    """Lay out the samples that PX4 logs in packets, each on its own time."""
    fields = log.table.topics.get("sensor_gyro_fifo", {})
    if not {"dt", "scale", "samples", "x[0]", "y[0]", "z[0]"} <= set(fields):
        return None
    count = int(np.median(fields["samples"]))
    rows = fields["samples"] == count
    back = np.arange(count)[None] - (count - 1)
    time = fields["timestamp"][rows, None] + 1e-6 * fields["dt"][rows, None] * back
    each = [np.column_stack([fields[f"{axis}[{k}]"][rows] for k in range(count)]) for axis in "xyz"]
    values = np.stack([fields["scale"][rows, None] * own for own in each], axis=-1)
    order = np.argsort(time.ravel(), kind="stable")
    return Samples(time.ravel()[order], values.reshape(-1, 3)[order], "sensor_gyro_fifo.x, y, z")


def _gains(autopilot: Autopilot | None, parameters: Parameters) -> dict[str, Array]:
    """Give the gains of the rate loop by roll, pitch and yaw, as the parameters have them."""
    if autopilot is None:
        return {}
    rows = autopilot.in_log(parameters)
    found: dict[str, Array] = {}
    for role in ("p", "i", "d", "ff", "k"):
        named = [autopilot.by_role(f"{axis}.{role}") for axis in ("roll", "pitch", "yaw")]
        values = [rows.get(each.name, np.nan) if each else np.nan for each in named]
        if np.isfinite(values).any():
            found[role] = np.array(values)
    if not found and "RATE_RLL_P" in parameters:
        found = {
            role: np.array([float(parameters.get(f"{axis}{role.upper()}", np.nan)) for axis in _OLD_GAINS])
            for role in ("p", "i", "d")
        }
    return found
