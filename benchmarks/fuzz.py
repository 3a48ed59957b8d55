"""Hostile configs, artifacts and logs against the commands that read them, and commands killed at any moment.

    python -m benchmarks.fuzz --each 10000 --kills 100 --processes 2

A case is met well where a command does its work, or ends with one message, exit code 1 or 2, and all files as they
were, without orders to the terminal and in 2 GB of memory. What is accepted has to pass `cpfls check`. A process of its
own, which cannot take more than 6 GB, runs the cases: one that turns for ever is ended after a minute and counted,
unless the command itself says that HDF5 does not come to an end. A killed command is run again, with --resume where it
left something to resume, and has to end in the bytes of one that nobody disturbed, with nothing left beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, Queue
from threading import Thread

from benchmarks.shared.measure import table
from cpfls_cli.artifacts import patience
from cpfls_cli.logs import matrices
from tests.builders.command_line import run
from tests.builders.hostile_files import FAULTS, KINDS, Good, tried
from tests.builders.studies import TINY, VEHICLE, stages
from tests.builders.vehicle_search import CONFIG, TRIED, left_out

PATIENCE_S = 60.0
LIMIT_BYTES = 6 << 30
TOLD, NO_END = "case ", "HDF5 did not finish reading"
PREPARING_S = 600.0
LONGER = ("--set", "identification.population=40", "--set", "identification.generations=6")
VEHICLE_STUDY = {"search_windows": 20, "folds": 2, "generations": 0, "population": 2, "leave_out": left_out(TRIED)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=10_000, help="cases of each kind")
    parser.add_argument("--kinds", default=",".join(KINDS), help="of files")
    parser.add_argument("--kills", type=int, default=100, help="over all commands")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=1, help="kinds of files that are tried side by side")
    parser.add_argument("--cases", nargs=3, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.cases:
        run_cases(asked.cases[0], int(asked.cases[1]), int(asked.cases[2]), asked.seed)
        return
    kinds = asked.kinds.split(",")
    with ThreadPoolExecutor(asked.processes) as side_by_side:
        counts = side_by_side.map(lambda kind: counted(kind, asked.each, asked.seed), kinds)
        faults = [[of_kind[fault] for fault in FAULTS] for of_kind in counts]
    rows = [[kind, asked.each, asked.each - sum(found), *found] for kind, found in zip(kinds, faults, strict=True)]
    table("fuzz", ["kind", "tried", "met well", *FAULTS], rows)
    print()
    columns = ["command", "kills", "resumed", "equal bytes", "other bytes", "left behind"]
    table("kills", columns, killed(asked.kills, random.Random(asked.seed)) if asked.kills else [])


def counted(kind: str, cases: int, seed: int) -> Counter[str]:
    """Run cases of a kind in processes of their own; a new one goes on after the case that hung or ended one."""
    counts: Counter[str] = Counter()
    first = 0
    while first < cases:
        for number, fault, what in told(kind, first, cases, seed):
            first = number + 1
            if fault:
                counts[fault] += 1
                print(f"{kind} {number}: {fault}: {what}", file=sys.stderr, flush=True)
    return counts


def told(kind: str, first: int, cases: int, seed: int) -> Iterator[tuple[int, str, str]]:
    words = [sys.executable, "-m", "benchmarks.fuzz", "--seed", str(seed), "--cases", kind, str(first), str(cases)]
    lines: Queue[str | None] = Queue()
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:

        def read() -> None:
            for line in process.stdout or ():
                lines.put(line)
            lines.put(None)

        Thread(target=read, daemon=True).start()
        number, fault, longest_s, said = first - 1, "", PREPARING_S, ""
        while number + 1 < cases:
            try:
                line = lines.get(timeout=longest_s)
            except Empty:
                fault = "hang"
                break
            if line is None:
                fault = "" if NO_END in said else "traceback"
                break
            if not line.startswith(TOLD):
                said = line
                continue
            longest_s, said = PATIENCE_S, ""
            number, *found = json.loads(line.removeprefix(TOLD))
            yield number, *found
        process.kill()
    if number + 1 < cases:
        yield number + 1, fault, f"the process ended with {process.returncode}: {said}"


def run_cases(kind: str, first: int, cases: int, seed: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        good = Good.made(Path(folder))
        if os.name == "posix":
            import resource

            resource.setrlimit(resource.RLIMIT_DATA, (LIMIT_BYTES, LIMIT_BYTES))
        patience.longest_read_s = matrices.longest_read_s = lambda _: PATIENCE_S / 4
        patience.end_what_hangs()
        print(TOLD + json.dumps([first - 1, "", ""]), flush=True)
        for number in range(first, cases):
            fault, what = tried(good.case(kind, [seed, number])) or ("", "")
            print(TOLD + json.dumps([number, fault, what]), flush=True)


@dataclass(frozen=True)
class Command:
    """A command that takes long enough to be killed, and whether it keeps what can be resumed."""

    title: str
    words: tuple[str, ...]
    ending: str = ".h5"


def killed(kills: int, moments: random.Random) -> list[list[object]]:
    """Kill each command in turn at random moments, run it again, and compare with the undisturbed run."""
    with tempfile.TemporaryDirectory() as folder:
        commands = commands_in(Path(folder))
        work = Path(folder) / "killed"
        rows: list[list[object]] = []
        for place, command in enumerate(commands):
            work.mkdir()
            whole, output = work / f"whole{command.ending}", work / f"output{command.ending}"
            start = time.perf_counter()
            assert started(command, whole).wait() == 0, command.title
            seconds = time.perf_counter() - start
            own = len(range(place, kills, len(commands)))
            counts = Counter(disturbed(command, whole, output, moments.uniform(0, seconds)) for _ in range(own))
            resumed = sum(count for (was_resumed, _, _), count in counts.items() if was_resumed)
            equal = sum(count for (_, is_equal, _), count in counts.items() if is_equal)
            left = sum(count for (_, _, is_left), count in counts.items() if is_left)
            rows.append([command.title, own, resumed, equal, own - equal, left])
            print(*rows[-1], file=sys.stderr, flush=True)
            shutil.rmtree(work)
        return rows


def disturbed(command: Command, whole: Path, output: Path, after_s: float) -> tuple[bool, bool, bool]:
    """Kill a command and run it again: whether it was resumed, ended in equal bytes, and left anything beside it."""
    process = started(command, output)
    time.sleep(after_s)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    leaves = any(output.with_name(output.name + ending).exists() for ending in (".checkpoint", ".partial"))
    ended = started(command, output, "--force", *(["--resume"] if leaves else [])).wait()
    beside = sorted(path.name for path in output.parent.iterdir())
    is_equal = ended == 0 and contents(output) == contents(whole)
    shutil.rmtree(output) if output.is_dir() else output.unlink(missing_ok=True)
    return leaves, is_equal, beside != sorted((output.name, whole.name))


def started(command: Command, output: Path, *options: str) -> subprocess.Popen[bytes]:
    words = [sys.executable, "-m", "cpfls_cli", *command.words, "-o", str(output), "--quiet", *options]
    return subprocess.Popen(words)


def contents(path: Path) -> list[bytes]:
    """Give the bytes of a file, or of all artifacts in a folder; a page names its own folder."""
    files = sorted(path.glob("*.h5")) if path.is_dir() else [path]
    return [file.read_bytes() for file in files]


def commands_in(folder: Path) -> list[Command]:
    """Prepare a tiny study, and two flights of a vehicle, and list the commands that take a while with them."""
    tiny, quad = str(folder / "tiny.yaml"), str(folder / "quad.yaml")
    Path(tiny).write_text(TINY + VEHICLE)
    Path(quad).write_text(f"{CONFIG}playback: {json.dumps(VEHICLE_STUDY)}\n")
    paths, making = stages(tiny, folder)
    for stage, words in making.items():
        assert run(*words, "-o", paths[stage]).exit_code == 0
    flights = []
    for number, direction in ((1, "[-0.3, 1.0, 0.4]"), (2, "[1.0, -0.7, 0.3]")):
        plan, flight = folder / f"path-{number}.h5", str(folder / f"flight-{number}.h5")
        straight = ("--set", "trajectory.path=straight", "--set", f"trajectory.direction={direction}")
        assert run("trajectory", quad, "-o", plan, *straight).exit_code == 0
        assert run("simulate", quad, plan, "--seed", number, "-o", flight).exit_code == 0
        flights.append(flight)
    flown, model = str(paths["flight"]), str(paths["model"])
    return [
        Command("identify", ("identify", tiny, flown, *LONGER)),
        Command("identify --workers 2", ("identify", tiny, flown, *LONGER, "--workers", "2")),
        Command("sweep", ("sweep", tiny, flown, "--set", "sweep.seeds=2", *LONGER)),
        Command("vehicle", ("vehicle", quad, flights[0], "--held-out", flights[1])),
        Command("reduce", ("reduce", tiny, flown)),
        Command("predict", ("predict", tiny, model, flown)),
        Command("report", ("report", tiny, flown, model), ".html"),
        Command("gap", ("gap", quad, flights[0], "--held-out", flights[1]), ""),
    ]


if __name__ == "__main__":
    main()
