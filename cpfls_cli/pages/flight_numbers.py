"""The page of the numbers of one flight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.artifacts.flight_numbers import FlightNumbersRecord
from cpfls_cli.pages.change_words import number_meanings
from cpfls_cli.pages.source import Source
from cpfls_cli.report.content import Block, Cell, Table, Text
from cpfls_cli.report.numbers import number


def answer(flight: Source[FlightNumbersRecord], index: int = 1) -> Iterator[Block]:
    """Tell the numbers of a flight with their errors."""
    record = flight.record
    of = "commands" if record.commanded else "speeds"
    battery = f", {number(record.voltage, 3)} V at the battery" if np.isfinite(record.voltage) else ""
    yield Text(f"{record.flight}: {number(record.duration, 3)} s in flight{battery}; loads are of {of}.")
    columns = zip(record.number, record.value.tolist(), record.error.tolist(), record.unit, strict=True)
    rows: list[list[str | Cell]] = [
        [name, number(value, 3), number(error, 2), "" if unit == "1" else unit] for name, value, error, unit in columns
    ]
    header = ("Number", "Value", "Error", "Unit")
    caption = f"What {record.flight} tells of its vehicle, with standard errors over blocks of the flight."
    meanings = number_meanings(record.number)
    yield Table(f"flight-numbers-{index}", caption, header, rows, frozenset({0, 3}), legend=meanings)
    yield from (Text(words, "warning") for words in record.warning)
