"""Step after step: a traced step with what it keeps for the next, as what acts between command and rotor does."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from math import exp
from typing import NamedTuple

import numpy as np

from cpfls_cli.filters import SecondOrder
from cpfls_cli.vehicle.tracing import SYMBOLS, Graph, Symbol, traced
from cpfls_cli.vehicle.values import Each, Functions, Value, plus, times

Flat = tuple[float, ...]


class RotorMotion(NamedTuple):
    """Rotors in the middle of a step.

    Attributes
    ----------
    speed, acceleration : value by rotor, rad/s and rad/s^2
    """

    speed: Value
    acceleration: Value


@dataclass
class Kept:
    """Values of the step before, those at the first step, and those for the next."""

    values: tuple[Symbol, ...]
    start: Flat
    after: tuple[Value, ...] = ()

    def keep(self, values: Iterable[Value]) -> None:
        """Say what the next step finds."""
        self.after = tuple(values)


class Memory:
    """What a step keeps, while it is traced.

    Parameters
    ----------
    graph : Graph
    step : float, s
        From step to step.
    """

    functions: Functions = SYMBOLS

    def __init__(self, graph: Graph, step: float) -> None:
        self.graph, self.step = graph, step
        (self.number,) = graph.inputs("number", 1)
        """Steps done so far."""
        self.kept: list[Kept] = []
        self.lines: list[tuple[int, tuple[Value, ...], tuple[Symbol, ...]]] = []

    @property
    def first(self) -> Value:
        """Whether it is the first step."""
        return self.number < 0.5

    def recall(self, start: Iterable[float]) -> Kept:
        """Give what was kept; `Kept.keep` has to follow."""
        values = tuple(map(float, start))
        one = Kept(self.graph.inputs(f"kept{len(self.kept)}_", len(values)), values)
        self.kept.append(one)
        return one

    def lagged(self, wanted: Value, ratio: float, start: Iterable[float]) -> Value:
        """Put values by rotor behind a first-order lag, exactly for what stays the same during each step.

        Parameters
        ----------
        ratio : float
            Time constant in steps; 0 for none.
        start : iterable of float

        Returns
        -------
        value by rotor
            In the middle of the step.
        """
        if ratio == 0:
            return wanted
        kept = self.recall(start)
        behind = Each(kept.values) - wanted
        kept.keep(wanted + exp(-1 / ratio) * behind)
        return wanted + exp(-0.5 / ratio) * behind

    def passed(self, section: SecondOrder, now: Value, settled: Value) -> Value:
        """Filter a value that had settled before the first step."""
        (a0, a1, a2), (_, b1, b2) = section.over.tolist(), section.under.tolist()
        kept = self.recall((0.0, 0.0))
        begin = (times(each, settled) for each in section.settled(np.ones(())).tolist())
        one, two = (self.functions.where(self.first, *pair) for pair in zip(begin, kept.values, strict=True))
        out = plus(times(a0, now), one)
        kept.keep((plus(times(a1, now), times(-b1, out), two), plus(times(a2, now), times(-b2, out))))
        return out

    def filtered(self, section: SecondOrder, rotors: RotorMotion) -> RotorMotion:
        """Filter rotors, which were settled before the first step."""
        return RotorMotion(
            Each(self.passed(section, each, each) for each in rotors.speed),
            Each(self.passed(section, each, 0.0) for each in rotors.acceleration),
        )

    def delayed(self, rotors: RotorMotion, steps: float) -> RotorMotion:
        """Delay rotors in straight lines; before the first have arrived they keep their speed."""
        if steps == 0:
            return rotors
        whole = int(steps)
        now = (*rotors.speed, *rotors.acceleration)
        count, place = len(now) // 2, len(self.lines)
        before = self.graph.inputs(f"late{place}_", (2 if whole else 1) * len(now))
        self.lines.append((whole, now, before))
        older, newer = before[: len(now)], before[len(now) :] if whole else now
        kept = self.recall([0.0] * count)
        held = [self.functions.where(self.first, *each) for each in zip(now[:count], kept.values, strict=True)]
        kept.keep(held)
        share, arrived = steps - whole, self.number > whole + 0.5
        moved = [plus((1 - share) * new, share * old) for old, new in zip(older, newer, strict=True)]
        held += [0.0] * count
        values = [self.functions.where(arrived, *each) for each in zip(moved, held, strict=True)]
        return RotorMotion(Each(values[:count]), Each(values[count:]))


@dataclass
class Machine:
    """A traced step with what it keeps.

    Attributes
    ----------
    kept : tuple of float
        What the next step finds, in the order in which it was recalled.
    """

    step: Callable[..., tuple[tuple[float, ...], ...]]
    kept: Flat
    lines: list[list[Flat]] = field(default_factory=list)
    whole: tuple[bool, ...] = ()
    number: int = 0

    @classmethod
    def of(
        cls, build: Callable[[Memory, tuple[Symbol, ...]], Iterable[Value]], given: int, step: float = 1.0
    ) -> Machine:
        """Trace a step.

        Parameters
        ----------
        build : callable
            From a memory and what is given to what comes out.
        given : int
            Numbers that are given at each step.
        step : float, s
            From step to step.
        """
        graph = Graph()
        memory, inputs = Memory(graph, step), graph.inputs("given", given)
        out = tuple(build(memory, inputs))
        kept, lines = memory.kept, memory.lines
        arguments = {
            "number": (memory.number,),
            "kept": [symbol for one in kept for symbol in one.values],
            "given": inputs,
            "late": [symbol for *_, before in lines for symbol in before],
        }
        after = [value for one in kept for value in one.after]
        function = traced(graph, arguments, [after, out, *(now for _, now, _ in lines)])
        begin = [[(0.0,) * len(now)] * (whole + 1) for whole, now, _ in lines]
        return cls(
            function, tuple(x for one in kept for x in one.start), begin, tuple(whole > 0 for whole, *_ in lines)
        )

    def advance(self, given: Flat) -> Flat:
        """Take a step, and give what comes out."""
        number = self.number
        late: Flat = ()
        for line, whole in zip(self.lines, self.whole, strict=True):
            # As many stand before the first as the delay has whole steps, and one.
            late += line[number] + line[number + 1] if whole else line[number]
        self.kept, out, *now = self.step((number,), self.kept, given, late)
        for line, values in zip(self.lines, now, strict=True):
            line.append(values)
        self.number = number + 1
        return out
