"""A load on a cable, against flights of the bare vehicle.

The vehicles, flights and hidden loads of the blind study: fast, near the ground, climbing and descending, under an
autopilot, with noise of all sensors, written to a folder. Five flights without a load are the reference, one or three
with it today's; the other bare ones are judged as well, one by one.
"""

import json
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.blind_study.fly import fly
from benchmarks.blind_study.sets import Size, sets
from benchmarks.shared.measure import count, program, table
from cpfls_cli.changes.judge import changed
from cpfls_cli.changes.numbers import flight_numbers
from cpfls_cli.config.load import load_study
from cpfls_cli.flights.recordings import read_flights

REFERENCE = 5


def flown(own, folder):
    """Fly a set, and tell its flights in numbers, with what is hidden in them."""
    (logs,) = fly([own], folder)
    key = json.loads((Path(folder) / "keys" / logs.name / "key.json").read_text(encoding="ascii"))
    files = [path for role in ("train", "held_out") for path in sorted(logs.glob(f"{role}_*.csv"))]
    read = read_flights(files, load_study(logs / "study.yaml")).flights
    return key, [flight_numbers(each) for each in read], read[0].vehicle


def said(today, before, vehicle):
    """Say what is judged, as cells of a table: names with belief, mass of the load next to the vehicle's, its cable."""
    change = changed(today, before, vehicle, np.random.default_rng(0))
    names = ", ".join(f"{each.name} {100 * each.belief:.0f} %" for each in change.causes) or "no change"
    loads = [each.sizes[0] for each in change.causes if each.name == "load on a cable"]
    mass = f"{loads[0].value:.3f} [{loads[0].low:.3f}, {loads[0].high:.3f}]" if loads else ""
    cable = f"{np.median([flight.cable_m for flight in today]):.2f}" if loads else ""
    return (names, mass, cable), bool(change.causes)


def main(folder: Path, seed: int = 90555, draws: int = 4, gusts: int = 1) -> None:
    noise = {"levels": ("mid",), "kinds": ("white",)}
    air = {"gusts": (gusts,), "instruments": ("setpoints",)}
    size = Size(seed=seed, draws=draws, groups=("single", "none"), none=12, **noise, **air)
    own = [each for each in sets(size) if each[0].case.group == "none" or "-payload-" in each[0].case.name]
    with ProcessPoolExecutor(2) as pool:
        judged = list(pool.map(partial(flown, folder=folder), own))
    bare = defaultdict(list)
    for key, numbers, _ in judged:
        bare[key["vehicle"]] += numbers if key["group"] == "none" else []
    rows = []
    for key, numbers, vehicle in judged:
        for today in (1, 3) if key["group"] != "none" else ():
            load = key["hidden"]["payload"]
            cells, _ = said(numbers[:today], bare[key["vehicle"]][:REFERENCE], vehicle)
            rows.append([key["vehicle"], f"{load['mass'] / vehicle.mass_kg:.3f}, {load['length']:.2f}", today, *cells])
    table("changed_cable", "vehicle | load, cable | flights | found | mass of the load | cable, m", rows)
    vehicles = {key["vehicle"]: vehicle for key, _, vehicle in judged}
    alarms = [
        said([flight], flights[:REFERENCE], vehicles[name])[1]
        for name, flights in bare.items()
        for flight in flights[REFERENCE:]
    ]
    print(f"\nbare flights that are said to have changed: {count(alarms)}")


if __name__ == "__main__":
    program(main)
