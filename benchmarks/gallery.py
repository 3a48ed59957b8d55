"""What one public log says of each of many vehicles: `cpfls look`, as a page in Markdown on standard output.

    python -m benchmarks.gallery REPOSITORIES > docs/gallery.md        make gallery REPOSITORIES=...

REPOSITORIES is a folder of clones, `owner/name` each, with or without a working tree; `benchmarks/gallery.tsv` lists
repository, path and vehicle. Numbers are those of `look.json`, with 95 % intervals; a log that is not there is listed
as such, and none is copied.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from benchmarks.shared.measure import program, progress

LISTED = Path(__file__).with_suffix(".tsv")
HEAD = """# Gallery: public logs of {} vehicles

What `cpfls look` identifies in one log of each, with nothing else known of the vehicle, as it comes out: numbers with
95 % intervals, which questions are answered, and what the first advice is. The logs are other people's, in the
repositories named, and are not part of this one. `make gallery REPOSITORIES=FOLDER` writes this page anew from clones
of them.

Effectiveness is the angular acceleration for a full command of the axis, with the total delay from command to rotation:
about yaw that may be below 0, for rotors that speed up turn the vehicle before their drag does. Uneven rotors are
shares of thrust off the mean, beyond their intervals. Answers are counted as yes, roughly and no.
"""
COLUMNS = ("Vehicle", "Log", "Flown", "Hover throttle", "Effectiveness, delay", "Uneven rotors", "Answers", "Missing")


def main(repositories: Path) -> None:
    with LISTED.open(encoding="utf-8", newline="") as stream:
        listed = list(csv.DictReader(stream, delimiter="\t"))
    print(HEAD.format(len(listed)))
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
    for each in listed:
        row = [each["vehicle"], f"{each['repository']}, `{each['path']}`"]
        print(f"| {' | '.join([*row, *_looked(repositories / each['repository'], each['path'])])} |", flush=True)
        progress(row)


def _looked(repository: Path, path: str) -> list[str]:
    """Look at a log of a repository, and give the cells of its row."""
    shown = subprocess.run(["git", "-C", repository, "show", f"HEAD:{path}"], capture_output=True, check=False)
    if shown.returncode:
        return ["", "", "", "", "", "the log is not in this clone"]
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, Path(path).name)
        log.write_bytes(shown.stdout)
        words = [sys.executable, "-m", "cpfls_cli", "look", log, "-o", Path(folder, "look"), "--json"]
        run = subprocess.run(words, capture_output=True, text=True, check=False)
    if run.returncode:
        return ["", "", "", "", "", run.stderr.strip().partition(f"{log.name}: ")[2] or run.stderr.strip()]
    found = json.loads(run.stdout)
    if "logged" not in found:
        # Several flights in one file: the first that flies.
        found = next(each for each in found.values() if isinstance(each, dict) and each.get("logged"))
    return _cells(found)


def _cells(found: Mapping[str, Any]) -> list[str]:
    answers = [each["answer"] for each in found["answers"]]
    hover, uneven = found["hover"], (found["balance"] or {}).get("uneven") or []
    rotors = {each["rotor"]: each["share"] for each in (found["balance"] or {}).get("rotors", [])}
    shares = (f"M{number} {_interval(rotors[number], 100, -1)} %" for number in sorted(uneven))
    counted = ", ".join(f"{answers.count(word)} {word}" for word in ("yes", "roughly", "no"))
    missing = found["next_steps"][0]["what"] if found["next_steps"] else ""
    return [
        f"{found['logged']['flown_s']:.0f} s",
        _interval(hover["throttle"], 100) + " %" if hover and hover["throttle"] else "",
        "; ".join(_plants(found["plants"] or {})),
        ", ".join(shares),
        counted,
        missing.replace("|", "/"),
    ]


def _plants(plants: Mapping[str, Any]) -> Iterator[str]:
    for axis, own in plants.items():
        if own["identified"]:
            delay = f", {_interval(own['total_delay'], 1e3)} ms" if own["total_delay"] else ""
            yield f"{axis} {_interval(own['effectiveness'])} rad/s²{delay}"


def _interval(number: Mapping[str, float], times: float = 1.0, offset: float = 0.0) -> str:
    ends = (float(f"{times * (number[key] + offset):.3g}") for key in ("value", "low", "high"))
    return "{:g} [{:g}, {:g}]".format(*ends)


if __name__ == "__main__":
    program(main)
