"""Table 3: the vehicle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.source import Sources
from cpfls_cli.report.content import Block, Section, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, plain
from cpfls_cli.vehicle.settings import VehicleSettings

_PAPER = ("9.81", "6", "4", "0.3", "121.5 × 10⁻⁶", "2.7 × 10⁻⁶", "0.6", "0.6", "1.2")
_PAPER_DURATION = "55"


def vehicle_section(sources: Sources) -> Section:
    """Show the vehicle of the study, beside the paper's where that is asked for.

    References
    ----------
    Table 3 of the paper.
    """
    paper = sources.settings.paper
    rows = [[quantity, value, *([printed] if paper else [])] for quantity, value, printed in _rows(sources)]
    header = ("Quantity", "Study", *(("Paper",) if paper else ()))
    caption = (
        "Table 3. The vehicle of the study config. A range means that the rotors differ; the arm is the distance of a "
        "rotor from the z axis."
    )
    blocks: list[Block] = [Table("table-3-vehicle", caption, header, rows)]
    other = [source.label for source in sources.all if source.vehicle != sources.vehicle]
    if other:
        blocks.append(Text(f"Made with another vehicle than this one: {', '.join(other)}.", "warning"))
    return Section("vehicle", "Vehicle", blocks)


def _rows(sources: Sources) -> list[tuple[str, str, str]]:
    vehicle = sources.vehicle
    values = [plain(vehicle.gravity_m_s2), plain(vehicle.mass_kg), *_rotors(vehicle)]
    values += [plain(moment) for moment in vehicle.inertia_kg_m2]
    names = ["gravity g, m/s²", "mass m, kg", "rotors", "arm l, m", "thrust factor k, N s²", "drag factor b, N m s²"]
    names += [f"{name}, kg m²" for name in INERTIA_PARAMETERS[: len(vehicle.inertia_kg_m2)]]
    printed = [*_PAPER, *["0"] * (len(values) - len(_PAPER))]
    rows = list(zip(names, values, printed, strict=True))
    return rows if sources.only_gap else [*rows, ("flight time T, s", _durations(sources), _PAPER_DURATION)]


def _rotors(vehicle: VehicleSettings) -> list[str]:
    arms = [float(np.hypot(rotor.position_m[0], rotor.position_m[1])) for rotor in vehicle.rotors]
    return [
        str(len(vehicle.rotors)),
        _range(arms),
        _range([rotor.thrust_factor_n_s2 for rotor in vehicle.rotors]),
        _range([rotor.drag_factor_n_m_s2 for rotor in vehicle.rotors]),
    ]


def _range(values: Sequence[float]) -> str:
    low, high = (plain(float(f"{value:.4g}")) for value in (min(values), max(values)))
    return low if low == high else f"{low} … {high}"


def _durations(sources: Sources) -> str:
    given = sources.flights or sources.trajectories
    times = [source.artifact.array("time") for source in given]
    return _range([float(time[-1] - time[0]) for time in times if len(time)]) if times else UNKNOWN
