"""The search for the structure of a vehicle: where it leaves what it has judged, and how it begins or goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.job import Job, check_outputs, origin_before
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.playback.structure import Judged, Kept, Rules, Solution, Structure
from cpfls_cli.result import about, part, result
from cpfls_cli.search.checkpoint import KeptFile, differences, keys_of
from cpfls_cli.store import write

_OF_VEHICLE = ("vehicle", "import", "playback")
"""Sections of the config that the search depends on."""


@result
class KeptStructure:
    """A structure that was judged: its fits to all parts of the flights first, then without each of them."""

    blocks: tuple[str, ...] = about("its blocks", "block")
    rules: int = about("rules of its remainder")
    order: int = about("order of the harmonics of its remainder")
    loss: Array = about("of each fit", "fit")
    values: Array = about("numbers of all fits, one fit after another", "value", unit="SI", ragged=True)
    hessian: Array = about("curvatures of the fit to all parts by rows", "curvature", ragged=True)

    @classmethod
    def of(cls, judged: Judged) -> KeptStructure:
        """Take the fits of a structure."""
        fits, rules = (judged.fit, *judged.without), judged.structure.rules
        return cls(
            blocks=judged.structure.blocks,
            rules=rules[0],
            order=rules[1],
            loss=np.array([each.loss for each in fits]),
            values=np.concatenate([each.values for each in fits]),
            hessian=judged.fit.hessian.ravel(),
        )

    @property
    def pair(self) -> tuple[Structure, Solution]:
        """The structure and its fits, equal to what was stored down to the last bit."""
        values = self.values.reshape(len(self.loss), -1)
        hessian = self.hessian.reshape(2 * values.shape[1:])
        return Structure(self.blocks, Rules(self.rules, self.order)), Solution(
            tuple(values), tuple(self.loss.tolist()), hessian
        )


@result
class KeptStructures:
    """An unfinished search for the structure of a vehicle: what was fitted so far, in the order of the search."""

    FORMAT: ClassVar = "cpfls/vehicle-checkpoint"
    MADE_BY: ClassVar = "vehicle"

    structures: tuple[KeptStructure, ...] = part(brief=False)


@dataclass(frozen=True)
class VehicleCheckpoint(KeptFile):
    """Where a search for the structure of a vehicle leaves what it has judged."""

    WORK: ClassVar = "search"
    SUFFIX: ClassVar = ".checkpoint"
    OUTPUT: ClassVar = Vehicle

    def write(self, judged: Sequence[Judged]) -> None:
        """Replace what was there by these structures, or leave it as it was."""
        write(self.path, KeptStructures(structures=tuple(map(KeptStructure.of, judged))), self.header)

    def read(self) -> Kept:
        """Take up what was left."""
        left, origin = self._read(KeptStructures)
        with self._damaged():
            kept = dict(each.pair for each in left.structures)
        old, new = (keys_of(header, _OF_VEHICLE) for header in (origin, self.header))
        self._require_same(differences(origin, self.header, old, new, unimportant="held-out"))
        return kept


def begin_vehicle_search(
    job: Job, files: Mapping[str, InputFile], *, resume: bool
) -> tuple[VehicleCheckpoint, Kept | None]:
    """Check checkpoint and output of a search for the structure of a vehicle before anything is computed.

    The solutions that are kept tell where to go on; None to start.
    """
    checkpoint = VehicleCheckpoint.beside(job.output, origin_before(job.study, files, "vehicle-checkpoint"))
    kept = checkpoint.read() if resume else None
    if kept is None:
        checkpoint.require_permission(force=job.force)
    check_outputs(job, job.output, replaceable=resume and checkpoint.output_may_be_replaced())
    return checkpoint, kept
