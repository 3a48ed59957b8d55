"""Body rates, from the gyroscope or else from the attitude."""

from __future__ import annotations

from cpfls_cli import rotations
from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.smoothing import derivative


def body_rate_of(time: Array, attitude: Array | None, measured: Array | None) -> Array | None:
    """Take the measured body rates, or derive them from the attitude, ``omega = W(q) dq/dt``.

    Parameters
    ----------
    time : array, shape (time,), s
    attitude : array, shape (time, 3), rad, or None
    measured : array, shape (time, 3), rad/s, body frame, or None

    Returns
    -------
    array, shape (time, 3), rad/s, body frame, or None
        None where there is neither.
    """
    if measured is not None or attitude is None:
        return measured
    return rotations.body_rate(attitude, derivative(time, attitude))
