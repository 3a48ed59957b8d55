"""The vehicle of a report, where its artifacts come from, and how those that it lacks are made."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from cpfls_cli.artifacts.diagnosis import Diagnosis
from cpfls_cli.artifacts.disagreement import Disagreement
from cpfls_cli.artifacts.extended import Extended
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.flights.flight import Flight
from cpfls_cli.flights.path import PlannedPath
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.reduction.selection import Selection
from cpfls_cli.report.content import Block, Listing, Section, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, plain
from cpfls_cli.validation.prediction import AlongFlight
from cpfls_cli.words import joined


def provenance_section(sources: Sources) -> Section:
    """List the artifacts with their hashes, inputs and configs."""
    blocks: list[Block] = [
        Table(
            "artifacts",
            "The artifacts of this report, by the SHA-256 of the file.",
            ("File", "Format", "cpfls", "Seed", "SHA-256 of the file", "SHA-256 of the config"),
            [_artifact(source) for source in sources.all],
            frozenset({0, 1, 2, 4, 5}),
            frozenset({4, 5}),
        )
    ]
    inputs = [row for source in sources.all for row in _inputs(source, sources)]
    if inputs:
        header = ("File", "Role", "Made from", "Format", "SHA-256", "In this report")
        caption = "The files that they were made from."
        blocks.append(Table("inputs", caption, header, inputs, frozenset(range(6)), frozenset({2, 4})))
    for config in dict.fromkeys(source.header.config for source in sources.all):
        names = ", ".join(source.label for source in sources.all if source.header.config == config)
        blocks.append(Listing(f"config of {names}", config))
    return Section("provenance", "Provenance", blocks)


def _artifact(source: Source) -> list[str]:
    header = source.header
    return [source.label, source.format, header.version, str(header.seed), source.sha256, source.config_sha256]


def _inputs(source: Source, sources: Sources) -> list[list[str]]:
    return [
        [source.label, role, file.name, file.format, file.sha256, "yes" if sources.by_hash(file.sha256) else "no"]
        for role, file in source.header.inputs.items()
    ]


_Lack = tuple[type, str, str]
_LACKS: tuple[_Lack, ...] = (
    (PlannedPath, "Figure 2 and the table of peaks", "cpfls trajectory CONFIG -o trajectory.h5"),
    (
        Flight,
        "Figure 4 and the quality of the flight",
        "cpfls simulate CONFIG trajectory.h5 -o flight.h5, or cpfls import CONFIG LOG -o flight.h5",
    ),
    (Selection, "Table 4 and Figure 5", "cpfls reduce CONFIG flight.h5 -o selection.h5"),
    (IdentifiedModel, "Table 5, the baselines, Figure 6 and the rules", "cpfls identify CONFIG flight.h5 -o model.h5"),
    (
        AlongFlight,
        "Figure 7 and the inertia matrix along a flight",
        "cpfls predict CONFIG model.h5 flight.h5 -o prediction.h5",
    ),
)
_GAP_LACKS: tuple[_Lack, ...] = (
    (
        Disagreement,
        "where and when model and flights disagree",
        "cpfls compare CONFIG FLIGHT... -o disagreement.h5",
    ),
    (Diagnosis, "what the model misses", "cpfls diagnose CONFIG disagreement.h5 -o diagnosis.h5"),
    (Extended, "the model with the effects in it", "cpfls extend CONFIG diagnosis.h5 -o extended.h5"),
)
_SHOWN = {"extended": "extended model"}


def missing(sources: Sources) -> dict[str, str]:
    """Name the formats of which no artifact was given.

    Returns
    -------
    dict of str to str
        One sentence by format, such as ``selection``: what is not shown, and the command that makes it.
    """
    listed = _wanted(sources)
    lacking = {_word(kind): (shows, command) for kind, shows, command in listed if not sources.of_kind(kind)}
    return {
        word: f"Not shown, because no {_SHOWN.get(word, word)} was given: {shows}; made by: {command}."
        for word, (shows, command) in lacking.items()
    }


def _wanted(sources: Sources) -> Iterator[_Lack]:
    """List what a report of these artifacts could show: nobody who looks for a gap wants a training path."""
    if not sources.only_gap:
        yield from _LACKS
    if sources.gap:
        yield from _GAP_LACKS[:2]
        if any(diagnosis.record.effects for diagnosis in sources.diagnoses):
            yield _GAP_LACKS[2]


def _word(wanted: Any) -> str:
    return "model" if wanted is IdentifiedModel else str(wanted.FORMAT).removeprefix("cpfls/")


def vehicle_section(sources: Sources) -> Section:
    """Show the vehicle of the study: Table 3 of the paper."""
    caption = (
        "The vehicle of the study config. A range means that the rotors differ; the arm is the distance of a "
        "rotor from the z axis."
    )
    blocks: list[Block] = [Table("table-3-vehicle", caption, ("Quantity", "Study"), list(_vehicle_rows(sources)))]
    unknown = sources.vehicle.unknown
    if unknown:
        names = joined(name.replace("_", " ") for name in unknown)
        blocks.append(Text(f"Guesses stand here for what the config leaves open: {names}.", "warning"))
    other = [source.label for source in sources.all if source.vehicle != sources.vehicle]
    if other:
        blocks.append(Text(f"Made with another vehicle than this one: {', '.join(other)}.", "warning"))
    return Section("stated-vehicle", "Vehicle", blocks)


def _vehicle_rows(sources: Sources) -> Iterator[tuple[str, str]]:
    vehicle = sources.vehicle
    yield "gravity g, m/s²", plain(vehicle.gravity_m_s2)
    yield "mass m, kg", plain(vehicle.mass_kg)
    yield "rotors", str(len(vehicle.rotors))
    yield "arm l, m", _range([float(np.hypot(*rotor.position_m[:2])) for rotor in vehicle.rotors])
    yield "thrust factor k, N s²", _range([rotor.thrust_factor_n_s2 for rotor in vehicle.rotors])
    yield "drag factor b, N m s²", _range([rotor.drag_factor_n_m_s2 for rotor in vehicle.rotors])
    for name, moment in zip(INERTIA_PARAMETERS, vehicle.inertia_kg_m2, strict=False):
        yield f"{name}, kg m²", plain(moment)
    if not sources.only_gap:
        times = [source.record.time for source in sources.flights or sources.trajectories]
        durations = [float(time[-1] - time[0]) for time in times if len(time)]
        yield "flight time T, s", _range(durations) if times else UNKNOWN


def _range(values: Sequence[float]) -> str:
    low, high = (plain(float(f"{value:.4g}")) for value in (min(values), max(values)))
    return low if low == high else f"{low} … {high}"
