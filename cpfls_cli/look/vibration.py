"""Vibration: spectra over throttle, the lines in them, what reaches the motors, and the filters against them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.law import STAGES, Filter, Law, chain
from cpfls_cli.autopilots.parameters import Autopilot
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.blocks import contiguous, half_width, jackknife_error
from cpfls_cli.look.flight import AXES, LogFlight, Samples
from cpfls_cli.look.law import flown_law
from cpfls_cli.look.steady import Windows, number, windows_of
from cpfls_cli.result import Estimate, about, part, result

_WINDOW_S, _FEWEST, _LEAST_SAMPLES = 0.25, 12, 32
_ABOVE_HZ, _SHOWS_HZ = 20.0, 50.0
"""Vibration is what is above the first; a log that ends below the second shows too little of it."""
_LOWEST_LINE_HZ, _FLOOR, _LINE_DB, _SURE, _MOST_LINES = 20.0, 0.3, 6.0, 5.0, 6
"""A line is so many decibels above the median of its neighbourhood, which is so much of half the sampling rate, on the
mean of all windows, and so many standard errors."""
_POWERS, _FOLDS_HZ = np.arange(-1.0, 1.3, 0.125), 450.0
"""Powers of the collective that a line's frequency may go with: 0 stays, below 0 is folded, which lines are that turn
faster than half the logged rate; where that is above the second, there are none."""
_BLOCKS, _BINS, _MOST_WINDOWS = 12, 16, 600
_ORDERS, _NEAR_ORDER, _PREFERRED_DB = 4, 0.05, 1.0
"""Multiples of a rotor's turns at which it shakes, how near a line is to one, and how much less a line along a rotor's
turns may rise than along the collective."""
_FIXED, _MOVES = 0.25, 0.1
_WIDE = 0.15
"""Relative half-width that a line takes with it."""
_STRONG_DB, _DELAY_HZ = 10.0, 5.0
"""Height of a line that filters are judged by, and where the delay of a filter is given."""
_BY_SPEED = ("rpm_filter_harmonics", "gyro_rpm_notch_harmonics")
"""Betaflight's notches at the speeds that motors report: with them, dynamic notches serve other lines."""
LIMITS = {"ardupilot": (30.0, 60.0), "px4": (4.905, 9.81)}
"""Vibration of the accelerometer, m/s^2: from where on there may be trouble, and from where on there is: ArduPilot's
guide to measuring vibration (of its VIBE, above 5 Hz), and the colours of PX4's Flight Review (of its metric)."""


@result
class Spectrum:
    """Power of a signal by frequency."""

    signal: str = about("gyroscope before filters, gyroscope, accelerometer, or commands")
    source: str = about("columns of the log")
    rate_hz: float = about("as logged", unit="Hz")
    rms: Array = about("root mean square above 20 Hz, by channel; rad/s, m/s^2 or share", "channel")
    frequency: Array = about("frequencies", "frequency", unit="Hz", brief=False)
    density: Array = about("single-sided, squared unit per Hz", "frequency", "channel", brief=False)


@result
class Line:
    """A line of the gyroscope's spectrum."""

    hz: float = about("at the median collective; as logged", unit="Hz")
    lowest_hz: float = about("at the 5th percentile of the collective", unit="Hz")
    highest_hz: float = about("at the 95th percentile of the collective", unit="Hz")
    above_db: float = about("above its neighbourhood", unit="dB")
    axis: str = about("where it is strongest")
    kind: str = about("rotor, moves (with collective), fixed, folded, or unknown: collective varies too little")
    power: Estimate | None = part(default=None)
    rotor: int = about("number of the rotor that it follows; 0 where speeds are not logged")
    order: int = about("multiple of the rotor's turns; 0 where speeds are not logged")


@result
class StatedFilter:
    """A filter that the log states."""

    parameter: str = about("its name")
    stage: str = about("what is filtered: measured, target, error, slope or output")
    kind: str = about("first, second, or notch")
    hz: float = about("cut-off or centre", unit="Hz")
    width_hz: float = about("of a notch", unit="Hz")
    delay_ms: float = about("that it costs at 5 Hz", unit="ms")


@result
class Change:
    """A parameter that this log shows should be another."""

    parameter: str = about("its name")
    now: float = about("as the log states it")
    proposed: float = about("value")
    reason: str = about("notch off the line, or line outside the range of dynamic notches")


@result
class Vibration:
    """Vibration of one flight."""

    spectra: dict[str, Spectrum] = part()
    lines: tuple[Line, ...] = part()
    lines_lack: str = about("why no line can be seen: empty, rate, or time")
    limit: tuple[float, ...] = about(
        "of the autopilot for an unfiltered accelerometer: doubtful, bad", "level", unit="m/s^2"
    )
    folds: bool = about("whether what is above half the logged rate may be folded below")
    filters: tuple[StatedFilter, ...] = part()
    delay_ms: float = about("of the static filters of the gyroscope together, at 5 Hz", unit="ms", gaps=True)
    changes: tuple[Change, ...] = part()
    map_collective: Array = about("middle of each bin", "bin", brief=False)
    map_hz: Array = about("frequencies", "map_frequency", unit="Hz", brief=False)
    map_db: Array = about("all axes, (rad/s)^2/Hz", "bin", "map_frequency", unit="dB", gaps=True, brief=False)


def vibration_of(flight: LogFlight) -> Vibration | None:
    """Estimate spectra, lines and their causes; None where no gyroscope is logged."""
    if not flight.gyroscope.values.size:
        return None
    before, after = flight.gyroscope_unfiltered, flight.gyroscope
    if before is not None and before.source == after.source:
        after = before
    autopilot = AUTOPILOTS.get(flight.autopilot)
    filtered = before is not None or bool(autopilot and after.source.startswith(autopilot.filtered))
    given = [
        ("gyroscope before filters", before if before is not None else None if filtered else after),
        ("gyroscope", after if filtered and after is not before else None),
        ("accelerometer", flight.accelerometer),
        ("commands", flight.rotors if flight.rotors_source == "logged" else None),
    ]
    parts = {name: _Power.of(flight, each) for name, each in given if each is not None and each.values.size}
    spectra = {name: power.spectrum(name) for name, power in parts.items() if power}
    main = parts.get("gyroscope before filters") or parts.get("gyroscope")
    lines = tuple(_lines(flight, main)) if main else ()
    law = flown_law(flight)
    filters = tuple(_filters(flight, autopilot, law)) if autopilot and law else ()
    level, hz, db = _map(flight, main) if main else (np.empty(0), np.empty(0), np.empty((0, 0)))
    highest = 0.5 * (before or after).rate_hz
    # What ArduPilot logs as IMU is behind its low-pass of 20 Hz.
    smooth = flight.accelerometer is not None and flight.accelerometer.source.startswith("IMU")
    return Vibration(
        spectra=spectra,
        lines=lines,
        lines_lack="" if main else "rate" if highest < _SHOWS_HZ else "time",
        limit=() if smooth else LIMITS.get(flight.autopilot, ()),
        folds=highest < _FOLDS_HZ,
        filters=filters,
        delay_ms=sum(each.delay_ms for each in filters if each.stage == "measured") if filters else np.nan,
        changes=() if highest < _FOLDS_HZ else tuple(_changes(flight, filters, lines)),
        map_collective=level,
        map_hz=hz,
        map_db=db,
    )


class _Power(NamedTuple):
    """Power of a signal, shape (window, frequency, channel), frequency in Hz."""

    samples: Samples
    windows: Windows
    frequency: Array
    density: Array

    @classmethod
    def of(cls, flight: LogFlight, samples: Samples) -> _Power | None:
        rate = samples.rate_hz
        if rate < 2 * _SHOWS_HZ:
            return None
        windows = windows_of(flight, max(_WINDOW_S, _LEAST_SAMPLES / rate))
        windows = windows.keep(np.asarray(np.isfinite(windows.means(samples)).all(axis=1)))
        if len(windows.begin) < _FEWEST:
            return None
        count = round(windows.length_s * rate)
        at = windows.begin[:, None] + np.arange(count) / rate
        values = np.stack([np.interp(at, samples.time, channel) for channel in samples.values.T], axis=2)
        taper = np.hanning(count)[:, None]
        # A turn that speeds up leaks less where its straight line is taken off.
        line = np.linspace(-1, 1, count)[:, None]
        slope = (line * values).sum(axis=1, keepdims=True) / (line**2).sum()
        flat = values - values.mean(axis=1, keepdims=True) - slope * line
        power = np.abs(np.fft.rfft(taper * flat, axis=1)) ** 2
        frequency = np.asarray(np.fft.rfftfreq(count, 1 / rate), dtype=float)
        return cls(samples, windows, frequency, power * 2 / (rate * (taper**2).sum()))

    def spectrum(self, name: str) -> Spectrum:
        """Average over windows."""
        return Spectrum(
            signal=name,
            source=self.samples.source,
            rate_hz=self.samples.rate_hz,
            rms=self._above(),
            frequency=self.frequency,
            density=self.density.mean(axis=0),
        )

    def _above(self) -> Array:
        """Compute the root mean square above 20 Hz in the windows, shape (channel,): of spectra, fast turns leak."""
        from scipy.fft import irfft, next_fast_len, rfft

        time, rate = self.samples.time, self.samples.rate_hz
        even = time[0] + np.arange(next_fast_len(int((time[-1] - time[0]) * rate) + 1, real=True)) / rate
        values = np.stack([np.interp(even, time, channel) for channel in self.samples.values.T])
        frequency = np.fft.rfftfreq(len(even), 1 / rate)
        passed = rfft(values, axis=1) / (1 + (_ABOVE_HZ / np.maximum(frequency, 1e-9)) ** 8)
        quick = irfft(passed, len(even), axis=1).T
        return np.asarray(np.sqrt(np.mean(self.windows.means(Samples(even, quick**2)), axis=0)))


def _map(flight: LogFlight, power: _Power) -> tuple[Array, Array, Array]:
    """Average the power of all axes over windows of about equal collective, dB."""
    level = power.windows.means(Samples(flight.time, flight.collective))[:, 0]
    ends = np.nanpercentile(level, [2, 98]) if np.isfinite(level).any() else np.zeros(2)
    edges = np.linspace(ends[0], ends[1], _BINS + 1)
    total, rows = power.density.sum(axis=2), np.full((_BINS, len(power.frequency)), np.nan)
    for k in range(_BINS):
        inside = (level >= edges[k]) & (level < edges[k + 1])
        if inside.sum() > 1:
            rows[k] = total[inside].mean(axis=0)
    return 0.5 * (edges[1:] + edges[:-1]), power.frequency, 10 * np.log10(np.maximum(rows, 1e-12))


class _Drive(NamedTuple):
    """What a line may follow, by window: the collective, or the turns of a rotor in 1/s."""

    rotor: int
    level: Array
    powers: Array


def _drives(flight: LogFlight, power: _Power) -> Iterator[_Drive]:
    powers = _POWERS if power.frequency[-1] < _FOLDS_HZ else _POWERS[_POWERS > -0.3]
    levels = [(0, power.windows.means(Samples(flight.time, flight.collective))[:, 0], powers)]
    if flight.rotor_speed is not None:
        turns = power.windows.means(flight.rotor_speed).T / (2 * np.pi)
        levels += [(rotor + 1, level, np.ones(1)) for rotor, level in enumerate(turns)]
    for rotor, level, tried in levels:
        known = level > 0
        if known.any():
            yield _Drive(rotor, np.where(known, level, np.median(level[known])), tried)
        elif not rotor:
            yield _Drive(0, np.ones(len(level)), np.zeros(1))


def _lines(flight: LogFlight, power: _Power) -> Iterator[Line]:
    """Find lines one after the other, each along what it follows, and take each out before the next."""
    from scipy.ndimage import median_filter

    rate, spacing = power.samples.rate_hz, power.frequency[1]
    thinned = slice(None, None, len(power.windows.begin) // _MOST_WINDOWS + 1)
    power = power._replace(windows=power.windows.keep(thinned), density=power.density[thinned])
    total = 10 * np.log10(np.maximum(power.density.sum(axis=2), 1e-20))
    above = total - median_filter(total, (1, max(int(_FLOOR * 0.5 * rate / spacing) | 1, 9)), mode="nearest")
    above[:, power.frequency < _LOWEST_LINE_HZ - 0.5 * spacing] = 0.0
    drives = list(_drives(flight, power))
    for _ in range(_MOST_LINES):
        tables = [_Table(above, drive, rate, spacing) for drive in drives]
        best = max(tables, key=lambda table: table.height + (_PREFERRED_DB if table.drive.rotor else 0.0))
        if not best.sure:
            return
        yield best.line(power)
        best.remove(above)


class _Table:
    """Mean height above the floor along all curves that a line may follow: sums over windows, (block, power, start)."""

    def __init__(self, above: Array, drive: _Drive, rate: float, spacing: float) -> None:
        self.drive, self.rate, self.spacing = drive, rate, spacing
        self.middle = float(np.median(drive.level))
        self.relative = drive.level / self.middle
        # Off the edges of bins, so that no rounding decides.
        steps = np.arange(2 * round(_LOWEST_LINE_HZ / spacing), above.shape[1] * 2 - 3)
        self.starts = spacing * (0.5 * steps + 0.25)
        if drive.rotor:
            steps = np.arange(-_NEAR_ORDER, _NEAR_ORDER, 0.5 * spacing / self.middle)
            self.starts = self.middle * (np.arange(1, _ORDERS + 1)[:, None] + steps).ravel()
        window = np.arange(len(above))[:, None, None]
        found = above[window, self._bins(self.relative[:, None, None] ** drive.powers[:, None] * self.starts)]
        group = contiguous(len(above), _BLOCKS)
        self.counts = np.bincount(group, minlength=_BLOCKS)
        self.heights = np.add.reduceat(found, np.searchsorted(group, np.arange(_BLOCKS)), axis=0)
        self.mean = self.heights.sum(axis=0) / len(above)
        at = int(np.argmax(self.mean))
        self.best = divmod(at, self.mean.shape[1])
        self.height = float(self.mean[self.best])

    def _bins(self, hz: Array) -> Array:
        """Give the bin in which a frequency shows, folded at half the rate."""
        folded = np.abs((hz + 0.5 * self.rate) % self.rate - 0.5 * self.rate)
        return np.rint(folded / self.spacing).astype(int)

    @property
    def sure(self) -> bool:
        """Whether the highest is a line."""
        each = self.heights[:, self.best[0], self.best[1]] / self.counts
        return self.height > _LINE_DB and self.height > _SURE * float(each.std(ddof=1) / np.sqrt(_BLOCKS))

    def power(self) -> Estimate | None:
        """Estimate the power of the collective that the frequency goes with; None where it hardly varies."""
        level = np.log(self.relative)
        # Within a bin all powers fit.
        coarse = 0.5 * self.spacing / self.starts[self.best[1]] / max(float(np.std(level)), 1e-9)
        if self.drive.rotor or len(self.drive.powers) < 2 or coarse > 0.5:
            return None
        near = np.abs(self.starts / self.starts[self.best[1]] - 1) < 0.1
        ridge = self.heights[:, :, near]

        def highest(table: Array) -> float:
            column = table.max(axis=1)
            k = int(np.clip(np.argmax(column), 1, len(column) - 2))
            left, top, right = column[k - 1 : k + 2]
            bend = left - 2 * top + right
            inside = float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5)) if bend < 0 else 0.0
            return float(self.drive.powers[k] + inside * (self.drive.powers[1] - self.drive.powers[0]))

        whole = ridge.sum(axis=0)
        value = highest(whole)
        left_out = np.array([highest(whole - each) for each in ridge])
        half = float(half_width(jackknife_error(left_out), _BLOCKS)) + coarse
        return Estimate.around(value, half)

    def line(self, power: _Power) -> Line:
        """Describe the highest."""
        start, power_of = float(self.starts[self.best[1]]), self.power()
        exponent = float(self.drive.powers[self.best[0]])
        ends = np.percentile(self.relative, [5, 50, 95]) ** exponent * start
        place = self._bins(self.relative**exponent * start)
        strength = power.density[np.arange(len(place)), place].mean(axis=0)
        kind = "rotor" if self.drive.rotor else "unknown"
        if power_of:
            kinds = {
                "folded": power_of.high < -_MOVES,
                "moves": power_of.low > _MOVES,
                "fixed": abs(power_of.value) + power_of.half < _FIXED,
            }
            kind = next((name for name, holds in kinds.items() if holds), "unknown")
        shown = sorted(float(hz) for hz in self._bins(ends[[0, 2]]) * self.spacing)
        return Line(
            hz=float(self._bins(ends[1]) * self.spacing),
            lowest_hz=shown[0],
            highest_hz=shown[1],
            above_db=self.height,
            axis=AXES[int(np.argmax(strength))],
            kind=kind,
            power=power_of,
            rotor=self.drive.rotor,
            order=round(start / self.middle) if self.drive.rotor else 0,
        )

    def remove(self, above: Array) -> None:
        """Take the highest out of the heights."""
        hz = self.relative ** self.drive.powers[self.best[0]] * self.starts[self.best[1]]
        place = self._bins(hz)[:, None]
        reach = np.maximum(2, np.rint(_WIDE * place))
        above[np.abs(np.arange(above.shape[1]) - place) <= reach] = 0.0


def _filters(flight: LogFlight, autopilot: Autopilot, law: Law) -> Iterator[StatedFilter]:
    """List the filters of the law, one of several axes once."""
    back = np.exp(-2j * np.pi * np.array([_DELAY_HZ]) * law.period)
    stated = autopilot.of_log(autopilot.in_log(flight.parameters))
    seen: set[tuple[str, Filter]] = set()
    for parameter in autopilot.parameters:
        group, stage, kind = (*parameter.role.split("."), "", "")[:3]
        own = getattr(law.axes[AXES.index(group) if group in AXES else 0], stage) if stage in STAGES else ()
        hz = stated[parameter.name] * parameter.scale
        kinds = {"first": ("first", "second")}.get(kind.rstrip("2"), (kind.rstrip("2"),))
        for each in (each for each in own if each.kind in kinds and each.hz == hz):
            if (stage, each) not in seen:
                seen.add((stage, each))
                phase = -float(np.angle(chain((each,), back, law.period))[0])
                yield StatedFilter(
                    parameter=parameter.name,
                    stage=stage,
                    kind=each.kind,
                    hz=each.hz,
                    width_hz=each.width_hz,
                    delay_ms=1e3 * phase / (2 * np.pi * _DELAY_HZ),
                )


def _changes(flight: LogFlight, filters: tuple[StatedFilter, ...], lines: tuple[Line, ...]) -> Iterator[Change]:
    """Propose what is sure: a notch off the one fixed line, and dynamic notches that begin above a motor's line."""
    notches = [each for each in filters if each.kind == "notch" and each.stage == "measured"]
    fixed = [line.hz for line in lines if line.kind == "fixed" and line.above_db > _STRONG_DB]
    if len(notches) == len(fixed) == 1 and abs(notches[0].hz - fixed[0]) > 0.5 * notches[0].width_hz:
        now, proposed = notches[0].hz, float(round(fixed[0]))
        yield Change(parameter=notches[0].parameter, now=now, proposed=proposed, reason="notch off the line")
    moving = [line.lowest_hz for line in lines if line.kind in ("moves", "rotor") and line.above_db > _STRONG_DB]
    count, low = (number(flight, f"dyn_notch_{name}") or 0.0 for name in ("count", "min_hz"))
    by_speed = any(number(flight, name) for name in _BY_SPEED)
    if moving and count > 0 and min(moving) < low and not by_speed:
        proposed = float(np.floor(min(moving) / 10) * 10)
        reason = "line outside the range of dynamic notches"
        yield Change(parameter="dyn_notch_min_hz", now=low, proposed=proposed, reason=reason)
