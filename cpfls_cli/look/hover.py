"""Throttle that hovers, shape of the thrust curve, and the battery under load."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.estimation.estimate import power_between
from cpfls_cli.look.flight import LogFlight
from cpfls_cli.look.steady import (
    WINDOW_S,
    StatedCurve,
    Windows,
    calm,
    jackknifed,
    number,
    on_clock,
    stated_curve,
    windows_of,
)
from cpfls_cli.result import Estimate, about, part, result
from cpfls_cli.units import STANDARD_GRAVITY

_HOVERS, _CLIMBS = 0.05, 0.3
"""Most difference of the vertical specific force from gravity, share, and climb rate, m/s."""
_THIN_AIR, _FOR_VOLTAGE = 0.8, "MOT_BAT_VOLT_MAX"
"""Density of the air at 2000 m over that at sea level, and the parameter of ArduPilot that is above 0 where it adds
what a battery has lost: commands are no throttle then."""
_ON_GROUND = 0.5
"""Share of the median thrust below which a vehicle that shows gravity is on the ground."""
_CURVE_S, _SPREAD, _LEAST_FORCE, _SHARPEST = 0.5, 1.25, 0.2, 0.5
"""Windows of the thrust curve; least ratio of the 95th to the 5th percentile of the collective; least specific force
along the thrust, in g: below, drag and inflow count as much as the rotors; half-width of the exponent of thrust above
which the shape is not known."""
_BATTERY_S, _PER_DEGREE_S, _FULL, _VARIES = 1.0, 30.0, 0.9, 0.15
"""Windows of the battery; time of the flight for a degree of the polynomial; collective that is full; least variation
of the load, share of it: by less, a current rises because voltage falls, at equal power."""


@result
class Stated:
    """A parameter of the autopilot against what the flight shows."""

    SHOWN = ("differs",)

    parameter: str = about("its name")
    value: float = about("as the log states it")
    measured: Estimate = part()

    @property
    def differs(self) -> bool:
        """Whether it lies outside the interval."""
        return not self.measured.low <= self.value <= self.measured.high


@result
class ThrustShape:
    """How thrust grows with the collective command: with which power of it."""

    exponent: Estimate = part()
    stated: float = about("exponent that the autopilot's curve has in the middle of the range", gaps=True)
    lowest: float = about("collective, 5th percentile")
    highest: float = about("collective, 95th percentile")
    collective: Array = about("of each window", "point", brief=False)
    specific_force: Array = about("upward along the body, of each window", "point", unit="m/s^2", brief=False)


@result
class Battery:
    """The battery under load."""

    against: str = about("load that the voltage falls with: current in A, or collective where no current is logged")
    slope: Estimate | None = part(default=None)
    lightest: float = about("load, 5th percentile", gaps=True)
    heaviest: float = about("load, 95th percentile", gaps=True)
    open_circuit_begin: Estimate | None = part(default=None)
    open_circuit_end: Estimate | None = part(default=None)
    sag_hover: Estimate | None = part(default=None)
    sag_full: Estimate | None = part(default=None)
    lowest: float = about("lowest voltage, mean of a second", unit="V")
    used_mah: float = about("charge used while the log runs", unit="mA h", gaps=True)
    time: Array = about("middle of each window", "second", unit="s", brief=False)
    voltage: Array = about("of each window", "second", unit="V", brief=False)
    load: Array = about("of each window", "second", brief=False)


@result
class Hover:
    """What holds the vehicle up: throttle, thrust curve, battery."""

    found_by: str = about("how hover is seen: specific force or climb rate; empty where it is not")
    throttle: Estimate | None = part(default=None)
    scatter: float = about("standard deviation of the throttle that hovers, over windows", gaps=True)
    hover_s: float = about("time in hover", unit="s")
    drift: Estimate | None = part(default=None)
    voltage_drift: float = about("change of the voltage over the same time", unit="V", gaps=True)
    shape: ThrustShape | None = part(default=None)
    battery: Battery | None = part(default=None)
    stated: Stated | None = part(default=None)


def hover_of(flight: LogFlight) -> Hover | None:
    """Estimate the throttle that hovers, the thrust curve and the battery; None where no collective is logged.

    `drift` is how the throttle that hovers changes from the first to the last window, along a straight line.
    """
    if not np.isfinite(flight.collective[flight.flown]).any():
        return None
    stated = stated_curve(flight)
    found_by, windows, throttle = _hovering(flight, stated)
    both = np.stack([throttle, stated.thrusts(throttle)], axis=1)
    # Without a full command a hover is a share of nothing.
    known = None if flight.relative else jackknifed(lambda kept: both[kept].mean(axis=0), len(both))
    voltage = windows.means(on_clock(flight, flight.voltage))[:, 0]
    time = windows.begin - windows.begin[0] if len(windows.begin) else windows.begin
    drift = jackknifed(lambda kept: _slope(time[kept], throttle[kept]) * np.ptp(time), len(time))
    return Hover(
        found_by=found_by if known else "",
        throttle=known.estimate(0) if known else None,
        scatter=float(throttle.std(ddof=1)) if known else np.nan,
        hover_s=len(throttle) * WINDOW_S,
        drift=drift.estimate() if drift else None,
        voltage_drift=float(_slope(time, voltage)[0] * np.ptp(time)) if drift else np.nan,
        shape=_shape(flight, stated),
        battery=_battery(flight, throttle),
        stated=_compared(flight, known.estimate(1)) if known else None,
    )


def _hovering(flight: LogFlight, stated: StatedCurve) -> tuple[str, Windows, Array]:
    """Give what shows hover, its windows, and the collective of each, shape (window,)."""
    windows = windows_of(flight)
    collective, climb, up = (
        windows.means(on_clock(flight, each))[:, 0]
        for each in (flight.collective, flight.climb_rate, -flight.specific_force[:, 2])
    )
    level = calm(flight, windows) & ~(np.abs(climb) > _CLIMBS) & np.isfinite(collective)
    by_force = level & (np.abs(up / STANDARD_GRAVITY - 1) < _HOVERS)
    by_climb = level & np.isfinite(climb) & np.isfinite(windows.means(on_clock(flight, flight.attitude))[:, 0])
    found_by, at = ("specific force", by_force) if np.isfinite(up).any() else ("climb rate", by_climb)
    thrust = stated.thrusts(collective)
    at &= thrust > _ON_GROUND * np.median(thrust[at]) if at.any() else at
    return found_by, windows.keep(at), collective[at]


def _slope(x: Array, y: Array) -> Array:
    """Fit the slope of a straight line, shape (1,)."""
    apart = x - x.mean()
    return np.array([apart @ y / max(float(apart @ apart), 1e-12)])


def _shape(flight: LogFlight, stated: StatedCurve) -> ThrustShape | None:
    """Estimate exponent and curve of thrust by what the collective does to the specific force.

    A height controller moves the collective against gusts and sinking voltage, which takes slope from thrust on
    collective and adds it to the inverse of collective on thrust. The truth lies between them (Frisch 1934), so the
    interval spans both.
    """
    windows = windows_of(flight, _CURVE_S)
    collective = windows.means(on_clock(flight, flight.collective))[:, 0]
    up = -windows.means(on_clock(flight, flight.specific_force))[:, 2]
    low, high = (0.0, 1.0) if stated.thrust else (stated.curve.low, stated.curve.high)
    share = (collective - low) / (high - low)
    used = (share > 0.02) & (share < 0.99) & (up > _LEAST_FORCE * STANDARD_GRAVITY)
    if used.sum() < 2 or np.divide(*np.percentile(share[used], [95, 5])) < _SPREAD:
        return None
    share, up, collective = share[used], up[used], collective[used]
    by, of = np.log(share), np.log(up)

    known = jackknifed(lambda kept: power_between(of[kept], by[kept]), len(share))
    if known is None:
        return None
    lower, upper = known.estimate(0), known.estimate(1)
    exponent = Estimate(value=float(np.sqrt(lower.value * upper.value)), low=lower.low, high=upper.high)
    if lower.low <= 0 or exponent.half > _SHARPEST:
        return None
    middle = np.exp(by.mean()) * np.array([0.99, 1.01]) * (high - low) + low
    curve = np.log(stated.thrusts(middle))
    return ThrustShape(
        exponent=exponent,
        stated=float(np.diff(curve)[0] / np.log(1.01 / 0.99)) if stated.name else np.nan,
        lowest=float(np.percentile(collective, 5)),
        highest=float(np.percentile(collective, 95)),
        collective=collective,
        specific_force=up,
    )


def _compared(flight: LogFlight, thrust: Estimate) -> Stated | None:
    """Compare the thrust that hovers with what the autopilot was given, or learned."""
    autopilot = AUTOPILOTS.get(flight.autopilot)
    hover = autopilot.by_role("motors.hover") if autopilot else None
    value = number(flight, hover.name) if hover else None
    if not hover or not value or (number(flight, _FOR_VOLTAGE) or 0) > 0:
        return None
    # ArduPilot adds to its throttle what thin air takes from thrust.
    thin = _THIN_AIR if flight.autopilot == "ardupilot" else 1.0
    measured = Estimate(value=thrust.value, low=thin * (1 - _HOVERS) * thrust.low, high=(1 + _HOVERS) * thrust.high)
    return Stated(parameter=hover.name, value=value, measured=measured)


def _battery(flight: LogFlight, throttle: Array) -> Battery | None:
    """Regress voltage on load jointly with what slowly discharges it."""
    windows = windows_of(flight, _BATTERY_S)
    voltage, current, collective = (
        windows.means(on_clock(flight, each))[:, 0] for each in (flight.voltage, flight.current, flight.collective)
    )
    measured = bool(np.isfinite(current).any() and np.nanstd(current) > 0)
    load = current if measured else collective
    whole = np.isfinite(voltage) & np.isfinite(load)
    if whole.sum() < 2 or np.ptp(voltage[whole]) <= 0:
        return None
    voltage, load, time = voltage[whole], load[whole], windows.begin[whole] + 0.5 * _BATTERY_S
    ends = np.array([time[0], time[-1]])
    known = jackknifed(lambda kept: _discharge(time[kept], voltage[kept], load[kept], ends), len(time))
    lightest, heaviest = (float(end) for end in np.percentile(load, [5, 95]))
    varies = heaviest - lightest > _VARIES * abs(heaviest)
    # A battery gives way under load; a slope that may be none is no finding.
    found = known if known is not None and varies and known.value[0] > known.half[0] else None
    circuit = found if measured else None
    full = load[collective[whole] > _FULL]
    hovering = load[np.abs(collective[whole] / np.mean(throttle) - 1) < _HOVERS] if len(throttle) else full[:0]
    return Battery(
        against="current" if measured else "collective",
        slope=found.estimate(0) if found else None,
        lightest=lightest,
        heaviest=heaviest,
        open_circuit_begin=circuit.estimate(1) if circuit else None,
        open_circuit_end=circuit.estimate(2) if circuit else None,
        sag_hover=circuit.moved(hovering.mean() * np.eye(3)).estimate() if circuit and len(hovering) else None,
        sag_full=circuit.moved(full.mean() * np.eye(3)).estimate() if circuit and len(full) else None,
        lowest=float(voltage.min()),
        used_mah=float(np.nansum(flight.current) / flight.rate_hz / 3.6) if measured else np.nan,
        time=time,
        voltage=voltage,
        load=load,
    )


def _discharge(time: Array, voltage: Array, load: Array, ends: Array) -> Array:
    """Fit voltage without load as a polynomial of time, up to a cubic, minus a slope times the load.

    Gives the slope, and voltage without load at both ends of the flight.
    """
    degree = int(np.clip((ends[1] - ends[0]) / _PER_DEGREE_S, 1, 3))
    scaled, bounds = (np.vander(2 * (at - ends[0]) / (ends[1] - ends[0]) - 1, degree + 1) for at in (time, ends))
    fit = np.linalg.lstsq(np.column_stack([-load, scaled]), voltage, rcond=None)[0]
    return np.array([fit[0], *(bounds @ fit[1:])])
