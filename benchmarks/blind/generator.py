"""Flights with hidden effects, made from physics alone: nothing here knows how they will be judged.

``cases(seed)`` lists a study, ``simulate_many(cases, seed)`` flies it, ``write`` gives noisy CSV logs and ``write_key``
puts what is hidden into another folder.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import oaconvolve

from . import turning
from .cases import INSTRUMENTS, Case
from .gusts import blown
from .measure import attacked, columns, disturb, observe, save
from .missions import MISSIONS, mission
from .plant import ALTERATIONS, nominal
from .rotor_terms import LEAD_IN
from .simulate import FlightPlan, simulate
from .vehicles import VEHICLES, Vehicle

DURATION = 30.0
ROLES = ("train", "held_out")
_WINDOW = 40
"""Samples of an average."""


@dataclass(frozen=True)
class Flight:
    """One flight: ``table`` is the noiseless log (time, columns), ``truth`` the motion as integrated.

    ``asked`` maps what was asked to its columns (time, 3), ``gusts`` the torque and force of the air (time, 6).
    """

    role: str
    mission: str
    table: np.ndarray
    truth: dict
    asked: dict
    gusts: np.ndarray


@dataclass(frozen=True)
class Flights:
    """The six flights of a case, or twelve if each path is flown once more."""

    case: Case
    vehicle: Vehicle
    flights: tuple[Flight, ...]

    def named(self):
        """Give each flight under its name, that of its role and its number therein."""
        count = len(self.flights) // len(ROLES)
        return {f"{flight.role}_{number % count + 1}": flight for number, flight in enumerate(self.flights)}


def _plans(case, seed, duration):
    vehicle = VEHICLES[case.vehicle]
    plans = []
    times = range(2 if case.instruments == "repeats" else 1)
    for role, again, place in product(range(len(ROLES)), times, range(len(MISSIONS))):
        hidden = case.hidden if case.only in ("", ROLES[role]) else {}
        name = "hover" if case.hover_only else MISSIONS[place]
        flight_seed = (seed, role * len(MISSIONS) + place, *case.name.encode())
        plant = nominal(vehicle)
        rng = np.random.default_rng([*flight_seed, 1])
        # Each flight starts with another charge.
        charge = rng.uniform(0.0, 0.6)
        if again:
            charge = np.random.default_rng([*flight_seed, 1, again]).uniform(0.0, 0.6)
        for effect, parameters in hidden.items():
            if effect in ALTERATIONS:
                ALTERATIONS[effect](plant, **parameters)
        plant.sag_start = charge
        wind = np.array(hidden.get("wind", {}).get("velocity", (0.0, 0.0, 0.0)))
        path = mission(name, vehicle, duration, rng)
        flown = hidden | {"gusts": case.air} if case.gusts else hidden
        plans.append(FlightPlan(vehicle, plant, path, flown, wind, flight_seed, again))
    return plans


def _collect(case, plans, record, first):
    flights = []
    for number, plan in enumerate(plans):
        truth = {name: values[first + number] for name, values in record.items()}
        role, table = ROLES[number * len(ROLES) // len(plans)], observe(truth, case)
        asked = {name: values[: len(table)] for name, values in plan.mission.asked().items()}
        flights.append(Flight(role, plan.mission.name, table, truth, asked, blown(plan, len(table))))
    return Flights(case, plans[0].vehicle, tuple(flights))


def simulate_many(cases, seed, duration=DURATION, lead_in=LEAD_IN):
    """Fly all cases in one batch, flights to train before as many held out; each depends on seed and case alone.

    The log lasts for a time in s, after a lead-in that it does not hold.
    """
    flown = {}
    for rotors in {VEHICLES[case.vehicle].count: None for case in cases}:
        alike = [number for number, case in enumerate(cases) if VEHICLES[case.vehicle].count == rotors]
        plans = [_plans(cases[number], seed, duration) for number in alike]
        record = simulate([plan for group in plans for plan in group], duration, lead_in)
        first = 0
        for number, group in zip(alike, plans, strict=True):
            flown[number] = _collect(cases[number], group, record, first)
            first += len(group)
    return [flown[number] for number in range(len(cases))]


def generate(case: Case, rng: np.random.Generator, duration=DURATION) -> Flights:
    """Fly one case."""
    return simulate_many([case], int(rng.integers(2**31)), duration)[0]


def residual(flight, case):
    """Torque the nominal craft cannot explain, from the noiseless log, shape (time, 3), N m.

    Uses the rotor speeds that the log shows: commands where the speeds are left out.
    """
    vehicle = VEHICLES[case.vehicle]
    inertia = np.array(vehicle.inertia)
    rate = flight.table[:, 4:7]
    first = columns(vehicle.count).index("omcmd1" if "om1" in case.left_out else "om1")
    speed = flight.table[:, first : first + vehicle.count]
    turn = CubicSpline(flight.table[:, 0], rate).derivative()(flight.table[:, 0])
    return turn * inertia + np.cross(rate, rate * inertia) - (speed**2) @ vehicle.allocation()[1:].T


def write(flights: Flights, folder, noise_level, kind, rng) -> list[Path]:
    """Write the noisy logs, ``train_1.csv`` and so on, and the nominal craft ``vehicle.json``."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, flight in flights.named().items():
        path = folder / f"{name}.csv"
        noisy = disturb(flight.table, flights.vehicle, noise_level, kind, rng)
        asked = {name: flight.asked[name] for name in INSTRUMENTS[flights.case.instruments]}
        save(attacked(noisy, flights.case.attack), flights.case.left_out, path, asked)
        paths.append(path)
    (folder / "vehicle.json").write_text(json.dumps(flights.vehicle.as_dict(), indent=1) + "\n", encoding="ascii")
    return paths


def write_key(flights: Flights, folder) -> Path:
    """Write what is hidden, with the size of its residual torque, as ``key.json``.

    In gusts the residual torque is that without them; how large both are in averages over windows stands next to it.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    key = flights.case.key()
    named = flights.named()
    without = {name: residual(flight, flights.case) - flight.gusts[:, :3] for name, flight in named.items()}
    key["residual_rms_n_m"] = {name: _rms(torque) for name, torque in without.items()}
    if flights.case.gusts:
        key["averaged_n_m"] = {name: _rms(_averaged(torque)) for name, torque in without.items()}
        key["gusts_averaged_n_m"] = {name: _rms(_averaged(flight.gusts[:, :3])) for name, flight in named.items()}
    path = folder / "key.json"
    path.write_text(json.dumps(key, indent=1) + "\n", encoding="ascii")
    return path


def _rms(values):
    return np.sqrt((values**2).mean(0)).tolist()


def _averaged(values):
    """Average over windows as smooth as those of the judge, shape (time, 3)."""
    shape = np.sin(np.pi * (np.arange(_WINDOW) + 0.5) / _WINDOW) ** 4
    return oaconvolve(values, shape[:, None] / shape.sum(), mode="valid", axes=0)


def bounds(flights: Flights):
    """Give the largest tilt (degrees), the least height over rotor radius and the fastest speed of all flights."""
    tilt = max(np.degrees(np.arccos(turning.matrix(f.truth["q"].T)[2, 2].min())) for f in flights.flights)
    height = min(f.truth["x"][:, 2].min() for f in flights.flights) / flights.vehicle.rotor_radius
    return tilt, height, max(np.linalg.norm(f.truth["v"], axis=1).max() for f in flights.flights)
