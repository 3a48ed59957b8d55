"""Constant offsets of velocity and acceleration, by what position and velocity change by over the same flight."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.blocks import ENOUGH_BLOCKS, block_length, contiguous, half_width, serial_error
from cpfls_cli.consistency.channels import AXES
from cpfls_cli.consistency.findings import Finding
from cpfls_cli.consistency.motion import CHANNELS, TURNED_RAD, Pair, PairCheck, compared
from cpfls_cli.consistency.repairs import ChannelRepair
from cpfls_cli.effects.signals import Signals
from cpfls_cli.rotations import cross
from cpfls_cli.rounding import largest, less
from cpfls_cli.weak_form.resampling import folds
from cpfls_cli.weak_form.windows import Windows
from cpfls_cli.words import joined

_LEAST = {"velocity": 0.1, "acceleration": 0.2, "specific_force": 0.2}
"""Offsets that calibrated sensors do not have, m/s and m/s^2: of an accelerometer 2 % of gravity."""
_CHANCE = 1e-5  # That scatter of blocks makes one: a dozen are looked at, and slow errors scatter less than others.
_APART = 0.5  # Share of an offset by which that of a half of the flight, or against the thrust, may be another.


class _Constant(NamedTuple):
    """By how much a channel exceeds another in one flight, each shape (axis,)."""

    value: Array
    error: Array
    halves: Array  # Shape (half, axis).
    mean: Array  # Of what is compared.
    unexplained: float


def offsets(checks: Sequence[PairCheck], flights: Sequence[Signals], windows: Windows) -> Iterator[ChannelRepair]:
    """Find channels with a constant that the derivative of position or velocity does not have.

    It is a number of each flight, in axes of the world or of the body, whichever leaves less; fitted jointly with
    scales and axes that are off, a delay, and a lever from the centre of mass. In blocks of an eighth of a flight slow
    errors count. A velocity that is rotated a little, and an attitude that leans, make one as well: the first is
    bounded by the mean velocity, and of the second the thrust knows.

    `checks`: of these flights.
    """
    long = [each for each in flights if len(each) * each.period >= ENOUGH_BLOCKS * block_length(0.0)]
    if any(each.attitude is None for each in long):
        return
    for check in checks:
        pair, wrong = check.pair, any(each.contradiction for each in check.problems)
        known = [each for each in long if compared(pair, each, windows) is not None]
        if wrong or not known or pair.first not in ("position", "velocity"):
            continue
        fits = [_constants(pair, each, windows) for each in known]
        left = {body: sum(fit[body].unexplained for fit in fits) for body in fits[0]}
        body = bool(less(left[True], left.get(False, np.inf)))
        judged = zip(fits, known, strict=True)
        sure = np.array([_is_sure(pair, fit[body], each, windows, in_body=body) for fit, each in judged])
        if sure.any():
            yield _repair(pair, np.array([fit[body].value for fit in fits]), sure, known, in_body=body)


def _constants(pair: Pair, signals: Signals, windows: Windows) -> dict[bool, _Constant]:
    """Fit the constant of one flight in axes of the world and, true, of the body."""
    rows = compared(pair, signals, windows)
    assert rows is not None, "both are logged"
    first, second, slope = rows
    turn, spin = signals.rotation, cross(signals.body_rate[:, None], np.eye(3)).swapaxes(1, 2)
    own = np.broadcast_to(np.eye(3), (len(first), 3, 3))
    if pair.second == "specific_force":
        frames, lever = {True: own}, windows.balance(spin @ spin, spin)
    else:
        frames = {False: own, True: windows.average(turn)}
        lever = (windows.average if pair.first == "position" else windows.derivative)(turn @ spin)
    # What is compared holds no error of the channel, which would explain itself.
    scale = np.einsum("ij,wk->wijk", np.eye(3), first - first.mean(axis=0)).reshape(len(first), 3, 9)
    columns = np.concatenate([scale, slope[:, :, None], lever, *frames.values()], axis=2)
    blocks, halves = (folds(columns, second - first, contiguous(len(first), n)) for n in (ENOUGH_BLOCKS, 2))
    found = {}
    for body, last in zip(frames, range(columns.shape[2] - 3 * len(frames), columns.shape[2], 3), strict=True):
        chosen = np.r_[:13, last : last + 3]
        value, left = blocks.fit(chosen)
        without, halved = (each.solve(chosen)[0][:, -3:, 0] for each in (blocks, halves))
        found[body] = _Constant(value[-3:, 0], serial_error(without), halved, first.mean(axis=0), float(left.sum()))
    return found


def _is_sure(pair: Pair, fit: _Constant, signals: Signals, windows: Windows, *, in_body: bool) -> BoolArray:
    """Check which constants are large, significant, and those of both halves and against the thrust, shape (axis,)."""
    size = np.abs(fit.value)
    least = _LEAST[pair.second] + TURNED_RAD * np.linalg.norm(fit.mean) * (pair.first == "position")
    sure = size > np.maximum(least, half_width(fit.error, ENOUGH_BLOCKS, 1 - _CHANCE))
    sure &= np.abs(fit.halves - fit.value).max(axis=0) < _APART * size
    if pair.first == "velocity" and sure[:2].any():
        thrust = Pair("thrust", *pair[1:])
        known = compared(thrust, signals, windows) is not None
        shared = _constants(thrust, signals, windows)[in_body].value if known else np.zeros(3)
        # Along the thrust its own size is not known so well, and no lean shows.
        sure[:2] &= (np.abs(shared - fit.value) < _APART * size)[:2]
    return np.asarray(sure)


def _repair(pair: Pair, values: Array, sure: BoolArray, flights: Sequence[Signals], *, in_body: bool) -> ChannelRepair:
    unit, along = ("m/s" if pair.first == "position" else "m/s^2"), f"along {'body ' if in_body else ''}"
    sizes = {i: largest(values[sure[:, i], i].tolist(), abs) for i in np.flatnonzero(sure.any(axis=0)).tolist()}
    words = joined(f"{size:+.2f} {unit} {along}{AXES[i]}" for i, size in sizes.items())
    own = [any(abs(value[i]) > _APART * abs(size) for i, size in sizes.items()) for value in values]
    of = "" if all(own) else f" in {joined(each.name for each, has in zip(flights, own, strict=True) if has)}"
    channel, witness = CHANNELS[pair.second], CHANNELS[pair.first].words
    what = f"the {channel.words} has a constant offset of {words}{of}, judged by the {witness}"
    finding = Finding(what, f"check {channel.keys}", pair.channels, contradiction=False, repairable=True)
    repair = ChannelRepair(pair.second, offset="".join(AXES[i] for i in sizes), offset_in_body=in_body)
    return repair.with_finding(finding, f"In each flight it is taken off by the {witness}")
