"""Gusty flights that nothing tells apart from the loop: what `cpfls vehicle` says of them, whole.

    python -m benchmarks.without_instruments [DRAWS]

Two vehicles of 45 g and 1.5 kg in three levels of gusts, on paths of 0.8 Hz at most and with sines of up to 5 Hz: three
paths of 30 s, each flown once, no setpoint logged; mass and places of the rotors are known. No moment that is called
determined may have an interval without the truth more often than chance has it, and in gusts no verdict may be good.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from benchmarks.shared.flight_csv import write_flight
from benchmarks.shared.measure import table
from tests.builders.gusty_flights import CALM, GRAVITY, GUSTS, LARGE, SMALL, STORM, Flight, Truth, gusty_flights

DRAWS = 1
VEHICLES = {"45 g": SMALL, "1.5 kg": LARGE}
REACHES_HZ = (0.0, 5.0)
PATHS, SECONDS = 3, 30.0
AT_ONCE = 2
"""Searches beside each other, one core each."""


class Case(NamedTuple):
    """Which vehicle flies in which gusts, on which paths."""

    vehicle: str
    gusts: tuple[float, float, float]
    reach_hz: float
    draw: int


def main(draws: int) -> None:
    cases = [
        Case(name, gusts, reach, draw)
        for draw in range(draws)
        for name in VEHICLES
        for gusts in (CALM, GUSTS, STORM)
        for reach in REACHES_HZ
    ]
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(AT_ONCE) as pool:
        rows = list(pool.map(lambda case: _row(Path(folder), case), cases))
    table("without_instruments", ["vehicle", "gusts, rad/s²", "path up to, Hz", "Ixx", "Iyy", "verdict"], rows)


def _row(folder: Path, case: Case) -> list[str]:
    truth = VEHICLES[case.vehicle]
    found = _found(folder / "-".join(map(str, (case.vehicle, *case.gusts, case.reach_hz, case.draw))), truth, case)
    moments = [_moment(found["parameters"][name], true) for name, true in _true(truth)]
    row = [case.vehicle, ", ".join(f"{gust:g}" for gust in case.gusts), f"{case.reach_hz or 0.8:g}", *moments]
    row.append(str(found["verdict"]["label"] if isinstance(found["verdict"], dict) else found["verdict"]))
    print(" | ".join(row), file=sys.stderr, flush=True)
    return row


def _true(truth: Truth) -> Iterator[tuple[str, float]]:
    return zip(("inertia_kg_m2.0", "inertia_kg_m2.1"), truth.inertia, strict=False)


def _moment(number: dict[str, Any], true: float) -> str:
    """Write a moment over the true one with its interval, and whether that holds 1."""
    if not number["determined"]:
        return f"{number['value'] / true:.2f}, not determined"
    low, high = number["low"] / true, number["high"] / true
    return f"{number['value'] / true:.3f} ({low:.3f} to {high:.3f}){'' if low <= 1 <= high else ', WRONG'}"


def _found(folder: Path, truth: Truth, case: Case) -> dict[str, Any]:
    """Write the flights and a config that knows mass and places, and search."""
    asked = [
        Flight(truth, case.gusts, PATHS * case.draw + path, 100 + PATHS * case.draw + path, reach=case.reach_hz)
        for path in range(PATHS)
    ]
    flown = [
        replace(flight, name=f"flight-{place}") for place, flight in enumerate(gusty_flights(asked, SECONDS), start=1)
    ]
    for flight in flown:
        write_flight(folder, flight)
    config = folder / "vehicle.yaml"
    config.write_text(yaml.safe_dump(_config(truth)), encoding="utf-8")
    flights = [str(folder / f"{flight.name}.csv") for flight in flown]
    call = ["vehicle", str(config), *flights, "-o", str(folder / "vehicle.h5"), "--json"]
    done = subprocess.run([sys.executable, "-m", "cpfls_cli", *call], capture_output=True, text=True, check=False)
    if not done.stdout:
        raise SystemExit(done.stderr)
    return dict(json.loads(done.stdout))


def _config(truth: Truth) -> dict[str, Any]:
    rotors = [
        {
            "position_m": list(rotor.position_m),
            "spin": rotor.spin,
            "thrust_factor_n_s2": None,
            "drag_factor_n_m_s2": None,
        }
        for rotor in truth.vehicle.rotors
    ]
    names = {
        "quaternion": (("qw", "qx", "qy", "qz"), "1"),
        "body_rate": (("wx", "wy", "wz"), "rad/s"),
        "position": (("x", "y", "z"), "m"),
        "velocity": (("vx", "vy", "vz"), "m/s"),
        "rotor_speed": (("om1", "om2", "om3", "om4"), "rad/s"),
    }
    fastest = 2.0 * (truth.mass * GRAVITY / 4 / truth.thrust_factor) ** 0.5
    return {
        "vehicle": {"mass_kg": truth.mass, "inertia_kg_m2": None, "rotor_speed_max_rad_s": fastest, "rotors": rotors},
        "import": {
            "time_column": "t",
            "time_unit": "s",
            "body_frame": "FLU",
            "world_frame": "ENU",
            "quaternion_order": "wxyz",
            "torque_source": None,
            "signals": {name: {"columns": list(columns), "unit": unit} for name, (columns, unit) in names.items()},
        },
    }


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else DRAWS)
