"""A known lag of the rotors: the command as they follow it."""

from __future__ import annotations

from dataclasses import replace
from math import exp

import numpy as np
from scipy.signal import lfilter

from cpfls_cli.flightlog.results import LogSignals


def followed(signals: LogSignals, time_constant: float) -> LogSignals:
    """Replace the commands to the rotors by what the rotors make of them, ``tau w' + w = u``, u held between samples.

    Parameters
    ----------
    signals : LogSignals
        On a uniform clock.
    time_constant : float
        tau, s; 0 for rotors that follow at once.
    """
    command = signals.rotor_command
    if command is None or time_constant == 0:
        return signals
    decay = exp(-(signals.time[1] - signals.time[0]) / time_constant)
    # A sample acts from its own stamp on, so the rotors see it one sample later.
    speed = lfilter([0.0, 1 - decay], [1.0, -decay], command, axis=0, zi=command[:1])[0]
    return replace(signals, rotor_command=np.asarray(speed))
