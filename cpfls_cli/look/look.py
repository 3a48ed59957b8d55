"""All that one ordinary log shows, in one result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from cpfls_cli.errors import InputError
from cpfls_cli.errors import about as about_
from cpfls_cli.flightlog.crash import MOMENTS
from cpfls_cli.flightlog.recognition import recognise
from cpfls_cli.look.answers import Answer, Found, NextStep, answers_of, next_steps
from cpfls_cli.look.balance import Balance, balance_of
from cpfls_cli.look.columns import LookedLog
from cpfls_cli.look.effectiveness import AxisPlant, effectiveness
from cpfls_cli.look.flight import AXES, LogFlight
from cpfls_cli.look.gains import ACCEPTABLE, AxisGains, TunedGains, tuned_gains
from cpfls_cli.look.gusts import AxisGusts, gusts_of
from cpfls_cli.look.hover import Hover, hover_of
from cpfls_cli.look.logged import Logged, what_is_logged
from cpfls_cli.look.loop import AxisLoop, loops_of
from cpfls_cli.look.reading import read_flight
from cpfls_cli.look.timeline import Event, timeline
from cpfls_cli.look.vibration import Vibration, vibration_of
from cpfls_cli.result import about, part, result
from cpfls_cli.trace import Track, track
from cpfls_cli.words import joined


@result
class Look:
    """What one log shows of its vehicle."""

    FORMAT: ClassVar = "cpfls/look"

    name: str = about("of the log")
    refused: str = about("why there is nothing to look at; empty where there is", default="")
    logged: Logged | None = part(default=None)
    events: tuple[Event, ...] = part(default=())
    answers: tuple[Answer, ...] = part(default=())
    next_steps: tuple[NextStep, ...] = part(default=())
    balance: Balance | None = part(default=None)
    hover: Hover | None = part(default=None)
    command_source: str = about("how what acts about the axes is known", default="")
    rotors_source: str = about("logged or rebuilt; empty where commands of the rotors are neither", default="")
    plants: dict[str, AxisPlant] | None = part(default=None)
    vibration: Vibration | None = part(default=None)
    loops: dict[str, AxisLoop] | None = part(default=None)
    gusts: dict[str, AxisGusts] | None = part(default=None)
    gains: TunedGains | None = part(default=None)
    tracks: dict[str, Track] | None = part(default=None)

    @property
    def danger(self) -> list[Event]:
        """List what ended a flight, or could have."""
        return [event for event in self.events if event.severity == "danger"]

    @property
    def file(self) -> str:
        """Name of the file, of which this may be one flight."""
        return self.name.partition(", flight ")[0]

    @property
    def warned(self) -> list[Event]:
        """Events that want a look, but for the autopilot's own; first how a flight ended, last what a log lacks."""
        found = [event for event in self.events if event.severity == "warning" and event.kind != "message"]
        last = {"landing": 1, "gap": 3, "restart": 3}
        return sorted(found, key=lambda event: 0 if event.kind in MOMENTS else last.get(event.kind, 2))

    @property
    def uneven(self) -> tuple[int, ...]:
        """Number the rotors that work more or less than sound ones."""
        return () if self.balance is None else self.balance.uneven

    @property
    def shaken(self) -> float:
        """Vibration of the accelerometer where its autopilot has a limit for it, m/s^2; else NaN."""
        given = None if self.vibration is None else self.vibration.spectra.get("accelerometer")
        known = given is not None and self.vibration is not None and len(self.vibration.limit) > 0
        return float(np.nanmax(given.rms)) if known and given and np.isfinite(given.rms).any() else np.nan

    @property
    def limit(self) -> float:
        """Limit that vibration exceeds, else the lower one, m/s^2; NaN where there is none."""
        limits = () if self.vibration is None else self.vibration.limit
        return max((each for each in limits if self.shaken > each), default=limits[0] if limits else np.nan)

    @property
    def judged(self) -> list[AxisGains]:
        """List the axes whose margins are those of the loop that flew."""
        axes = () if self.gains is None else self.gains.axes
        return [axis for axis in axes if axis.before and axis.reason not in {"law", "feedback"}]

    @property
    def small(self) -> list[str]:
        """Name the axes whose margins surely are smaller than every guide accepts."""
        found = [(axis.axis, axis.before) for axis in self.judged if axis.before]
        return [
            name for name, m in found if m.phase_deg.high < ACCEPTABLE.phase_deg or m.gain_db.high < ACCEPTABLE.gain_db
        ]

    @property
    def doubtful(self) -> list[str]:
        """Name the axes whose margins most likely are smaller than every guide accepts."""
        found = [(axis.axis, axis.before) for axis in self.judged if axis.before]
        return [
            name
            for name, m in found
            if m.phase_deg.value < ACCEPTABLE.phase_deg or m.gain_db.value < ACCEPTABLE.gain_db
        ]

    @property
    def good(self) -> list[str]:
        """Name what the log shows to be as it should."""
        found = [(axis.axis, axis.before) for axis in self.judged if axis.before]
        fine = [
            name for name, m in found if m.phase_deg.low >= ACCEPTABLE.phase_deg and m.gain_db.low >= ACCEPTABLE.gain_db
        ]
        balanced = self.balance is not None and self.balance.even
        return [
            *(["balance"] if balanced else []),
            *(["vibration"] if self.shaken <= self.limit else []),
            *([f"margins of {joined(fine)}"] if fine else []),
        ]


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
    """Compute all that one log shows.

    Raises
    ------
    InputError
        If the log holds no flight of a multirotor, or no body rates.
    """
    progress("recognises its signals")
    with about_(name, InputError):
        recognition = recognise(topics, units, parameters, system)
    flight = read_flight(name, topics, units, parameters, system, recognition)
    progress("balance, hover, vibration")
    balance, hover, vibration = balance_of(flight), hover_of(flight), vibration_of(flight)
    progress("effectiveness")
    plants = effectiveness(flight)
    progress("the loop that flew")
    loops = loops_of(flight, plants)
    gusts = gusts_of(flight, {plant.axis: plant.model for plant in plants if plant.identified})
    progress("gains")
    gains = tuned_gains(flight, plants)
    found = Found(
        flight=flight,
        balance=balance,
        hover=hover,
        plants=plants,
        loops=loops,
        vibration=vibration,
        gusts=gusts,
        gains=gains,
    )
    answers = answers_of(found)
    return Look(
        name=name,
        logged=what_is_logged(flight, LookedLog(topics, units, system), recognition, flown_at, warnings),
        events=timeline(flight, topics, recognition, messages),
        answers=answers,
        next_steps=next_steps(found, answers),
        balance=balance,
        hover=hover,
        command_source=flight.command_source,
        rotors_source=flight.rotors_source,
        plants={plant.axis: plant for plant in plants},
        vibration=vibration,
        loops={loop.axis: loop for loop in loops},
        gusts={each.axis: each for each in gusts},
        gains=gains,
        tracks=_tracks(flight),
    )


def _tracks(flight: LogFlight) -> dict[str, Track]:
    """Take the signals that the page draws over time, those that the log has."""
    degrees = 180 / np.pi
    labels = tuple(
        f"M{rotor + 1}" for rotor in range(flight.rotors.values.shape[-1] if flight.rotors.values.size else 0)
    )
    lean, volts = ("roll", "pitch"), ("voltage",)
    given = {
        "rate": (AXES, flight.time, degrees * flight.body_rate, False),
        "rate_asked": (tuple(f"{axis} setpoint" for axis in AXES), flight.time, degrees * flight.rate_setpoint, True),
        "attitude": (lean, flight.time, degrees * flight.attitude[:, :2], False),
        "rotors": (labels, flight.rotors.time, flight.rotors.values, False),
        "height": (("height",), flight.time, flight.height, False),
        "voltage": (volts, flight.time, flight.voltage, False),
    }
    return {
        name: track(words, time, values, dashed=asked)
        for name, (words, time, values, asked) in given.items()
        if len(time) and np.isfinite(values).any()
    }
