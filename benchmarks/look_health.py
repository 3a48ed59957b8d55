"""How often the intervals of `look` on balance, hover, battery and gusts hold the truth, on simulated flights."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.shared.measure import program, table
from cpfls_cli.look.answers import gusts_of
from cpfls_cli.look.balance import balance_of
from cpfls_cli.look.hover import hover_of
from tests.builders.look_flights import CROSS, correlated, hovering, still_flight
from tests.unit.look import test_gusts as gusty
from tests.unit.look import test_hover as lifted
from tests.unit.look.test_balance import CURVE, EVEN


def main(draws: int = 200) -> None:
    rows = []
    for what, truth, estimates in (*_balances(range(draws)), *_hovers(range(draws)), *_gusts(range(draws // 2))):
        known = [(each.low, each.high, each.half) for each in estimates if each is not None]
        low, high, half = np.array(known).reshape(-1, 3).T
        inside = np.sum((low <= truth) & (truth <= high)) / max(len(known), 1)
        rows.append((what, float(truth), len(known), inside, np.sum(half) / max(len(known), 1)))
    table("look_health", "what | truth | found | inside | half-width", rows)


def _balances(seeds: range) -> Iterator[tuple]:
    share = 1 / 0.9 / ((3 + 1 / 0.9) / 4)
    for seconds in (20, 60, 240):
        for gusts in (0.005, 0.02, 0.05):
            flights = (hovering(EVEN, seed, seconds, gusts=gusts, weak={2: 0.9}, **CURVE) for seed in seeds)
            found = [balance_of(flight).rotors[2].share for flight in flights]
            yield f"share of a rotor of 90 %, {seconds} s, gusts {gusts}", share, found
    ahead = 1 + 0.04 / np.mean(CROSS[:, 0] ** 2) * CROSS[:, 0]
    turn = {"heading": lambda time: np.pi * (time > 30), "wind": (0.06, 0.03), **CURVE}
    turned = [balance_of(hovering(ahead, seed, **turn)) for seed in seeds]
    yield "centre of mass forward, wind, half a turn", 0.04, [each.fixed_forward for each in turned]
    yield "wind, half a turn", np.hypot(0.06, 0.03), [each.wind for each in turned]


def _hovers(seeds: range) -> Iterator[tuple]:
    for memory in (0.5, 1.0, 3.0):
        noises = (correlated(np.random.default_rng(seed), 1200, 20.0, memory)[:, 0] for seed in seeds)
        found = [hover_of(still_flight(60.0, 20.0, collective=0.4 + 0.02 * noise)).throttle for noise in noises]
        yield f"hover throttle, 60 s, gusts of {memory} s", 0.4, found
    for exponent in (1.0, 1.5, 2.0):
        for gusts in (0.02, 0.1):
            shapes = [hover_of(lifted.climbing(seed, exponent, gusts=gusts)).shape for seed in seeds]
            yield f"exponent of thrust, gusts {gusts}", exponent, [shape and shape.exponent for shape in shapes]
    batteries = [hover_of(lifted.battery(seed)).battery for seed in seeds]
    yield "resistance of the battery", 0.05, [each.slope for each in batteries]
    yield "open-circuit voltage at the end", 15.5, [each.open_circuit_end for each in batteries]


def _gusts(seeds: range) -> Iterator[tuple]:
    for memory in (0.15, 0.3, 1.0):
        found = [gusts_of(gusty.gusty(seed, memory=memory), {"roll": gusty.PLANT})[0] for seed in seeds]
        yield f"gusts of {memory} s, in the band", gusty.in_band(3.0, memory), [each.in_band for each in found]
        yield f"gusts of {memory} s, size", 3.0, [each.size for each in found]


if __name__ == "__main__":
    program(main)
