"""The vehicle of the study: Table 3 of the paper."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.source import Sources
from cpfls_cli.report.content import Block, Section, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, plain
from cpfls_cli.words import joined


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
    return Section("vehicle", "Vehicle", blocks)


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
