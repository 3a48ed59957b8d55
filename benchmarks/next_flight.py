"""Settle what a diagnosis leaves open by one more flight: the planned one, a random one, or the one of the advice.

Flights of the own simulator hide one effect; those whose diagnosis is AMBIGUOUS between it and a rival are kept, half
of the sets with each of two seeds. One more flight of 30 s goes to those that train, and the diagnosis is made again.
"""

from __future__ import annotations

import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain

import numpy as np

from benchmarks.blind.vehicles import HUMMINGBIRD, SIXKG, XQUAD
from benchmarks.gap import vehicle_of
from benchmarks.shared.measure import program, progress, table
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import CpflsError, SettingError
from cpfls_cli.gap.balance.weak_flight import Preparation
from cpfls_cli.gap.diagnose import DiagnosisRun, diagnose
from cpfls_cli.gap.naming.ranking import best_floor
from cpfls_cli.gap.next_flight.rivals import Question, SizedEffect, formulas_off, open_questions, physical_values, usual
from cpfls_cli.gap.next_flight.room import HarmonicPath, Room, room_of
from cpfls_cli.gap.next_flight.search import Logging, expected_floor, goal, next_flight, planned_signals
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.simulation.inverse import measure
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.trajectory.settings import NextFlightSettings, TrajectorySettings
from cpfls_cli.weak_form.windows import common_windows

SEEDS = (31, 47)
# A load on a cable costs as much as the rest of the catalogue, and its swing is no look-alike of a gentle flight.
SETTINGS = GapSettings(shifts=39, ignore=("payload",))
NOISE = {
    "attitude": 0.003, "body_rate": 0.005, "position": 0.02, "velocity": 0.05, "acceleration": 0.1, "rotor_speed": 1.0,
}  # fmt: skip
LOGGED = frozenset({"attitude", "position", "velocity", "acceleration"})
FIRST_S, NEXT_S, RATE_HZ = 20.0, 30.0, 200.0
WAYS = ("planned", "random", "advice")
# What a sentence of advice asks for: words in it, the axes to move (x, y, z, yaw), and at which frequencies in Hz.
# Two neighbouring frequencies swell and fade: the same motion at several amplitudes.
MANOEUVRES = (
    (("climb", "descen", "thrust", "above the ground"), ((2, (0.1, 0.3)),)),
    (("legs", "speed", "forward", "fast", "opposite"), ((0, (0.07, 0.2)), (1, (0.1, 0.17)))),
    (("amplitude", "sweep", "rate", "roll", "tilt"), ((0, (0.7, 0.77)), (1, (0.83, 0.9)))),
    (("yaw effort", "slow with fast yaw"), ((3, (0.4, 0.5)),)),
    (("yaw",), ((3, (0.07, 0.1)),)),
    (("stop", "swing"), ((0, (0.1, 0.13)), (1, (0.1,)))),
)
SHARES = (0.3, 0.6, 1.0)


@dataclass(frozen=True)
class OpenSet:
    """Flights whose diagnosis cannot tell the hidden effect from a rival."""

    hidden: SizedEffect
    rival: str
    advice: str
    room: Room
    flights: tuple[Signals, Signals]
    diagnosis: DiagnosisRun


def main(sets: int = 40) -> None:
    rows, totals, expected = [], {way: Counter() for way in WAYS}, {way: [] for way in WAYS}
    with ProcessPoolExecutor(len(SEEDS)) as pool:
        of_seeds = list(pool.map(settled, SEEDS, [sets // len(SEEDS)] * len(SEEDS)))
    for hidden, rival, outcomes in chain(*of_seeds):
        for way, (outcome, sure) in outcomes.items():
            totals[way][outcome.partition(":")[0]] += 1
            expected[way].append(sure)
        rows.append((hidden, rival, *(f"{outcome} ({sure:.2f})" for outcome, sure in outcomes.values())))
    table("next-flight-sets", ("hidden", "rival", *(f"{way} (predicted)" for way in WAYS)), rows)
    summary = [
        (way, *(f"{counts[kind]} of {counts.total()}" for kind in ("right", "wrong", "open")), np.mean(expected[way]))
        for way, counts in totals.items()
    ]
    table("next-flight", "one more flight of 30 s | right | wrong | open | predicted share right", summary)


def settled(seed: int, count: int) -> list[tuple[str, str, dict[str, tuple[str, float]]]]:
    """Settle the sets of a seed: hidden effect, its rival, and the outcome of each way."""
    found = []
    for number, opened in enumerate(open_sets(seed, count)):
        outcomes = settle(opened, np.random.default_rng([seed, number, 1]))
        found.append((opened.hidden.candidate.effect.name, opened.rival, outcomes))
        progress([seed, number, *found[-1]])
    return found


def open_sets(seed: int, count: int):
    """Fly sets until enough of them are ambiguous, as many as can be of different pairs."""
    rng = np.random.default_rng(seed)
    pairs = [
        (name, rival)
        for name, effect in CATALOGUE.items()
        for rival in effect.rivals
        if effect.kind == CATALOGUE[rival].kind == "wrench" and not {name, rival} & set(SETTINGS.ignore)
    ]
    found, tried = 0, Counter()
    while found < count:
        for index in rng.permutation(len(pairs)):
            if found == count:
                return
            opened = ambiguous(*pairs[index], rng)
            tried[opened is not None] += 1
            print("   tried", *pairs[index], "none" if opened is None else "open", file=sys.stderr, flush=True)
            if opened is not None:
                found += 1
                yield opened


def ambiguous(name: str, rival: str, rng: np.random.Generator) -> OpenSet | None:
    """Fly gently with an effect; None where the diagnosis is sure, or not sure of anything."""
    craft = (SIXKG, HUMMINGBIRD, XQUAD)[rng.integers(3)]
    vehicle = vehicle_of(craft)
    settings = TrajectorySettings(
        path="next-flight", duration_s=NEXT_S, next_flight=NextFlightSettings(starts=20, iterations=120)
    )
    room = room_of(settings, vehicle, 0.0, 0.02)
    short = replace(room, settings=replace(settings, duration_s=FIRST_S))
    moved = rng.random(4) < 0.6

    def gentle() -> HarmonicPath:
        return short.drawn(rng).scaled(np.where(moved, rng.choice(SHARES), 0.02))

    first, floor = gentle(), floor_of(craft)
    logging = Logging(LOGGED, False, floor, SETTINGS)
    weak = logging.weak(planned_signals(short.planned(first), short, logging))
    hidden = usual(CATALOGUE[name], vehicle)
    apart, seen = (
        float(logging.gathered(Question(hidden, other), [weak]).left.sum()) for other in (CATALOGUE[rival], None)
    )
    size = rng.uniform(1.5, 5.0) * np.sqrt(len(weak) * weak.known.sum() / 6 / max(seen, 1e-9))
    # Flights that cannot carry the effect, or that tell it from the rival without doubt, are no open sets.
    if size > 2.0 or apart * size**2 > 60 or hidden.candidate.effect.unit_coefficient:
        return None
    hidden = replace(hidden, linear=hidden.linear * size)
    paths = {"training": first, "held out": gentle()}
    try:
        flights = tuple(fly(short, path, hidden, rng, path_name) for path_name, path in paths.items())
        run = diagnose(flights[:1], flights[1:], SETTINGS, rng)
    except (CpflsError, SettingError):
        return None
    diagnosis = run.diagnosis
    named = {effect.name for effect in diagnosis.effects}
    rivals = [a for a in diagnosis.alternatives if name in (a.name, a.instead_of)]
    # What was not tried for want of a signal is settled by logging it.
    if any(np.isnan(rival.relative_gain) for rival in diagnosis.alternatives):
        return None
    if str(diagnosis.verdict) != "AMBIGUOUS" or not rivals or not named <= {name, *(a.instead_of for a in rivals)}:
        return None
    other = rivals[0].instead_of if rivals[0].name == name else rivals[0].name
    return OpenSet(hidden, other, rivals[0].separated_by, room, flights, run)


@cache
def floor_of(craft) -> np.ndarray:
    """Find the noise floor of its logs."""
    settings = TrajectorySettings(path="next-flight", duration_s=NEXT_S)
    noise = SimulationSettings(mode="closed-loop", noise=NOISE)
    room = room_of(settings, vehicle_of(craft), 0.0, 0.02)
    return expected_floor(room, Logging(LOGGED, False, np.ones(6), SETTINGS), noise, 0.01, np.random.default_rng(1))


def fly(room: Room, path: HarmonicPath, hidden: SizedEffect, rng: np.random.Generator, name: str) -> Signals:
    """Fly a path in closed loop with the hidden effect, and log it with noise."""
    planned = room.planned(path, 0.01)
    effects = {hidden.candidate.effect.name: physical_values(hidden)}
    loop = SimulationSettings(
        mode="closed-loop", noise=NOISE, closed_loop=ClosedLoopSettings(effects=effects, integration_rate_hz=RATE_HZ)
    )
    logged = measure(planned.time, vars(planned), room.vehicle, loop, rng).signals
    signals = {name: logged[name] for name in NOISE}
    return Signals(time=planned.time, vehicle=room.vehicle, **signals, name=name)


def settle(opened: OpenSet, rng: np.random.Generator) -> dict[str, tuple[str, float]]:
    """Fly one more flight in each way; the outcome, and the probability that was predicted for a right one."""
    diagnosis, training = opened.diagnosis.diagnosis, opened.flights[:1]
    prepared = Preparation(common_windows(training, SETTINGS), None, SETTINGS, opened.diagnosis.audit)
    weak = prepared.repaired(training)
    floor = best_floor(opened.diagnosis.hypothesis)
    off = formulas_off(opened.diagnosis.hypothesis, floor)
    questions = open_questions(diagnosis.effects, diagnosis.alternatives, (), weak, floor, SETTINGS)
    asked = goal(questions, weak, opened.room, Logging(LOGGED, False, floor, SETTINGS, None, off))
    found = next_flight(asked, rng)
    paths: dict[str, HarmonicPath] = {
        "planned": found.path,
        "random": opened.room.drawn(rng),
        "advice": advised(opened.advice, opened.room),
    }
    return {way: outcome(opened, asked, path, rng) for way, path in paths.items()}


def outcome(opened: OpenSet, asked, path: HarmonicPath, rng: np.random.Generator) -> tuple[str, float]:
    """Fly, diagnose again with the flight among those that train, and judge by the hidden effect."""
    name, room = opened.hidden.candidate.effect.name, opened.room
    answers = asked.answers(planned_signals(room.planned(path), room, asked.logging))
    more = fly(room, path, opened.hidden, rng, "next")
    pairs = zip(asked.questions, answers, strict=True)
    sure = min([a.sure for q, a in pairs if q.true.candidate.effect.name == name], default=0.0)
    diagnosis = diagnose([*opened.flights[:1], more], opened.flights[1:], SETTINGS, rng).diagnosis
    names = [effect.name for effect in diagnosis.effects]
    if str(diagnosis.verdict) == "NAMED":
        return ("right" if names == [name] else f"wrong: {' '.join(names)}"), sure
    left = [f"or {rival.name}" for rival in diagnosis.alternatives]
    return " ".join([f"open: {diagnosis.verdict}", *names, *left]), sure


def advised(advice: str, room: Room) -> HarmonicPath:
    """Fly what a sentence of advice asks for, as far as the room allows."""
    frequencies: dict[int, list[float]] = {}
    for words, moves in MANOEUVRES:
        if any(word in advice for word in words):
            for axis, hertz in moves:
                frequencies.setdefault(axis, []).extend(hertz)
    width = max(3, *(len(hertz) for hertz in frequencies.values())) if frequencies else 3
    order = np.tile(np.arange(1, width + 1), (4, 1))
    cosine, sine = np.zeros((2, 4, width))
    for axis, hertz in frequencies.items():
        order[axis, : len(hertz)] = np.round(np.array(hertz) * NEXT_S)
        sine[axis, : len(hertz)] = 1 / np.array(hertz)
    path = HarmonicPath(np.zeros(4), order, cosine, sine, NEXT_S)
    for axis in range(4):
        alone = room.fitted(path.scaled(np.arange(4) == axis))
        path = replace(path, sine=np.where(np.arange(4)[:, None] == axis, alone.sine, path.sine))
    return room.fitted(path)


if __name__ == "__main__":
    program(main)
