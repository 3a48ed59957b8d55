"""Draw vehicles from what flights leave possible, for simulators that fly many: .yaml, .json or .npz."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from cpfls_cli.arguments import ExportAnywayOption
from cpfls_cli.artifacts.vehicle_model import name_of
from cpfls_cli.errors import ComputationError, InputError, about
from cpfls_cli.export.samples import ENDINGS, Samples
from cpfls_cli.export.text import identifier
from cpfls_cli.flights.models import any_model, found_vehicle, is_found, is_model
from cpfls_cli.pages.trust import trust_words
from cpfls_cli.playback.gusts import GUST_AXES
from cpfls_cli.playback.spread import drawn, require_sure
from cpfls_cli.result import about as described
from cpfls_cli.result import result
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages.export import sheet_of

VehicleArgument = Annotated[Path, typer.Argument(metavar="VEHICLE", help="Made by `cpfls vehicle`.")]
CountOption = Annotated[int, typer.Option("-n", "--count", metavar="N", min=2, help="Vehicles to draw.")]
SeedOption = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Of the draws.")]


@result
class Written:
    """Vehicles that were drawn, in a file."""

    dry_run: bool = described("whether nothing was written")
    output: str = described("the file")
    bytes: int = described("of the file")
    samples: Samples

    @property
    def calm(self) -> dict[str, list[str]]:
        """Axes on which no gusts are known, those about which the vehicle turns and those along which it moves."""
        gusts = self.samples.sheet.model.gusts
        known = np.zeros(len(GUST_AXES), bool) if gusts is None else np.asarray(gusts.size) != 0
        still = [name for name, known_there in zip(GUST_AXES, known, strict=True) if not known_there]
        parted = (("about", GUST_AXES[:3]), ("along", GUST_AXES[3:]))
        return {word: own for word, axes in parted if (own := [name for name in axes if name in still])}


@stage(Written, words={"name_of": name_of, "trust_words": trust_words})
def spread(
    run: Run,
    model: VehicleArgument,
    count: CountOption = 1000,
    seed: SeedOption = 1,
    anyway: ExportAnywayOption = False,
) -> Written | None:
    """Draw vehicles, and write them."""
    ending = run.output.suffix
    if ending not in ENDINGS:
        known = ", ".join(ENDINGS)
        raise InputError(f"{run.output}: its suffix names no form; give the name one of the suffixes {known}")
    source = run.take({"model": model})["model"]
    if is_model(model) and not is_found(model):
        raise InputError(
            f"{model}: is a model of `cpfls {any_model(model).MADE_BY}`, which holds no covariance of its numbers; "
            "`cpfls vehicle` finds a vehicle with one"
        )
    found = found_vehicle(model)
    sheet = sheet_of(model, identifier(model.stem), source, force=run.force, anyway=anyway)
    with about(model, InputError, ComputationError):
        require_sure(found)
        if run.dry_run:
            run.say(f"{count} vehicles would be drawn from {model}")
            return None
        samples = Samples(
            sheet=sheet,
            spread=drawn(sheet.model, found, count, np.random.default_rng(seed)),
            numbers={number.name: number for number in found.numbers},
            seed=seed,
            not_determined=found.not_determined,
            held=found.guessed,
        )
    run.texts[run.output] = text = samples.written(ending)
    run.also = {**samples.facts, "ranges": {name: each._asdict() for name, each in samples.ranges.items()}}
    return Written(dry_run=False, output=str(run.output), bytes=len(text), samples=samples)
