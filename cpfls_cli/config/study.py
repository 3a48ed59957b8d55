"""One study: the settings of every section, composed and validated together."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field
from typing_extensions import Doc

from cpfls_cli.config.report_settings import ReportSettings
from cpfls_cli.flightlog.settings import ImportSettings
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.identification.sweep_settings import SweepSettings
from cpfls_cli.reduction.settings import ReductionSettings
from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.trajectory.settings import TrajectorySettings
from cpfls_cli.vehicle.settings import VehicleSettings


class Study(BaseModel):
    """All settings of one study, one attribute per section of the YAML config."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, populate_by_name=True)

    seed: Annotated[int, Field(ge=0, lt=2**63), Doc("seed of everything random in this study")] = 1
    vehicle: Annotated[VehicleSettings, Doc("the aircraft: mass, inertia, rotors")] = VehicleSettings()
    trajectory: Annotated[TrajectorySettings, Doc("the path that `cpfls trajectory` plans")] = TrajectorySettings()
    simulation: Annotated[SimulationSettings, Doc("what `cpfls simulate` adds")] = SimulationSettings()
    import_: Annotated[
        ImportSettings, Field(alias="import"), Doc("how `cpfls import` reads a log: columns, units, frames, filters")
    ] = ImportSettings()
    reduction: Annotated[ReductionSettings, Doc("which samples `cpfls reduce` keeps")] = ReductionSettings()
    identification: Annotated[IdentificationSettings, Doc("what `cpfls identify` fits and how it searches")] = (
        IdentificationSettings()
    )
    sweep: Annotated[SweepSettings, Doc("what `cpfls sweep` tries, and how often")] = SweepSettings()
    gap: Annotated[GapSettings, Doc("how `cpfls compare`, `diagnose`, `extend` and `gap` look for what is missing")] = (
        GapSettings()
    )
    report: Annotated[ReportSettings, Doc("what `cpfls report` shows")] = ReportSettings()


SECTIONS = ("vehicle", "trajectory", "simulation", "import", "reduction", "identification", "sweep", "gap", "report")
"""The sections of a config, in the order of the pipeline."""
