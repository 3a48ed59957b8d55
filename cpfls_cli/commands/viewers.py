"""Command `export` of what is not a model: quantities over the clock of the log, for programs that draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cpfls_cli.artifacts.job import Job, check_outputs, take_inputs
from cpfls_cli.artifacts.output import write_files
from cpfls_cli.commands.report import read_sources
from cpfls_cli.export.mcap_form import mcap_bytes
from cpfls_cli.export.tracks import TIME, View, csv_text
from cpfls_cli.export.viewed import view_of
from cpfls_cli.report.content import Text
from cpfls_cli.report.numbers import number
from cpfls_cli.report.outcome import Outcome
from cpfls_cli.words import joined


def run(job: Job, artifact: Path, form: str) -> Outcome:
    """Write the quantities of an artifact."""
    take_inputs(job, {"artifact": artifact})
    check_outputs(job, job.output)
    (source,) = read_sources([artifact], [""])
    view = view_of(artifact, source.record, source.header.config)
    content = mcap_bytes(view) if form == "mcap" else csv_text(view)
    if not job.dry_run:
        write_files({job.output: content})
    size = len(content if isinstance(content, bytes) else content.encode())
    verb = "would be written" if job.dry_run else "written"
    told = [f"{job.output}: {verb} ({size} bytes)", *_told(view, form)]
    return Outcome(_summary(job, view, form, size), tuple(map(Text, told)))


def _told(view: View, form: str) -> list[str]:
    """Say what is in the file, on which clock, and how to open it."""
    if not view.tracks:
        over = view.curves[0].over
        names = ", ".join(curve.name for curve in view.curves)
        return [f"{names}, over {over}" + (", its first column: take it for the time in PlotJuggler" * (form == "csv"))]
    flights = [name for name in dict.fromkeys(track.flight for track in view.tracks) if name]
    names = ", ".join(dict.fromkeys(track.name for track in view.tracks))
    names += f"; of {joined(flights)} each" if flights else ""
    first = min(float(track.time[0]) for track in view.tracks)
    last = max(float(track.time[-1]) for track in view.tracks)
    clock = (
        f"on the clock of the log, {number(first, 9)} to {number(last, 9)} s"
        if view.on_log_clock
        else f"from {number(first, 4)} to {number(last, 4)} s; no log is behind it, or one of an older version"
    )
    own = ""
    if form == "csv":
        column = view.stamps[0] if view.on_log_clock and view.stamps else TIME
        own = f"; take the column {column} for the time in PlotJuggler"
    left = f"; curves over {view.curves[0].over} are in .mcap alone" if view.curves and form == "csv" else ""
    return [names, f"{clock}{own}{left}"]


def _summary(job: Job, view: View, form: str, size: int) -> dict[str, object]:
    return {
        "dry_run": job.dry_run,
        "format": form,
        "output": [str(job.output)],
        "bytes": size,
        "on_log_clock": view.on_log_clock,
        "tracks": [
            {
                "name": track.path,
                "unit": track.unit,
                "frame": track.frame,
                "samples": len(track.time),
                "first_s": float(np.min(track.time, initial=np.inf)),
                "values": list(track.values),
                "axes": list(track.axes),
            }
            for track in view.tracks
        ],
        "curves": [curve.name for curve in view.curves],
    }
