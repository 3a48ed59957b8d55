"""What a log holds: its signals, how fast and how whole they are, and what that allows."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Final

import numpy as np

from cpfls_cli.arrays import Array, runs
from cpfls_cli.flightlog.recognised import Recognition
from cpfls_cli.flightlog.rotor_columns import TOO_SLOW
from cpfls_cli.flightlog.stated_vehicle import FAST_HZ, log_faster, stated_frame
from cpfls_cli.flightlog.topics import logged_hz
from cpfls_cli.look.columns import LookedLog
from cpfls_cli.look.flight import LogFlight, Samples
from cpfls_cli.result import about, part, result
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
        # Each sample stands for the time up to the next.
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
