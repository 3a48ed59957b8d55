"""A disagreement as datasets."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpfls_cli.artifacts.audit_file import audit_data
from cpfls_cli.artifacts.tables import table, texts
from cpfls_cli.flights.recordings import Flights
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.compare import Disagreement, WorstChannel


def disagreement_data(found: Disagreement, given: Flights) -> dict[str, Any]:
    """Arrange a disagreement as datasets."""
    return {
        "gap/channel": np.array(CHANNELS),
        "gap/rms": found.rms,
        "gap/floor": found.floor,
        "gap/floors": found.floors,
        "gap/share": found.rms / found.activity,
        "residual/time": found.centres,
        "residual/flight": found.flight_index,
        "residual/value": found.residual,
        "state/name": texts(found.states),
        "state/value": np.column_stack(list(found.states.values())),
        **_stretches(found),
        **table("dependence", [d._asdict() for d in found.dependence], ("channel", "signal"), ("r2", "p_value")),
        **({} if found.worst is None else _heat_map(found.worst)),
        **_replay(found),
        **table("not_excited", [vars(each) for each in found.not_excited], ("name", "reason"), ()),
        **audit_data(found.audit),
        "warning": texts(given.warnings),
    }


def _stretches(found: Disagreement) -> dict[str, Any]:
    rows = [
        {"flight": s.flight, "start": s.start_s, "end": s.end_s, "channel": s.channel, "floors": s.rms_floors}
        for s in found.stretches
    ]
    return table("stretch", rows, ("channel",), ("flight", "start", "end", "floors"))


def _replay(found: Disagreement) -> dict[str, Any]:
    return {
        "replay/horizon": np.arange(1, len(found.held.horizon_s) + 1),
        "replay/horizon_s": found.held.horizon_s,
        "replay/rate_model": found.replayed.rate,
        "replay/rate_held": found.held.rate,
        "replay/attitude_model": found.replayed.attitude,
        "replay/attitude_held": found.held.attitude,
    }


def _heat_map(worst: WorstChannel) -> dict[str, Any]:
    first, second = worst.heat_map.edges
    return {
        "heat_map/channel": np.array(worst.channel),
        "heat_map/signal": np.array(worst.signals),
        "heat_map/first_edge": first,
        "heat_map/second_edge": second,
        "heat_map/mean": worst.heat_map.mean,
        "heat_map/count": worst.heat_map.count,
    }
