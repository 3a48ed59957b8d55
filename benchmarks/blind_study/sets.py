"""Which flights a study judges: cases with a size and a kind of noise, under names that tell nothing."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.blind.cases import Case, cases, make
from benchmarks.blind.measure import KINDS
from benchmarks.blind.vehicles import VEHICLES

LEVELS = ("low", "mid", "high")
GROUPS = ("single", "none", "outside", "form", "pair", "triple", "background", "hover", "no_velocity", "no_force")


@dataclass(frozen=True)
class Size:
    """How much of a study is flown; ``none`` is the number of sets that hide nothing, all of them if None."""

    seed: int
    draws: int = 6
    levels: Sequence[str] = LEVELS
    kinds: Sequence[str] = KINDS
    groups: Sequence[str] = GROUPS
    none: int | None = None
    limit: int | None = None


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
        told = f"{self.seed} {self.case.name} {self.level} {self.kind}"
        return hashlib.sha256(told.encode()).hexdigest()[:16]

    def generator(self):
        """Give the random numbers of its noise."""
        return np.random.default_rng([self.seed, *self.case.name.encode(), *f"{self.level} {self.kind}".encode()])


def sets(size):
    """List the sets of a study, those of a case together.

    Parameters
    ----------
    size : Size

    Returns
    -------
    list of list of Set
        One list for each case.
    """
    own = [case for case in cases(size.seed, size.draws) if case.group in size.groups]
    noises = [(level, kind) for level in size.levels for kind in size.kinds]
    if size.none is not None and "none" in size.groups:
        own = [case for case in own if case.group != "none"]
    out = [[Set(case, level, kind, size.seed) for level, kind in noises] for case in own]
    if size.none is not None and "none" in size.groups:
        out += [[Set(_empty(place, size.seed), *noises[place % len(noises)], size.seed)] for place in range(size.none)]
    if size.limit is None or size.limit >= len(out):
        return out
    # A part of a study is a sample of all of it.
    kept = np.random.default_rng(size.seed).permutation(len(out))[: size.limit]
    return [out[place] for place in sorted(kept)]


def _empty(place, seed):
    """Make a case that hides nothing, each one another flight."""
    plain = [(name, {}) for name in VEHICLES]
    vehicle, options = [*plain, ("sixkg", {"ideal_command": True})][place % (len(plain) + 1)]
    name = f"none-{vehicle}-{place}"
    return make(name, "none", vehicle, (), np.random.default_rng([seed, *name.encode()]), **options)
