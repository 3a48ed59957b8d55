"""The finished runs of a sweep that goes on: kept beside the output after each run, and continued from."""

from __future__ import annotations

import glob
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.formats import SWEEP
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.artifacts.store import Artifact, format_name, read_artifact, write_artifact
from cpfls_cli.artifacts.sweep_rows import COMPLETE, RUN, Rows, no_rows, sweep_data
from cpfls_cli.config.load import parse_config
from cpfls_cli.errors import ComputationError, InputError, OutputError
from cpfls_cli.flights.sources import read_good
from cpfls_cli.search.resuming import differences, nothing_to_resume, require_same
from cpfls_cli.search.sweep_plan import SweepPlan

_SECTIONS = ("reduction", "identification", "sweep")
_SEEDS = "sweep.seeds"


@dataclass(frozen=True)
class PartialSweep:
    """Where a sweep leaves its finished runs.

    Attributes
    ----------
    output : Path
        What the sweep is for.
    header : Header
        Of the sweep that is run now: its config, seed and inputs.
    """

    path: Path
    output: Path
    header: Header

    @classmethod
    def beside(cls, output: Path, header: Header) -> PartialSweep:
        """Name the finished runs of an output: ``sweep.h5.partial`` of ``sweep.h5``."""
        return cls(output.with_name(f"{output.name}.partial"), output, header)

    def take_up(self, *, resume: bool, force: bool) -> Artifact | None:
        """Read what a stopped sweep left, where the sweep is to go on.

        Parameters
        ----------
        force : bool
            Allow it to be given up.

        Returns
        -------
        Artifact or None
            None for a sweep that starts.

        Raises
        ------
        InputError
            If there is something and neither is said, or nothing that can be resumed.
        """
        if resume:
            return self._read()
        if self.path.exists() and not force:
            raise InputError(
                f"{self.path}: a sweep for {self.output} was stopped here; --resume continues it, --force starts again"
            )
        return None

    def rows(self, plan: SweepPlan, left: Artifact | None) -> Rows:
        """Take the runs that are finished, and keep them from here on.

        Parameters
        ----------
        left : Artifact or None
            By a stopped sweep.

        Raises
        ------
        InputError
            If they are not runs of this plan.
        """
        rows = no_rows(plan)
        if left is not None:
            self._require_same_plan(plan, left)
            rows = {path: np.asarray(left.data[path], dtype=values.dtype) for path, values in rows.items()}
        for part in self.path.parent.glob(f".{glob.escape(self.path.name)}.????????.part"):
            part.unlink(missing_ok=True)
        self.write(plan, rows)
        return rows

    def write(self, plan: SweepPlan, rows: Rows) -> None:
        """Replace what was there by these finished runs, or leave it as it was.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        write_artifact(self.path, Artifact(SWEEP, self.header, sweep_data(plan, rows)))

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Say of whatever fails inside that the sweep can go on nevertheless."""
        try:
            yield
        except (ComputationError, OutputError) as error:
            if self.path.exists():
                error.add_note(f"{self.path}: is intact; the same command with --resume goes on")
            raise

    def remove(self) -> None:
        """Remove the finished runs, after the output is written."""
        self.path.unlink(missing_ok=True)

    def output_may_be_replaced(self) -> bool:
        """Tell whether the output is what this stopped sweep left: incomplete, or complete and not tidied up."""
        if not self.output.is_file() or format_name(self.output) != SWEEP.format:
            return False
        sweep = read_artifact(self.output, SWEEP)
        return not sweep.data[COMPLETE] or sweep.header == self.header

    def _read(self) -> Artifact:
        if not self.path.exists():
            raise nothing_to_resume(self.path, self.output, SWEEP)
        try:
            left = read_good(self.path, SWEEP)
        except InputError as error:
            raise InputError(f"{error}; --force without --resume starts again") from None
        old, new = _keys(left.header), _keys(self.header)
        require_same(self.path, "sweep", differences(left.header, self.header, old, new))
        return left

    def _require_same_plan(self, plan: SweepPlan, left: Artifact) -> None:
        now = {path: values for path, values in sweep_data(plan, no_rows(plan)).items() if path.startswith("setting/")}
        done = len(left.array(f"{RUN}seed"))
        found = [f"{path} differs" for path, values in now.items() if not np.array_equal(left.data[path], values)]
        if done > plan.runs:
            found.append(f"{_SEEDS} = {len(plan.seeds)}, but {done} runs are finished")
        require_same(self.path, "sweep", found)


def _keys(header: Header) -> dict[str, Any]:
    """List the keys that a sweep depends on, with dots; more seeds only add to it."""
    config = parse_config(header.config, "/config")
    return {"seed": config["seed"]} | {
        f"{section}.{key}": value
        for section in _SECTIONS
        for key, value in config.get(section, {}).items()
        if f"{section}.{key}" != _SEEDS
    }
