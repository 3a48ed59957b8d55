"""One folder of flights judged as `cpfls gap` judges it; the key is never opened."""

from __future__ import annotations

import time
from pathlib import Path

from cpfls_cli.config.load import load_study
from cpfls_cli.config.study import generator
from cpfls_cli.errors import CpflsError
from cpfls_cli.flights.recordings import read_flights
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.result import plain


def judge(folder):
    """Diagnose the flights of a folder: ``study.yaml``, ``train_*.csv`` and ``held_out_*.csv``; give plain data."""
    folder = Path(folder)
    started = time.monotonic()
    try:
        answer = _judged(folder)
    except CpflsError as error:
        answer = {"verdict": "ERROR", "error": str(error), "effects": []}
    return {"set": folder.name, **plain(answer), "seconds": round(time.monotonic() - started, 2)}


def _judged(folder):
    study = load_study(folder / "study.yaml")
    logs = [sorted(folder.glob(f"{role}_*.csv")) for role in ("train", "held_out")]
    read = read_flights([*logs[0], *logs[1]], study).flights
    training, held = read[: len(logs[0])], read[len(logs[0]) :]
    run = diagnose(training, held, study.gap, generator(study, "diagnose"))
    found = run.diagnosis
    return {
        "verdict": str(found.verdict),
        "effects": [_effect(effect) for effect in found.effects],
        "closest": [_effect(effect) for effect in found.closest],
        "alternatives": [vars(rival) for rival in found.alternatives],
        "sets": [vars(each) for each in found.sets],
        "unexplained": [vars(left) for left in found.unexplained],
        "differences": list(found.differences),
        "contradictions": list(found.contradictions),
        "share": found.share,
        "gap_before": {"value": found.gap.before.tolist(), "floors": found.gap.before_floors.tolist()},
        "gap_after": {"value": found.gap.after.tolist(), "floors": found.gap.after_floors.tolist()},
        "floor": found.gap.floor.tolist(),
        "air": None if run.air is None else _air(run.air),
    }


def _air(air):
    """Tell gusts by channel, N m, N and s, and of which channels they are all that is left."""
    names = ("size", "low", "high", "memory", "memory_low", "memory_high")
    return {"gusts_only": air.gusts_only.tolist()} | {name: getattr(air.found, name).tolist() for name in names}


def _effect(effect):
    numbers = {
        c.name: {"value": c.value, "low": c.low, "high": c.high, "unit": c.unit, "possible": list(c.plausible)}
        for c in effect.numbers
    }
    return {"name": effect.name, "coefficients": numbers, "p_value": effect.p_value, "share": effect.share}
