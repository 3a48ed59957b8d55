"""All that one ordinary log shows, in one result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, ClassVar, Final

import numpy as np

from cpfls_cli.arrays import Array, runs
from cpfls_cli.errors import InputError
from cpfls_cli.errors import about as about_
from cpfls_cli.flightlog.crash import MOMENTS
from cpfls_cli.flightlog.recognised import Recognition
from cpfls_cli.flightlog.recognition import recognise
from cpfls_cli.flightlog.rotor_columns import TOO_SLOW
from cpfls_cli.flightlog.stated_vehicle import FAST_HZ, log_faster, stated_frame
from cpfls_cli.flightlog.topics import logged_hz
from cpfls_cli.look.answers import Answer, AxisGusts, Found, NextStep, answers_of, gusts_of, next_steps
from cpfls_cli.look.balance import Balance, balance_of
from cpfls_cli.look.columns import LookedLog
from cpfls_cli.look.effectiveness import AxisPlant, effectiveness
from cpfls_cli.look.flight import AXES, LogFlight, Samples
from cpfls_cli.look.gains import ACCEPTABLE, AxisGains, TunedGains, tuned_gains
from cpfls_cli.look.hover import Hover, hover_of
from cpfls_cli.look.loop import AxisLoop, loops_of
from cpfls_cli.look.reading import read_flight
from cpfls_cli.look.timeline import Event, timeline
from cpfls_cli.look.vibration import Vibration, vibration_of
from cpfls_cli.result import about, part, result
from cpfls_cli.trace import Track, track
from cpfls_cli.words import joined

_RATE_HZ, _ROTORS_HZ, _GYROSCOPE_HZ = FAST_HZ, FAST_HZ, 400.0
"""At which body rates and commands show the loop that flew, rotors their dynamics, and a gyroscope what vibrates at the
rotors' frequencies."""

_LOST_STEPS: Final = 1.5
"""Steps without a sample from which on one is lost."""


@result
class SignalRow:
    """One signal of a log."""

    signal: str = about("what it is")
    source: str = about("columns of the log that it comes from")
    rate_hz: float = about("samples in a second, pauses left out", unit="Hz")
    lost: float = about("share of the samples that are missing between the first and the last one")
    longest_gap_s: float = about("longest time between two samples", unit="s")
    asked_hz: float = about(
        "from which rate on the answers that need it are whole; missing where any will do", gaps=True
    )

    @property
    def slow(self) -> bool:
        """Whether it is logged too slowly for an answer that needs it."""
        return self.rate_hz < 0.99 * self.asked_hz  # Clocks drift.


@result
class Logged:
    """What a log holds."""

    name: str = about("of the file")
    system: str = about("what wrote it, and its version; empty where that is not said")
    autopilot: str = about("whose control law is known; empty for another", default="")
    vehicle: str = about("what flies")
    frame: str = about("frame that the parameters state; empty where they state none", default="")
    rotors: int = about("number of rotors; 0 where the log does not show them", default=0)
    date: str = about("when the log begins, UTC; empty where it does not say", default="")
    duration_s: float = about("from its first to its last sample", unit="s")
    flown_s: float = about("of that in flight", unit="s")
    spans_s: Array = about("begin and end of each flight", "flight", "end", unit="s")
    voltage_begin: float = about("of the battery where flight begins", unit="V", gaps=True, default=np.nan)
    voltage_end: float = about("of the battery where flight ends", unit="V", gaps=True, default=np.nan)
    gyroscope: str = about("whether the fastest gyroscope is in front of the autopilot's filters, behind them, or both")
    signals: tuple[SignalRow, ...] = part()
    faster: str = about("what to set in the autopilot to log faster what is too slow", default="")
    warnings: str = about("what is wrong with the file, and with what it is taken for, a sentence a line", default="")


def what_is_logged(
    flight: LogFlight,
    log: LookedLog,
    recognition: Recognition,
    flown_at: float = np.nan,
    warnings: tuple[str, ...] = (),
) -> Logged:
    """List what a log holds, how fast, and what is lost, with warnings of the reader.

    `flown_at`: when it begins, s since 1970 began; NaN where it does not say.
    """
    frame = stated_frame(flight.parameters, recognition.rotors)
    spans = [(float(flight.time[a]), float(flight.time[b - 1])) for a, b in runs(flight.flown)]
    rows = tuple(_rows(flight, log, recognition))
    slow = [row.signal for row in rows if row.slow and row.asked_hz == _RATE_HZ]
    volts = flight.voltage[flight.flown & np.isfinite(flight.voltage)]
    near = max(1, round(flight.rate_hz))
    return Logged(
        name=flight.name,
        system=flight.system,
        autopilot=flight.autopilot,
        vehicle="VTOL, its hover" if recognition.winged else "multirotor",
        frame="" if frame is None else frame[0],
        rotors=recognition.rotors,
        date="" if not np.isfinite(flown_at) else datetime.fromtimestamp(flown_at, UTC).strftime("%Y-%m-%d %H:%M"),
        # Each sample counts for the time up to the next.
        duration_s=float(flight.time[-1] - flight.time[0]) + 1 / flight.rate_hz,
        flown_s=float(flight.flown.sum() / flight.rate_hz),
        spans_s=np.array(spans).reshape(-1, 2),
        voltage_begin=float(np.median(volts[:near])) if len(volts) else np.nan,
        voltage_end=float(np.median(volts[-near:])) if len(volts) else np.nan,
        gyroscope="behind" * bool(flight.autopilot) if flight.gyroscope_unfiltered is None else "both",
        signals=rows,
        faster=log_faster(joined(slow), FAST_HZ, flight.system, parameters=flight.parameters) if slow else "",
        # How to log faster is said by itself.
        warnings="\n".join((*warnings, *(own for own in recognition.warnings if not own.startswith(TOO_SLOW)))),
    )


def _rows(flight: LogFlight, log: LookedLog, recognition: Recognition) -> list[SignalRow]:
    """List signals with their own clocks, what is needed most first."""
    rotors = f"rotor commands{', rebuilt' if flight.rotors_source == 'rebuilt' else ''}"
    named: list[tuple[str, Samples | None, float]] = [
        ("body rate", flight.gyroscope, _RATE_HZ),
        ("unfiltered gyroscope", flight.gyroscope_unfiltered, _GYROSCOPE_HZ),
        (rotors, flight.rotors if len(flight.rotors.time) else None, _ROTORS_HZ),
        ("rotor speeds", flight.rotor_speed, np.nan),
        ("accelerometer", flight.accelerometer, np.nan),
    ]
    named += [("output of the rate loop", next(log.found("output"), None), _RATE_HZ)]
    taken = {"body_rate", "acceleration", "rotor_command", "rotor_speed"}
    for guess in recognition.signals:
        if guess.signal not in taken:
            asked = _RATE_HZ if guess.signal == "setpoint_body_rate" else np.nan
            named.append((guess.signal.replace("_", " "), log.samples(guess.columns.columns), asked))
    named += [(what, next(log.found(what), None), np.nan) for what in ("current", "voltage", "height")]
    rows: dict[str, SignalRow] = {}
    for what, samples, asked in named:
        if samples is not None and what not in rows and len(samples.time) > 1:
            rows[what] = _row(flight, what, samples, asked)
    asked = flight.unfollowed or bool(np.isfinite(flight.rate_setpoint).any())
    for what in (rotors, *(() if asked else ("setpoint body rate",))):
        lacks = SignalRow(signal=what, source="", rate_hz=0.0, lost=0.0, longest_gap_s=0.0, asked_hz=_RATE_HZ)
        rows.setdefault(what, lacks)
    return list(rows.values())


def _row(flight: LogFlight, what: str, samples: Samples, asked_hz: float) -> SignalRow:
    rate = logged_hz(samples.time)
    rows = np.clip(np.searchsorted(flight.time, samples.time[:-1]), 0, len(flight.time) - 1)
    steps = np.diff(samples.time)[flight.flown[rows]]
    lost = float(np.round(steps[steps > _LOST_STEPS / rate] * rate - 1).sum()) if rate > 0 else 0.0
    return SignalRow(
        signal=what,
        source=samples.source,
        rate_hz=rate,
        lost=lost / max(lost + len(steps), 1.0),
        longest_gap_s=float(steps.max()) if len(steps) else 0.0,
        asked_hz=asked_hz,
    )


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
