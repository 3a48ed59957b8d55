"""Turn a flight log into a flight."""

from __future__ import annotations

from dataclasses import replace

from cpfls_cli.arguments import LogArgument
from cpfls_cli.consistency.findings import contradictions
from cpfls_cli.consistency.rotors import beyond_belief
from cpfls_cli.flightlog.results import Imported
from cpfls_cli.flights.recordings import check_flight, doubts_on_voltage, imported, read_import
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._flight import FIGURES, WORDS


@stage(Imported, title="Flight", figures=FIGURES, words=WORDS, study=True)
def import_(run: Run, log: LogArgument) -> Imported | None:
    """Import a log, and check it against itself and the vehicle of the config."""
    run.take({"log": log})
    made = imported(log, run.study)
    # An import is quick, and only the whole of it shows that every key suits the log.
    if run.dry_run:
        return None
    read = read_import(log.name, [made], run.study)
    findings = (*beyond_belief(run.study.vehicle), *check_flight(read, run.study))
    never = contradictions(findings)
    doubted = [each.sentence for each in findings if each.sentence not in never]
    warnings = (*made.warnings, *doubts_on_voltage(read.signals, read.units), *doubted)
    # The command that learns from it: a model of a torque, a whole vehicle of rotors alone.
    if not made.lacks:
        run.go_on("identify", run.output, output=run.sibling("model.h5"))
    elif made.has_rotors:
        run.next.append(("cpfls", "vehicle", run.config, run.output, "-o", run.sibling("vehicle.h5")))
    run.also = {"signals": [name for name in made.signals if name != "time"]}
    return replace(made, warnings=warnings, contradictions=never)
