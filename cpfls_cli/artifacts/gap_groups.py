"""Groups of datasets that the formats of the gap workflow have in common."""

from __future__ import annotations

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.spec import BODY, EULER, WORLD, dataset, group, record


@record
class NotExcitedGroup:
    """Effects that could be there unseen."""

    name: tuple[str, ...] = dataset("name", "effects that could be there unseen", "unseen")
    reason: tuple[str, ...] = dataset(
        "reason", "why: signals that are lacking, or the flight that would show it", "unseen"
    )


@record
class AuditCoefficientGroup:
    """Numbers of the faults of sensors."""

    finding: tuple[str, ...] = dataset("finding", "fault that each number belongs to", "audit_number")
    name: tuple[str, ...] = dataset("name", "name of the number", "audit_number")
    unit: tuple[str, ...] = dataset("unit", "unit of the number", "audit_number")
    value: Array = dataset("value", "estimate", "audit_number", units="SI")
    low: Array = dataset("low", "lower end of the 95 % interval", "audit_number", units="SI", gaps=True)
    high: Array = dataset("high", "upper end of the 95 % interval", "audit_number", units="SI", gaps=True)
    named: Array = dataset("named", "1 where it is sure and of practical size", "audit_number")


@record
class AuditGroup:
    """What the sensors say about each other."""

    finding: tuple[str, ...] = dataset("audit/finding", "faults of sensors that were tested", "finding")
    named: Array = dataset("audit/named", "1 where the fault is sure and matters", "finding")
    p_value: Array = dataset("audit/p_value", "probability that chance shows as much", "finding")
    sentence: tuple[str, ...] = dataset("audit/sentence", "what was found, in words", "finding")
    coefficient: AuditCoefficientGroup = group("audit_coefficient")
    untested: tuple[str, ...] = dataset(
        "audit/untested", "faults that could not be tested, with the reason", "untested"
    )
    warning: tuple[str, ...] = dataset(
        "audit/warning", "channels that disagree or look broken; nothing is repaired for them", "audit_warning"
    )
    note: tuple[str, ...] = dataset("audit/note", "for information", "audit_note")


@record
class BaseGroup:
    """The model that the flights were compared with."""

    kind: str = dataset("kind", "rigid-body: the vehicle of /config; model: an identified model")
    config: str | None = dataset("config", "the study that the model was identified with, as YAML", default=None)
    weights: Array | None = dataset("weights", "as /model/weights of cpfls/model", "gene", default=None)
    coefficients: Array | None = dataset(
        "coefficients",
        "as /model/coefficients of cpfls/model",
        "base_parameter",
        units="kg m^2",
        frame=EULER,
        default=None,
    )
    rigid_body: Array | None = dataset(
        "rigid_body", "as /model/rigid_body of cpfls/model", "6", units="kg m^2", frame=BODY, default=None
    )
    input_range: Array | None = dataset("input_range", "as /model/input_range of cpfls/model", "2", "2", default=None)
    visited: BoolArray | None = dataset(
        "visited", "as /model/visited of cpfls/model", "cell", "cell", frame=EULER, default=None
    )


@record
class FlightGroup:
    """What each flight is, and where its samples begin."""

    name: tuple[str, ...] = dataset("name", "file name, with the part of it where one flight was split", "flight")
    role: tuple[str, ...] = dataset("role", "given, training or held-out", "flight")
    first: IntArray = dataset("first", "index of the first sample of each flight", "flight")
    commanded: IntArray = dataset(
        "commanded", "1 where actuation is what was asked for, not what was measured", "flight"
    )


@record
class SignalsGroup:
    """Signals of all flights; not finite in a flight that lacks one."""

    time: Array = dataset("time", "time on the clock of the flight", "sample", units="s")
    body_rate: Array = dataset(
        "body_rate", "body rates p, q, r, as logged", "sample", "axis", units="rad/s", frame=BODY
    )
    attitude: Array | None = dataset(
        "attitude", "roll, pitch, yaw", "sample", "axis", units="rad", frame=EULER, gaps=True, default=None
    )
    velocity: Array | None = dataset(
        "velocity", "velocity", "sample", "axis", units="m/s", frame=WORLD, gaps=True, default=None
    )
    position: Array | None = dataset(
        "position", "position", "sample", "axis", units="m", frame=WORLD, gaps=True, default=None
    )
    acceleration: Array | None = dataset(
        "acceleration", "acceleration", "sample", "axis", units="m/s^2", frame=WORLD, gaps=True, default=None
    )
    specific_force: Array | None = dataset(
        "specific_force",
        "what an accelerometer senses",
        "sample",
        "axis",
        units="m/s^2",
        frame=BODY,
        gaps=True,
        default=None,
    )
    rotor_speed: Array | None = dataset(
        "rotor_speed",
        "rotor speeds, measured or commanded",
        "sample",
        "rotor",
        units="rad/s",
        frame=BODY,
        gaps=True,
        default=None,
    )
    stated_torque: Array | None = dataset(
        "stated_torque",
        "torque of a log without rotor speeds",
        "sample",
        "axis",
        units="N m",
        frame=BODY,
        gaps=True,
        default=None,
    )
    stated_thrust: Array | None = dataset(
        "stated_thrust", "thrust of such a log, along body z", "sample", units="N", frame=BODY, gaps=True, default=None
    )
    voltage: Array | None = dataset(
        "voltage", "of the battery, as a share of the full one", "sample", gaps=True, default=None
    )


@record
class FlightsGroup:
    """Flights that later stages read, one after another along the samples."""

    each: FlightGroup = group("flight")
    signals: SignalsGroup = group("signals")


@record
class EffectGroup:
    """Effects, largest share first."""

    name: tuple[str, ...] = dataset(
        "name", "identifier, see `cpfls effects`; largest share first, faults of sensors before", "effect"
    )
    kind: tuple[str, ...] = dataset("kind", "wrench, actuator, sensor or parameter", "effect")
    named: Array = dataset("named", "1 if the verdict names it, 0 if it is only the closest", "effect")
    p_value: Array = dataset("p_value", "probability that chance explains as much, over the whole catalogue", "effect")
    share: Array = dataset("share", "part of the gap above the floor that comes back without it", "effect")
    selection_frequency: Array = dataset(
        "selection_frequency", "share of the blocks without which it is still the first choice", "effect"
    )
    sentence: tuple[str, ...] = dataset("sentence", "what a pilot understands", "effect")


@record
class CoefficientGroup:
    """Coefficients and shapes of the effects with their intervals."""

    effect: tuple[str, ...] = dataset("effect", "effect that each coefficient belongs to", "coefficient")
    name: tuple[str, ...] = dataset("name", "name of the coefficient or shape", "coefficient")
    unit: tuple[str, ...] = dataset("unit", "unit of the coefficient", "coefficient")
    value: Array = dataset("value", "estimate", "coefficient", units="SI")
    low: Array = dataset("low", "lower end of the 95 % interval", "coefficient", units="SI", gaps=True)
    high: Array = dataset("high", "upper end of the 95 % interval", "coefficient", units="SI", gaps=True)
    plausible_low: Array = dataset(
        "plausible_low", "least value that is physically possible", "coefficient", units="SI", gaps=True
    )
    plausible_high: Array = dataset(
        "plausible_high", "largest value that is physically possible", "coefficient", units="SI", gaps=True
    )


@record
class LinearGroup:
    """Linear coefficients of the columns of each effect."""

    effect: tuple[str, ...] = dataset(
        "effect", "effect that each linear coefficient belongs to, in the order of its columns", "linear"
    )
    value: Array = dataset("value", "linear coefficients of the columns of each effect", "linear", units="SI")


@record
class ShapeGroup:
    """Nonlinear shapes of the effects."""

    effect: tuple[str, ...] = dataset("effect", "effect that each shape belongs to", "shape")
    name: tuple[str, ...] = dataset("name", "what the effect depends on nonlinearly", "shape")
    value: Array = dataset("value", "value of the shape", "shape", units="SI")


@record
class ParameterGroup:
    """Numbers of the vehicle, refitted with the effects."""

    name: tuple[str, ...] = dataset("name", "numbers of the vehicle, refitted with the effects", "parameter")
    unit: tuple[str, ...] = dataset("unit", "1 for a relative error: true over that of the model, less 1", "parameter")
    value: Array = dataset("value", "estimate", "parameter", units="SI")
    low: Array = dataset("low", "lower end of the 95 % interval", "parameter", units="SI", gaps=True)
    high: Array = dataset("high", "upper end of the 95 % interval", "parameter", units="SI", gaps=True)


@record
class NamedEffectsGroup:
    """Effects with all their numbers, enough to evaluate them."""

    effect: EffectGroup = group("effect")
    coefficient: CoefficientGroup = group("coefficient")
    linear: LinearGroup = group("linear")
    shape: ShapeGroup = group("shape")
    parameter: ParameterGroup = group("parameter")


@record
class GapChangeGroup:
    """Gap of each channel on held-out flights, before and after."""

    channel: tuple[str, ...] = dataset(
        "channel",
        "names of the channels: torque about (x y z, N m) and force along (x y z, N) the body axes",
        "channel",
    )
    before: Array = dataset(
        "before",
        "root mean square on the held-out flights, model as given",
        "channel",
        units="SI",
        frame=BODY,
        gaps=True,
    )
    after: Array = dataset("after", "the same with the effects", "channel", units="SI", frame=BODY, gaps=True)
    floor: Array = dataset("floor", "noise floor of the held-out flights", "channel", units="SI", frame=BODY, gaps=True)
    before_floors: Array = dataset(
        "before_floors", "gap of the model as given, in floors", "channel", frame=BODY, gaps=True
    )
    after_floors: Array = dataset("after_floors", "gap with the effects, in floors", "channel", frame=BODY, gaps=True)


@record
class ReplayChangeGroup:
    """Errors of replays on held-out flights by horizon, before and after."""

    horizon: IntArray = dataset("horizon", "samples over which measured rotor speeds are replayed", "horizon")
    horizon_s: Array = dataset("horizon_s", "the same in seconds", "horizon", units="s", gaps=True)
    rate_before: Array = dataset(
        "rate_before",
        "rms error of body rates, model as given",
        "horizon",
        "axis",
        units="rad/s",
        frame=BODY,
        gaps=True,
    )
    rate_after: Array = dataset(
        "rate_after", "the same with the effects", "horizon", "axis", units="rad/s", frame=BODY, gaps=True
    )
    rate_held: Array = dataset(
        "rate_held", "the same where the rates are held", "horizon", "axis", units="rad/s", frame=BODY, gaps=True
    )
    attitude_before: Array = dataset(
        "attitude_before",
        "rms turn between simulated and measured",
        "horizon",
        "axis",
        units="rad",
        frame=BODY,
        gaps=True,
    )
    attitude_after: Array = dataset(
        "attitude_after", "the same with the effects", "horizon", "axis", units="rad", frame=BODY, gaps=True
    )
    attitude_held: Array = dataset(
        "attitude_held", "the same where the rates are held", "horizon", "axis", units="rad", frame=BODY, gaps=True
    )
