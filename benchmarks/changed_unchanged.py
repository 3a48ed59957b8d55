"""False alarms on flights of a vehicle that nobody changed: each left out in turn, and random splits.

    python -m benchmarks.changed_unchanged STUDY FLIGHT... [--splits N] [--keep FILE]

The flights are logs of one vehicle, in any format that the study reads.
"""

from __future__ import annotations

import argparse
import pickle
import sys
from hashlib import sha256
from pathlib import Path

import numpy as np

from benchmarks.shared.measure import table
from cpfls_cli.changes.judge import changed
from cpfls_cli.changes.numbers import FlightNumbers, flight_numbers
from cpfls_cli.changes.results import Changed
from cpfls_cli.config.load import load_study
from cpfls_cli.errors import CpflsError
from cpfls_cli.flights.recordings import read_alone

REFERENCES, TODAY = (3, 5, 8), (1, 3)


def numbers_of(study: object, paths: list[Path], keep: Path | None) -> dict[str, FlightNumbers]:
    """Read flights, or what was kept of them; one that cannot be read is said."""
    known: dict[str, FlightNumbers] = pickle.loads(keep.read_bytes()) if keep and keep.exists() else {}
    for path in paths:
        name = f"{path.parent.name}/{path.name}"
        if name in known:
            continue
        try:
            read = read_alone(path, study)
            known[name] = flight_numbers(read.recording, read.full_voltage)
        except CpflsError as error:
            print(f"{name}: {error}", file=sys.stderr)
    if keep:
        keep.write_bytes(pickle.dumps(known))
    return {name: each for path in paths if (each := known.get(name := f"{path.parent.name}/{path.name}"))}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("study", type=Path)
    parser.add_argument("flights", type=Path, nargs="+")
    parser.add_argument("--splits", type=int, default=50)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    study = load_study(given.study)
    # A copy under another name tells the same and would count twice.
    flights = list({sha256(path.read_bytes()).digest(): path for path in reversed(given.flights)}.values())[::-1]
    told = list(numbers_of(study, flights, given.keep).values())
    rows = []

    def judge(today: list[int], before: list[int], rng: np.random.Generator) -> Changed:
        return changed([told[each] for each in today], [told[each] for each in before], study.vehicle, rng)

    alone = range(len(told))
    runs = [judge([own], [each for each in alone if each != own], np.random.default_rng(own)) for own in alone]
    rows.append([len(told) - 1, 1, *_counted(runs)])
    for before in REFERENCES:
        for today in TODAY:
            if before + today > len(told):
                continue
            runs = []
            for split in range(given.splits):
                rng = np.random.default_rng([before, today, split])
                order = rng.permutation(len(told))
                runs.append(judge(order[:today].tolist(), order[today : today + before].tolist(), rng))
            rows.append([before, today, *_counted(runs)])
    table("changed_unchanged_flights", ["references", "flights today", "sets", "alarms", "p <= 5 %", "said"], rows)


def _counted(runs: list[Changed]) -> list[object]:
    said = sorted("+".join(found.name for found in run.causes) or "?" for run in runs if run.changed)
    small = sum(run.p <= 0.05 for run in runs)
    return [len(runs), len(said), small, ", ".join(said) or "—"]


if __name__ == "__main__":
    main()
