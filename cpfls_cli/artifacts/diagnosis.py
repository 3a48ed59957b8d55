"""The artifact of a diagnosis: which physical effect a model misses."""

from __future__ import annotations

from typing import ClassVar

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.gap_groups import (
    AuditGroup,
    BaseGroup,
    FlightsGroup,
    GapChangeGroup,
    NamedEffectsGroup,
    NotExcitedGroup,
    ReplayChangeGroup,
)
from cpfls_cli.artifacts.spec import BODY, Format, Record, dataset, group, record


@record
class AlternativeGroup:
    """Effects that the flights cannot tell from a named one."""

    name: tuple[str, ...] = dataset("name", "effects that the flights cannot tell from a named one", "alternative")
    instead_of: tuple[str, ...] = dataset("instead_of", "the named one", "alternative")
    relative_gain: Array = dataset("relative_gain", "what it explains over what the named one explains", "alternative")
    separated_by: tuple[str, ...] = dataset("separated_by", "the flight that would tell", "alternative")


@record
class UnexplainedGroup:
    """Channels with a gap that nothing in the catalogue explains."""

    axis: tuple[str, ...] = dataset("axis", "channels with a gap that nothing in the catalogue explains", "unexplained")
    floors: Array = dataset("floors", "root mean square of what is left, in floors", "unexplained")
    signal: tuple[str, ...] = dataset("signal", "signal that it depends on most; empty for none", "unexplained")
    share: Array = dataset("share", "share of what is left that signal or narrow band explains", "unexplained")
    frequency: Array = dataset("frequency", "of a narrow band that stands out", "unexplained", units="Hz", gaps=True)
    energy: tuple[str, ...] = dataset("energy", "feeds, drains or neither", "unexplained")


@record
class TorqueAloneGroup:
    """First choices of a look at the torques alone."""

    name: tuple[str, ...] = dataset("name", "first choices of a look at the torques alone", "torque_alone")
    share: Array = dataset("share", "share of the gap that each would explain", "torque_alone")


@record
class ResidualChangeGroup:
    """Gap of each held-out window, before and after."""

    time: Array = dataset("time", "middle of each held-out window, on the clock of its flight", "window", units="s")
    flight: IntArray = dataset("flight", "index of its flight", "window")
    before: Array = dataset(
        "before", "gap of the model as given, N m and N", "window", "channel", units="SI", frame=BODY, gaps=True
    )
    parameters: Array = dataset(
        "parameters", "gap with only its numbers refitted", "window", "channel", units="SI", frame=BODY, gaps=True
    )
    after: Array = dataset("after", "gap with the effects", "window", "channel", units="SI", frame=BODY, gaps=True)


@record
class WhitenessGroup:
    """Autocorrelation of the gap on held-out windows."""

    lag: Array = dataset("lag", "distance of windows that do not overlap", "lag", units="s")
    before: Array = dataset("before", "autocorrelation of the gap of the model as given", "lag", "channel", gaps=True)
    after: Array = dataset("after", "autocorrelation of the gap with the effects", "lag", "channel", gaps=True)
    p_value_before: Array = dataset(
        "p_value_before", "probability that noise is as correlated, by Ljung and Box", "channel", gaps=True
    )
    p_value_after: Array = dataset("p_value_after", "the same with the effects", "channel", gaps=True)


@record
class PictureGroup:
    """Stretch of a held-out flight in which model and flight disagree most."""

    flight: str = dataset("flight", "held-out flight of the stretch in which model and flight disagreed most")
    channel: str = dataset("channel", "channel of the stretch")
    time: Array = dataset("time", "on the clock of the flight", "moment", units="s")
    measured: Array = dataset(
        "measured", "torque or force that the measured motion takes", "moment", units="SI", frame=BODY
    )
    before: Array = dataset("before", "simulated, model as given", "moment", units="SI", frame=BODY)
    after: Array = dataset("after", "simulated, with the effects", "moment", units="SI", frame=BODY)


@record
class RunGroup:
    """Free runs of a held-out stretch."""

    flight: str = dataset("flight", "held-out flight of the stretch whose free runs went astray most")
    axis: int = dataset("axis", "body axis on which they did: 0, 1, 2 for x, y, z")
    time: Array = dataset("time", "on the clock of the flight", "run_sample", units="s")
    restart: Array = dataset("restart", "times at which each free run starts from the measured rate", "run", units="s")
    measured: Array = dataset("measured", "body rates", "run_sample", "axis", units="rad/s", frame=BODY)
    before: Array = dataset("before", "simulated, model as given", "run_sample", "axis", units="rad/s", frame=BODY)
    after: Array = dataset("after", "simulated, with the effects", "run_sample", "axis", units="rad/s", frame=BODY)


@record
class DiagnosisRecord(Record):
    """The artifact `cpfls/diagnosis`."""

    FORMAT: ClassVar = Format(
        "cpfls/diagnosis",
        "which physical effect a model misses, judged on flights that the fit did not see",
        "diagnose, gap",
        ("disagreement", "held-out-1"),
    )

    verdict: str = dataset("verdict", "NAMED, PARTIAL, AMBIGUOUS, UNEXPLAINED, NO_GAP or NOT_EXCITED")
    share: float = dataset("share", "part of the held-out gap above the floor that the effects take off")
    split: str = dataset("split", "which flights trained and which were held out, and why")
    effects: NamedEffectsGroup = group("")
    alternative: AlternativeGroup = group("alternative")
    unexplained: UnexplainedGroup = group("unexplained")
    torque_alone: TorqueAloneGroup = group("torque_alone")
    gap: GapChangeGroup = group("gap")
    replay: ReplayChangeGroup | None = group("replay", default=None)
    residual: ResidualChangeGroup = group("residual")
    whiteness: WhitenessGroup | None = group("whiteness", default=None)
    picture: PictureGroup | None = group("picture", default=None)
    run: RunGroup | None = group("run", default=None)
    not_excited: NotExcitedGroup = group("not_excited")
    audit: AuditGroup = group("")
    note: tuple[str, ...] = dataset("note", "what a reader should know", "note")
    base: BaseGroup = group("base")
    flights: FlightsGroup = group("")
