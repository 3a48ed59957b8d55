"""Thrust by what carries the weight: its factor, and how that of commands goes with them and with the voltage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import ENOUGH_BLOCKS, MOST_BLOCKS, contiguous, half_width, jackknife_error, leaving_out
from cpfls_cli.effects.registry import SUPPLY
from cpfls_cli.effects.signals import Signals
from cpfls_cli.estimation.estimate import power_between
from cpfls_cli.inertia import INERTIA_PARAMETERS, KNOWN
from cpfls_cli.playback.fit import BLOCKS
from cpfls_cli.playback.flight import LoggedFlight, PlaybackFlight
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.parameters import CURVE, FoundNumber, interval, needs_velocity
from cpfls_cli.vehicle.settings import VehicleSettings

_CALIBRATED = 0.01
"""Share of its weight that an accelerometer may be off by, as calibrated before a flight: 0.1 m/s^2."""
_LINEAR = 0.5
"""Power of squared commands with which thrust rises that goes with the commands themselves."""
_PIECE_S = 2.0
"""Length of pieces over which thrust carries the weight: gusts and climbs are shorter, a discharge is longer."""
_STEADY = 1e-3  # Share by which a voltage varies in flight: less is rounding.


class CommandedThrust(NamedTuple):
    """How the thrust of commands goes with the voltage of the battery, and with the commands.

    `numbers`: the power of the voltage, where one is known. `rises`: ends of the power of squared commands with which
    it rises, 1 for a square, one half for a line. `full`: those of the factor by which the power of the voltage leaves
    the thrust of a full battery open.
    """

    numbers: tuple[FoundNumber, ...] = ()
    rises: tuple[float, float] = (1.0, 1.0)
    full: tuple[float, float] = (1.0, 1.0)

    def whole(self, model: VehicleModel) -> VehicleModel:
        """Let a model with known numbers take commands as they are logged."""
        sags = (ModelEffect(SUPPLY.name, {own.name.partition(".")[2]: own.value}, np.zeros(0)) for own in self.numbers)
        return replace(model, vehicle=replace(model.vehicle, unknown=()), effects=(*model.effects, *sags))

    def acting(self, flight: LoggedFlight) -> PlaybackFlight:
        """Give a flight whose commands count as with a full battery."""
        acting = self.whole(VehicleModel(vehicle=flight.parts[0].vehicle)).acting
        return replace(flight, parts=tuple(map(acting, flight.parts))).playback


def carrying_weight(
    vehicle: VehicleSettings, flights: Sequence[PlaybackFlight]
) -> tuple[VehicleSettings, tuple[FoundNumber, ...]]:
    """Replace the guess of the thrust factor by what carries the weight; a guessed drag factor scales with it.

    Where runs do not move, for want of velocity, the thrust factor follows from the accelerometer, and is then found
    and returned: it is no longer unknown to the runs. So is one that is stated and that the accelerometer contradicts.
    Without one either, or where it feels no lift, nothing separates thrust from weight, and the guess stays.
    """
    open_thrust, moves = "thrust_factor" in vehicle.unknown, all(flight.translates for flight in flights)
    if not open_thrust and moves:
        return vehicle, ()
    squares = np.concatenate([(flight.speed**2).sum(axis=1) for flight in flights])
    if not squares.any():
        return vehicle, ()
    sensed = None if moves else _sensed_thrust_factor(vehicle, flights)
    stated = float(np.mean([rotor.thrust_factor_n_s2 for rotor in vehicle.rotors]))
    if not open_thrust:
        if sensed is None or sensed.low <= stated <= sensed.high:
            return vehicle, ()
        sensed = sensed._replace(stated=stated)
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    thrust = weight / float(np.mean(squares)) if sensed is None else sensed.value
    factor = thrust / stated
    rotors = tuple(
        replace(
            rotor,
            thrust_factor_n_s2=thrust if open_thrust else factor * rotor.thrust_factor_n_s2,
            drag_factor_n_m_s2=rotor.drag_factor_n_m_s2 * (factor if "drag_factor" in vehicle.unknown else 1.0),
        )
        for rotor in vehicle.rotors
    )
    unknown = tuple(name for name in vehicle.unknown if moves or not needs_velocity(name))
    return replace(vehicle, rotors=rotors, unknown=unknown), () if sensed is None else (sensed,)


def _sensed_thrust_factor(vehicle: VehicleSettings, flights: Sequence[PlaybackFlight]) -> FoundNumber | None:
    """Regress mass times specific force along z on the squared speeds, with an interval from blocks left out."""
    products, squares = [], []
    for flight in flights:
        if flight.specific_force is None:
            return None
        lift = (flight.speed**2).sum(axis=1)
        force = vehicle.mass_kg * flight.specific_force[:, 2]
        count = max(2, BLOCKS // len(flights))
        products += [part.sum() for part in np.array_split(lift * force, count)]
        squares += [part.sum() for part in np.array_split(lift**2, count)]
    above, below = np.array(products), np.array(squares)
    left = below.sum() - below
    if not (left > 0).all():
        return None
    value = float(above.sum() / below.sum())
    scatter = float(half_width(jackknife_error((above.sum() - above) / left), len(products)))
    half = float(np.hypot(scatter, _CALIBRATED * value))
    # An accelerometer that is upside down, or noise, feels no lift.
    if value <= half:
        return None
    low, high = interval(value, half, positive=True)
    return FoundNumber("thrust_factor", "N s^2", value, low, high, np.nan, high < KNOWN * low, False)


def commanded_thrust(flights: Sequence[LoggedFlight]) -> CommandedThrust:
    """Find how the thrust of commands goes with voltage and command, by what carries the weight.

    Over short pieces, logarithms of what is carried, by velocity or else by accelerometer, and of the squared commands
    are regressed on each other, and on that of the voltage where all flights know it. A loop that answers gusts leaves
    the power of squared commands between the two (see `loop_bounds`). A command also draws the voltage down, so time
    and flight are the instruments of the voltage: the discharge alone shows its power.
    """
    parts = [(number, part) for number, flight in enumerate(flights) for part in flight.parts if part.commanded]
    rows = np.array([(*row, number) for number, part in parts for row in _carried(part)]).reshape(-1, 5)
    # Neither on the ground, where nothing turns, nor in a fall do rotors carry the weight.
    rows = rows[np.isfinite(rows[:, :2]).all(axis=1)]
    if len(rows) < ENOUGH_BLOCKS:
        return CommandedThrust()
    known = np.isfinite(rows).all() and np.ptp(rows[:, 2]) > _STEADY
    carried, squares, volts, time, number = rows.T
    joint = volts[:, None] if known else None
    slow = np.column_stack([time, number[:, None] == np.unique(number)])

    def powers(kept: BoolArray) -> Array:
        own = power_between(carried[kept], squares[kept], None if joint is None else joint[kept], slow[kept])
        # A supply acts on the command.
        return np.array([own[0], min(own[1], 1 / _LINEAR), *(-own[2:])])

    blocks = min(max(len(rows) // 2, ENOUGH_BLOCKS), MOST_BLOCKS)
    found, left_out = leaving_out(powers, len(rows), blocks)
    half = half_width(jackknife_error(left_out), blocks)
    low, high = np.clip([found[0] - half[0], found[1] + half[1]], _LINEAR, 1 / _LINEAR).tolist()
    rises = min(low, 1.0), max(high, 1.0)
    shape = SUPPLY.shapes[0]
    if not known or not half[2] < found[2] <= shape.grid[-1]:
        return CommandedThrust((), rises)
    power, low, high = (float(found[2] + sign * half[2]) for sign in (0, -1, 1))
    number = FoundNumber(
        f"{SUPPLY.name}.{shape.name}", shape.unit, power, low, high, np.nan, high <= KNOWN * low, False
    )
    # What carries the weight at the mean voltage is known, and extrapolated to the full battery.
    below, above = (float(np.exp((power - end) * volts.mean())) for end in (low, high))
    return CommandedThrust((number,), rises, (below, above))


def _carried(part: Signals) -> Iterator[tuple[float, float, float, float]]:
    """Give by pieces logarithms of what is carried, of the squared commands that carry it, of the voltage; and time."""
    squares = (part.speed**2).sum(axis=1) if part.rotor_speed is not None else np.zeros(len(part))
    velocity, force = part.velocity, part.specific_force
    volts = np.full(len(part), np.nan) if part.voltage is None else part.voltage
    piece = contiguous(len(part), max(1, round(len(part) * part.period / _PIECE_S)))
    for number in range(piece[-1] + 1):
        own = np.flatnonzero(piece == number)
        if part.attitude is not None and velocity is not None:
            upward, lift = part.rotation[own, 2, 2], velocity[own[[0, -1]], 2]
            needed = part.vehicle.gravity_m_s2 + (lift[1] - lift[0]) / (part.time[own[-1]] - part.time[own[0]])
        elif force is not None:
            upward, needed = np.ones(len(own)), force[own, 2].mean()
        else:
            return
        carries = float((squares[own] * upward).mean())
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.log([needed, carries, volts[own].mean()]).tolist()
        yield *logs, float(part.time[own].mean())


def widened_by_law(numbers: Sequence[FoundNumber], commands: CommandedThrust) -> Iterator[FoundNumber]:
    """Widen intervals of factors by the power of the voltage, and of the inertia where the thrust has no curve found.

    Weight shows the thrust that carries it, and rotation how it changes over the moments of inertia, and how their drag
    does.
    """
    ends = dict.fromkeys(("thrust_factor", "drag_factor"), commands.full)
    if CURVE not in {number.name for number in numbers}:
        (low, high), (least, most) = commands.rises, commands.full
        ends |= dict.fromkeys((f"inertia.{name}" for name in INERTIA_PARAMETERS[:3]), (low, high))
        ends["drag_factor"] = low * least, high * most
    for number in numbers:
        low, high = (end * own for end, own in zip(number[3:5], ends.get(number.name, (1.0, 1.0)), strict=True))
        known = number.name not in ends or high <= KNOWN * low
        yield number._replace(low=low, high=high, determined=number.determined and known)
