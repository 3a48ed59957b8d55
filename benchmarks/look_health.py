"""How often the intervals of `look` on balance, hover, battery and gusts cover the truth, on simulated flights.

Prints Markdown: share of draws whose 95 % interval holds the truth, and the mean half-width. A minute.
"""

import numpy as np

from cpfls_cli.look.balance import balance_of
from cpfls_cli.look.gusts import gusts_of
from cpfls_cli.look.hover import hover_of
from tests.builders.look_flights import CROSS, correlated, hovering, still_flight
from tests.unit.look import test_gusts as gusty
from tests.unit.look import test_hover as lifted
from tests.unit.look.test_balance import CURVE, EVEN

DRAWS = 200


def row(what, estimates, truth):
    known = [each for each in estimates if each is not None]
    inside = np.mean([each.low <= truth <= each.high for each in known])
    half = np.mean([each.half for each in known])
    print(f"| {what} | {truth:.3g} | {len(known)} | {inside:.3f} | {half:.3g} |")


def balances():
    share = 1 / 0.9 / ((3 + 1 / 0.9) / 4)
    for seconds in (20, 60, 240):
        for gusts in (0.005, 0.02, 0.05):
            found = [
                balance_of(hovering(EVEN, seed, seconds, gusts=gusts, weak={2: 0.9}, **CURVE)) for seed in range(DRAWS)
            ]
            row(f"share of a rotor of 90 %, {seconds} s, gusts {gusts}", [b.rotors[2].share for b in found], share)
    ahead = 0.04 / np.mean(CROSS[:, 0] ** 2) * CROSS[:, 0]
    turned = [
        balance_of(hovering(1 + ahead, seed, heading=lambda t: np.pi * (t > 30), wind=(0.06, 0.03), **CURVE))
        for seed in range(DRAWS)
    ]
    row("centre of mass forward, wind, half a turn", [b.fixed_forward for b in turned], 0.04)
    row("wind, half a turn", [b.wind for b in turned], np.hypot(0.06, 0.03))


def hovers():
    for memory in (0.5, 1.0, 3.0):
        found = []
        for seed in range(DRAWS):
            noise = correlated(np.random.default_rng(seed), 1200, 20.0, memory)[:, 0]
            found.append(hover_of(still_flight(60.0, 20.0, collective=0.4 + 0.02 * noise)).throttle)
        row(f"hover throttle, 60 s, gusts of {memory} s", found, 0.4)
    for exponent in (1.0, 1.5, 2.0):
        for gusts in (0.02, 0.1):
            shapes = [hover_of(lifted.climbing(seed, exponent, gusts=gusts)).shape for seed in range(DRAWS)]
            row(f"exponent of thrust, gusts {gusts}", [shape and shape.exponent for shape in shapes], exponent)
    batteries = [hover_of(lifted.battery(seed)).battery for seed in range(DRAWS)]
    row("resistance of the battery", [each.slope for each in batteries], 0.05)
    row("open-circuit voltage at the end", [each.open_circuit_end for each in batteries], 15.5)


def gusts():
    for memory in (0.15, 0.3, 1.0):
        plants = {"roll": gusty.PLANT}
        found = [gusts_of(gusty.gusty(seed, memory=memory), plants)[0] for seed in range(DRAWS // 2)]
        row(f"gusts of {memory} s, in the band", [each.in_band for each in found], gusty.in_band(3.0, memory))
        row(f"gusts of {memory} s, size", [each.size for each in found], 3.0)


def main() -> None:
    print("| what | truth | found | inside | half-width |\n|---|---|---|---|---|")
    balances()
    hovers()
    gusts()


if __name__ == "__main__":
    main()
