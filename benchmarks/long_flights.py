"""Time per sample and peak memory of reduction and identification, from 5e3 to 5e6 samples.

Each flight is the paper's, tiled, with noise on its motion and torque. Every line runs in a process of its own, whose
peak memory is read at its end.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from functools import partial
from mmap import mmap
from pathlib import Path
from time import perf_counter

import h5py
import numpy as np

from benchmarks.shared.measure import program, seconds, table
from benchmarks.shared.studies import CONFIG, paper_flight, paper_study
from cpfls_cli import __version__
from cpfls_cli.artifacts.gate import SCHEMA_VERSION
from cpfls_cli.config.study import resolved_yaml
from cpfls_cli.files import seal_of
from cpfls_cli.flightlog.results import MOTION
from cpfls_cli.flights.training import flight_source
from cpfls_cli.identification.evaluator import Problem, decode, refine
from cpfls_cli.identification.identify import model_evaluator

SIZES = (5_000, 50_000, 500_000, 5_000_000)
NOISE = 0.01
EVALUATIONS = 3
BUDGET = 4
SMALL = ("--set", "identification.population=10", "--set", "identification.generations=2")


def main(most: int = SIZES[-1], *, one: Path | None = None) -> None:
    if one:
        print(json.dumps(measure(one)))
        return
    sizes = [size for size in SIZES if size <= most]
    of_identified_models(sizes)


def of_identified_models(sizes: list[int]) -> None:
    """Reduce and evaluate flights of these sizes; print it."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        flight, model = Path(folder) / "flight.h5", Path(folder) / "model.h5"
        write_tiled(flight, SIZES[0])
        # A model with bands; the loops of all commands are compiled then.
        by_command("identify", model, flight, *SMALL)
        for samples in sizes:
            write_tiled(flight, samples)
            one = in_own_process(flight)
            reduced = by_command("reduce", Path(folder) / "selection.h5", flight)
            rows.append((samples, one["evaluation"], one["search"], one["memory"], *reduced))
    columns = (
        "samples | evaluation, us per sample | local search, us per sample | peak memory, MB | "
        "`cpfls reduce` to 685, s | its peak memory, MB"
    )
    table("long_flights", columns, rows)


def write_tiled(path: Path, samples: int) -> None:
    """Write the paper's flight over and over."""
    flight = paper_flight()
    names = ("attitude", "rate", "acceleration")
    motion = dict(zip(MOTION, (getattr(flight.motion, name) for name in names), strict=True))
    write_over_and_over(path, samples, motion | {"torque": flight.torque}, 0.01, resolved_yaml(paper_study()), NOISE)


def write_over_and_over(
    path: Path, samples: int, signals: dict[str, np.ndarray], period: float, config: str, noise: float
) -> None:
    """Write a flight artifact block by block: a flight over and over, with noise as a share of its scatter."""
    rng = np.random.default_rng(6)
    with h5py.File(path, "w") as file:
        header = {"format": "cpfls/flight", "schema_version": SCHEMA_VERSION, "cpfls_version": __version__}
        file.attrs.update(header | {"seed": 6, "stage": "simulate", "cautions": ""})
        file["config"] = np.bytes_(config.encode())
        file["time"] = period * np.arange(samples)
        for name, values in signals.items():
            dataset = file.create_dataset(name, (samples, *values.shape[1:]), dtype=float)
            scale = noise * values.std(axis=0)
            for start in range(0, samples, len(values)):
                own = values[: samples - start]
                dataset[start : start + len(own)] = own + scale * rng.standard_normal(own.shape)
    with path.open("r+b") as file, mmap(file.fileno(), 0) as content:
        line = seal_of(content)
    with path.open("ab") as file:
        file.write(line)


def measure(path: Path) -> dict[str, float]:
    """Time evaluations of a flight; report microseconds per sample."""
    source = flight_source(path)
    evaluator = model_evaluator(source, source, paper_study().identification)
    chromosome = np.full(evaluator.structure.genes, 30000)
    work = lambda: evaluator.objectives(chromosome, fitted(evaluator, chromosome))  # noqa: E731
    work()
    evaluation = np.median([1e6 * seconds(work, perf_counter) / len(source) for _ in range(EVALUATIONS)])
    problem = Problem(evaluator.solver, fitted(evaluator, chromosome))
    products = evaluator.solver.products(decode(evaluator.structure, chromosome.astype(float)))
    one_search = partial(refine, problem, chromosome, products, BUDGET)
    if len(source) == SIZES[0]:
        # What a first search loads counts where samples are few.
        one_search()
    search = 1e6 * seconds(one_search, perf_counter) / len(source)
    return {"evaluation": float(evaluation), "search": search}


def fitted(evaluator, chromosome: np.ndarray):
    fit = evaluator.fit(chromosome)
    assert fit is not None
    return fit


def in_own_process(path: Path) -> dict[str, float]:
    _, memory, said = beside([sys.executable, "-m", "benchmarks.long_flights", "--one", path])
    return json.loads(said) | {"memory": memory}


def by_command(command: str, output: Path, *words: Path | str, config: Path = CONFIG) -> tuple[float, float]:
    """Run a command of the program: seconds of processor time, and peak memory in MB."""
    full = [sys.executable, "-m", "cpfls_cli", command, config, *words, "-o", output, "--force"]
    seconds, memory, _ = beside(full)
    return seconds, memory


def beside(call) -> tuple[float, float, str]:
    """Run a program from a small process: seconds of processor time, peak memory in MB, and what it printed.

    The peak memory of a process is never below that of the process that started it.
    """
    code = (
        "import json, resource, subprocess, sys;"
        "said = subprocess.run(sys.argv[1:], check=True, stdout=subprocess.PIPE, text=True).stdout;"
        "own = resource.getrusage(resource.RUSAGE_CHILDREN);"
        "print(json.dumps([own.ru_utime + own.ru_stime, own.ru_maxrss / 1024, said]))"
    )
    small = [sys.executable, "-c", code, *map(str, call)]
    seconds, memory, said = json.loads(subprocess.run(small, check=True, stdout=subprocess.PIPE, text=True).stdout)
    return seconds, memory, said


if __name__ == "__main__":
    program(main)
