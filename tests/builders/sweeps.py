"""Settings of sweeps with runs of given errors."""

import numpy as np
import pytest

from benchmarks.paper import searches
from benchmarks.paper.replicates import Replicate, Setting, Sweep


def setting_of(mse, structure="cpfls", samples=5487, size=(40, 10), seeds=None, **more):
    """Make a setting whose runs have these errors in all measures, on the training part alone."""
    errors = np.asarray(mse, dtype=float)
    seeds = np.arange(len(errors)) if seeds is None else np.asarray(seeds)
    given = {
        "name": "x",
        "overrides": (),
        "structure": structure,
        "samples": samples,
        "criterion": "all" if samples == 5487 else "KD-exchange",
        "selection": "",
        "population": size[0],
        "generations": size[1],
        "judged_on": "training",
        "ranking": "quantity-dominance",
        "uniform_condition_number": np.nan,
        "largest_torque": np.nan,
        "replicates": tuple(replicate_of(int(seed), error) for seed, error in zip(seeds, errors, strict=True)),
    }
    return Setting(**given | more)


def replicate_of(seed, error, **more):
    """Make a run with one error in all measures."""
    given = {name: np.array([error]) for name in ("mse", "max_error", "relative_error")}
    given |= {f"learned_{name}": error for name in ("mse", "max_error", "relative_error")}
    counts = {"generations": 1, "evaluations": seed, "settled": 0}
    return Replicate(**given | counts | {"seed": seed, "condition_number": float(seed), "chromosome": (1,)} | more)


def sweep_of(*settings):
    """Make a sweep whose runs are finished."""
    return Sweep(parts=("training",), complete=True, settings=settings)


def searched(folder, name, seed, seeds):
    """Search 30 samples in two sizes, from a seed on; both are small."""
    given = (folder / "study.yaml", folder / "flight.h5", searches.Compared.LARGER, folder / name)
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setitem(searches._SMALLER, "identification.population", 10)
        monkeypatch.setitem(searches._SMALLER, "identification.generations", 2)
        searches.main(*given, seed, seeds, population=8, generations=1, samples=[30])
    return folder / name
