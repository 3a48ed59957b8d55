"""What is said of vehicles that nobody changed, and of fifteen changes at three sizes each, in flights with truth.

Vehicles (quadrotor, hexarotor, nano) hover and fly gentle legs for 30 s in gusts, each day with another trim, battery,
wind and gusts; their configs are off by what configs are off by. Numbers of flights are kept in a folder, so that they
need not fly again.
"""

from __future__ import annotations

import contextlib
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple
from unittest.mock import patch

import numpy as np
import typer

from benchmarks.shared.changing_flights import GRAVITY, HEXA, NANO, QUAD, Body, Kind, Trim, day_of, flown, vehicle_of
from benchmarks.shared.measure import program, table
from cpfls_cli.changes import judge
from cpfls_cli.changes.judge import _Space, changed
from cpfls_cli.changes.numbers import FlightNumbers, flight_numbers
from cpfls_cli.changes.results import Changed
from cpfls_cli.consistency.check import check
from cpfls_cli.consistency.findings import contradictions
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.vehicle.settings import VehicleSettings

KINDS = {"quadrotor": QUAD, "hexarotor": HEXA, "nano": NANO}
INSTRUMENTS = ("commands", "speeds")
VEHICLES, DAYS, A_DAY, THRICE = 6, 9, 3, 3
"""Of the first so many days three flights."""

REFERENCES = (3, 5, 8)
FASTER = 2.0
"""Pace of flights that are flown otherwise: legs of four times the acceleration."""

USUAL = 5
"""Reference flights of changes."""

ByLog = dict[str, FlightNumbers]
"""By instrument."""

SIZES = {
    "thrust of a rotor": (0.05, 0.1, 0.2),
    "drag of a rotor": (0.1, 0.2, 0.4),
    "two rotors": (0.05, 0.1, 0.2),
    "mass": (0.03, 0.06, 0.12),
    "mass off centre": (0.03, 0.06, 0.12),
    "centre of mass": (0.025, 0.05, 0.1),
    "inertia about x": (0.1, 0.2, 0.4),
    "motor lag": (0.005, 0.01, 0.02),
    "delay": (0.004, 0.01, 0.02),
    "drag of the body": (0.5, 1.0, 2.0),
    "gyroscope bias": (0.01, 0.03, 0.1),
    "gyroscope scale": (0.05, 0.1, 0.2),
    "accelerometer bias": (0.1, 0.3, 1.0),
    "vibration": (1.0, 3.0, 7.0),
    "battery": (0.5, 1.0, 2.0),
    "gusts": (0.4, 1.0, 2.0),
    "wind": (0.2, 0.5, 1.0),
    "mass and drag of a rotor": (0.1, 0.2, 0.4),
}
"""Shares; of the arm for the centre of mass, s for lag and delay, rad/s, m/s^2; wind as the acceleration it gives."""


LOGARITHMS = ("inertia about x", "gyroscope scale", "gusts")
"""Changes whose cause is given by the logarithm."""


Right = dict[str, tuple[float, ...]]


class Altered(NamedTuple):
    """A body after a change, and what is right to say of it: causes, each with its sizes in its unit, where known."""

    body: Body
    right: Right


def altered(name: str, size: float, kind: Kind, body: Body, draw: int) -> Altered:
    """Change one thing of a body."""
    rotors = kind.rotors
    one, other = draw % rotors, (draw + 1 + draw // rotors % (rotors - 1)) % rotors
    place, side = kind.places[one], np.eye(2)[draw % 2] * (-1) ** (draw // 2)
    axis = np.eye(3)[0]

    def times(which: Sequence[int], factor: float, values: np.ndarray) -> np.ndarray:
        return np.where(np.isin(np.arange(rotors), which), factor * values, values)

    if name in ("thrust of a rotor", "two rotors"):
        lost = sorted([one, other] if name == "two rotors" else [one])
        weak = body._replace(thrust=times(lost, 1 - size, body.thrust), drag=times(lost, 1 - size, body.drag))
        words = " and ".join(f"M{index + 1}" for index in lost)
        return Altered(weak, {f"rotor{'s' * (len(lost) > 1)} {words}": (size,) * len(lost)})
    if name == "drag of a rotor":
        heavy = body._replace(drag=times([one], 1 + size, body.drag))
        return Altered(heavy, {"torque about z": (float(kind.spins[one]) * size / rotors,)})
    if name in ("mass", "mass off centre"):
        at = 0.5 * place if name == "mass off centre" else np.zeros(2)
        inertia = body.inertia + size * body.mass * np.array([at[1] ** 2, at[0] ** 2, at @ at])
        heavy = body._replace(mass=body.mass * (1 + size), centre=body.centre + size / (1 + size) * at, inertia=inertia)
        beside: Right = {f"weight near M{one + 1}": ()} if name == "mass off centre" else {"hover": (size,)}
        return Altered(heavy, {"mass": (size,), **beside})
    if name == "mass and drag of a rotor":
        heavy, askew = (altered(each, size, kind, body, draw) for each in ("mass", "drag of a rotor"))
        return Altered(heavy.body._replace(drag=askew.body.drag), heavy.right | askew.right)
    if name == "centre of mass":
        moved = size * kind.arm * side
        return Altered(body._replace(centre=body.centre + moved), {name: tuple(moved.tolist())})
    if name == "inertia about x":
        return Altered(body._replace(inertia=body.inertia * (1 + size * axis)), {"gain roll": (-np.log1p(size),)})
    if name == "motor lag":
        return Altered(body._replace(lag=body.lag + size), {"delay": (size,), "lag": (size,)})
    if name == "delay":
        return Altered(body._replace(late=body.late + size), {"delay": (size,), "lag": (size,)})
    if name == "drag of the body":
        return Altered(body._replace(air=body.air * (1 + size)), {})
    if name == "gyroscope bias":
        return Altered(body._replace(turn_bias=body.turn_bias + size * axis), {"drift": (size, 0.0, 0.0)})
    if name == "gyroscope scale":
        return Altered(body._replace(turn_gain=body.turn_gain * (1 + size * axis)), {"scale x": (np.log1p(size),)})
    if name == "accelerometer bias":
        return Altered(body._replace(felt_bias=body.felt_bias + size * np.eye(3)[2]), {"felt z": (size,)})
    if name == "vibration":
        shaken = body._replace(unbalance=times([one], 1 + size, body.unbalance))
        return Altered(shaken, {"vibration": (), "unbalance": (), f"unbalance M{one + 1}": ()})
    if name == "battery":
        # `sag` is drawn by a hover of the type; this body's takes other speeds.
        drawn = body.sag * (body.mass * GRAVITY / (kind.hover * body.thrust.sum())) ** 1.5
        return Altered(body._replace(sag=body.sag * (1 + size)), {"battery sag": (size * drawn,)})
    if name == "gusts":
        return Altered(body._replace(gusts=body.gusts * (1 + size)), {"gusts": (np.log1p(size),)})
    blown = size * side
    return Altered(body._replace(wind=body.wind + blown * body.mass / body.air), {"lean": tuple((-blown).tolist())})


class Fleet(NamedTuple):
    """Vehicles of a type, and the flights of days on which nobody changed them."""

    vehicles: list[tuple[VehicleSettings, Body]]
    days: list[list[list[ByLog]]]
    """By vehicle, day and flight."""


class Case(NamedTuple):
    """A flight after a change."""

    name: str
    size: float
    vehicle: int
    draw: int
    right: Right
    by_log: ByLog


def _numbers_by_log(kind: Kind, vehicle: VehicleSettings, body: Body, seed: list[int], pace: float = 1.0) -> ByLog:
    return {name: flight_numbers(each, kind.volts) for name, each in flown(kind, vehicle, body, seed, pace).items()}


def _fleet(kind: Kind, trim: Trim, series: int) -> Fleet:
    numbers = range(series * VEHICLES, (series + 1) * VEHICLES)
    vehicles = [vehicle_of(kind, np.random.default_rng([kind.rotors, index])) for index in numbers]
    days: list[list[list[ByLog]]] = []
    for index, (vehicle, body) in zip(numbers, vehicles, strict=True):
        days.append([])
        for day in range(DAYS):
            own = day_of(kind, body, trim, np.random.default_rng([kind.rotors, index, day]))
            flights = A_DAY if day < THRICE else 1
            days[-1].append([_numbers_by_log(kind, vehicle, own, [index, day, flight]) for flight in range(flights)])
    return Fleet(vehicles, days)


def _faster(kind: Kind, trim: Trim, fleet: Fleet, series: int) -> list[list[ByLog]]:
    """Fly once more on each day, legs in half of the time: by vehicle and day."""
    made: list[list[ByLog]] = []
    for index, (vehicle, body) in enumerate(fleet.vehicles, series * VEHICLES):
        made.append([])
        for day in range(DAYS):
            own = day_of(kind, body, trim, np.random.default_rng([kind.rotors, index, day]))
            made[-1].append(_numbers_by_log(kind, vehicle, own, [index, day, A_DAY], FASTER))
    return made


def _cases(kind: Kind, trim: Trim, fleet: Fleet, names: Sequence[str], series: int, draw: int) -> list[Case]:
    index = draw % VEHICLES
    vehicle, body = fleet.vehicles[index]
    cases = []
    for number, (name, sizes) in enumerate(SIZES.items()):
        for step, size in enumerate(sizes if name in names else ()):
            seed = [kind.rotors, 1000 * (series + 1) + draw, number, step]
            now = altered(name, size, kind, day_of(kind, body, trim, np.random.default_rng(seed)), draw)
            try:
                by_log = _numbers_by_log(kind, vehicle, now.body, seed)
            except InputError as error:
                print(f"{name} {size:g}, draw {draw}: {error}", file=sys.stderr)
                continue
            cases.append(Case(name, size, index, draw, now.right, by_log))
    return cases


def _judged(fleet: Fleet, vehicle: int, instrument: str, today: Sequence[ByLog], count: int, draw: int) -> Changed:
    """Hold flights against those of so many other days, one each."""
    rng = np.random.default_rng([vehicle, count, draw])
    others = [day[0] for day in fleet.days[vehicle] if day[0] is not today[0]]
    before = [others[each][instrument] for each in rng.choice(len(others), count, replace=False)]
    flights = [each[instrument] for each in today]
    with _ROUGHLY:
        roughly = changed(flights, before, fleet.vehicles[vehicle][0], np.random.default_rng(0))
    return roughly if roughly.p > _FAR else changed(flights, before, fleet.vehicles[vehicle][0], rng)


_ROUGHLY, _FAR = patch.object(judge, "drawn_by_chance", partial(judge.drawn_by_chance, draws=250)), 0.12
"""So few draws of chance tell an unchanged vehicle, far from the threshold, from one that may have changed."""


def _unchanged(fleet: Fleet) -> Iterator[list[object]]:
    for instrument in INSTRUMENTS:
        for flights in (1, A_DAY):
            for count in REFERENCES:
                with _WITHOUT_SHOWS:
                    runs = [
                        _judged(fleet, index, instrument, day[:flights], count, number)
                        for index, days in enumerate(fleet.days)
                        for number, day in enumerate(days)
                        if len(day) >= flights
                    ]
                yield [instrument, count, flights, *_alarms(runs)]


_SHOWN = 3
"""Draws in which it is asked what would show."""

_WITHOUT_SHOWS = patch.object(_Space, "shows", lambda *_: np.nan)
"""What would show is not asked of vehicles that nobody changed, and takes long."""


_NO_CAUSE = "cause not named"


def _alarms(runs: Sequence[Changed]) -> list[object]:
    said = sorted("+".join(found.name for found in run.causes) or _NO_CAUSE for run in runs if run.changed)
    return [len(runs), len(said), sum(run.p <= 0.05 for run in runs), ", ".join(said) or "—"]


def _otherwise(fleet: Fleet, faster: list[list[ByLog]]) -> Iterator[list[object]]:
    """Hold each day's flight against those of other days that are flown otherwise, or some so and some so."""
    usual = [[day[0] for day in days] for days in fleet.days]
    sides = {"slow": (faster, usual), "fast": (usual, faster), "both": (faster, usual)}
    for instrument in INSTRUMENTS:
        for before, (today, others) in sides.items():
            for count in REFERENCES:
                runs = []
                with _WITHOUT_SHOWS:
                    for index, (vehicle, _) in enumerate(fleet.vehicles):
                        for day in range(DAYS):
                            rng = np.random.default_rng([index, count, day])
                            days = rng.permutation([each for each in range(DAYS) if each != day])[:count]
                            # One in three is flown as today's.
                            mixed = [before == "both" and at % 3 == 0 for at in range(count)]
                            known = [
                                (today if alike else others)[index][each][instrument]
                                for alike, each in zip(mixed, days, strict=True)
                            ]
                            runs.append(changed([today[index][day][instrument]], known, vehicle, rng))
                yield [instrument, before, count, *_alarms(runs)]


def _as_logged(case: Case, instrument: str) -> Case:
    """Leave out what the log does not separate: of what is between command and rotor, speeds show the lag alone."""
    unlike = "delay" if instrument == "speeds" and "lag" in case.right else ""
    return case._replace(right={name: sizes for name, sizes in case.right.items() if name != unlike})


class Verdict(NamedTuple):
    """How right an answer is."""

    found: bool
    right: bool
    among: bool
    wrong: bool
    held: tuple[bool, ...]
    """Whether each interval holds the truth."""

    named: str


def _verdict(case: Case, run: Changed) -> Verdict:
    sure = {found.name for found in run.causes if found.named}
    listed = {found.name for found in run.causes} | {own.name for found in run.causes for own in found.alike}
    held = tuple(
        size.low <= true <= size.high
        for found in run.causes
        for size, true in zip(found.sizes, case.right.get(found.name, ()), strict=False)
    )
    names = "+".join(found.name + "?" * (not found.named) for found in run.causes) or _NO_CAUSE * run.changed
    rights = set(case.right)
    right, wrong = bool(rights & sure), bool(sure - rights - _part_of(rights))
    return Verdict(run.changed, right, not right and bool(rights & listed), wrong, held, names)


def _part_of(rights: Iterable[str]) -> set[str]:
    """List what is not wrong to name of what is right: each of two rotors, and what a mass off the centre does."""
    off_centre = ("hover", "centre of mass") if "mass" in rights and "hover" not in rights else ()
    pairs = [right.removeprefix("rotors ").split(" and ") for right in rights if right.startswith("rotors ")]
    return {*off_centre, *(f"rotor {rotor}" for pair in pairs for rotor in pair)}


def _changes(fleet: Fleet, cases: Sequence[Case], instrument: str) -> tuple[list[list[object]], list[list[object]]]:
    """Give a row a change and size, and one a change: the smallest that is found, and what the tool says would show."""
    rows: list[list[object]] = []
    smallest: list[list[object]] = []
    for name in dict.fromkeys(case.name for case in cases):
        sizes = SIZES[name]
        shares, shows, held = [], [], []
        for size in sizes:
            own = [_as_logged(case, instrument) for case in cases if case.name == name and case.size == size]
            runs = [_judge_case(fleet, case, instrument) for case in own]
            said = [_verdict(case, run) for case, run in zip(own, runs, strict=True)]
            counts = [sum(getattr(each, what) for each in said) for what in ("found", "right", "among", "wrong")]
            held += [each for verdict in said for each in verdict.held]
            shares.append(counts[0] / max(len(own), 1))
            shows += [_shows(case, run) for case, run in zip(own, runs, strict=True) if case.draw < _SHOWN]
            others = [each.named for case, each in zip(own, said, strict=True) if each.named not in ("", *case.right)]
            rows.append([name, size, len(own), *counts, ", ".join(sorted(others)) or "—"])
        enough = [size for at, size in enumerate(sizes) if min(shares[at:]) >= 0.9]
        smallest.append([name, min(enough, default="—"), float(np.median(shows)), f"{sum(held)} of {len(held)}"])
    return rows, smallest


def _judge_case(fleet: Fleet, case: Case, instrument: str) -> Changed:
    """Ask what would show in the first draws alone, for it takes long."""
    with contextlib.nullcontext() if case.draw < _SHOWN else _WITHOUT_SHOWS:
        return _judged(fleet, case.vehicle, instrument, [case.by_log], USUAL, case.draw)


def _shows(case: Case, run: Changed) -> float:
    """Give the smallest size that is said to show, as sizes are listed; NaN where no cause is right."""
    shows = {each.cause: each.smallest for each in run.shows}
    sizes = [(shows[name], truth) for name, truth in case.right.items() if name in shows and truth]
    if case.name in LOGARITHMS:
        return float(np.expm1(sizes[0][0])) if sizes else np.nan
    return min((case.size * shows / np.abs(truth).max() for shows, truth in sizes), default=np.nan)


WRONG: dict[str, Callable[[Signals], Signals]] = {
    "gyroscope mirrored about x": lambda own: replace(own, body_rate=own.body_rate * [-1.0, 1.0, 1.0]),
    "gyroscope mirrored about z": lambda own: replace(own, body_rate=own.body_rate * [1.0, 1.0, -1.0]),
    "axes x and y of the gyroscope exchanged": lambda own: replace(own, body_rate=own.body_rate[:, [1, 0, 2]]),
    "M1 and M2 exchanged": lambda own: _exchanged(own, 1),
    "M1 and M3 exchanged": lambda own: _exchanged(own, 2),
    "rates in deg/s": lambda own: replace(own, body_rate=np.degrees(own.body_rate)),
    "accelerations in g": lambda own: replace(own, specific_force=own.specific_force / 9.81),
    "rotors in rpm": lambda own: replace(own, rotor_speed=own.rotor_speed * 30 / np.pi),
}
"""Logs of today that are wrong, by what is wrong of them."""


def _exchanged(own: Signals, other: int) -> Signals:
    order = np.arange(own.rotor_speed.shape[1])
    order[[0, other]] = order[[other, 0]]
    command = None if own.rotor_command is None else own.rotor_command[:, order]
    return replace(own, rotor_speed=own.rotor_speed[:, order], rotor_command=command)


def _wrong(kind: Kind, trim: Trim, fleet: Fleet, series: int) -> Iterator[list[object]]:
    """Make a flight of each vehicle wrong in each way, and count the verdicts."""
    said: dict[tuple[str, str], list[str]] = {}
    for index, (vehicle, body) in enumerate(fleet.vehicles):
        own = day_of(kind, body, trim, np.random.default_rng([kind.rotors, series, index, 7]))
        for instrument, right in flown(kind, vehicle, own, [series, index, 7]).items():
            for name, make in WRONG.items():
                recording = make(right)
                today = flight_numbers(recording, kind.volts)
                before = [day[0][instrument] for day in fleet.days[index][:USUAL]]
                change = changed([today], before, vehicle, np.random.default_rng(index))
                accused = tuple(contradictions(check([recording], GapSettings())))
                record = replace(change, contradictions=accused)
                said.setdefault((name, instrument), []).append(record.verdict)
    verdicts = ("CHANGED", "CANNOT TELL", "NO CHANGE SEEN", "NO CHANGE")
    for (name, instrument), each in said.items():
        yield [name, instrument, len(each), *(each.count(verdict) for verdict in verdicts)]


def _kept(path: Path | None, make: Callable[[], Any]) -> Any:
    if path is not None and path.exists():
        return pickle.loads(path.read_bytes())
    made = make()
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(pickle.dumps(made))
    return made


def main(
    kind: str,
    draws: int = 20,
    series: Annotated[int, typer.Option(help="vehicles, days and draws that no other series has")] = 0,
    trim: float = 0.03,
    keep: Path | None = None,
    only: Annotated[str, typer.Option(help="unchanged, changes, otherwise or wrong")] = "",
    of: list[str] | None = None,
) -> None:
    type_, scatter = KINDS[kind], Trim(trim, trim / 30)
    folder = keep and keep / f"{kind}-{trim:g}-{series}"
    fleet: Fleet = _kept(folder and folder / "fleet.pickle", partial(_fleet, type_, scatter, series))
    if only == "otherwise":
        faster = _kept(folder and folder / "faster.pickle", partial(_faster, type_, scatter, fleet, series))
        columns = "log | references flown | references | sets | alarms | p <= 5 % | said"
        table(f"changed_otherwise_{kind}", columns, list(_otherwise(fleet, faster)))
    if only == "wrong":
        columns = "wrong | log | flights | changed | cannot tell | no change seen | no change"
        table(f"changed_wrong_{kind}", columns, list(_wrong(type_, scatter, fleet, series)))
    if only in ("", "unchanged"):
        columns = "log | references | flights today | sets | alarms | p <= 5 % | said"
        table(f"changed_unchanged_{kind}", columns, list(_unchanged(fleet)))
        print()
    if only in ("", "changes"):
        cases: list[Case] = []
        for draw in range(draws):
            fly = partial(_cases, type_, scatter, fleet, of or list(SIZES), series, draw)
            cases += _kept(folder and folder / f"draw-{draw}.pickle", fly)
        for instrument in INSTRUMENTS:
            rows, smallest = _changes(fleet, cases, instrument)
            columns = "change | size | draws | found | right | among those alike | wrong name | said otherwise"
            table(f"changed_found_{kind}_{instrument}", columns, rows)
            print()
            columns = "change | found with 90 % | said to show | intervals that hold"
            table(f"changed_smallest_{kind}_{instrument}", columns, smallest)
            print()


if __name__ == "__main__":
    program(main)
