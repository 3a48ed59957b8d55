"""19,350 free runs of 50 steps by the compiled loops, and the same in NumPy over all windows at once; one core.

The flights are simulated (tests/builders/playback_flights.py): three of 65 s at 100 Hz, run from every sample. Times
are processor times and hold the weights of each sample as well as the runs; code is compiled before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.shared.measure import in_turn, program, seconds, table
from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.playback.flight import PlaybackFlight
from cpfls_cli.playback.groups import JointNumbers
from cpfls_cli.playback.table import Airflow
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.motion import State
from cpfls_cli.playback.parameters import LEARNED, FreeNumbers, blocks_of
from cpfls_cli.playback.player import Player, free_runs, player_of, rotation_vectors
from cpfls_cli.playback.replay import Played, replay
from cpfls_cli.rotations import turns
from tests.builders.playback_flights import KINDS, MIDDLING, STATED, flown, truth

HORIZON = 50
BLOCKS = tuple(block for block in blocks_of(STATED) if block not in LEARNED)
RULES = Airflow(np.linspace(0.0, 1.0, 4), 4)
"""Three rules of fourth order: 54 terms beside the 34 of the effects."""

Along = Sequence[tuple[Player, PlaybackFlight]]


def main() -> None:
    flights = flown(truth(), KINDS, duration_s=65.0, noise=MIDDLING, seed=1)
    rows = [(name, *timed(along)) for name, along in players(flights).items()]
    print(f"{len(starts(flights[0])) * len(flights)} windows x {HORIZON} steps, processor time on one core:\n")
    columns = "model | terms in use | NumPy, s | compiled, s | times faster (range) | largest difference"
    table("replay", columns, rows)
    stated, model = VehicleModel(vehicle=STATED), drawn(BLOCKS)
    played = [Played(flight, player_of(model, flight), player_of(stated, flight)) for flight in flights]
    whole = min(seconds(lambda: replay(played, HORIZON, 1)) for _ in range(3))
    print(f"\nAll four predictions with means and sizes, as `cpfls replay` makes them, all effects: {whole:.2f} s")


def players(flights: Sequence[PlaybackFlight]) -> dict[str, Along]:
    """Make models ready: rotors alone, what flew, all effects, with a remainder, and with no weight of 0."""
    models = {
        "rotors alone": VehicleModel(vehicle=STATED),
        "what flew": truth(),
        "all effects": drawn(BLOCKS),
        "all effects and a remainder": drawn((*BLOCKS, *LEARNED)),
    }
    along = {name: [(player_of(model, flight), flight) for flight in flights] for name, model in models.items()}
    last, rng = list(along.values())[-1], np.random.default_rng(2)
    table = last[0][0].table
    noise = 1e-9 * abs(table.weights).max() * rng.standard_normal(table.weights.shape)
    full = replace(table, weights=table.weights + noise)
    along["every term in every row"] = [(replace(player, table=full), at) for player, at in last]
    return along


def drawn(blocks: tuple[str, ...]) -> VehicleModel:
    """Draw numbers near the stated ones, none of them 0."""
    free = JointNumbers(FreeNumbers(STATED, blocks, RULES))
    away = 0.05 * free.scales * abs(np.random.default_rng(1).standard_normal(len(free.numbers)))
    return free.at(np.clip(free.starts + away, free.lows, free.highs)).model


def timed(along: Along) -> tuple:
    """Time both ways in turn; the difference of their errors is a share of the largest error."""
    compiled, reference = by_loops(along), by_numpy(along)
    away = max(abs(one - other).max() for one, other in zip(compiled, reference, strict=True))
    times = in_turn(partial(by_numpy, along), partial(by_loops, along))
    used, _ = along[0][0].step_weights(slice(0, 1))
    size = max(abs(errors).max() for errors in reference)
    return len(used.active), times.slow_s, times.fast_s, times.range, float(away / size)


def starts(flight: PlaybackFlight) -> IntArray:
    return flight.starts(HORIZON, 1)


def by_loops(along: Along) -> list[Array]:
    return [free_runs(player, flight, starts(flight), HORIZON).errors for player, flight in along]


def by_numpy(along: Along) -> list[Array]:
    return [_NumpyRuns(player, flight).errors() for player, flight in along]


class _NumpyRuns:
    """All windows of a flight side by side, with the weights of each sample evaluated once."""

    def __init__(self, player: Player, flight: PlaybackFlight) -> None:
        self.player, self.flight, self.starts = player, flight, starts(flight)
        self.used, self.weights = player.step_weights(slice(0, len(flight)))

    def errors(self) -> Array:
        motion = self.flight.motion
        state = State(*(values[self.starts] for values in motion[:4]))
        errors = np.empty((len(self.starts), HORIZON, 4, 3))
        for step in range(HORIZON):
            state, at = self.moved(state, self.weights[self.starts + step]), self.starts + step + 1
            errors[:, step, 0] = state.position - motion.position[at]
            errors[:, step, 1] = state.velocity - motion.velocity[at]
            errors[:, step, 2] = rotation_vectors(motion.rotation[at], state.rotation)
            errors[:, step, 3] = state.rate - motion.rate[at]
        return errors

    def moved(self, start: State, weights: Array) -> State:
        """Take one step of the midpoint rule."""
        h = self.flight.motion.period
        linear, angular = self.accelerations(start, weights)
        middle = State(
            start.position,
            start.velocity + 0.5 * h * linear,
            start.rotation @ turns(0.5 * h * start.rate),
            start.rate + 0.5 * h * angular,
        )
        linear, angular = self.accelerations(middle, weights)
        return State(
            start.position + h * middle.velocity,
            start.velocity + h * linear,
            start.rotation @ turns(h * middle.rate),
            start.rate + h * angular,
        )

    def accelerations(self, at: State, weights: Array) -> tuple[Array, Array]:
        body = self.player.body
        air = (at.velocity[:, None] @ at.rotation)[:, 0]
        terms = self.player.table.terms(air, at.rate)[:, self.used.active]
        wrench = (weights @ terms[:, :, None])[:, :, 0]
        linear = (at.rotation @ wrench[:, 3:, None])[:, :, 0] / body.mass - [0.0, 0.0, body.gravity]
        return linear, (wrench[:, :3] - np.cross(at.rate, at.rate @ body.inertia)) @ body.inverse


if __name__ == "__main__":
    program(main)
