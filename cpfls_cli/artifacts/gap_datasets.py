"""Groups of datasets that the formats of the gap workflow have in common."""

from __future__ import annotations

from dataclasses import replace

from cpfls_cli.artifacts.spec import BODY, EULER, NO_FRAME, WORLD, DatasetSpec

_CHANNELS = "torque about (x y z, N m) and force along (x y z, N) the body axes"


def signal(path: str, dimensions: tuple[str, ...], units: str, frame: str, description: str) -> DatasetSpec:
    """Describe a signal of flights one after another; not finite in a flight that lacks it.

    Parameters
    ----------
    path : str
        Below ``signals``.
    dimensions : tuple of str
        After the sample.
    """
    return DatasetSpec(f"signals/{path}", ("sample", *dimensions), units, frame, description, False, True)


def text(path: str, dimension: str | None, description: str, required: bool = True) -> DatasetSpec:
    """Describe a text.

    Parameters
    ----------
    dimension : str or None
        None for a single one.
    """
    dimensions = () if dimension is None else (dimension,)
    return DatasetSpec(path, dimensions, "text", NO_FRAME, description, required)


def number(
    path: str, dimensions: tuple[str, ...], description: str, units: str = "1", frame: str = NO_FRAME
) -> DatasetSpec:
    """Describe numbers that are known everywhere."""
    return DatasetSpec(path, dimensions, units, frame, description)


def gappy(
    path: str, dimensions: tuple[str, ...], description: str, units: str = "1", frame: str = NO_FRAME
) -> DatasetSpec:
    """Describe numbers that may be unknown."""
    return DatasetSpec(path, dimensions, units, frame, description, gaps=True)


def optional(*specs: DatasetSpec) -> tuple[DatasetSpec, ...]:
    """Let an artifact lack datasets."""
    return tuple(replace(spec, required=False) for spec in specs)


FLIGHTS = (
    text("flight/name", "flight", "file name, with the part of it where one flight was split"),
    text("flight/role", "flight", "given, training or held-out"),
    number("flight/first", ("flight",), "index of the first sample of each flight"),
    number("flight/commanded", ("flight",), "1 where actuation is what was asked for, not what was measured"),
    number("signals/time", ("sample",), "time on the clock of the flight", "s"),
    number("signals/body_rate", ("sample", "axis"), "body rates p, q, r, as logged", "rad/s", BODY),
    signal("attitude", ("axis",), "rad", EULER, "roll, pitch, yaw"),
    signal("velocity", ("axis",), "m/s", WORLD, "velocity"),
    signal("position", ("axis",), "m", WORLD, "position"),
    signal("acceleration", ("axis",), "m/s^2", WORLD, "acceleration"),
    signal("specific_force", ("axis",), "m/s^2", BODY, "what an accelerometer senses"),
    signal("rotor_speed", ("rotor",), "rad/s", BODY, "rotor speeds, measured or commanded"),
    signal("stated_torque", ("axis",), "N m", BODY, "torque of a log without rotor speeds"),
    signal("stated_thrust", (), "N", BODY, "thrust of such a log, along body z"),
    signal("voltage", (), "1", NO_FRAME, "of the battery, as a share of the full one"),
)
"""Flights one after another along ``sample``."""

AUDIT = (
    text("audit/finding", "finding", "faults of sensors that were tested"),
    number("audit/named", ("finding",), "1 where the fault is sure and matters"),
    number("audit/p_value", ("finding",), "probability that chance shows as much"),
    text("audit/sentence", "finding", "what was found, in words"),
    text("audit_coefficient/finding", "audit_number", "fault that each number belongs to"),
    text("audit_coefficient/name", "audit_number", "name of the number"),
    text("audit_coefficient/unit", "audit_number", "unit of the number"),
    number("audit_coefficient/value", ("audit_number",), "estimate", "SI"),
    gappy("audit_coefficient/low", ("audit_number",), "lower end of the 95 % interval", "SI"),
    gappy("audit_coefficient/high", ("audit_number",), "upper end of the 95 % interval", "SI"),
    number("audit_coefficient/named", ("audit_number",), "1 where it is sure and of practical size"),
    text("audit/untested", "untested", "faults that could not be tested, with the reason"),
    text("audit/warning", "audit_warning", "channels that disagree or look broken; nothing is repaired for them"),
    text("audit/note", "audit_note", "for information"),
)
"""What the sensors say about each other."""

BASE = (
    text("base/kind", None, "rigid-body: the vehicle of /config; model: an identified model"),
    *optional(
        text("base/config", None, "the study that the model was identified with, as YAML"),
        number("base/weights", ("gene",), "as /model/weights of cpfls/model"),
        number("base/coefficients", ("base_parameter",), "as /model/coefficients of cpfls/model", "kg m^2", EULER),
        number("base/rigid_body", ("6",), "as /model/rigid_body of cpfls/model", "kg m^2", BODY),
        number("base/input_range", ("2", "2"), "as /model/input_range of cpfls/model"),
        number("base/visited", ("cell", "cell"), "as /model/visited of cpfls/model", frame=EULER),
    ),
)
"""The model that the flights were compared with."""

NOT_EXCITED = (
    text("not_excited/name", "unseen", "effects that could be there unseen"),
    text("not_excited/reason", "unseen", "why: signals that are lacking, or the flight that would show it"),
)

EFFECTS = (
    text("effect/name", "effect", "identifier, see `cpfls effects`; largest share first, faults of sensors before"),
    text("effect/kind", "effect", "wrench, actuator, sensor or parameter"),
    number("effect/named", ("effect",), "1 if the verdict names it, 0 if it is only the closest"),
    number("effect/p_value", ("effect",), "probability that chance explains as much, over the whole catalogue"),
    number("effect/share", ("effect",), "part of the gap above the floor that comes back without it"),
    number("effect/selection_frequency", ("effect",), "share of the blocks without which it is still the first choice"),
    text("effect/sentence", "effect", "what a pilot understands"),
    text("coefficient/effect", "coefficient", "effect that each coefficient belongs to"),
    text("coefficient/name", "coefficient", "name of the coefficient or shape"),
    text("coefficient/unit", "coefficient", "unit of the coefficient"),
    number("coefficient/value", ("coefficient",), "estimate", "SI"),
    gappy("coefficient/low", ("coefficient",), "lower end of the 95 % interval", "SI"),
    gappy("coefficient/high", ("coefficient",), "upper end of the 95 % interval", "SI"),
    gappy("coefficient/plausible_low", ("coefficient",), "least value that is physically possible", "SI"),
    gappy("coefficient/plausible_high", ("coefficient",), "largest value that is physically possible", "SI"),
    text("linear/effect", "linear", "effect that each linear coefficient belongs to, in the order of its columns"),
    number("linear/value", ("linear",), "linear coefficients of the columns of each effect", "SI"),
    text("shape/effect", "shape", "effect that each shape belongs to"),
    text("shape/name", "shape", "what the effect depends on nonlinearly"),
    number("shape/value", ("shape",), "value of the shape", "SI"),
    text("parameter/name", "parameter", "numbers of the vehicle, refitted with the effects"),
    text("parameter/unit", "parameter", "1 for a relative error: true over that of the model, less 1"),
    number("parameter/value", ("parameter",), "estimate", "SI"),
    gappy("parameter/low", ("parameter",), "lower end of the 95 % interval", "SI"),
    gappy("parameter/high", ("parameter",), "upper end of the 95 % interval", "SI"),
)
"""Effects with all their numbers, enough to evaluate them."""

SHRUNK = (
    text("gap/channel", "channel", f"names of the channels: {_CHANNELS}"),
    gappy("gap/before", ("channel",), "root mean square on the held-out flights, model as given", "SI", BODY),
    gappy("gap/after", ("channel",), "the same with the effects", "SI", BODY),
    gappy("gap/floor", ("channel",), "noise floor of the held-out flights", "SI", BODY),
    gappy("gap/before_floors", ("channel",), "gap of the model as given, in floors", frame=BODY),
    gappy("gap/after_floors", ("channel",), "gap with the effects, in floors", frame=BODY),
    *optional(
        number("replay/horizon", ("horizon",), "samples over which measured rotor speeds are replayed"),
        gappy("replay/horizon_s", ("horizon",), "the same in seconds", "s"),
        gappy("replay/rate_before", ("horizon", "axis"), "rms error of body rates, model as given", "rad/s", BODY),
        gappy("replay/rate_after", ("horizon", "axis"), "the same with the effects", "rad/s", BODY),
        gappy("replay/rate_held", ("horizon", "axis"), "the same where the rates are held", "rad/s", BODY),
        gappy("replay/attitude_before", ("horizon", "axis"), "rms turn between simulated and measured", "rad", BODY),
        gappy("replay/attitude_after", ("horizon", "axis"), "the same with the effects", "rad", BODY),
        gappy("replay/attitude_held", ("horizon", "axis"), "the same where the rates are held", "rad", BODY),
    ),
)
"""How the gap shrinks on flights that the fit did not see."""
