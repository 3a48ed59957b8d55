"""What a flight holds of the attitude controllers that were compared on it."""

from __future__ import annotations

from cpfls_cli.artifacts.spec import BODY, EULER, NO_FRAME, DatasetSpec

_BY_AXIS = ("controller", "axis")


def _spec(path: str, dimensions: tuple[str, ...], units: str, frame: str, text: str, gaps: bool = False) -> DatasetSpec:
    return DatasetSpec(path, dimensions, units, frame, text, required=False, gaps=gaps)


TRACKING: tuple[DatasetSpec, ...] = (
    _spec("tracking/controller", ("controller",), "text", NO_FRAME, "model, rigid-body, pd, vehicle: the model flies"),
    _spec("tracking/time", ("tracked",), "s", NO_FRAME, "samples of the plan; the flight ends where it was lost"),
    _spec("tracking/error", ("controller", "tracked", "axis"), "rad", EULER, "planned less flown angles", gaps=True),
    _spec("tracking/settled_from", (), "s", NO_FRAME, "when the initial error has died down, from the first sample"),
    _spec("tracking/rms", _BY_AXIS, "rad", EULER, "root mean square error; not finite where lost", gaps=True),
    _spec("tracking/settled_rms", _BY_AXIS, "rad", EULER, "the same of the samples after that time", gaps=True),
    _spec("tracking/max_error", _BY_AXIS, "rad", EULER, "largest error", gaps=True),
    _spec("tracking/settled_max", _BY_AXIS, "rad", EULER, "largest error after that time", gaps=True),
    _spec("tracking/torque_rms", _BY_AXIS, "N m", BODY, "root mean square of the torque", gaps=True),
    _spec("tracking/clipped", ("controller",), "1", NO_FRAME, "share of the commands clipped to the largest torque"),
    _spec("tracking/lost_at", ("controller",), "s", NO_FRAME, "time of a loss; not finite where none", gaps=True),
    _spec("tracking/control_rate", (), "1/s", NO_FRAME, "commands in a second"),
    _spec("tracking/outside", ("time",), "1", NO_FRAME, "1 where the flight leaves what the model's training visited"),
    _spec("tracking/not_positive_definite", (), "1", NO_FRAME, "samples of the flight where no body has the D(q)"),
)
"""All optional: only a flight under a computed torque has them."""
