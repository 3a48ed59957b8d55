"""The artifact of a comparison: where a model and flights disagree."""

from __future__ import annotations

from typing import ClassVar

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.gap_groups import AuditGroup, BaseGroup, FlightsGroup, NotExcitedGroup
from cpfls_cli.artifacts.spec import BODY, Format, Record, dataset, group, record


@record
class GapGroup:
    """Gap of each channel."""

    channel: tuple[str, ...] = dataset(
        "channel", "names of the channels: torque about, force along the body axes", "channel"
    )
    rms: Array = dataset(
        "rms", "root mean square of the gap over windows, N m and N", "channel", units="SI", frame=BODY, gaps=True
    )
    floor: Array = dataset(
        "floor", "noise floor of the same windows, N m and N", "channel", units="SI", frame=BODY, gaps=True
    )
    floors: Array = dataset("floors", "gap over floor", "channel", frame=BODY, gaps=True)
    share: Array = dataset(
        "share", "gap over the torque or force that moves the vehicle", "channel", frame=BODY, gaps=True
    )


@record
class ResidualGroup:
    """Gap of each window."""

    time: Array = dataset("time", "middle of each window, on the clock of its flight", "window", units="s")
    flight: IntArray = dataset("flight", "index of its flight", "window")
    value: Array = dataset(
        "value", "what inertia and rotors leave, N m and N", "window", "channel", units="SI", frame=BODY, gaps=True
    )


@record
class StateGroup:
    """Signals averaged over the windows."""

    name: tuple[str, ...] = dataset("name", "signals averaged over the same windows", "state")
    value: Array = dataset("value", "their averages", "window", "state", units="SI", gaps=True)


@record
class StretchGroup:
    """Stretches of time with the largest gap, largest first."""

    flight: IntArray = dataset(
        "flight", "index of the flight; stretches of time with the largest gap, first", "stretch"
    )
    start: Array = dataset("start", "on the clock of the flight", "stretch", units="s")
    end: Array = dataset("end", "on the clock of the flight", "stretch", units="s")
    channel: tuple[str, ...] = dataset("channel", "channel of the gap", "stretch")
    floors: Array = dataset("floors", "root mean square of the gap there, in floors", "stretch")


@record
class DependenceGroup:
    """How well single signals explain the gap of a channel."""

    channel: tuple[str, ...] = dataset("channel", "channel; the best pairs of channel and signal first", "dependence")
    signal: tuple[str, ...] = dataset("signal", "signal that the gap is explained with, alone", "dependence")
    r2: Array = dataset("r2", "share of the variance explained on blocks that the fit did not see", "dependence")
    p_value: Array = dataset("p_value", "probability that chance does as well with any signal", "dependence")


@record
class HeatMapGroup:
    """Mean gap over the two signals that explain it best."""

    channel: str = dataset("channel", "channel with the largest gap in floors")
    signal: tuple[str, ...] = dataset("signal", "the two signals that explain it best", "2")
    first_edge: Array = dataset("first_edge", "edges of the cells along the first signal", "edge", units="SI")
    second_edge: Array = dataset("second_edge", "edges of the cells along the second signal", "edge", units="SI")
    mean: Array = dataset(
        "mean", "mean gap in each cell, N m or N", "cell_first", "cell_second", units="SI", frame=BODY, gaps=True
    )
    count: IntArray = dataset("count", "windows in each cell", "cell_first", "cell_second")


@record
class ReplayGroup:
    """Errors of replays of the measured rotor speeds by horizon."""

    horizon: IntArray = dataset("horizon", "samples over which measured rotor speeds are replayed", "horizon")
    horizon_s: Array = dataset("horizon_s", "the same in seconds", "horizon", units="s")
    rate_model: Array = dataset(
        "rate_model", "rms error of body rates", "horizon", "axis", units="rad/s", frame=BODY, gaps=True
    )
    rate_held: Array = dataset(
        "rate_held", "the same where the rates are held", "horizon", "axis", units="rad/s", frame=BODY, gaps=True
    )
    attitude_model: Array = dataset(
        "attitude_model", "rms turn, simulated to measured", "horizon", "axis", units="rad", frame=BODY, gaps=True
    )
    attitude_held: Array = dataset(
        "attitude_held", "the same where the rates are held", "horizon", "axis", units="rad", frame=BODY, gaps=True
    )


@record
class DisagreementRecord(Record):
    """The artifact `cpfls/disagreement`."""

    FORMAT: ClassVar = Format(
        "cpfls/disagreement",
        "where a model and flights disagree, with the flights",
        "compare, gap",
        ("flight-1", "model"),
    )

    gap: GapGroup = group("gap")
    residual: ResidualGroup = group("residual")
    state: StateGroup = group("state")
    stretch: StretchGroup = group("stretch")
    dependence: DependenceGroup = group("dependence")
    heat_map: HeatMapGroup | None = group("heat_map", default=None)
    replay: ReplayGroup | None = group("replay", default=None)
    not_excited: NotExcitedGroup = group("not_excited")
    audit: AuditGroup = group("")
    warning: tuple[str, ...] = dataset("warning", "what to know about the flights", "warning")
    base: BaseGroup = group("base")
    flights: FlightsGroup = group("")
