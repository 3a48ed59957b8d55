"""The search for the structure of a vehicle: where it leaves what it has judged, and how it begins or goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpfls_cli.artifacts.checkpoint import VehicleCheckpointRecord
from cpfls_cli.artifacts.job import Job, check_outputs, header_of
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.artifacts.store import write_record
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.playback.structure import Judged, Kept, Rules, Solution, Structure
from cpfls_cli.search.checkpoint import KeptFile, differences, keys_of

_OF_VEHICLE = ("vehicle", "import", "playback")
"""Sections of the config that the search depends on."""


@dataclass(frozen=True)
class VehicleCheckpoint(KeptFile):
    """Where a search for the structure of a vehicle leaves what it has judged."""

    WORK: ClassVar = "search"
    SUFFIX: ClassVar = ".checkpoint"
    OUTPUT: ClassVar = Vehicle

    def write(self, judged: Sequence[Judged]) -> None:
        """Replace what was there by these structures, or leave it as it was."""
        write_record(self.path, VehicleCheckpointRecord.of(judged).with_header(self.header))

    def read(self) -> Kept:
        """Take up what was left."""
        record = self._read(VehicleCheckpointRecord)
        with self._damaged():
            kept = kept_of(record)
        old, new = (keys_of(header, _OF_VEHICLE) for header in (record.origin, self.header))
        self._require_same(differences(record.origin, self.header, old, new, unimportant="held-out"))
        return kept


def kept_of(record: VehicleCheckpointRecord) -> Kept:
    """Rebuild what the search left, equal to what was stored down to the last bit."""
    structure = record.structure
    numbers = np.cumsum(structure.numbers)[:-1]
    hessians = np.split(record.hessian, np.cumsum(structure.numbers**2)[:-1])
    values = np.split(record.values, numbers * record.loss.shape[1])
    rows = zip(structure.blocks, structure.rules.tolist(), record.loss.tolist(), values, hessians, strict=True)
    return {
        Structure(tuple(blocks.split()), Rules(*rules)): Solution(
            tuple(own.reshape(len(losses), -1)), tuple(losses), hessian.reshape(2 * (len(own) // len(losses),))
        )
        for blocks, rules, losses, own, hessian in rows
    }


def begin_vehicle_search(
    job: Job, files: Mapping[str, InputFile], *, resume: bool
) -> tuple[VehicleCheckpoint, Kept | None]:
    """Check checkpoint and output of a search for the structure of a vehicle before anything is computed.

    The solutions that are kept tell where to go on; None to start.
    """
    checkpoint = VehicleCheckpoint.beside(job.output, header_of(job.study, files))
    kept = checkpoint.read() if resume else None
    if kept is None:
        checkpoint.require_permission(force=job.force)
    check_outputs(job, job.output, replaceable=resume and checkpoint.output_may_be_replaced())
    return checkpoint, kept
