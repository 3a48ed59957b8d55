"""The made-up flight in topics with clocks of their own, and what is proposed for it."""

import numpy as np
from scipy.spatial.transform import Rotation

from cpfls_cli.flightlog.proposal import known_log, propose
from tests.builders.unknown_logs import FLIP, NED, named


def topic(own, every, columns):
    """A topic that has a sample at every so many."""
    return {"timestamp": own.time[::every], **{name: values[::every] for name, values in columns.items()}}


def proposed(topics, system, parameters=None, units=None):
    return propose([known_log("log", topics, units or {}, parameters or {}, system)], None, None)


def maps(proposal):
    return {guess.signal: guess.columns for guess in proposal.signals}


def ardupilot(own):
    angles = np.degrees(Rotation.from_matrix(NED @ own.rotation.as_matrix() @ FLIP).as_euler("ZYX")[:, ::-1])
    # Outputs 5 to 8 drive the motors 1 to 4; the first four are servos.
    pulses = np.column_stack([np.full((len(own.time), 4), 1500.0), 1000 + own.speed])
    topics = {
        "ATT": topic(own, 4, named(angles, "Roll", "Pitch", "Yaw")),
        "IMU": topic(own, 1, named(own.rate @ FLIP, "GyrX", "GyrY", "GyrZ"))
        | named(own.specific_force @ FLIP, "AccX", "AccY", "AccZ"),
        "IMU[1]": topic(own, 1, named(own.rate @ FLIP, "GyrX", "GyrY", "GyrZ")),
        "XKF1": topic(own, 10, named(own.position @ NED.T, "PN", "PE", "PD")),
        "RCOU": topic(own, 2, named(pulses, *(f"C{number}" for number in range(1, 9)))),
    }
    for motor in range(4):
        rpm = own.speed[:, motor] * 60 / (2 * np.pi)
        topics[f"ESC[{motor}]" if motor else "ESC"] = topic(own, 2, {"RPM": rpm})
    return topics
