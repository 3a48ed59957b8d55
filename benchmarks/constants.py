"""Fit flights of a known vehicle: errors of its numbers, intervals that hold them, blocks that are chosen.

Parts, all if none is named: coloured (noise of 50 ms, from a config that is wrong), speeds (from mass and geometry
alone, as all that follow; rotor speeds logged), search (and the structure looked for), commands (in per cent, and no
rotor speed), rotorpy (flights in CPFLS_FLIGHTS), weight (added). What else a fit starts from is guessed as for a config
that leaves it null. Fits have the structure that flew, except for those of search; each has nine flights of 20 s
(tests/builders/playback_flights.py). With white noise a fit ends where it does from a wrong config too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import t as student

from benchmarks.shared.measure import count, program, table
from benchmarks.shared.playback_scores import SYMBOLS, free_runs, score
from cpfls_cli.arrays import Array
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.playback.evaluation import Group
from cpfls_cli.playback.fit import Fitted, fit, uncertainty, windows_of
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.parameters import MASS
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import Structure
from cpfls_cli.playback.vehicle import differences, find_vehicle, found_numbers
from cpfls_cli.playback.weight import carrying_weight
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.playback_flights import (
    ADDED_AT,
    ADDED_KG,
    KINDS,
    MIDDLING,
    ROTORPY,
    ROTORPY_HIDDEN,
    STATED,
    TRUE_BLOCKS,
    flown,
    judged,
    loaded,
    logged,
    nothing_known,
    rotorpy_flight,
    true_numbers,
    truth,
)  # fmt: skip
from tests.builders.recorded_flights import FLIGHTS

SEARCHES, LOADED = 2, 10
COLOURED = replace(MIDDLING, time_constant_s=0.05)
STEPS, TOLERANCE, SLOPE = 60, 3e-5, 1e-5
USUAL = PlaybackSettings()
SEARCH = PlaybackSettings(search_windows=120)
LAG = "lag.time_constant_s"
ASKED = {"thrust_factor": "1 %", "drag_factor": "3 %", LAG: "2 ms", "added mass": "3 %"}
ASKED |= {f"inertia.I{axis}": "3 %" for axis in ("xx", "yy", "zz")}
ASKED |= {f"place of the added mass, {axis}": "3 mm" for axis in "xy"}
LINEAR, LARGEST_SPEED, NOMINAL_SPEED = 0.45, 1250.0, 1000.0
"""Thrust curve of the flights without rotor speeds; the speed at a command of 1, and what a config says of it."""

NOMINAL = nothing_known(replace(STATED, rotor_speed_max_rad_s=NOMINAL_SPEED))
OF_COMMANDS = (LAG, "inertia.Ixx", "inertia.Iyy", "inertia.Izz")
"""Numbers that do not depend on what a command of 1 is."""


class Compared(NamedTuple):
    """A number against its true value: error and half width of its interval in per cent, or ms, or mm."""

    error: float
    half: float
    held: bool
    unit: str


class Number(NamedTuple):
    """A number with its interval, named as a fit names it."""

    name: str
    unit: str
    value: float
    low: float
    high: float


def main(parts: list[str] | None = None, seeds: int = 20) -> None:
    for name in parts or PARTS:
        print(f"\n{name}:\n")
        PARTS[name](seeds)


def training(model: VehicleModel, seed: int, noise=MIDDLING) -> list[PlaybackFlight]:
    return flown(model, KINDS * 3, seed=seed, noise=noise)


def found(
    vehicle: VehicleSettings, flights: Sequence[PlaybackFlight], blocks: Sequence[str], groups: tuple[Group, ...] = ()
) -> tuple[Fitted, list]:
    """Fit blocks and what is not known, as `cpfls vehicle` does once it has chosen them; also their numbers."""
    begun, _ = carrying_weight(vehicle, [flight for flight in flights if not flight.group])
    free = Structure(tuple(block for block in blocks if block not in begun.unknown)).free(begun, groups)
    windows = windows_of(flights, USUAL.horizon_s, USUAL.window_interval_s)
    fitted = fit(free, windows, {}, STEPS, TOLERANCE)
    spread = uncertainty(fitted, windows)
    more = differences(fitted, spread) if groups else over_yaw_inertia(fitted, spread)
    return fitted, [*found_numbers(fitted, spread), *more]


def over_yaw_inertia(fitted: Fitted, spread) -> Iterator[Number]:
    """Give numbers of yaw over its inertia, which motion shows better than either."""

    def ratios(step: Array | float) -> dict[str, float]:
        physical = fitted.free.physical(fitted.values + step)
        every = judged({name: each.value for name, each in physical.items()})
        return {name: value for name, value in every.items() if name not in physical}

    steps = SLOPE * np.diag(fitted.free.scales)
    slopes = np.array([[*ratios(step).values()] for step in steps]) - [[*ratios(-step).values()] for step in steps]
    slopes = slopes.T / (2 * SLOPE * fitted.free.scales)
    halves = student.ppf(0.975, spread.blocks - 1) * np.sqrt(np.diag(slopes @ spread.covariance @ slopes.T))
    for (name, value), half in zip(ratios(0.0).items(), halves, strict=True):
        yield Number(name, "", value, value - half, value + half)


def compared(numbers, true: Mapping[str, float]) -> dict[str, Compared]:
    """Compare numbers, or differences, with those that are true."""
    rows = {}
    for each in numbers:
        if each.name in true:
            factor, unit = (1000.0, f"m{each.unit}") if each.unit in ("s", "m") else (100 / abs(true[each.name]), "%")
            error, half = factor * (each.value - true[each.name]), factor * (each.high - each.low) / 2
            rows[each.name] = Compared(error, half, each.low <= true[each.name] <= each.high, unit)
    return rows


COLUMNS = "number | asked | median error | largest | mean | median half interval | intervals that hold it"


def by_number(fits: Sequence[Mapping[str, Compared]]) -> Iterator[tuple[str, ...]]:
    for name in fits[0]:
        rows = [each[name] for each in fits]
        errors, unit = np.array([row.error for row in rows]), rows[0].unit
        sizes = (np.median(np.abs(errors)), np.abs(errors).max())
        half = np.median([row.half for row in rows])
        texts = (*(f"{size:.2f} {unit}" for size in sizes), f"{errors.mean():+.2f} {unit}", f"{half:.2f} {unit}")
        yield name, ASKED.get(name.rpartition(": ")[2], ""), *texts, count([row.held for row in rows])
    held = [row.held for each in fits for row in each.values()]
    yield "all", "90 to 98 %", "", "", "", "", f"{100 * np.mean(held):.1f} %"


def coloured(seeds: int) -> None:
    true, fits, ratios = true_numbers(), [], []
    for seed in range(1, seeds + 1):
        fitted, numbers = found(STATED, training(truth(), seed, COLOURED), TRUE_BLOCKS)
        fits.append(compared(numbers, true | judged(true)))
        flights = flown(truth(), seed=1000 + seed, noise=COLOURED)
        ours, theirs = (score([free_runs(each, own, 5) for own in flights]).sums for each in (fitted.model, truth()))
        ratios.append(ours / theirs)
    table("constants_coloured", COLUMNS, list(by_number(fits)))
    print("\nplayback error on other flights over that of the true model\n")
    sizes = zip(SYMBOLS.values(), np.median(ratios, axis=0), np.max(ratios, axis=0), strict=True)
    table("constants_coloured_errors", "signal | median | largest", list(sizes), digits=4)


def speeds(seeds: int) -> None:
    each = (training(truth(), seed) for seed in range(1, seeds + 1))
    fits = [compared(found(nothing_known(), flights, TRUE_BLOCKS)[1], true_numbers()) for flights in each]
    table("constants_speeds", COLUMNS, list(by_number(fits)))


def search(_seeds: int) -> None:
    """Look for the structure as well, with small settings: where speeds are logged, and once where commands are."""
    rows = []
    for seed in range(1, SEARCHES + 1):
        rows += searched(f"speeds {seed}", nothing_known(), training(truth(), seed), TRUE_BLOCKS, true_numbers())
    known = {name: value for name, value in true_numbers().items() if name in OF_COMMANDS}
    rows += searched("commands 1", NOMINAL, without_speeds(1), (*TRUE_BLOCKS, "thrust_slope"), known)
    table("constants_search", "flights | blocks too many | missed | number | error | half interval | holds it", rows)


def searched(
    name: str,
    vehicle: VehicleSettings,
    flights: Sequence[PlaybackFlight],
    blocks: Sequence[str],
    true: Mapping[str, float],
) -> list[tuple[str, ...]]:
    result = find_vehicle(vehicle, flights, SEARCH, lambda *_: None)
    chosen = next(each.blocks for each in result.structures if each.name == "chosen")
    flew = [block for block in blocks if block not in vehicle.unknown]
    more, missed = ([b for b in one if b not in other] for one, other in ((chosen, flew), (flew, chosen)))
    about, errors = (", ".join(more) or "none", ", ".join(missed) or "none"), compared(result.numbers, true)
    rows = [(number, errors[number]) for number in ASKED if number in errors]
    return [
        (
            name,
            *about,
            number,
            f"{row.error:+.2f} {row.unit}",
            f"{row.half:.2f} {row.unit}",
            "yes" if row.held else "no",
        )
        for number, row in rows
    ]


def curved() -> VehicleModel:
    """Give rotors whose thrust has a linear and a square part, and that hover at the speeds of `truth`."""
    return replace(truth(), effects=(*truth().effects, ModelEffect("thrust_slope", {}, np.array([LINEAR]))))


def without_speeds(seed: int) -> list[PlaybackFlight]:
    """Fly; logged is a share of a largest speed that nobody knows, and is taken as one of the nominal speed."""
    flights = training(curved(), seed, replace(MIDDLING, speed=0.0))
    return [replace(flight, speed=NOMINAL_SPEED / LARGEST_SPEED * flight.speed) for flight in flights]


def commands(seeds: int) -> None:
    fits, curves = [], []
    true = {name: value for name, value in true_numbers().items() if name in OF_COMMANDS}
    for seed in range(1, seeds + 1):
        flights = without_speeds(seed)
        fitted, numbers = found(NOMINAL, flights, (*TRUE_BLOCKS, "thrust_slope"))
        fits.append(compared(numbers, true))
        speeds = np.concatenate([flight.speed for flight in flights]) / NOMINAL_SPEED
        flew = np.linspace(speeds.min(), speeds.max(), 200)
        curve = thrust(curved(), LARGEST_SPEED * flew)
        away = thrust(fitted.model, NOMINAL_SPEED * flew) - curve
        curves.append((flew[0], flew[-1], 100 * np.abs(away).max() / curve.max()))
    low, high, largest = np.array(curves).T
    row = (f"{low.mean():.2f} to {high.mean():.2f}", "2 %", f"{np.median(largest):.2f} %", f"{largest.max():.2f} %")
    table("constants_curve", "commands flown | asked | median of the largest deviation | largest", [row])
    print()
    table("constants_commands", COLUMNS, list(by_number(fits)))


def thrust(model: VehicleModel, speed: Array) -> Array:
    """Compute the thrust of a rotor, N."""
    factor = model.vehicle.rotors[0].thrust_factor_n_s2
    share, hover = sum(float(curve.coefficients[0]) for curve in model.thrust_curve), hover_speed(model.vehicle)
    return np.asarray(factor * ((1 - share) * speed**2 + share * hover * speed))


def rotorpy(seeds: int) -> None:
    if not (FLIGHTS / "rotorpy").exists():
        print(f"{FLIGHTS / 'rotorpy'} is absent; set CPFLS_FLIGHTS to the folder of other people's flights")
        return
    rows = []
    for name, hidden in ROTORPY_HIDDEN.items():
        flight, true = rotorpy_flight(name), stated_numbers(ROTORPY, hidden)
        blocks = [effect.name for effect in hidden]
        flights = [flight, *(with_noise(flight, np.random.default_rng(seed)) for seed in range(1, seeds + 1))]
        clean, *noisy = (compared(found(nothing_known(ROTORPY), [own], blocks)[1], true) for own in flights)
        at_once = {number: f"{row.error:+.2f} {row.unit}" for number, row in clean.items()}
        rows += [(name, number, at_once.get(number, ""), *row) for number, *row in by_number(noisy)]
    table("constants_rotorpy", f"flight | number | without noise{COLUMNS.removeprefix('number')}", rows)


def with_noise(flight: PlaybackFlight, rng: np.random.Generator) -> PlaybackFlight:
    """Log a flight that has no noise once more."""
    motion = flight.motion
    turned = Rotation.from_matrix(motion.rotation).as_quat()
    states = np.hstack([motion.position, motion.velocity, turned, motion.rate])
    return logged(flight.name, states, flight.speed, motion.period, flight.hold, MIDDLING, rng)


def stated_numbers(vehicle: VehicleSettings, effects=()) -> dict[str, float]:
    rotor, moments = vehicle.rotors[0], vehicle.inertia_kg_m2
    known = dict(zip(("inertia.Ixx", "inertia.Iyy", "inertia.Izz"), moments, strict=False))
    known |= {"thrust_factor": rotor.thrust_factor_n_s2, "drag_factor": rotor.drag_factor_n_m_s2}
    offset = [effect.coefficients.tolist() for effect in effects if effect.name == "com_offset"]
    return known | {f"com_offset.c_{axis}": value for pair in offset for axis, value in zip("xy", pair, strict=True)}


def weight(_seeds: int) -> None:
    """Fly as often with a weight of 5 % of the mass, 5 cm off the centre, as without."""
    name = "loaded"
    groups = (Group(name, (MASS, "com_offset", "inertia")),)
    true = {f"{name}: added mass": ADDED_KG}
    true |= {f"{name}: place of the added mass, {axis}": at for axis, at in zip("xy", ADDED_AT.tolist(), strict=True)}
    moments = (stated_numbers(model.vehicle) for model in (loaded(), truth()))
    more, own = ({key: value for key, value in each.items() if "inertia" in key} for each in moments)
    true |= {f"{name}: {key}": value for key, value in more.items()}
    true |= {f"{name}: added {key.removeprefix('inertia.')}": value - own[key] for key, value in more.items()}
    fits = []
    for seed in range(1, LOADED + 1):
        others = [replace(flight, group=name) for flight in training(loaded(), 1000 + seed)]
        _, numbers = found(nothing_known(), [*training(truth(), seed), *others], TRUE_BLOCKS, groups)
        fits.append(compared(numbers, true | true_numbers()))
    table("constants_weight", COLUMNS, list(by_number(fits)))


PARTS = {each.__name__: each for each in (coloured, speeds, search, commands, rotorpy, weight)}

if __name__ == "__main__":
    program(main)
