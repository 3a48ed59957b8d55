"""The state of a flight over the same windows as its residual, each signal under the name a reader knows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.weak_flight import WeakFlight

ANGLES = ("roll", "yaw")
"""Signals that come back after a full turn."""

_ACTUATION = ("rotor torque", "rotor speed", "thrust")


def state_signals(flight: WeakFlight, signals: Signals) -> dict[str, Array]:
    """Average everything the flight has of motion and actuation over its windows.

    Parameters
    ----------
    flight : WeakFlight
    signals : Signals
        Of the flight, as measured or with actuator effects applied.

    Returns
    -------
    dict of str to array, shape (window,)
        SI units; velocities through the air in the body frame, angles within half a turn.
    """
    averaged = {"time": flight.windows.centres(signals.time) - signals.time[0]}
    for name, values in _instantaneous(signals):
        averaged[name] = flight.windows.average(values)
    return averaged | {name: _within_half_turn(averaged[name]) for name in ANGLES if name in averaged}


def joined_states(states: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    """Put the states of several flights one after another; what a flight lacks is not a number there.

    Parameters
    ----------
    states : sequence of mapping of str to array, shape (window,)
        Of each flight.

    Returns
    -------
    dict of str to array, shape (window,)
    """
    names = dict.fromkeys(name for state in states for name in state)
    return {
        name: np.concatenate([state.get(name, np.full(len(state["time"]), np.nan)) for state in states])
        for name in names
    }


def without_actuation(state: Mapping[str, Array]) -> dict[str, Array]:
    """Leave out what the rotors do.

    The controller answers every disturbance with the rotors, and their noise is noise of the residual, so that a
    residual nearly always follows their torque, whatever causes it. Causes are looked for among the other signals.

    Parameters
    ----------
    state : mapping of str to array, shape (window,)

    Returns
    -------
    dict of str to array, shape (window,)
    """
    return {name: values for name, values in state.items() if not name.startswith(_ACTUATION)}


def _instantaneous(signals: Signals) -> Iterator[tuple[str, Array]]:
    yield from _axes("body rate", signals.body_rate)
    if signals.attitude is not None:
        # A turn through half a turn must not average to zero.
        yield from zip(("roll", "pitch", "yaw"), np.unwrap(signals.attitude, axis=0).T, strict=True)
    yield from _translation(signals)
    yield from _actuation(signals)


def _translation(signals: Signals) -> Iterator[tuple[str, Array]]:
    if signals.velocity is not None:
        if signals.attitude is not None:
            yield from _axes("air velocity", signals.air_velocity)
        yield "speed", np.linalg.norm(signals.velocity, axis=1)
        yield "horizontal speed", np.linalg.norm(signals.velocity[:, :2], axis=1)
        yield "vertical speed", signals.velocity[:, 2]
    if signals.position is not None:
        yield "height", signals.position[:, 2] - signals.ground_height_m


def _actuation(signals: Signals) -> Iterator[tuple[str, Array]]:
    if signals.rotor_speed is not None:
        for number, speed in enumerate(signals.rotor_speed.T, start=1):
            yield f"rotor speed {number}", speed
    if signals.thrust is not None:
        yield "thrust", signals.thrust
    if signals.torque is not None:
        yield from _axes("rotor torque", signals.torque)
    if signals.voltage is not None:
        yield "voltage", signals.voltage


def _axes(name: str, values: Array) -> Iterator[tuple[str, Array]]:
    for axis, column in zip("xyz", values.T, strict=True):
        yield f"{name} {axis}", column


def _within_half_turn(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
