"""Judge the gap workflow blindly: ``python -m benchmarks.blind_study run --seed 777 --draws 2 --out data/blind``."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.blind.cases import INSTRUMENTS
from benchmarks.blind.gusts import GUSTS
from benchmarks.blind.vehicles import VEHICLES
from benchmarks.blind_study.air_tables import air_tables
from benchmarks.blind_study.fly import flown, fly
from benchmarks.blind_study.ordinary import ordinary
from benchmarks.blind_study.run import CASES_AT_ONCE, judge_all, run
from benchmarks.blind_study.score import scored
from benchmarks.blind_study.sets import GROUPS, LEVELS, Size, sets
from benchmarks.blind_study.tables import tables
from benchmarks.blind_study.thin import thinned

_QUICK = {
    "single": 22, "none": 4, "outside": 18, "pair": 3, "triple": 1, "background": 1, "form": 3, "hover": 2,
    "no_velocity": 1, "no_force": 1, "lacking": 8, "drag_factor": 4, "attack": 12, "differing": 4, "pybullet": 4,
}  # fmt: skip
"""Cases of each group in a quick study: about six minutes of one core."""
_QUICK_IN_GUSTS = {"single": 8, "none": 2, "outside": 4}
"""Cases of each group, in each air, in a quick study in gusts, which leaves out the other groups."""


def main():
    """Fly, judge or score a study, or all of it."""
    options = _arguments()
    size = _size(options, {})
    if options.command == "fly":
        for own in sets(size):
            fly([own], options.out)
    if options.command == "thin":
        print(thinned(options.out))
    if options.command in ("ordinary", "askew"):
        print(ordinary(options.out, askew=options.command == "askew"))
    if options.command == "judge":
        judge_all(options.out, options.processes)
    if options.command == "run":
        run(sets(size), options.out, options.processes, options.keep)
    if options.command == "quick":
        _quick(options)
    if options.command in ("run", "score", "quick"):
        judged = scored(options.out)
        text = tables(judged, air_tables(judged))
        (options.out / "tables.md").write_text(text, encoding="utf-8")
        print(text)


def _size(options, usual, **fixed):
    each = usual if options.sets is None else dict.fromkeys(options.groups, options.sets)
    names = ("seed", "draws", "levels", "kinds", "groups", "none", "vehicles", "gusts", "instruments", "in_turn")
    return Size(**{name: getattr(options, name) for name in names} | {"each": each} | fixed)


def _quick(options):
    """Judge a few cases of each group with the code as it is; their flights are flown once and kept."""
    usual = dict.fromkeys(options.groups, 0) | _QUICK_IN_GUSTS if any(options.gusts) else _QUICK
    chosen = sets(_size(options, usual, draws=2, levels=("mid",), kinds=("white",), none=None))
    left = [own for own in chosen if not flown(own[0], options.out)]
    for start in range(0, len(left), CASES_AT_ONCE):
        fly(left[start : start + CASES_AT_ONCE], options.out)
    judge_all(options.out, options.processes, [own[0].name for own in chosen])


def _arguments():
    parser = argparse.ArgumentParser(prog="benchmarks.blind_study", description=__doc__)
    parser.add_argument("command", choices=("fly", "thin", "ordinary", "askew", "judge", "score", "run", "quick"))
    parser.add_argument("--out", type=Path, default=Path("data/blind"), help="folder of the study")
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--draws", type=int, default=2, help="draws of each effect")
    parser.add_argument("--levels", type=_list, default=LEVELS, help="noise: low,mid,high")
    parser.add_argument("--kinds", type=_list, default=("white", "coloured"), help="noise: white,coloured")
    parser.add_argument("--groups", type=_list, default=GROUPS, help=",".join(GROUPS))
    parser.add_argument("--vehicles", type=_list, default=tuple(VEHICLES), help=",".join(VEHICLES))
    parser.add_argument("--none", type=int, help="number of sets that hide nothing, over all vehicles and noises")
    parser.add_argument("--sets", type=int, help="largest number of cases of each group")
    parser.add_argument("--gusts", type=_numbers, default=GUSTS[:1], help="levels: 0,1,2")
    parser.add_argument("--instruments", type=_list, default=("none",), help=",".join(INSTRUMENTS))
    parser.add_argument("--in-turn", action="store_true", help="each case in one of these airs, dealt out by chance")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--keep", action="store_true", help="keep the logs, 4 MB for each set")
    return parser.parse_args()


def _numbers(text):
    return tuple(map(int, text.split(",")))


def _list(text):
    return tuple(part for part in text.split(",") if part)


if __name__ == "__main__":
    main()
