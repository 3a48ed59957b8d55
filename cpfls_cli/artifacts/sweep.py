"""The artifact of a sweep: one row for each run."""

from __future__ import annotations

from typing import ClassVar

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import Format, Record, dataset, group, record


@record
class SettingGroup:
    """Settings of the sweep."""

    name: tuple[str, ...] = dataset("name", "what the config calls it", "setting")
    overrides: tuple[str, ...] = dataset("overrides", "what is different in it, as options of --set", "setting")
    structure: tuple[str, ...] = dataset("structure", "cpfls or fls", "setting")
    samples: IntArray = dataset("samples", "samples learned from", "setting")
    criterion: tuple[str, ...] = dataset("criterion", "what chose them; all: all samples that train", "setting")
    selection: tuple[str, ...] = dataset(
        "selection", "sha256 of their indices; equal ones are the same samples", "setting"
    )
    population: IntArray = dataset("population", "chromosomes in the population", "setting")
    generations: IntArray = dataset("generations", "generations bred at most", "setting")


@record
class RunGroup:
    """One row for each run."""

    setting: IntArray = dataset(
        "setting", "index of the setting; every setting with the first seed, then the next seed", "run"
    )
    seed: IntArray = dataset("seed", "`cpfls identify --seed` with it finds the same model", "run")
    generations: IntArray = dataset("generations", "generations bred", "run")
    evaluations: IntArray = dataset("evaluations", "chromosomes evaluated", "run")
    mse: Array = dataset(
        "mse",
        "mean squared torque error over the axes; not known: no model found",
        "run",
        "part",
        units="(N m)^2",
        gaps=True,
    )
    max_error: Array = dataset("max_error", "largest torque error", "run", "part", units="N m", gaps=True)
    relative_error: Array = dataset(
        "relative_error", "largest error over largest torque, worst axis", "run", "part", gaps=True
    )
    condition_number: Array = dataset("condition_number", "over the kept singular values", "run", gaps=True)
    chromosome: IntArray = dataset("chromosome", "chosen 16-bit weights; -1 beyond those of the setting", "run", "gene")


@record
class SweepRecord(Record):
    """The artifact `cpfls/sweep`."""

    FORMAT: ClassVar = Format(
        "cpfls/sweep",
        "replicates of a search, by setting and seed",
        "sweep",
        ("flight", "validate", "choose-on"),
    )

    setting: SettingGroup = group("setting")
    part: tuple[str, ...] = dataset(
        "part", "what models are judged on: training, held-out rests, other flights", "part"
    )
    run: RunGroup = group("run")
    complete: bool = dataset("complete", "1 where every run is finished, 0 where `--resume` goes on")
