"""Attitude control by a model of the vehicle, and how well a motion is tracked with it."""

from cpfls_cli.control.controllers import (
    Controller,
    Gains,
    Plan,
    TorqueActuators,
    computed_torque,
    gains,
    plan_of,
    proportional_derivative,
)
from cpfls_cli.control.track import AttitudeLoop, Scores, Sensing, Tracked, flown_signals, scores, start_of, track

__all__ = [
    "AttitudeLoop",
    "Controller",
    "Gains",
    "Plan",
    "Scores",
    "Sensing",
    "TorqueActuators",
    "Tracked",
    "computed_torque",
    "flown_signals",
    "gains",
    "plan_of",
    "proportional_derivative",
    "scores",
    "start_of",
    "track",
]
