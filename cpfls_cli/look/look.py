"""All that one ordinary log tells, in one result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.recognition import recognise
from cpfls_cli.look.answers import Answer, Found, answers_of
from cpfls_cli.look.balance import Balance, balance_of
from cpfls_cli.look.columns import LookedLog, on_clock
from cpfls_cli.look.effectiveness import AxisPlant, effectiveness
from cpfls_cli.look.flight import LogFlight, Samples
from cpfls_cli.look.gains import TunedGains, tuned_gains
from cpfls_cli.look.gusts import AxisGusts, gusts_of
from cpfls_cli.look.hover import Hover, hover_of
from cpfls_cli.look.logged import Logged, what_is_logged
from cpfls_cli.look.reading import read_flight
from cpfls_cli.look.timeline import Event, timeline
from cpfls_cli.look.vibration import Vibration, vibration_of
from cpfls_cli.result import about, part, result

_DRAWN_HZ = 1000.0


@result
class Traces:
    """Signals over the whole log, for the page."""

    time: Array = about("from the first stamp", "time", unit="s", brief=False)
    body_rate: Array = about("roll, pitch, yaw; right, nose up, clockwise", "time", "axis", unit="rad/s", gaps=True, brief=False)
    rate_setpoint: Array = about("of the same", "time", "axis", unit="rad/s", gaps=True, brief=False)
    attitude: Array = about("roll and pitch", "time", "lean", unit="rad", gaps=True, brief=False)
    rotors: Array = about("commands, share of full", "time", "rotor", gaps=True, brief=False)
    height: Array = about("from where it starts", "time", unit="m", gaps=True, brief=False)
    voltage: Array = about("of the battery", "time", unit="V", gaps=True, brief=False)


@result
class Look:
    """What one log tells of its vehicle."""

    FORMAT: ClassVar = "cpfls/look"

    name: str = about("of the log")
    refused: str = about("why there is nothing to look at; empty where there is", default="")
    logged: Logged | None = part(default=None)
    events: tuple[Event, ...] = part(default=())
    answers: tuple[Answer, ...] = part(default=())
    balance: Balance | None = part(default=None)
    hover: Hover | None = part(default=None)
    command_source: str = about("how what acts about the axes is known", default="")
    rotors_source: str = about("logged or rebuilt; empty where commands of the rotors are neither", default="")
    plants: tuple[AxisPlant, ...] = part(default=())
    vibration: Vibration | None = part(default=None)
    gusts: tuple[AxisGusts, ...] = part(default=())
    gains: TunedGains | None = part(default=None)
    traces: Traces | None = part(default=None)


def look_at(
    name: str,
    topics: Any,
    units: Mapping[str, str],
    parameters: Mapping[str, float | str],
    system: str,
    *,
    messages: Sequence[tuple[float, str, str]] = (),
    flown_at: float = np.nan,
    warnings: tuple[str, ...] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Look:
    """Compute all that one log tells.

    Raises
    ------
    InputError
        If the log holds no flight of a multirotor, or no body rates.
    """
    progress("recognises its signals")
    recognition = recognise(topics, units, parameters, system)
    flight = read_flight(name, topics, units, parameters, system, recognition)
    progress("balance, hover, vibration")
    balance, hover, vibration = balance_of(flight), hover_of(flight), vibration_of(flight)
    progress("effectiveness")
    plants = effectiveness(flight)
    gusts = gusts_of(flight, {plant.axis: plant.model for plant in plants if plant.identified})
    progress("gains")
    gains = tuned_gains(flight, plants)
    found = Found(flight, balance, hover, plants, (), vibration, gusts, gains)
    return Look(
        name=name,
        logged=what_is_logged(flight, LookedLog(topics), recognition, flown_at, warnings),
        events=timeline(flight, topics, recognition, messages),
        answers=answers_of(found),
        balance=balance,
        hover=hover,
        command_source=flight.command_source,
        rotors_source=flight.rotors_source,
        plants=plants,
        vibration=vibration,
        gusts=gusts,
        gains=gains,
        traces=_traces(flight),
    )


def _traces(flight: LogFlight) -> Traces:
    step = max(1, round(flight.rate_hz / _DRAWN_HZ))
    each = slice(None, None, step)
    rotors = flight.rotors.values.shape[1] if flight.rotors.values.ndim > 1 else 0
    known = on_clock(Samples(flight.rotors.time, flight.rotors.values), flight.time, rotors) if rotors else np.empty((len(flight.time), 0))
    small = np.float32
    return Traces(
        time=flight.time[each],
        body_rate=flight.body_rate[each].astype(small),
        rate_setpoint=flight.rate_setpoint[each].astype(small),
        attitude=flight.attitude[each, :2].astype(small),
        rotors=known[each].astype(small),
        height=flight.height[each].astype(small),
        voltage=flight.voltage[each].astype(small),
    )
