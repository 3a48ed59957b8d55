"""Attitude control with a model, beside a rigid body and feedback alone: what a model is good for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.formats import MODEL
from cpfls_cli.pages.figures.tracking import AXES, CONTROLLERS, tracking_figure
from cpfls_cli.pages.source import Source, Sources, section_of_each
from cpfls_cli.report.content import Block, Cell, Heading, Section, Table, Text, Tone
from cpfls_cli.report.numbers import number, percent, plain

_EVEN = 1.01
"""An error that is larger by less than this factor is as good."""

_HEADER = (
    "Controller",
    *(f"RMS {axis}, °" for axis in AXES),
    *(f"Largest {axis}, °" for axis in AXES),
    "RMS torque x, y, z, N m",
)


def tracking_section(sources: Sources) -> Section | None:
    """Show how closely controllers followed a plan.

    Returns
    -------
    Section or None
        None where no flight was controlled with a model.
    """
    tracked = [flight for flight in sources.flights if "tracking/controller" in flight.artifact.data]
    return section_of_each(
        "tracking", "Control with the model", tracked, lambda flight, index: _tracking(flight, index, sources)
    )


def _tracking(flight: Source, index: int, sources: Sources) -> Iterator[Block]:
    settings = flight.config["simulation"]["computed_torque"]
    yield Heading(flight.label)
    yield Text(_setting(flight, settings))
    yield from _judged(flight)
    yield from _limits(flight, sources)
    yield _table(flight, index, settings)
    yield tracking_figure(f"tracking-error-{index}", flight)


def _setting(flight: Source, settings: dict[str, Any]) -> str:
    model, path = flight.input_name("model"), flight.input_name("trajectory")
    plant = "the exact vehicle" if settings["plant"] == "vehicle" else "the identified model itself"
    frequencies = ", ".join(plain(value) for value in settings["natural_frequency_hz"])
    rate = plain(flight.artifact.number("tracking/control_rate"))
    return (
        f"The attitude of {path} is followed by {plant}, held at its centre of mass, under τ = D(q) v + C(q, q̇) q̇ with "
        f"v = q̈ planned + Kd ė + Kp e: natural frequency {frequencies} Hz in roll, pitch and yaw, damping "
        f"{plain(settings['damping'])}, {rate} commands in a second. D and C are those of {model}, of the rigid "
        "body fitted to the same samples, and of the exact vehicle; PD alone has the same gains times a constant "
        "inertia and knows nothing else."
    )


def _judged(flight: Source) -> Iterator[Text]:
    artifact = flight.artifact
    rms = dict(zip(artifact.texts("tracking/controller"), artifact.array("tracking/settled_rms"), strict=True))
    if np.isnan(rms["model"]).any():
        yield Text("The controller with the identified model lost the vehicle.", "warning")
    for other, words in (("rigid-body", "of the rigid body fitted to the same samples"), ("pd", "of PD alone")):
        yield from _share(rms["model"], rms[other], words, "note" if other == "rigid-body" else "warning")


def _limits(flight: Source, sources: Sources) -> Iterator[Text]:
    artifact, model = flight.artifact, sources.by_hash(flight.made_from("model"))
    samples, outside = len(artifact.array("time")), int(np.sum(artifact.array("tracking/outside")))
    if outside:
        beyond = f"{outside} of {samples} samples of this flight lie outside the attitudes that training visited"
        if model is not None and model.artifact.spec == MODEL and model.record.known_everywhere:
            yield Text(f"{beyond}: one rule holds everywhere and all its coefficients are known.", "note")
        else:
            yield Text(f"{beyond}: the model extrapolates there.", "warning")
    indefinite = int(artifact.number("tracking/not_positive_definite"))
    if indefinite:
        impossible = f"D(q) is not positive definite at {indefinite} of {samples} samples"
        yield Text(f"{impossible}: no body moves like that.", "warning")


def _share(own: Array, other: Array, words: str, tone: Tone) -> Iterator[Text]:
    """Compare two errors; which tone it gets depends on whether the model is the worse one on some axis."""
    if np.isfinite(own).all() and (other > 0).all():
        shares = ", ".join(number(value, 3) for value in own / other)
        worse = bool((own > _EVEN * other).any())
        told = f"The error of the identified model is {shares} times that {words} (roll, pitch, yaw)."
        yield Text(told, tone if worse else "good")


def _table(flight: Source, index: int, settings: dict[str, Any]) -> Table:
    artifact = flight.artifact
    since = number(artifact.number("tracking/settled_from"), 3)
    names = artifact.texts("tracking/controller")
    caption = f"Attitude errors of {flight.label} after {since} s, when an initial error has died down."
    if settings["torque_max_n_m"] is not None:
        shares = zip(names, artifact.array("tracking/clipped"), strict=True)
        clipped = ", ".join(f"{CONTROLLERS[name]} {percent(share)}" for name, share in shares)
        caption += f" Commands clipped: {clipped}."
    return Table(f"tracking-{index}", caption, _HEADER, [_row(flight, place) for place in range(len(names))])


def _row(flight: Source, place: int) -> list[str | Cell]:
    artifact = flight.artifact
    name = CONTROLLERS[artifact.texts("tracking/controller")[place]]
    lost = float(artifact.array("tracking/lost_at")[place])
    if not np.isnan(lost):
        return [name, Cell(f"lost at {number(lost, 3)} s", "warning"), *([""] * (len(_HEADER) - 2))]
    errors = np.degrees([artifact.array(f"tracking/settled_{kind}")[place] for kind in ("rms", "max")]).ravel()
    torque = ", ".join(number(value, 3) for value in artifact.array("tracking/torque_rms")[place])
    return [name, *(number(value, 3) for value in errors), torque]
