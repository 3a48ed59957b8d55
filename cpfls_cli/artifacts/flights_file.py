"""Flights inside the artifacts of the gap workflow: one after another, so that later stages need no other file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.config.study import Study
from cpfls_cli.effects.signals import Signals
from cpfls_cli.gap.balance.windows import Recording

_SIGNALS = (
    "attitude",
    "velocity",
    "position",
    "acceleration",
    "specific_force",
    "rotor_speed",
    "stated_torque",
    "stated_thrust",
    "voltage",
)


def flights_data(recordings: Sequence[Recording], roles: Sequence[str]) -> dict[str, Any]:
    """Arrange flights as datasets.

    Parameters
    ----------
    roles : sequence of str
        Of each: given, training or held-out.
    """
    lengths = [len(recording.signals) for recording in recordings]
    data: dict[str, Any] = {
        "flight/name": np.array([recording.name for recording in recordings]),
        "flight/role": np.array(roles),
        "flight/first": np.cumsum([0, *lengths[:-1]]),
        "flight/commanded": np.array([int(recording.signals.commanded) for recording in recordings]),
        "signals/time": np.concatenate([recording.signals.time for recording in recordings]),
        "signals/body_rate": np.concatenate([recording.signals.body_rate for recording in recordings]),
    }
    for name in _SIGNALS:
        joined = _joined([getattr(recording.signals, name) for recording in recordings], lengths)
        if joined is not None:
            data[f"signals/{name}"] = joined
    return data


def flights_of(artifact: Artifact, study: Study, *roles: str) -> list[Recording]:
    """Rebuild the flights that an artifact holds.

    Parameters
    ----------
    *roles : str
        Only these; all if none is named.
    """
    first = artifact.array("flight/first").astype(int)
    last = [*first[1:], len(artifact.array("signals/time"))]
    return [
        Recording(name, _signals(artifact, slice(start, stop), bool(commanded), study))
        for name, role, start, stop, commanded in zip(
            artifact.texts("flight/name"),
            artifact.texts("flight/role"),
            first,
            last,
            artifact.array("flight/commanded"),
            strict=True,
        )
        if not roles or role in roles
    ]


def _joined(parts: Sequence[Array | None], lengths: Sequence[int]) -> Array | None:
    shape = next((part.shape[1:] for part in parts if part is not None), None)
    if shape is None:
        return None
    filled = [
        np.full((length, *shape), np.nan) if part is None else part for part, length in zip(parts, lengths, strict=True)
    ]
    return np.concatenate(filled)


def _signals(artifact: Artifact, part: slice, commanded: bool, study: Study) -> Signals:
    there: dict[str, Any] = {
        name: artifact.array(f"signals/{name}")[part] for name in _SIGNALS if f"signals/{name}" in artifact.data
    }
    return Signals(
        time=artifact.array("signals/time")[part],
        body_rate=artifact.array("signals/body_rate")[part],
        vehicle=study.vehicle,
        commanded=commanded,
        ground_height_m=study.gap.ground_height_m,
        # A flight that lacks a signal lacks all of it.
        **{name: values for name, values in there.items() if np.isfinite(values).all()},
    )
