"""The terms of a batch of flights; each module adds its own."""

from __future__ import annotations

from . import body_terms, gusts, pybullet_terms, rotor_terms, strange_terms  # noqa: F401
from .instant import Term

STAGES = ("thrust", "hub", "body", "coupled")


def build(flights):
    """Make the terms of a batch, sorted by stage.

    ``flights`` holds, per flight, its vehicle, a dict of hidden effects and a function giving a fresh generator.
    """
    by_stage = {stage: [] for stage in STAGES}
    for name, kind in Term.kinds.items():
        rows = [row for row, flight in enumerate(flights) if name in flight.hidden]
        if rows:
            parameters = [flights[row].hidden[name] for row in rows]
            vehicles = [flights[row].vehicle for row in rows]
            rngs = [flights[row].generator(name) for row in rows]
            by_stage[kind.stage].append(kind(rows, parameters, vehicles, rngs))
    return by_stage
