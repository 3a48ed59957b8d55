"""Flights as a user would have them: logs and a config in one folder, the key in another."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import yaml

from benchmarks.blind.cases import INSTRUMENTS
from benchmarks.blind.generator import DURATION, simulate_many, write, write_key
from benchmarks.blind.measure import ASKED

_COLUMNS_OF = Path(__file__).parents[2] / "configs" / "gap" / "sixkg.yaml"


def fly(group, folder, duration=DURATION):
    """Fly cases, write the logs of each set to ``flights/NAME`` and what is hidden to ``keys/NAME``.

    A case of which a flight tumbles until its numbers are none is left out, and said. Gives the folders with logs.
    """
    written = []
    seed = group[0][0].seed
    for flights, own in zip(simulate_many([own[0].case for own in group], seed, duration), group, strict=True):
        if not all(np.isfinite(flight.table).all() for flight in flights.flights):
            print(f"not flown: {own[0].case.name} tumbles beyond all numbers", file=sys.stderr)
            continue
        for each in own:
            logs = Path(folder) / "flights" / each.name
            write(flights, logs, each.level, each.kind, each.generator())
            asked = INSTRUMENTS[each.case.instruments]
            (logs / "study.yaml").write_text(config(logs / "vehicle.json", asked), encoding="utf-8")
            _write_key(flights, each, Path(folder) / "keys" / each.name)
            written.append(logs)
    return written


def flown(each, folder):
    """Tell whether the logs of a set lie in a folder, with what is hidden in it today."""
    key = Path(folder) / "keys" / each.name / "key.json"
    if not key.exists() or not (Path(folder) / "flights" / each.name / "study.yaml").exists():
        return False
    stated, wanted = json.loads(key.read_text(encoding="ascii")), json.loads(json.dumps(each.case.key()))
    return all(stated.get(name) == value for name, value in wanted.items())


def config(vehicle_file, asked=()):
    """Describe a vehicle and the columns of its logs as YAML, what was asked of it among them."""
    stated = json.loads(vehicle_file.read_text(encoding="utf-8"))
    factors = {"drag_factor_n_m_s2": stated["torque_factor"], "radius_m": stated["rotor_radius"]}
    hover = (stated["mass"] * stated["gravity"] / sum(stated["thrust_factors"])) ** 0.5
    vehicle = {
        "gravity_m_s2": stated["gravity"],
        "mass_kg": stated["mass"],
        "inertia_kg_m2": stated["inertia"],
        "rotor_speed_max_rad_s": round(3 * hover),
        "rotors": [
            {"position_m": place, "spin": spin, "thrust_factor_n_s2": thrust, **factors}
            for place, spin, thrust in zip(stated["rotors"], stated["spin"], stated["thrust_factors"], strict=True)
        ],
    }
    logged = yaml.safe_load(_COLUMNS_OF.read_text(encoding="utf-8"))["import"]
    for signal, prefix in (("rotor_speed", "om"), ("rotor_command", "omcmd")):
        logged["signals"][signal]["columns"] = [f"{prefix}{number + 1}" for number in range(len(stated["spin"]))]
    for name in asked:
        columns, unit = ASKED[name]
        logged["signals"][name] = {"columns": list(columns), "unit": unit}
    # PyYAML writes 1e-05, which a YAML parser of another make reads as text.
    return json.dumps({"seed": 1, "vehicle": vehicle, "import": logged}, indent=1)


def _write_key(flights, each, folder):
    path = write_key(flights, folder)
    key = json.loads(path.read_text(encoding="ascii"))
    key |= {"set": each.name, "level": each.level, "kind": each.kind}
    path.write_text(json.dumps(key, indent=1) + "\n", encoding="ascii")
