"""Two things timed in turn, tables in Markdown, and the same as JSON."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

RESULTS = Path(__file__).resolve().parents[1] / "results"


@dataclass(frozen=True)
class Ratio:
    """How much longer one thing takes than another, both timed in turn."""

    slow_s: float
    fast_s: float
    ratio: float
    lowest: float
    highest: float

    @property
    def range(self) -> str:
        return f"{self.ratio:.3g} ({self.lowest:.3g} to {self.highest:.3g})"


def in_turn(
    slow: Callable[[], object],
    fast: Callable[[], object],
    repeats: int = 5,
    clock: Callable[[], float] = perf_counter,
) -> Ratio:
    """Time two things in turn, each once unmeasured before; medians, and the range of the ratio."""
    slow(), fast()
    return ratio_of([(seconds(slow, clock), seconds(fast, clock)) for _ in range(repeats)])


def ratio_of(times: Sequence[tuple[float, float]]) -> Ratio:
    """Compare pairs of times, the slow one first."""
    ratios = [one / other for one, other in times]
    both = (median(time[place] for time in times) for place in (0, 1))
    return Ratio(*both, median(ratios), min(ratios), max(ratios))


def seconds(work: Callable[[], object], clock: Callable[[], float] = perf_counter) -> float:
    """Time something once; the processor's clock (`process_time`) is the one that other programs disturb least."""
    start = clock()
    work()
    return clock() - start


def pin_threads() -> None:
    """Limit linear algebra to one thread; call it before anything numerical is imported."""
    from cpfls_cli.cli.main import use_one_thread

    use_one_thread()


def table(name: str, columns: Sequence[str], rows: Sequence[Sequence[Any]], digits: int = 3, **more: Any) -> None:
    """Print a Markdown table and write it, with the machine in words, to ``benchmarks/results/NAME.json``."""
    print("| " + " | ".join(columns) + " |")
    print("|" + "---|" * len(columns))
    for row in rows:
        print("| " + " | ".join(_text(value, digits) for value in row) + " |", flush=True)
    RESULTS.mkdir(exist_ok=True)
    records = [dict(zip(columns, row, strict=True)) for row in rows]
    content: Mapping[str, Any] = {"machine": machine(), "rows": records, **more}
    (RESULTS / f"{name}.json").write_text(json.dumps(content, indent=1, default=float) + "\n", encoding="utf-8")


def machine() -> str:
    """Describe the machine in words."""
    import numba
    import numpy as np
    from llvmlite.binding import get_host_cpu_name

    versions = f"Python {platform.python_version()}, numpy {np.__version__}, numba {numba.__version__}"
    gigabytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{os.cpu_count()} cores ({get_host_cpu_name()}), {gigabytes:.0f} GiB, {versions}"


def _text(value: Any, digits: int) -> str:
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)
