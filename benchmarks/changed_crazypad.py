"""Propellers cut, taped, weights: what is said of CrazyPAD's groups of flights, beside the share of each command.

    python benchmarks/changed_crazypad.py STUDY FOLDER [--keep FILE]

FOLDER is `data/motor_data` of AerialRoboticsUUST/CrazyPAD; STUDY reads its logs, as `cpfls init` writes one. Reference
are all normal flights of the same vehicle (E8, E9). The baseline is the mean share of each motor's command, in
deviations of the normal flights, with Student's t at 1 % over all motors.
"""

from __future__ import annotations

import argparse
import re
import sys
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, table

pin_threads()

import numpy as np
from scipy.stats import spearmanr, t

from benchmarks.changed_unchanged import numbers_of
from cpfls_cli.changes.judge import FALSE_ALARM, changed
from cpfls_cli.changes.numbers import FlightNumbers
from cpfls_cli.changes.results import Changed
from cpfls_cli.config.load import load_study


class Told(NamedTuple):
    """What both say of a group."""

    group: str
    millimetres: float
    """Cut from both blades together."""

    right: str
    run: Changed
    deviations: np.ndarray
    threshold: float

    @property
    def named(self) -> str:
        return "+".join(found.name + "?" * (not found.named) for found in self.run.causes) or "—"

    @property
    def sure(self) -> set[str]:
        return {found.name for found in self.run.causes if found.named}

    @property
    def listed(self) -> set[str]:
        """What is found or looks alike."""
        alike = {own.name for found in self.run.causes for own in found.alike}
        return alike | {found.name for found in self.run.causes}

    @property
    def share(self) -> str:
        most = int(np.argmax(self.deviations))
        return f"M{most + 1}" if np.abs(self.deviations).max() > self.threshold else "—"

    @property
    def size(self) -> float:
        """Of the rotor M3; 0 where it is not named."""
        sizes = [found.sizes[0].value for found in self.run.causes if found.name == "rotor M3"]
        return sizes[0] if sizes else 0.0


def _right(group: str) -> str:
    if group.startswith("add_weight"):
        return "mass"
    if "string" in group:
        return "load on a cable"
    rotors = sorted(set(re.findall(r"[Mm]\d", group.upper())))
    return f"rotor{'s' * (len(rotors) == 2)} {' and '.join(rotors)}" if len(rotors) < 3 else "—"


def _cut(group: str) -> float:
    lengths = [float(each) for each in re.findall(r"(\d+(?:\.\d+)?)(?:mm|мм)", group)]
    return sum(each for each in lengths if each < 10)


def _shares(flights: list[FlightNumbers]) -> np.ndarray:
    loads = np.array([[value for name, value in each.values.items() if name.startswith("thrust ")] for each in flights])
    return np.exp(loads) / np.exp(loads).sum(axis=1, keepdims=True)


def _deviations(today: list[FlightNumbers], before: list[FlightNumbers]) -> tuple[np.ndarray, float]:
    """Give the mean share of each motor in deviations of the reference, and from where on it counts."""
    own, usual = _shares(today).mean(axis=0), _shares(before)
    count, motors = usual.shape
    deviation = usual.std(axis=0, ddof=1) * np.sqrt(1 + 1 / count)
    return (own - usual.mean(axis=0)) / deviation, float(t.ppf(1 - FALSE_ALARM / 2 / motors, count - 1))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("study", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    study = load_study(given.study)
    flights = numbers_of(study, sorted(given.folder.glob("*/E?_log*")), given.keep)

    def of(name: str) -> tuple[str, str]:
        group, log = name.split("/")
        return group, log[:2]

    groups = {key: [flights[name] for name in names] for key, names in groupby(flights, of)}
    usual = {vehicle: own for (group, vehicle), own in groups.items() if group == "normal_flight"}
    rng = np.random.default_rng(1)
    told = []
    for (group, vehicle), today in groups.items():
        if group != "normal_flight":
            run = changed(today, usual[vehicle], study.vehicle, rng)
            deviations, threshold = _deviations(today, usual[vehicle])
            name = f"{group} {vehicle}".replace("мм", "mm")
            told.append(Told(name, _cut(group), _right(group), run, deviations, threshold))
    rows = [[each.group, each.right, each.named, each.run.p, each.size, each.share] for each in told]
    header = ["group", "what was done", "said", "p", "size of M3", "by the share of commands"]
    table("changed_crazypad", header, rows)
    print()
    kinds = {
        "M3 cut": lambda each: each.right == "rotor M3" and each.millimetres > 0,
        "M3 cut by 2 mm and more in all": lambda each: each.right == "rotor M3" and each.millimetres >= 2,
        "M1 and M2 cut": lambda each: each.right == "rotors M1 and M2",
        "M2 cut": lambda each: each.right == "rotor M2",
        "weight": lambda each: each.right == "mass",
        "weight on a string": lambda each: each.right == "load on a cable",
        "tape": lambda each: each.group.startswith("tape"),
    }
    rows = []
    for kind, chosen in kinds.items():
        own = [each for each in told if chosen(each)]
        rotors = {name.split()[-1] for each in own for name in [each.right]}
        rows.append(
            [
                kind,
                len(own),
                sum(each.run.changed for each in own),
                sum(each.sure == {each.right} for each in own),
                sum(each.right in each.listed for each in own),
                sum(bool(each.sure - {each.right}) for each in own),
                sum(each.share != "—" for each in own),
                sum(each.share in rotors and each.share in each.right for each in own),
            ]
        )
    header = [
        "done",
        "groups",
        "found",
        "named",
        "among those alike",
        "wrong name",
        "found by share",
        "rotor by share",
    ]
    table("changed_crazypad_counts", header, rows)
    cuts = [each for each in told if each.right == "rotor M3" and each.millimetres > 0]
    for vehicle in sorted({each.group[-2:] for each in cuts}):
        own = [each for each in cuts if each.group.endswith(vehicle)]
        cut = [each.millimetres for each in own]
        ranks = [spearmanr(cut, values).statistic for values in ([o.size for o in own], [o.deviations[2] for o in own])]
        print(
            f"\n{vehicle}: rank correlation of {len(own)} cuts with the size {ranks[0]:.2f}, the share {ranks[1]:.2f}"
        )
    alarms = []
    for own in usual.values():
        for index, flight in enumerate(own):
            others = own[:index] + own[index + 1 :]
            deviations, threshold = _deviations([flight], others)
            alarms.append(
                (bool(changed([flight], others, study.vehicle, rng).causes), np.abs(deviations).max() > threshold)
            )
    ours, shares = np.sum(alarms, axis=0)
    print(f"\nnormal flights left out in turn: {len(alarms)}; false alarms {ours}, by the share {shares}")


if __name__ == "__main__":
    main()
