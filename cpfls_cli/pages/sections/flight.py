"""The flights: what was recorded, what was repaired, and Figure 4."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.pages.figures.attitude import attitude_figure
from cpfls_cli.pages.figures.rotation import rotation_figure
from cpfls_cli.pages.figures.torque import torque_figure
from cpfls_cli.pages.source import Source, Sources, section_of_each
from cpfls_cli.report.content import Block, Facts, Heading, Section, Table, Text
from cpfls_cli.report.numbers import count, number, plain


def flight_section(sources: Sources) -> Section | None:
    """Show the flights.

    Returns
    -------
    Section or None
        None where no flight was given.
    """
    return section_of_each("flights", "Flights", sources.flights, lambda flight, index: _flight(flight, index, sources))


def _flight(flight: Source, index: int, sources: Sources) -> Iterator[Block]:
    artifact = flight.artifact
    yield Heading(flight.label)
    yield Facts(_facts(flight))
    if "quality/count" in artifact.data:
        yield _quality(flight, index)
    if "quality/warning" in artifact.data:
        yield from [Text(f"{warning}.", "warning") for warning in artifact.texts("quality/warning")]
    if "attitude" in artifact.data and sources.by_hash(flight.made_from("trajectory")) is None:
        drawn = rotation_figure if _turns(artifact) else attitude_figure
        yield drawn(f"figure-3-flight-{index}", flight)
    if "torque" in artifact.data:
        yield torque_figure(f"figure-4-torque-{index}", flight)
    else:
        yield Text("This flight holds no torque, so nothing can be learned from it.", "warning")


def _turns(artifact: Artifact) -> bool:
    """Tell whether roll or pitch goes round the circle, so that angles alone would run off the figure."""
    if "attitude_rate" not in artifact.data:
        return False
    return bool(np.ptp(artifact.array("attitude")[:, :2], axis=0).max() > 2 * np.pi)


def _facts(flight: Source) -> list[tuple[str, str]]:
    artifact = flight.artifact
    time = artifact.array("time")
    duration = float(time[-1] - time[0]) if len(time) else 0.0
    rate = (len(time) - 1) / duration if duration > 0 else float("nan")
    rows = [("Source", _origin(flight)), ("Samples", f"{len(time)} over {duration:.2f} s, {number(rate)} per second")]
    if "torque" in artifact.data:
        largest = np.max(np.abs(artifact.array("torque")), axis=0)
        shown = ", ".join(f"{number(value, 3)} {axis}" for value, axis in zip(largest, _AXES, strict=True))
        rows.append(("Largest torque, N m", shown))
    if "delay/value" in artifact.data:
        rows.append(("Delay taken out", _delay(flight)))
    rows.append(("Noise added", _noise(flight)))
    return rows


_AXES = ("roll", "pitch", "yaw")


def _origin(flight: Source) -> str:
    kinds = {"trajectory": "simulated along", "log": "imported from"}
    inputs = flight.artifact.header.inputs.items()
    return ", ".join(f"{kinds.get(role, role)} {file.name} (sha256 {file.sha256[:12]})" for role, file in inputs)


def _delay(flight: Source) -> str:
    delay = f"{1e3 * flight.artifact.number('delay/value'):.1f} ms of motion behind command"
    if "delay/r2" not in flight.artifact.data:
        return f"{delay}, as the config states"
    best = float(np.max(flight.artifact.array("delay/r2"), initial=-np.inf))
    return f"{delay}, estimated from this flight (pooled R² of the rigid body there {best:.3f})"


def _noise(flight: Source) -> str:
    if "noise/signal" not in flight.artifact.data:
        return "none" if flight.made_from("trajectory") else "none; this is a recording"
    deviations = flight.artifact.array("noise/std")
    signals = flight.artifact.texts("noise/signal")
    words = [f"{name} {' '.join(plain(v) for v in row)}" for name, row in zip(signals, deviations, strict=True)]
    return f"{'; '.join(words)} (standard deviation by axis, SI units)"


def _quality(flight: Source, index: int) -> Table:
    artifact = flight.artifact
    rows = [
        [reason, count(number_of)]
        for reason, number_of in zip(artifact.texts("quality/reason"), artifact.array("quality/count"), strict=True)
    ]
    return Table(
        f"quality-{index}", f"What was found in the log of {flight.label}.", ("What: what was done", "Count"), rows
    )
