"""What the stage `simulate` says of attitude controllers that were compared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.report.outcome import Outcome


def tracking_outcome(
    signals: Mapping[str, Array],
    noise: Sequence[str],
    record: Mapping[str, Any],
    notes: Iterable[str],
    same_everywhere: bool,
) -> Outcome:
    """Describe a comparison.

    Parameters
    ----------
    signals : mapping of str to array
        Of the flight under the model's controller.
    noise : sequence of str
        Signals with noise in the log.
    record : mapping of str to array
        Datasets of the comparison.
    notes : iterable of str
        What to know of the model.
    same_everywhere : bool
        Whether the model has the same coefficients at all attitudes.
    """
    summary = {
        "samples": len(signals["time"]),
        "noise": list(noise),
        "max_torque": np.max(np.abs(signals["torque"]), axis=0).tolist(),
        "control_rate_hz": float(record["tracking/control_rate"]),
        "settled_from_s": float(record["tracking/settled_from"]),
        "rotor_speed": "rotor_speed" in signals,
        "outside": int(np.sum(record["tracking/outside"])),
        "not_positive_definite": int(record["tracking/not_positive_definite"]),
        "controllers": list(_controllers(record)),
    }
    lines = (_first_line(summary, record), _head(summary), *_table(summary["controllers"]), *_compared(record))
    return Outcome(summary, lines, (*notes, *_warnings(summary, same_everywhere)))


def _controllers(record: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    keys = {
        "rms_rad": "rms",
        "settled_rms_rad": "settled_rms",
        "max_rad": "max_error",
        "settled_max_rad": "settled_max",
        "torque_rms_n_m": "torque_rms",
        "clipped": "clipped",
        "lost_at_s": "lost_at",
    }
    for index, name in enumerate(record["tracking/controller"].tolist()):
        yield {"name": name, **{key: record[f"tracking/{path}"][index].tolist() for key, path in keys.items()}}


def _first_line(summary: Mapping[str, Any], record: Mapping[str, Any]) -> str:
    samples, rate = len(record["tracking/time"]), summary["control_rate_hz"]
    return (
        f"{samples} samples, {rate:.6g} commands in a second; attitude only, the vehicle is held at its centre of mass"
    )


def _head(summary: Mapping[str, Any]) -> str:
    since = f"{summary['settled_from_s']:.3g} s"
    return f"error in roll pitch yaw after {since}, deg: rms, largest; body torque about x y z, N m: rms"


def _table(controllers: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    for one in controllers:
        if not np.isnan(one["lost_at_s"]):
            yield f"{one['name']:<10}  lost the vehicle at {one['lost_at_s']:.4g} s"
            continue
        rms, largest = (_three(np.degrees(one[key])) for key in ("settled_rms_rad", "settled_max_rad"))
        clipped = f"  clipped {one['clipped']:.1%}" if one["clipped"] else ""
        yield f"{one['name']:<10}  rms {rms}  largest {largest}  torque {_three(one['torque_rms_n_m'])}{clipped}"


def _three(values: Sequence[float] | Array) -> str:
    return " ".join(f"{value:>9.3g}" for value in values)


def _compared(record: Mapping[str, Any]) -> Iterator[str]:
    """Say how the model does beside the others: nobody should have to divide for it."""
    rms = dict(zip(record["tracking/controller"].tolist(), record["tracking/settled_rms"], strict=True))
    shares = [
        f"{' '.join(f'{share:.3g}' for share in rms['model'] / rms[other])} of that of {words}"
        for other, words in (("rigid-body", "the rigid body fitted to the same samples"), ("pd", "PD alone"))
        if np.all(rms[other] > 0) and np.isfinite(rms["model"]).all()
    ]
    if shares:
        yield f"rms error with the model (roll pitch yaw): {', '.join(f'times {share}' for share in shares)}"


def _warnings(summary: Mapping[str, Any], same_everywhere: bool) -> Iterator[str]:
    samples = summary["samples"]
    if summary["outside"]:
        trust = (
            "the same coefficients hold there, if the structure does" if same_everywhere else "do not trust it there"
        )
        yield f"{summary['outside']} of {samples} samples lie outside the attitudes that training visited: {trust}"
    if summary["not_positive_definite"]:
        bad = summary["not_positive_definite"]
        yield f"D(q) is not positive definite at {bad} of {samples} samples: no body moves like that"
    if not np.isnan(summary["controllers"][0]["lost_at_s"]):
        yield f"the flight ends after {samples} samples, where the controller with the model lost the vehicle"
    if not summary["rotor_speed"]:
        yield "rotor_speed is left out: in hover the rotors cannot give all these torques"
