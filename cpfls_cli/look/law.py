"""The control law that flew, as far as a log states it."""

from __future__ import annotations

import numpy as np

from cpfls_cli.arrays import Array, Numbers
from cpfls_cli.autopilots.law import Law, chain
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.flight import LogFlight


def flown_law(flight: LogFlight) -> Law | None:
    """Make the law of the parameters in a log; None where it states no gains, or those of a version of other scales."""
    autopilot = AUTOPILOTS.get(flight.autopilot)
    if autopilot is None or autopilot.firmware.too_old(flight.system):
        return None
    logged = autopilot.in_log(flight.parameters)
    return autopilot.law(autopilot.of_log(logged)) if logged else None


def gyroscope_filters(law: Law | None, axis: int, frequency: Array) -> Numbers:
    """Evaluate the filters that a logged body rate has passed, shape (frequency,); 1 where they are not known."""
    if law is None:
        return np.ones(len(frequency), dtype=complex)
    return chain(law.axes[axis].measured, np.exp(-2j * np.pi * frequency * law.period), law.period)
