"""A disagreement for people and for machines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cpfls_cli.artifacts.audit_file import audit_lines, audit_summary
from cpfls_cli.flights.recordings import Flights
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.compare import Disagreement
from cpfls_cli.gap.replay import Replayed
from cpfls_cli.pages.gap_words import whole_percent

_STRETCHES = 3
_SIGNALS = 3
_SIGNIFICANT = 0.05
_LEAST_SHARE = 1e-3
UNITS = ("N m",) * 3 + ("N",) * 3
"""Unit of each channel."""


def disagreement_lines(found: Disagreement, given: Flights) -> list[str]:
    """Say where a model and flights disagree."""
    return [
        *where_lines(found, given),
        *replay_lines("simulated from the measured rotors", found.replayed, found.held),
        *unseen_lines((each.name, each.reason) for each in found.not_excited),
        *audit_lines(found.audit),
    ]


def where_lines(found: Disagreement, given: Flights) -> Iterator[str]:
    """Say on which axis, when and with which signal a model and flights disagree."""
    yield from (_channel_line(found, place) for place in range(len(CHANNELS)) if np.isfinite(found.rms[place]))
    yield from _stretch_lines(found, given)
    yield from _signal_lines(found)


def disagreement_summary(found: Disagreement, given: Flights) -> dict[str, Any]:
    """Describe a disagreement for machines."""
    names = [recording.name for recording in given.recordings]
    return {
        "flights": names,
        "gap": {
            **gap_summary(found.rms, found.floors),
            "share": [float(share) for share in found.rms / found.activity],
        },
        "stretches": [{**stretch._asdict(), "flight": names[stretch.flight]} for stretch in found.stretches],
        "dependence": [one._asdict() for one in found.dependence],
        "heat_map": None
        if found.worst is None
        else {"channel": found.worst.channel, "signals": list(found.worst.signals)},
        "replay": replay_summary(found.held, model=found.replayed, held=found.held),
        "not_excited": [vars(each) for each in found.not_excited],
        "audit": audit_summary(found.audit),
        "warnings": list(given.warnings),
    }


def gap_summary(value: np.ndarray, floors: np.ndarray) -> dict[str, Any]:
    """Describe the gap of each channel for machines.

    Parameters
    ----------
    value : array, shape (6,), N m and N
    floors : array, shape (6,)

    Returns
    -------
    dict
        Lists over x, y, z; not finite where unknown.
    """
    return {
        "torque_n_m": [float(v) for v in value[:3]],
        "floors": [float(v) for v in floors[:3]],
        "force_n": [float(v) for v in value[3:]],
        "force_floors": [float(v) for v in floors[3:]],
    }


def replay_summary(clock: Replayed, **models: Replayed) -> dict[str, Any]:
    """Describe replays for machines.

    Parameters
    ----------
    clock : Replayed
        Gives the horizons.
    **models : Replayed
        By name.
    """
    rates = {f"rate_{name}_rad_s": model.rate.tolist() for name, model in models.items()}
    attitudes = {f"attitude_{name}_rad": model.attitude.tolist() for name, model in models.items()}
    return {"horizon_s": clock.horizon_s.tolist(), **rates, **attitudes}


def unseen_lines(unseen: Iterator[tuple[str, str]]) -> Iterator[str]:
    """Say which effects could be there unseen, those of one reason together.

    Parameters
    ----------
    unseen : iterator of (str, str)
        Names and reasons.
    """
    reasons: dict[str, list[str]] = {}
    for name, reason in unseen:
        reasons.setdefault(reason, []).append(name)
    for reason, names in reasons.items():
        yield f"cannot be seen: {', '.join(names)}: {reason}"


def replay_lines(what: str, model: Replayed, held: Replayed) -> Iterator[str]:
    """Say how far a simulation is off at its longest horizon; nothing of flights without rates."""
    # Rates that never change are those of a log that has none.
    if not held.rate.any():
        return
    rate, still = (" ".join(f"{value:.2g}" for value in each.rate[-1]) for each in (model, held))
    after = f"after {model.horizon_s[-1]:.2g} s the rates are off by {rate} rad/s (x y z)"
    yield f"{what}: {after}; if they stayed what they were, by {still}"


def _channel_line(found: Disagreement, place: int) -> str:
    floors, share = found.floors[place], found.rms[place] / found.activity[place]
    size = f"{found.rms[place]:.3g} {UNITS[place]}, {floors:.2g} times the noise floor"
    size_of = f"{share:.1%}" if share >= _LEAST_SHARE else f"less than {_LEAST_SHARE:.1%}"
    part = f", {size_of} of what moves it" if np.isfinite(share) else ""
    return f"{CHANNELS[place]}: gap {size}{part}{'' if floors > 1.5 else ': nothing above noise'}"


def _stretch_lines(found: Disagreement, given: Flights) -> Iterator[str]:
    for stretch in found.stretches[:_STRETCHES]:
        name = given.recordings[stretch.flight].name
        size = f"{stretch.rms_floors:.2g} floors"
        yield f"largest in {name} from {stretch.start_s:.1f} s to {stretch.end_s:.1f} s: {stretch.channel}, {size}"


def _signal_lines(found: Disagreement) -> Iterator[str]:
    for place, channel in enumerate(CHANNELS):
        own = [d for d in found.dependence if d.channel == channel and d.p_value < _SIGNIFICANT and d.r2 > 0]
        if own and found.floors[place] > 1:
            best = ", ".join(f"{d.signal} ({whole_percent(d.r2)})" for d in own[:_SIGNALS])
            yield f"{channel} follows {best}"
