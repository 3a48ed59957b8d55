"""The page of attitude control with a model, beside a rigid body and feedback alone: what a model is good for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.flight import FlightRecord, TrackingGroup
from cpfls_cli.artifacts.scores import AXES
from cpfls_cli.artifacts.spec import Record
from cpfls_cli.pages.prediction import trust_along
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.canvas import BASELINE, GREY, legend_above, line, plot, stacked, style_of
from cpfls_cli.report.content import Block, Cell, Folded, Heading, Plot, Table, Text, Tone
from cpfls_cli.report.numbers import number, percent, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CONTROLLERS = {"model": "identified model", "rigid-body": "rigid body", "pd": "PD alone", "vehicle": "exact vehicle"}
_HEADER = (
    "Controller",
    *(f"RMS {axis}, °" for axis in AXES),
    *(f"Largest {axis}, °" for axis in AXES),
    "RMS torque x, y, z, N m",
)
# An error that is larger by less than this factor is as good.
_EVEN = 1.01
_WINDOW_S = 1.0
# Share of the largest error below which none is worth a look.
_SHOWN = 1e-6


def answer(flight: Source[FlightRecord], model: Record | None = None, index: int = 1) -> Iterator[Block]:
    """Say how closely each controller followed the plan, how the model does beside the others, and what to distrust."""
    record, tracking = flight.record, _comparison(flight)
    samples = len(record.time)
    yield Text(
        f"{len(tracking.time)} samples, control rate {plain(tracking.control_rate)} Hz; attitude only, the vehicle is "
        "held at its centre of mass"
    )
    errors, others = _tables(flight, index)
    yield errors
    yield Folded("largest errors, and torques", [others], shown=True)
    yield from _beside(tracking, "rigid-body", "of the rigid body fitted to the same samples", "note")
    yield from _beside(tracking, "pd", "of PD alone", "warning")
    yield from trust_along(tracking.outside_count, tracking.not_positive_definite, samples, model)
    if tracking.lost("model"):
        yield Text(
            f"the flight ends after {samples} samples, where the controller with the model lost the vehicle", "warning"
        )
    if record.rotor_speed is None:
        yield Text("rotor_speed is left out: in hover the rotors cannot give all these torques", "warning")


def _comparison(flight: Source[FlightRecord]) -> TrackingGroup:
    assert flight.record.tracking is not None, "no controllers were compared"
    return flight.record.tracking


def _tables(flight: Source[FlightRecord], index: int) -> tuple[Table, Table]:
    """Show the errors as root mean square, and apart the largest ones with the torques."""
    tracking = _comparison(flight)
    since = number(tracking.settled_from, 3)
    caption = f"Attitude errors of {flight.label} after {since} s, when an initial error has died down."
    if flight.config["simulation"]["computed_torque"]["torque_max_n_m"] is not None:
        clipped = zip(tracking.controller, tracking.clipped, strict=True)
        shares = ", ".join(f"{_CONTROLLERS[name]} {percent(share)}" for name, share in clipped)
        caption += f" Commands clipped: {shares}."
    whole = Table("", "", _HEADER, [_row(tracking, name) for name in tracking.controller])
    errors = replace(whole.part(f"tracking-{index}", 0, 1, 2, 3), caption=caption)
    return errors, whole.part(f"tracking-largest-{index}", 0, 4, 5, 6, 7)


def _row(tracking: TrackingGroup, name: str) -> list[str | Cell]:
    index = tracking.controller.index(name)
    if tracking.lost(name):
        lost = Cell(f"lost at {number(tracking.lost_at[index], 3)} s", "warning")
        return [_CONTROLLERS[name], lost, *([""] * (len(_HEADER) - 2))]
    errors = np.degrees([tracking.settled_rms[index], tracking.settled_max[index]]).ravel()
    torque = ", ".join(number(value, 3) for value in tracking.torque_rms[index])
    return [_CONTROLLERS[name], *(number(value, 3) for value in errors), torque]


def _beside(tracking: TrackingGroup, other: str, words: str, tone: Tone) -> Iterator[Text]:
    """Compare the error of the model with that of another controller; the tone is for where the model is worse."""
    ratio = tracking.ratio(other)
    if ratio is not None:
        shares = ", ".join(number(value, 3) for value in ratio)
        text = f"The error of the identified model is {shares} times that {words} (roll, pitch, yaw)."
        yield Text(text, tone if bool((ratio > _EVEN).any()) else "good")


def tracking_blocks(flight: Source[FlightRecord], index: int, sources: Sources) -> Iterator[Block]:
    """Show how closely controllers followed a plan, where a flight was controlled with a model."""
    model = sources.by_hash(flight.made_from("model"))
    yield Heading(flight.label)
    yield Text(_setting(flight, flight.config["simulation"]["computed_torque"]))
    yield from answer(flight, None if model is None else model.record, index)
    yield tracking_figure(f"tracking-error-{index}", flight)


def _setting(flight: Source[FlightRecord], settings: dict[str, Any]) -> str:
    model, path = flight.input_name("model"), flight.input_name("trajectory")
    plant = "the exact vehicle" if settings["plant"] == "vehicle" else "the identified model itself"
    frequencies = ", ".join(plain(value) for value in settings["natural_frequency_hz"])
    return (
        f"The attitude of {path} is followed by {plant} under τ = D(q) v + C(q, q̇) q̇ with v = q̈ planned + Kd ė + Kp "
        f"e: natural frequency {frequencies} Hz in roll, pitch and yaw, damping {plain(settings['damping'])}. D and C "
        f"are those of {model}, of the rigid body fitted to the same samples, and of the exact vehicle; PD alone has "
        "the same gains times a constant inertia and no model."
    )


def tracking_figure(name: str, flight: Source[FlightRecord]) -> Plot:
    """Draw the size of the attitude error, averaged over a second, by axis and controller."""
    tracking = _comparison(flight)
    time, error = tracking.time, np.degrees(tracking.error)
    window = max(int(np.sum(time - time[0] < _WINDOW_S)), 1)

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(AXES))
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            axes.set_yscale("log")
            for row, controller in enumerate(tracking.controller):
                style = BASELINE if controller == "vehicle" else style_of(row)
                line(axes, *_averaged(time, error[row, :, index], window), label=_CONTROLLERS[controller], **style)
            lowest, highest = axes.get_ylim()
            axes.set_ylim(bottom=max(lowest, _SHOWN * highest))
            axes.axvline(time[0] + tracking.settled_from, color=GREY, linewidth=0.8, linestyle=":")
            axes.set_title(f"error in {axis}", loc="left" if index else "right")
            axes.set_ylabel("°")
        legend_above(panels[0])
        panels[-1].set_xlabel("time, s")

    caption = (
        f"Attitude error of {flight.label}, root mean square over {_WINDOW_S:g} s, on a logarithmic scale. From the "
        "dotted line on the initial error has died down."
    )
    return plot(name, caption, "Attitude error by controller in roll, pitch and yaw over time", 5.2, draw)


def _averaged(time: Array, error: Array, window: int) -> tuple[Array, Array]:
    """Take the root mean square over a window; what follows a loss is left out, and zero has no logarithm."""
    known = error[np.isfinite(error)]
    if len(known) < window:
        return time[:0], known[:0]
    mean = np.convolve(known**2, np.full(window, 1.0 / window), mode="valid")
    middle = time[window // 2 : window // 2 + len(mean)]
    size = np.sqrt(np.maximum(mean, 0.0))
    return middle[size > 0], size[size > 0]
