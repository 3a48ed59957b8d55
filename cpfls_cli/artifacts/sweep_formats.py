"""The format of a sweep: one row for each run, grouped by setting and seed."""

from __future__ import annotations

from cpfls_cli.artifacts.gap_datasets import gappy, number, text
from cpfls_cli.artifacts.spec import NO_FRAME, ArtifactSpec, DatasetSpec

_BY_PART = ("run", "part")

SWEEP = ArtifactSpec(
    "cpfls/sweep",
    "replicates of a search, by setting and seed",
    "sweep",
    (
        text("setting/name", "setting", "what the config calls it"),
        text("setting/overrides", "setting", "what is different in it, as options of --set"),
        text("setting/structure", "setting", "cpfls or fls"),
        number("setting/samples", ("setting",), "samples learned from"),
        text("setting/criterion", "setting", "what chose them; all: all samples that train"),
        text("setting/selection", "setting", "sha256 of their indices; equal ones are the same samples"),
        number("setting/population", ("setting",), "chromosomes in the population"),
        number("setting/generations", ("setting",), "generations bred at most"),
        text("part", "part", "what models are judged on: training, held-out rests, other flights"),
        number("run/setting", ("run",), "index of the setting; every setting with the first seed, then the next seed"),
        number("run/seed", ("run",), "`cpfls identify --seed` with it finds the same model"),
        number("run/generations", ("run",), "generations bred"),
        number("run/evaluations", ("run",), "chromosomes evaluated"),
        gappy("run/mse", _BY_PART, "mean squared torque error over the axes; not known: no model found", "(N m)^2"),
        gappy("run/max_error", _BY_PART, "largest torque error", "N m"),
        gappy("run/relative_error", _BY_PART, "largest error over largest torque, worst axis"),
        gappy("run/condition_number", ("run",), "over the kept singular values"),
        DatasetSpec(
            "run/chromosome", ("run", "gene"), "1", NO_FRAME, "chosen 16-bit weights; -1 beyond those of the setting"
        ),
        number("complete", (), "1 where every run is finished, 0 where `--resume` goes on"),
    ),
    ("flight", "validate", "choose-on"),
)
