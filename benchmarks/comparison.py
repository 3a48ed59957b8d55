"""Hold the answers of one checkout against those of another: terminal, exit codes, JSON, pages, numbers in files.

    python -m benchmarks.comparison run PATH/TO/cpfls OUT [SCENARIO...]
    python -m benchmarks.comparison hold OLD NEW

A scenario is a list of commands, typed one after the other in an empty folder; minutes in all. Flights of others are
read from the folder that CPFLS_FLIGHTS names, `../shared/data` by default. This goes when the house is rebuilt.
"""

import difflib
import json
import os
import re
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import h5py
import numpy as np

DATA = Path(os.environ.get("CPFLS_FLIGHTS", "../shared/data")).resolve()
REAL = DATA / "real"
ROOT = Path(__file__).resolve().parents[1]
_SAME = 1e-6
"""Relative difference of numbers in files that is rounding."""

_FLY = ["config > study.yaml", "trajectory study.yaml --hover 30 --excite roll,pitch -o path.h5"]
_CLOSED = "simulate study.yaml {path} --mode closed-loop {more} -o {out}.h5"


def _closed(out: str, more: str = "", path: str = "path.h5") -> str:
    return _CLOSED.format(path=path, more=more, out=out)


SCENARIOS: dict[str, list[str]] = {
    "first-answer": [
        "config > study.yaml",
        "trajectory study.yaml -o path.h5",
        _closed("flight", "--effect com_offset=0.01,-0.006"),
        "gap study.yaml flight.h5 -o gap",
        "gap study.yaml flight.h5 -o json --json",
        "info flight.h5",
        "check flight.h5",
    ],
    "nothing-hidden": [*_FLY, _closed("a"), _closed("b", "--seed 2"), "gap study.yaml a.h5 b.h5 -o gap"],
    "vehicle": [
        *_FLY,
        _closed("a"),
        _closed("b", "--seed 2"),
        _closed("c", "--seed 3"),
        "vehicle study.yaml a.h5 b.h5 --held-out c.h5 --seed 1 -o vehicle.h5",
        "replay study.yaml vehicle.h5 c.h5 -o replay.h5",
        "response study.yaml a.h5 --model vehicle.h5 -o response.h5",
        "tune study.yaml vehicle.h5 --autopilot px4 -o gains.h5",
        "report study.yaml vehicle.h5 replay.h5 response.h5 gains.h5 -o report.html",
        "simulate study.yaml c.h5 --autopilot px4 -o twin.h5",
        "export vehicle.h5 -o uav.xml",
        "spread vehicle.h5 -n 20 -o spread.json",
        "info vehicle.h5",
    ],
    "changed": [
        *_FLY,
        *(_closed(f"r{seed}", f"--seed {seed}") for seed in range(1, 5)),
        _closed("same", "--seed 9"),
        _closed("heavier", "--seed 10 --effect com_offset=0.008,0.0"),
        *(f"changed study.yaml {now}.h5 --since r1.h5 r2.h5 r3.h5 r4.h5 -o {now}" for now in ("same", "heavier")),
        "changed study.yaml same.h5 --since r1.h5 r2.h5 -o two",
        "trend study.yaml r1.h5 r2.h5 r3.h5 r4.h5 same.h5 heavier.h5 -o trend",
    ],
    "paper": [
        f"trajectory {ROOT}/configs/quick.yaml -o path.h5",
        f"simulate {ROOT}/configs/quick.yaml path.h5 -o flight.h5",
        f"reduce {ROOT}/configs/quick.yaml flight.h5 -o selection.h5",
        f"identify {ROOT}/configs/quick.yaml flight.h5 --selection selection.h5 -o model.h5",
        f"report {ROOT}/configs/quick.yaml *.h5 -o report.html",
        "export model.h5 -o model.c --force",
    ],
    "crazyswarm": [
        f"init {REAL}/crazyswarm2_lee/log119.csv --mass 0.034 --arm 0.046 -o study.yaml -v",
        f"import {ROOT}/configs/crazyflie.yaml {REAL}/crazyswarm2_lee/log119.csv -o a.h5",
        f"gap {ROOT}/configs/gap/crazyswarm2.yaml {REAL}/crazyswarm2_lee/log119.csv -o gap",
    ],
    "cards": [
        f"init {REAL}/crazypad_usd/normal_flight__E8_log0* --mass 0.034 --arm 0.046 -o study.yaml -v",
        f"changed {ROOT}/configs/gap/crazypad_usd.yaml {REAL}/crazypad_usd/cut_propeller_M3_4mm*log00"
        f" --since {REAL}/crazypad_usd/normal_flight__E8_log0* -o cut",
        f"changed {ROOT}/configs/gap/crazypad_usd.yaml {REAL}/crazypad_usd/normal_flight__E8_log00"
        f" --since {REAL}/crazypad_usd/normal_flight__E8_log01 {REAL}/crazypad_usd/normal_flight__E8_log02 -o same",
    ],
    "hover": [
        f"init {REAL}/crazypad_com/normal_flight__E9_log00.csv --mass 0.034 --arm 0.046 -o study.yaml -v",
        f"changed {ROOT}/configs/gap/crazypad.yaml {REAL}/crazypad_com/add_weight_W3_near_M3__E9_log00.csv"
        f" --since {REAL}/crazypad_com/normal_flight__E9_log0*.csv -o weight",
        f"gap {ROOT}/configs/gap/crazypad.yaml {REAL}/crazypad_com/add_weight_W3_near_M3__E9_log00.csv -o gap",
    ],
    "fast-log": [
        f"init {REAL}/arpl_crazyflie_1khz/*.csv --mass 0.03 --arm 0.046 -o study.yaml -v",
        f"gap {ROOT}/configs/gap/arpl.yaml {REAL}/arpl_crazyflie_1khz/log15_55_90s.csv -o gap",
    ],
    "rotorpy": [
        f"init {DATA}/rotorpy/none.csv --mass 0.5 --arm 0.17 -o study.yaml -v",
        f"gap {ROOT}/configs/gap/rotorpy.yaml {DATA}/rotorpy/drag.csv -o gap",
    ],
}


class _Words(HTMLParser):
    """What a page says: its text without scripts, styles and drawings."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._silent = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:  # noqa: ARG002
        self._silent += tag in ("script", "style", "svg")

    def handle_endtag(self, tag: str) -> None:
        self._silent -= tag in ("script", "style", "svg")

    def handle_data(self, data: str) -> None:
        if not self._silent and data.strip():
            self.lines.append(" ".join(data.split()))


def run(cpfls: Path, output: Path, names: list[str]) -> None:
    """Type the commands of scenarios with one checkout's program, and keep what each prints and writes."""
    for name in names or SCENARIOS:
        folder = output / name
        folder.mkdir(parents=True)
        for number, line in enumerate(SCENARIOS[name]):
            begun = time.perf_counter()
            done = subprocess.run(
                f"{cpfls} {line}",
                cwd=folder,
                shell=True,
                capture_output=True,
                text=True,
                env=os.environ | {"COLUMNS": "120"},
                check=False,
            )
            said = f"$ cpfls {line}\nexit code {done.returncode}\n{done.stdout}--- stderr\n{_calm(done.stderr)}"
            (folder / f"{number:02}.said").write_text(said.replace(str(folder), "."))
            print(f"{name}: {line[:90]}: {done.returncode} in {time.perf_counter() - begun:.1f} s", flush=True)
        for file in sorted(folder.rglob("*.h5")):
            for words in ("-v", "--json"):
                done = subprocess.run(
                    [cpfls, "info", file, words], capture_output=True, text=True, env=os.environ | {"COLUMNS": "120"}
                )
                file.with_suffix(f".info{words}").write_text(done.stdout.replace(str(folder), "."))
        for page in folder.rglob("*.html"):
            words = _Words()
            words.feed(page.read_text())
            page.with_suffix(".words").write_text("\n".join(words.lines))


def _calm(text: str) -> str:
    """Leave out what a clock says."""
    return re.sub(r" in [\d.]+ (s|min)\b|\([\d.]+ k?MB?\)|\b[\d.]+ s elapsed", "", text)


_HASHES = re.compile(r"\b(?:[0-9a-f]{64}|[0-9a-f]{12})\b|\b\d+ bytes|\b[1-9]\.\d+\.\d+\b")
"""What differs with every change of a file or the version."""
_CHECKOUT = re.compile(r"/\S+(?=/(?:configs|data)/)")


def _plain(text: str) -> list[str]:
    """Leave out hashes, and where the checkout lies."""
    return [_HASHES.sub("#", _CHECKOUT.sub("CHECKOUT", line)) for line in text.splitlines()]


def hold(old: Path, new: Path) -> int:
    """Print what differs between two runs; gives the number of files that do."""
    paths = sorted({each.relative_to(root) for root in (old, new) for each in root.rglob("*") if each.is_file()})
    differing = 0
    for path in paths:
        if path.suffix not in (".said", ".words", ".h5", ".json", ".yaml", ".c", ".xml", ".info-v"):
            continue
        if not (old / path).exists() or not (new / path).exists():
            lines = [f"only in {(old if (old / path).exists() else new)}"]
        elif path.suffix == ".h5":
            lines = _numbers_differ(old / path, new / path)
        else:
            one, other = (_plain((root / path).read_text()) for root in (old, new))
            lines = list(difflib.unified_diff(one, other, lineterm="", n=0))[2:]
        if lines:
            differing += 1
            print(f"=== {path}", *lines[:60], sep="\n")
    print(f"{differing} of {len(paths)} files differ")
    return differing


def _numbers_differ(old: Path, new: Path) -> list[str]:
    first, second = (_datasets(path) for path in (old, new))
    lines = [f"only in one: {name}" for name in sorted(first.keys() ^ second.keys())]
    for name in sorted(first.keys() & second.keys()):
        one, other = first[name], second[name]
        if one.shape != other.shape or one.dtype.kind != other.dtype.kind:
            lines.append(f"{name}: {one.dtype}{one.shape} and {other.dtype}{other.shape}")
        elif one.dtype.kind in "fiub":
            scale = np.nanmax(np.abs(one), initial=0.0)
            if not np.allclose(one, other, rtol=_SAME, atol=_SAME * float(scale), equal_nan=True):
                lines.append(f"{name}: {np.ravel(one)[:4]} and {np.ravel(other)[:4]}")
        elif not np.array_equal(one, other):
            lines.append(f"{name}: {json.dumps(str(np.ravel(one)[:3]))} and {json.dumps(str(np.ravel(other)[:3]))}")
    return lines


def _datasets(path: Path) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, own: found.update({name: np.asarray(own[()])}) if isinstance(own, h5py.Dataset) else None
        )
    return found


def main() -> None:
    """Run or hold, as the command line says."""
    command, first, second, *rest = sys.argv[1:]
    if command == "run":
        run(Path(first).absolute(), Path(second).absolute(), rest)
    else:
        sys.exit(min(1, hold(Path(first), Path(second))))


if __name__ == "__main__":
    main()
