"""The checkpoint of a search: written beside the output after every generation, and continued from."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpfls_cli.artifacts.formats import CHECKPOINT, MODEL
from cpfls_cli.artifacts.spec import Header
from cpfls_cli.artifacts.state_file import StoppedSearch, nothing_data, state_data, stopped_search, with_unfinished
from cpfls_cli.artifacts.store import Artifact, write_artifact
from cpfls_cli.config.load import parse_config
from cpfls_cli.errors import InputError
from cpfls_cli.evolution.state import EvolutionState
from cpfls_cli.flights.sources import read_good
from cpfls_cli.identification.search import Unfinished
from cpfls_cli.search.resuming import differences, nothing_to_resume, require_same

_SECTION = "identification"
_GENERATIONS = f"{_SECTION}.generations"


@dataclass(frozen=True)
class Checkpoint:
    """Where a search leaves its state.

    Attributes
    ----------
    header : Header
        Of the search that is run now: its config, seed and inputs.
    """

    path: Path
    header: Header

    @classmethod
    def beside(cls, output: Path, header: Header) -> Checkpoint:
        """Name the checkpoint of an output: ``model.h5.checkpoint`` of ``model.h5``."""
        return cls(output.with_name(f"{output.name}.checkpoint"), header)

    @property
    def output(self) -> Path:
        """What the search is for."""
        return self.path.with_suffix("")

    def write(self, state: EvolutionState) -> None:
        """Replace what was there by this state, or leave it as it was.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        write_artifact(self.path, Artifact(CHECKPOINT, self.header, state_data(state)))

    def add(self, unfinished: Unfinished) -> None:
        """Add what was evaluated of the next generation, so that it need not be done again.

        Raises
        ------
        OutputError
            If it cannot be written; what was there is left as it was.
        """
        data = nothing_data(unfinished)
        if self.path.exists():
            data = with_unfinished(read_good(self.path, CHECKPOINT).data, unfinished)
        write_artifact(self.path, Artifact(CHECKPOINT, self.header, data))

    def read(self) -> StoppedSearch:
        """Take up what was left.

        Raises
        ------
        InputError
            If there is none, if it is damaged, or if it is of another search.
        """
        if not self.path.exists():
            raise nothing_to_resume(self.path, self.output, MODEL)
        try:
            artifact = read_good(self.path, CHECKPOINT)
            stopped = stopped_search(artifact)
        except InputError as error:
            raise InputError(f"{error}; --force without --resume starts again") from None
        except (ValueError, LookupError, TypeError) as error:
            raise InputError(f"{self.path}: damaged: {error}; --force without --resume starts again") from None
        self._require_same_search(artifact.header, 0 if stopped.state is None else stopped.state.index)
        return stopped

    def remove(self) -> None:
        """Remove the checkpoint, if there is one."""
        self.path.unlink(missing_ok=True)

    def tidy(self) -> None:
        """Remove what a killed search left half-written of the checkpoint and of its output."""
        for name in (self.path.name, self.output.name):
            for part in self.path.parent.glob(f".{glob.escape(name)}.????????.part"):
                part.unlink(missing_ok=True)

    def _require_same_search(self, then: Header, generation: int) -> None:
        old, new = ({key: value for key, value in _keys(h).items() if key != _GENERATIONS} for h in (then, self.header))
        differing = [*differences(then, self.header, old, new, unimportant="validate")]
        generations = _keys(self.header)[_GENERATIONS]
        if generation > generations:
            differing.append(f"{_GENERATIONS} = {generations}, but it has come to generation {generation}")
        require_same(self.path, "search", differing)


def _keys(header: Header) -> dict[str, Any]:
    """List the keys that a search depends on, with dots."""
    config = parse_config(header.config, "/config")
    return {"seed": header.seed, **dict(_flat(_SECTION, config[_SECTION]))}


def _flat(prefix: str, values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(f"{prefix}.{key}", value)
        else:
            yield f"{prefix}.{key}", value
