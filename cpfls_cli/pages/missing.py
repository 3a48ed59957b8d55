"""What a report lacks, and the command that makes it."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.artifacts.formats import (
    DIAGNOSIS,
    DISAGREEMENT,
    EXTENDED,
    FLIGHT,
    MODEL,
    PREDICTION,
    SELECTION,
    SWEEP,
    TRAJECTORY,
)
from cpfls_cli.artifacts.spec import ArtifactSpec
from cpfls_cli.pages.gap_words import titles_of
from cpfls_cli.pages.source import Sources

_LACKS: tuple[tuple[ArtifactSpec, str, str], ...] = (
    (TRAJECTORY, "Figure 2 and the table of peaks", "cpfls trajectory CONFIG -o trajectory.h5"),
    (
        FLIGHT,
        "Figure 4 and the quality of the flight",
        "cpfls simulate CONFIG trajectory.h5 -o flight.h5, or cpfls import CONFIG LOG -o flight.h5",
    ),
    (SELECTION, "Table 4 and Figure 5", "cpfls reduce CONFIG flight.h5 -o selection.h5"),
    (MODEL, "Table 5, the baselines, Figure 6 and the rules", "cpfls identify CONFIG flight.h5 -o model.h5"),
    (
        PREDICTION,
        "Figure 7 and the inertia matrix along a flight",
        "cpfls predict CONFIG model.h5 flight.h5 -o prediction.h5",
    ),
)
_SWEEP = (SWEEP, "Table 5 with its means over several seeds", "cpfls sweep CONFIG flight.h5 -o sweep.h5")
_SHOWN = {"extended": "extended model"}
_GAP_LACKS: tuple[tuple[ArtifactSpec, str, str], ...] = (
    (DISAGREEMENT, "where and when model and flights disagree", "cpfls compare CONFIG FLIGHT... -o disagreement.h5"),
    (DIAGNOSIS, "what the model misses", "cpfls diagnose CONFIG disagreement.h5 -o diagnosis.h5"),
    (EXTENDED, "the model with the effects in it", "cpfls extend CONFIG diagnosis.h5 -o extended.h5"),
)


def missing(sources: Sources) -> dict[str, str]:
    """Name the formats of which no artifact was given.

    Returns
    -------
    dict of str to str
        One sentence by format, such as ``selection``; it says what is not shown and what makes it.
    """
    given = {source.artifact.spec.format for source in sources.all}
    return {
        _word(
            spec
        ): f"Not shown, because no {_SHOWN.get(_word(spec), _word(spec))} was given: {shows}; made by: {command}."
        for spec, shows, command in _wanted(sources)
        if spec.format not in given
    }


def _wanted(sources: Sources) -> Iterator[tuple[ArtifactSpec, str, str]]:
    """List what a report of these artifacts could show: nobody who looks for a gap wants a training path."""
    if not sources.only_gap:
        yield from _LACKS
    if sources.settings.paper:
        yield _SWEEP
    if sources.gap:
        yield from _GAP_LACKS[:2]
        if any(len(titles_of(diagnosis)) for diagnosis in sources.diagnoses):
            yield _GAP_LACKS[2]


def _word(spec: ArtifactSpec) -> str:
    return spec.format.removeprefix("cpfls/")
