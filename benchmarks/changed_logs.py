"""What is said of other people's logs of one vehicle: flights that nobody changed, and CrazyPAD's groups.

    python -m benchmarks.changed_logs STUDY FLIGHT...                each left out in turn, and random splits
    python -m benchmarks.changed_logs STUDY FOLDER --crazypad        propellers cut and taped, weights

FOLDER is `data/motor_data` of AerialRoboticsUUST/CrazyPAD; STUDY reads its logs, as `cpfls init` writes one. Reference
are all normal flights of the same vehicle (E8, E9). The baseline is the mean share of each motor's command, in
deviations of the normal flights, with Student's t at 1 % over all motors.
"""

from __future__ import annotations

import pickle
import re
import sys
from collections.abc import Iterator
from hashlib import sha256
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr, t

from benchmarks.shared.measure import program, table
from cpfls_cli.changes.judge import FALSE_ALARM, changed
from cpfls_cli.changes.numbers import FlightNumbers, flight_numbers
from cpfls_cli.changes.results import Changed
from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import Study
from cpfls_cli.errors import CpflsError
from cpfls_cli.flights.recordings import read_alone

REFERENCES, TODAY = (3, 5, 8), (1, 3)


def main(study: Path, flights: list[Path], crazypad: bool = False, splits: int = 50, keep: Path | None = None) -> None:
    read = load_study(study)
    if crazypad:
        _crazypad(read, numbers_of(read, sorted(flights[0].glob("*/E?_log*")), keep))
    else:
        # A copy under another name would count twice.
        once = {sha256(path.read_bytes()).digest(): path for path in reversed(flights)}
        _unchanged(read, list(numbers_of(read, list(once.values())[::-1], keep).values()), splits)


def numbers_of(study: Study, paths: list[Path], keep: Path | None) -> dict[str, FlightNumbers]:
    """Read flights, or what was kept of them; one that cannot be read is said."""
    known: dict[str, FlightNumbers] = pickle.loads(keep.read_bytes()) if keep and keep.exists() else {}
    names = {f"{path.parent.name}/{path.name}": path for path in paths}
    for name in names.keys() - known.keys():
        try:
            read = read_alone(names[name], study)
            known[name] = flight_numbers(read.signals, read.full_voltage)
        except CpflsError as error:
            print(f"{name}: {error}", file=sys.stderr)
    if keep:
        keep.write_bytes(pickle.dumps(known))
    return {name: known[name] for name in names if name in known}


def _unchanged(study: Study, flights: list[FlightNumbers], splits: int) -> None:
    def judge(today: list[int], before: list[int], rng: np.random.Generator) -> Changed:
        return changed([flights[each] for each in today], [flights[each] for each in before], study.vehicle, rng)

    alone = range(len(flights))
    runs = [judge([own], [each for each in alone if each != own], np.random.default_rng(own)) for own in alone]
    rows = [[len(flights) - 1, 1, *_counted(runs)]]
    for before in REFERENCES:
        for today in [each for each in TODAY if before + each <= len(flights)]:
            runs = []
            for split in range(splits):
                rng = np.random.default_rng([before, today, split])
                order = rng.permutation(len(flights))
                runs.append(judge(order[:today].tolist(), order[today : today + before].tolist(), rng))
            rows.append([before, today, *_counted(runs)])
    table("changed_unchanged_flights", "references | flights today | sets | alarms | p <= 5 % | said", rows)


def _counted(runs: list[Changed]) -> list[object]:
    said = sorted("+".join(found.name for found in run.causes) or "?" for run in runs if run.changed)
    return [len(runs), len(said), sum(run.p <= 0.05 for run in runs), ", ".join(said) or "—"]


class Group(NamedTuple):
    """What both ways say of a group of flights."""

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
        return next((found.sizes[0].value for found in self.run.causes if found.name == "rotor M3"), 0.0)

    @property
    def counts(self) -> list[int]:
        """Whether it is found, named, among those alike, wrongly named; found by the share, its rotor by the share."""
        ours = self.run.changed, self.sure == {self.right}, self.right in self.listed, bool(self.sure - {self.right})
        return [*ours, self.share != "—", self.share in self.right]


KINDS = {
    "M3 cut": lambda each: each.right == "rotor M3" and each.millimetres > 0,
    "M3 cut by 2 mm and more in all": lambda each: each.right == "rotor M3" and each.millimetres >= 2,
    "M1 and M2 cut": lambda each: each.right == "rotors M1 and M2",
    "M2 cut": lambda each: each.right == "rotor M2",
    "weight": lambda each: each.right == "mass",
    "weight on a string": lambda each: each.right == "load on a cable",
    "tape": lambda each: each.group.startswith("tape"),
}


def _crazypad(study: Study, flights: dict[str, FlightNumbers]) -> None:
    by_group = groupby(flights, lambda name: (name.split("/")[0], name.split("/")[1][:2]))
    groups = {key: [flights[name] for name in names] for key, names in by_group}
    usual = {vehicle: own for (group, vehicle), own in groups.items() if group == "normal_flight"}
    rng, judged = np.random.default_rng(1), []
    for (group, vehicle), today in groups.items():
        if group != "normal_flight":
            run = changed(today, usual[vehicle], study.vehicle, rng)
            name = f"{group} {vehicle}".replace("мм", "mm")
            judged.append(Group(name, _cut(group), _right(group), run, *_deviations(today, usual[vehicle])))
    rows = [[each.group, each.right, each.named, each.run.p, each.size, each.share] for each in judged]
    table("changed_crazypad", "group | what was done | said | p | size of M3 | by the share of commands", rows)
    print()
    chosen = {kind: [each for each in judged if of(each)] for kind, of in KINDS.items()}
    counts = {kind: np.array([each.counts for each in own], dtype=int) for kind, own in chosen.items()}
    rows = [[kind, len(each), *each.reshape(-1, 6).sum(axis=0)] for kind, each in counts.items()]
    columns = "done | groups | found | named | among those alike | wrong name | found by share | rotor by share"
    table("changed_crazypad_counts", columns, rows)
    for line in _correlations(chosen["M3 cut"]):
        print(f"\n{line}")
    alarms = []
    for own in usual.values():
        for index, flight in enumerate(own):
            others = own[:index] + own[index + 1 :]
            deviations, threshold = _deviations([flight], others)
            causes = changed([flight], others, study.vehicle, rng).causes
            alarms.append((bool(causes), np.abs(deviations).max() > threshold))
    ours, shares = np.sum(alarms, axis=0)
    print(f"\nnormal flights left out in turn: {len(alarms)}; false alarms {ours}, by the share {shares}")


def _correlations(cuts: list[Group]) -> Iterator[str]:
    for vehicle in sorted({each.group[-2:] for each in cuts}):
        own = [each for each in cuts if each.group.endswith(vehicle)]
        cut, sizes, shares = zip(*((each.millimetres, each.size, each.deviations[2]) for each in own), strict=True)
        size, share = (spearmanr(cut, values).statistic for values in (sizes, shares))
        yield f"{vehicle}: rank correlation of {len(own)} cuts with the size {size:.2f}, the share {share:.2f}"


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


def _deviations(today: list[FlightNumbers], before: list[FlightNumbers]) -> tuple[np.ndarray, float]:
    """Give the mean share of each motor in deviations of the reference, and from where on it counts."""
    own, usual = (
        np.exp([[value for name, value in each.values.items() if name.startswith("thrust ")] for each in flights])
        for flights in (today, before)
    )
    own, usual = (each / each.sum(axis=1, keepdims=True) for each in (own, usual))
    count, motors = usual.shape
    deviation = usual.std(axis=0, ddof=1) * np.sqrt(1 + 1 / count)
    deviations = (own.mean(axis=0) - usual.mean(axis=0)) / deviation
    return deviations, float(t.ppf(1 - FALSE_ALARM / 2 / motors, count - 1))


if __name__ == "__main__":
    program(main)
