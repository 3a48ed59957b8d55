"""What a report lacks, and the command that makes it."""

from __future__ import annotations

from cpfls_cli.artifacts.formats import FLIGHT, MODEL, PREDICTION, SELECTION, TRAJECTORY
from cpfls_cli.artifacts.spec import ArtifactSpec
from cpfls_cli.report.source import Sources

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


def missing(sources: Sources) -> dict[str, str]:
    """Name the formats of which no artifact was given.

    Parameters
    ----------
    sources : Sources

    Returns
    -------
    dict of str to str
        One sentence by format, such as ``selection``; it says what is not shown and what makes it.
    """
    given = {source.artifact.spec.format for source in sources.all}
    return {
        _word(spec): f"Not shown, because no {_word(spec)} was given: {shows}; made by: {command}."
        for spec, shows, command in _LACKS
        if spec.format not in given
    }


def _word(spec: ArtifactSpec) -> str:
    return spec.format.removeprefix("cpfls/")
