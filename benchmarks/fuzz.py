"""Hostile configs, artifacts and logs against the commands that read them.

A case is met well where a command does its work, or ends with one message, exit code 1 or 2, and all files as they
were, without orders to the terminal and in 2 GB of memory. What is accepted has to pass `cpfls check`. A process of its
own, which cannot take more than 6 GB, runs the cases: one that turns for ever is ended after a minute and counted,
unless the command itself says that HDF5 does not come to an end.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from typing import Annotated

import typer

from benchmarks.shared.measure import program, table
from cpfls_cli.artifacts import patience
from cpfls_cli.logs import matrices
from tests.builders.hostile_files import FAULTS, KINDS, Good, tried

PATIENCE_S = 60.0
LIMIT_BYTES = 6 << 30
CASE, NO_END = "case ", "HDF5 did not finish reading"
PREPARING_S = 600.0


def main(
    each: int = 10_000,
    kinds: str = ",".join(KINDS),
    seed: int = 1,
    processes: int = 1,
    cases: Annotated[str, typer.Option(hidden=True)] = "",
) -> None:
    if cases:
        kind, first, count = cases.split(",")
        run_cases(kind, int(first), int(count), seed)
        return
    names = kinds.split(",")
    with ThreadPoolExecutor(processes) as side_by_side:
        counts = side_by_side.map(lambda kind: counted(kind, each, seed), names)
        faults = [[of_kind[fault] for fault in FAULTS] for of_kind in counts]
    rows = [[kind, each, each - sum(found), *found] for kind, found in zip(names, faults, strict=True)]
    table("fuzz", ["kind", "tried", "met well", *FAULTS], rows)


def counted(kind: str, cases: int, seed: int) -> Counter[str]:
    """Run cases of a kind in processes of their own; a new one goes on after the case that hung or ended one."""
    counts: Counter[str] = Counter()
    first = 0
    while first < cases:
        for number, fault, what in reported(kind, first, cases, seed):
            first = number + 1
            if fault:
                counts[fault] += 1
                print(f"{kind} {number}: {fault}: {what}", file=sys.stderr, flush=True)
    return counts


def reported(kind: str, first: int, cases: int, seed: int) -> Iterator[tuple[int, str, str]]:
    words = [sys.executable, "-m", "benchmarks.fuzz", "--seed", str(seed), "--cases", f"{kind},{first},{cases}"]
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
            if not line.startswith(CASE):
                said = line
                continue
            longest_s, said = PATIENCE_S, ""
            number, *found = json.loads(line.removeprefix(CASE))
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
        print(CASE + json.dumps([first - 1, "", ""]), flush=True)
        for number in range(first, cases):
            fault, what = tried(good.case(kind, [seed, number])) or ("", "")
            print(CASE + json.dumps([number, fault, what]), flush=True)


if __name__ == "__main__":
    program(main)
