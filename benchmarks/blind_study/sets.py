"""Which flights a study judges: cases with a size and a kind of noise, under names that tell nothing."""

from __future__ import annotations

import hashlib
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from benchmarks.blind.cases import Case, cases, in_air, make
from benchmarks.blind.measure import KINDS
from benchmarks.blind.vehicles import STUDIED, VEHICLES

LEVELS = ("low", "mid", "high")
GROUPS = (
    "single", "none", "outside", "form", "pair", "triple", "background", "hover", "no_velocity", "no_force",
    "lacking", "drag_factor", "attack", "differing", "pybullet",
)  # fmt: skip


@dataclass(frozen=True)
class Size:
    """How much of a study is flown.

    ``none`` is the number of sets that hide nothing, all of them if None; ``each`` the largest number of cases of some
    groups, with as many different things hidden as the group has. Each case is flown in gusts of each level with each
    of the instruments, or ``in_turn`` with one of these pairs alone, which are dealt out by chance.
    """

    seed: int
    draws: int = 6
    levels: Sequence[str] = LEVELS
    kinds: Sequence[str] = KINDS
    groups: Sequence[str] = GROUPS
    none: int | None = None
    vehicles: Sequence[str] = tuple(VEHICLES)
    each: Mapping[str, int] = field(default_factory=dict)
    gusts: Sequence[int] = (0,)
    instruments: Sequence[str] = ("none",)
    in_turn: bool = False


@dataclass(frozen=True)
class Set:
    """The flights of a case under one noise."""

    case: Case
    level: str
    kind: str
    seed: int

    @property
    def name(self):
        """Name of its folder, from which nobody can guess what is hidden."""
        described = f"{self.seed} {self.case.name} {self.level} {self.kind}"
        if not self.case.usual:
            described += f" {self.case.gusts} {self.case.instruments}"
        return hashlib.sha256(described.encode()).hexdigest()[:16]

    def generator(self):
        """Give the random numbers of its noise."""
        return np.random.default_rng([self.seed, *self.case.name.encode(), *f"{self.level} {self.kind}".encode()])


def sets(size):
    """List the sets of a study, those of a case in one air together."""
    own = [case for case in cases(size.seed, size.draws) if case.group in size.groups and case.vehicle in size.vehicles]
    noises = [(level, kind) for level in size.levels for kind in size.kinds]
    if size.none is not None and "none" in size.groups:
        own = [case for case in own if case.group != "none"]
    out = [[Set(case, level, kind, size.seed) for level, kind in noises] for case in own]
    if size.none is not None and "none" in size.groups:
        out += [[Set(_empty(place, size.seed), *noises[place % len(noises)], size.seed)] for place in range(size.none)]
    return [
        [replace(each, case=in_air(each.case, level, instruments, size.seed)) for each in own]
        for own, airs in _in_airs(_part(out, size), size)
        for level, instruments in airs
    ]


def _in_airs(groups, size):
    """Give each case the pairs of gusts and instruments that it is flown with."""
    airs = list(product(size.gusts, size.instruments))
    if not size.in_turn:
        return [(own, airs) for own in groups]
    dealt = np.random.default_rng(size.seed).permutation(np.arange(len(groups)) % len(airs))
    return [(own, [airs[place]]) for own, place in zip(groups, dealt, strict=True)]


def _part(groups, size):
    """Take some cases of each group: each effect, or fault of a log, once before any comes again."""
    order = np.random.default_rng(size.seed).permutation(len(groups))
    seen, ranked = Counter(), []
    for place in order:
        # Names of cases are GROUP-VEHICLE-WHAT...-DRAW.
        group, _, what, *_ = groups[place][0].case.name.split("-")
        ranked.append((seen[group, what], place))
        seen[group, what] += 1
    kept = defaultdict(list)
    # A stable sort keeps the order of chance within a rank.
    for _, place in sorted(ranked, key=lambda pair: pair[0]):
        group = groups[place][0].case.group
        if len(kept[group]) < size.each.get(group, len(groups)):
            kept[group].append(place)
    return [groups[place] for place in sorted(place for own in kept.values() for place in own)]


def _empty(place, seed):
    """Make a case that hides nothing, each one another flight."""
    plain = [(name, {}) for name in STUDIED]
    vehicle, options = [*plain, ("sixkg", {"ideal_command": True})][place % (len(plain) + 1)]
    name = f"none-{vehicle}-{place}"
    return make(name, "none", vehicle, (), np.random.default_rng([seed, *name.encode()]), **options)
