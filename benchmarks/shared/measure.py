"""Command lines of the benchmarks, two things timed in turn, and tables in Markdown and JSON."""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
import typer

RESULTS = Path(__file__).resolve().parents[1] / "results"


def program(main: Callable[..., None]) -> None:
    """Call the main function of a module with what the command line says; its parameters are the options."""
    main.__doc__ = sys.modules[main.__module__].__doc__
    typer.run(main)


@dataclass(frozen=True)
class Ratio:
    """How much longer one thing takes than another, both timed in turn."""

    slow_s: float
    fast_s: float
    ratio: float
    lowest: float
    highest: float

    @classmethod
    def of(cls, times: Sequence[tuple[float, float]]) -> Ratio:
        """Compare pairs of times, the slow one first."""
        ratios = [one / other for one, other in times]
        both = (median(time[index] for time in times) for index in (0, 1))
        return cls(*both, median(ratios), min(ratios), max(ratios))

    @property
    def range(self) -> str:
        return f"{self.ratio:.3g} ({self.lowest:.3g} to {self.highest:.3g})"


def in_turn(
    slow: Callable[[], object], fast: Callable[[], object], repeats: int = 5, clock: Callable[[], float] = process_time
) -> Ratio:
    """Time two things in turn, each once unmeasured before; medians, and the range of the ratio."""
    slow(), fast()
    return Ratio.of([(seconds(slow, clock), seconds(fast, clock)) for _ in range(repeats)])


def seconds(work: Callable[[], object], clock: Callable[[], float] = process_time) -> float:
    """Time something once, by the processor's clock, which other programs disturb least."""
    start = clock()
    work()
    return clock() - start


def table(name: str, columns: str | Sequence[str], rows: Sequence[Sequence[Any]], digits: int = 3, **more: Any) -> None:
    """Print a Markdown table and write it to ``benchmarks/results``; columns are one text, or a sequence."""
    columns = columns.split(" | ") if isinstance(columns, str) else columns
    print("| " + " | ".join(columns) + " |")
    print("|" + "---|" * len(columns))
    for row in rows:
        print("| " + " | ".join(_text(value, digits) for value in row) + " |", flush=True)
    RESULTS.mkdir(exist_ok=True)
    records = [dict(zip(columns, row, strict=True)) for row in rows]
    content: Mapping[str, Any] = {"machine": machine(), "rows": records, **more}
    (RESULTS / f"{name}.json").write_text(json.dumps(content, indent=1, default=float) + "\n", encoding="utf-8")


def progress(row: Sequence[object]) -> None:
    """Show a row of a long table on stderr as soon as it is known."""
    print(*row, sep=" | ", file=sys.stderr, flush=True)


def count(flags: Any) -> str:
    """Write how many of an array are true."""
    return f"{int(np.sum(flags))} of {np.size(flags)}"


def mean_and_ends(values: Any, digits: int = 3) -> str:
    """Write the mean and the ends of an array; a dash where it is empty."""
    ends = f"{np.min(values):.2f} to {np.max(values):.2f}" if len(values) else ""
    return f"{np.mean(values):.{digits}f} ({ends})" if len(values) else "—"


def machine() -> str:
    """Describe the machine in words."""
    import numba
    from llvmlite.binding import get_host_cpu_name

    versions = f"Python {platform.python_version()}, numpy {np.__version__}, numba {numba.__version__}"
    gigabytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{os.cpu_count()} cores ({get_host_cpu_name()}), {gigabytes:.0f} GiB, {versions}"


def _text(value: Any, digits: int) -> str:
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)
