"""Command `verify-export`: an exported vehicle flown along a flight, and compared with its model's playback."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cpfls_cli.artifacts.job import input_file
from cpfls_cli.commands.vehicle_sheets import sheet_of
from cpfls_cli.config.load import stored_study
from cpfls_cli.errors import InputError
from cpfls_cli.export.registry import FORMS, exported, require_package
from cpfls_cli.export.text import identifier
from cpfls_cli.export.verify import verified
from cpfls_cli.flights.models import read_model
from cpfls_cli.flights.playback import flights_to_play
from cpfls_cli.pages.export import verification_answer, verification_summary
from cpfls_cli.playback.flight import playback_flight
from cpfls_cli.playback.player import made_ready
from cpfls_cli.playback.rotors import Hold
from cpfls_cli.report.content import Text
from cpfls_cli.report.outcome import Outcome, caution_texts


def is_export(path: Path) -> bool:
    """Tell by its name whether a file is what `cpfls export` writes."""
    return path.suffix in {ending for form in FORMS.values() for ending in (form.ending, form.also) if ending}


@dataclass(frozen=True)
class Options:
    """How an export is verified.

    Attributes
    ----------
    form : str
        Word of the target.
    horizon_s : float
        How far each run goes, s.
    windows : int
        Runs, at most.
    hold : {"linear", "previous"} or None
        What a speed is between samples; None for what is usual.
    """

    form: str
    horizon_s: float = 0.5
    windows: int = 10
    hold: Hold | None = None


def run(model: Path, flight: Path, options: Options, *, force: bool, dry_run: bool) -> Outcome:
    """Export a model, fly it, and say how far it is from its own playback."""
    require_package(options.form)
    for path in (model, flight):
        if not path.is_file():
            raise InputError(f"{path}: no such file")
    if is_export(model):
        raise InputError(
            f"{model}: is an export; name the model that it was made from, which is exported again and flown"
        )
    sheet = sheet_of(model, identifier(model.stem), input_file(model), force=force, anyway=True)
    made = exported(sheet, options.form, f"{sheet.name}.py")
    study = stored_study(sheet.origin.config, sheet.file)
    read = read_model(model, study)
    (logged,) = flights_to_play([flight], study, options.hold)
    along, player = made_ready(read, logged)
    if dry_run:
        line = Text(f"{model}: would be flown along {flight}, in {options.form}; model and flight are good")
        return Outcome({"dry_run": True}, (line,))
    horizon = max(1, round(options.horizon_s / along.motion.period))
    # With its logged rotor speeds, but without the faults of sensors that a model knows of.
    repaired = playback_flight(logged.name, [read.repaired(part) for part in logged.parts], logged.hold)
    verification = verified(options.form, made, repaired, (along, player), horizon, options.windows)
    blocks = verification_answer(options.form, made.told, logged, verification)
    summary = verification_summary(options.form, made.missing, verification) | {"cautions": list(sheet.cautions)}
    return Outcome(summary, (*caution_texts(sheet.cautions), *blocks), int(not verification.agrees))
