"""Which flights train and which are held out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.windows import Recording, common_windows
from cpfls_cli.gap.settings import GapSettings


@dataclass(frozen=True)
class Split:
    """Flights to learn from, flights to judge on, and why."""

    training: tuple[Recording, ...]
    held_out: tuple[Recording, ...]
    sentence: str


def split_flights(given: Sequence[Recording], held_out: Sequence[Recording], settings: GapSettings) -> Split:
    """Split flights for learning and judging.

    Parameters
    ----------
    held_out : sequence of Recording
        Flights that are held out; if there are none, the last third of the flights is, or of one flight its last third.

    Raises
    ------
    InputError
        If a flight or a part is too short, or their rates differ.
    """
    if held_out:
        common_windows([*given, *held_out], settings)
        return Split(tuple(given), tuple(held_out), f"held out as asked: {_names(held_out)}")
    if len(given) > 1:
        common_windows(given, settings)
        first = len(given) - max(1, len(given) // 3)
        training, last = tuple(given[:first]), tuple(given[first:])
        return Split(training, last, f"no flight was held out by name, so the last third of them is: {_names(last)}")
    return _thirds(given[0], settings)


def seen_twice(given: Iterable[InputFile], held_out: Iterable[InputFile]) -> tuple[str, ...]:
    """Warn of files that stand for two flights: what is learned and judged on one flight says nothing of another."""
    learned: dict[str, str] = {}
    said = []
    for file in given:
        if file.sha256 in learned:
            said.append(f"{file.name}: is given twice, also as {learned[file.sha256]}")
        learned[file.sha256] = file.name
    said += [
        f"{file.name}: is learned from and held out at once, so the gap after shows nothing of flights not seen"
        for file in held_out
        if file.sha256 in learned
    ]
    return tuple(said)


def _thirds(flight: Recording, settings: GapSettings) -> Split:
    # What the whole flight cannot be cut into windows for is no matter of its length.
    common_windows([flight], settings)
    cut = 2 * len(flight.signals) // 3
    training = Recording(f"{flight.name} (first two thirds)", _cut(flight.signals, slice(0, cut)))
    last = Recording(f"{flight.name} (last third)", _cut(flight.signals, slice(cut, None)))
    try:
        common_windows([training, last], settings)
    except InputError as error:
        raise InputError(
            f"{flight.name}: one flight is too short to hold a third of it out; give more flights, or --held-out "
            f"FLIGHT: {error}"
        ) from None
    return Split((training,), (last,), f"there is one flight only, so it was held out in time: {last.name}")


def _cut(signals: Signals, part: slice) -> Signals:
    own: dict[str, Any] = {field.name: getattr(signals, field.name) for field in fields(signals)}
    cut: dict[str, Any] = {name: value[part] if isinstance(value, np.ndarray) else value for name, value in own.items()}
    return Signals(**cut)


def _names(flights: Sequence[Recording]) -> str:
    return ", ".join(flight.name for flight in flights)
