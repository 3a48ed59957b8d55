"""What acts on a vehicle about its axes: its rotors by their places, or what its rate loop puts out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.motors import MixerRule, ThrustCurve, factor_mix
from cpfls_cli.autopilots.parameters import Autopilot
from cpfls_cli.flightlog.airframe import Airframe
from cpfls_cli.flightlog.recognised import Guess
from cpfls_cli.flightlog.stated_vehicle import Parameters
from cpfls_cli.flightlog.topics import REBUILT
from cpfls_cli.look.columns import FRD, LookedLog, along_each
from cpfls_cli.look.flight import Samples
from cpfls_cli.units import SPEED_UNITS

_OF_OUTPUT, _FAST_HZ, _SLOWEST_HZ = 0.7, 40.0, 4.0
"""Times as fast as the output of the rate loop that rotors have to be logged to be taken before it, and Hz; and Hz
below which a command says nothing of motion."""

_FOLLOWS: Final = 0.6
"""Correlation from which on one signal is another one's, but for its sign and size."""

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
