"""What a sweep says: mean and spread of each setting."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.identification.judge import Spread, spread
from cpfls_cli.report.outcome import Outcome

_MEASURES = ("mse", "max_error", "relative_error")
_SHOWN = (("mse", "MSE"), ("max_error", "largest error, N m"), ("condition_number", "condition number"))


def sweep_outcome(data: Mapping[str, Any], runs: int, seconds: float) -> Outcome:
    """Say what a sweep found.

    Parameters
    ----------
    data : mapping of str to array
        Of its artifact.
    runs : int
        Finished or not.
    seconds : float
        That it took.
    """
    done = len(data["run/seed"])
    settings = [_setting(data, index) for index in range(len(data["setting/name"]))]
    summary = {
        "runs": done,
        "runs_in_all": runs,
        "complete": bool(data["complete"]),
        "settings": settings,
        "seconds": round(seconds, 3),
    }
    lines = [f"{done} of {runs} runs, {len(settings)} settings; mean and standard deviation of the training part"]
    nothing = int(np.sum(np.isnan(data["run/mse"][:, 0])))
    warnings = (f"{nothing} of {done} runs found no finite model; they count for no mean",) if nothing else ()
    return Outcome(summary, (*lines, *_table(settings)), warnings)


def _setting(data: Mapping[str, Any], index: int) -> dict[str, Any]:
    own = np.asarray(data["run/setting"]) == index
    parts = [str(part) for part in data["part"]]
    measured = {name: np.asarray(data[f"run/{name}"])[own] for name in _MEASURES}
    return {
        "name": str(data["setting/name"][index]),
        "overrides": json.loads(str(data["setting/overrides"][index])),
        **{name: data[f"setting/{name}"][index] for name in ("structure", "samples", "population", "generations")},
        "runs": int(np.sum(own)),
        "seeds": np.asarray(data["run/seed"])[own].tolist(),
        **{name: _spread(values[:, 0]) for name, values in measured.items()},
        "condition_number": _spread(np.asarray(data["run/condition_number"])[own]),
        "held_out": {
            part: {name: _spread(values[:, place]) for name, values in measured.items()}
            for place, part in enumerate(parts)
            if place
        },
    }


def _spread(values: Array) -> dict[str, float]:
    found: Spread = spread(values)
    return {
        "mean": found.mean,
        "variance": found.variance,
        "standard_deviation": found.deviation,
        "smallest": float(np.nanmin(values)) if found.count else float("nan"),
    }


def _table(settings: list[dict[str, Any]]) -> list[str]:
    """Line up one row for each setting."""
    rows = [["setting", "samples", "population", "generations", "runs", *(title for _, title in _SHOWN)]]
    for setting in settings:
        counts = [str(setting[key]) for key in ("samples", "population", "generations", "runs")]
        rows.append([setting["name"], *counts, *(_written(setting[name]) for name, _ in _SHOWN)])
    widths = [max(len(row[place]) for row in rows) for place in range(len(rows[0]))]
    return [
        "  ".join([row[0].ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    ]


def _written(found: Mapping[str, float]) -> str:
    mean, deviation = found["mean"], found["standard_deviation"]
    if np.isnan(mean):
        return "-"
    return f"{mean:.4g}" if np.isnan(deviation) else f"{mean:.4g} ± {deviation:.2g}"
