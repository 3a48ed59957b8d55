"""Fit flights of a known vehicle: errors of the numbers, how often intervals hold the truth, which blocks are chosen.

    python -m benchmarks.playback_truth [SEEDS] [SEARCHES]

Each seed is nine flights of 20 s with lag, damping, drag, flapping and wrong constants at once
(tests/builders/playback_flights.py), logged with white and with coloured noise, and three flights that judge. SEEDS
(20) fits have the structure that flew; SEARCHES (2) have to find it, with the white noise.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from benchmarks.shared.measure import table
from benchmarks.shared.playback_scores import SYMBOLS, free_runs, score
from cpfls_cli.arrays import Array
from cpfls_cli.playback.fit import Fitted, FitWindows, fit, uncertainty
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.settings import PlaybackSettings
from cpfls_cli.playback.structure import Judged, Structure
from cpfls_cli.playback.vehicle import find_vehicle
from tests.builders.playback_flights import KINDS, MIDDLING, STATED, TRUE_BLOCKS, flown, judged, true_numbers, truth

NOISE = {"white": MIDDLING, "coloured, 50 ms": replace(MIDDLING, time_constant_s=0.05)}
TIMES, HORIZON, EVERY = 3, 50, 60
STEPS, TOLERANCE = 60, 3e-5
SEARCH = PlaybackSettings(search_windows=120, population=6, generations=1)
_STEP = 1e-5


class Recovered(NamedTuple):
    """One fit of the structure that flew: relative errors, which intervals hold the truth, error of playback."""

    error: Array
    held: Array
    half: Array
    ratio: Array


def main(seeds: int, searches: int) -> None:
    for name, noise in NOISE.items():
        print(f"\nnoise {name}, {seeds} seeds:\n")
        found = [recovered(*flights(seed, noise)) for seed in range(1, seeds + 1)]
        short = name.split(",")[0]
        table(f"playback_truth_{short}", ("number", *COLUMNS), list(by_number(found)))
        ratios = np.array([each.ratio for each in found])
        print("\nplayback error on flights that judge, over that of the true model:\n")
        rows = [
            (f"Σ{symbol}", float(np.median(values)), float(values.max()))
            for symbol, values in zip(SYMBOLS.values(), ratios.T, strict=True)
        ]
        table(f"playback_truth_{short}_errors", ("signal", "median", "largest"), rows, digits=4)
    print("\nsearch for the structure, white noise:\n")
    rows = [searched(seed) for seed in range(1, searches + 1)]
    table("playback_truth_structure", ("seed", "chosen and not there", "missed", "Σω over that of the truth"), rows)


COLUMNS = ("median error", "largest", "mean", "median half interval", "intervals that hold the truth")


def flights(seed: int, noise) -> tuple[list[PlaybackFlight], list[PlaybackFlight]]:
    """Fly for the fit, and once more to judge."""
    return flown(truth(), KINDS * TIMES, seed=seed, noise=noise), flown(truth(), seed=1000 + seed, noise=noise)


def recovered(training: Sequence[PlaybackFlight], judging: Sequence[PlaybackFlight]) -> Recovered:
    windows = [FitWindows.of(flight, HORIZON, EVERY) for flight in training]
    free = Structure(TRUE_BLOCKS).free(STATED)
    fitted = fit(free, windows, {}, STEPS, TOLERANCE)
    spread = uncertainty(fitted, windows)
    slopes = np.stack([numbers(fitted, step) - numbers(fitted, -step) for step in _STEP * np.diag(free.scales)], 1)
    slopes /= 2 * _STEP * free.scales
    half = student.ppf(0.975, spread.blocks - 1) * np.sqrt(np.diag(slopes @ spread.covariance @ slopes.T))
    true = TRUE[1]
    error = numbers(fitted) - true
    return Recovered(error / true, np.abs(error) <= half, half / true, ratio(fitted.model, judging))


def _with_ratios(known: dict[str, float]) -> tuple[list[str], Array]:
    ratios = judged(known)
    both = known | {name: ratios[name] for name in ratios if name not in known}
    return list(both), np.array(list(both.values()))


TRUE = _with_ratios(true_numbers())


def numbers(fitted: Fitted, step: Array | float = 0.0) -> Array:
    """Give the numbers, and those of yaw over its inertia as well."""
    physical = fitted.free.physical(fitted.values + step)
    return _with_ratios({name: each.value for name, each in physical.items()})[1]


def ratio(model: VehicleModel, judging: Sequence[PlaybackFlight]) -> Array:
    """Compare with the model that flew, shape (4,)."""
    fitted, true = (score([free_runs(each, flight, 5) for flight in judging]) for each in (model, truth()))
    return np.asarray(fitted.sums / true.sums)


def by_number(found: Sequence[Recovered]):
    errors, held = np.array([each.error for each in found]), np.array([each.held for each in found])
    half = np.array([each.half for each in found])
    percent = "{:.1f} %".format
    for place, name in enumerate(TRUE[0]):
        error = 100 * errors[:, place]
        sizes = (float(np.median(np.abs(error))), float(np.abs(error).max()))
        width = 100 * float(np.median(half[:, place]))
        share = f"{held[:, place].sum()} of {len(found)}"
        yield name, *map(percent, sizes), f"{error.mean():+.1f} %", percent(width), share
    yield "all", "", "", "", "", f"{100 * held.mean():.1f} %"


def searched(seed: int) -> tuple[str, ...]:
    """Name the blocks that are chosen and not there, and those missed."""
    training, judging = flights(seed, MIDDLING)
    found = find_vehicle(STATED, training, SEARCH, np.random.default_rng(seed), _silent)
    chosen = found.choice.chosen.structure.blocks
    more, missed = ([b for b in one if b not in other] for one, other in ((chosen, TRUE_BLOCKS), (TRUE_BLOCKS, chosen)))
    return str(seed), ", ".join(more) or "none", ", ".join(missed) or "none", f"{ratio(found.model, judging)[3]:.3f}"


def _silent(known: Sequence[Judged], total: int) -> None:
    if len(known) % 10 == 0:
        best = min(each.error for each in known)
        print(f"{len(known)} of about {total}, smallest error {best:.4f}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    asked = [int(text) for text in sys.argv[1:3]]
    main(*asked, *(20, 2)[len(asked) :])
