"""Attitude control by a model of the vehicle, and how well a motion is tracked with it."""

from cpfls_cli.control.flown import flown_signals
from cpfls_cli.control.integrate import Actuators
from cpfls_cli.control.laws import (
    Controller,
    Gains,
    RigidBody,
    TorqueModel,
    computed_torque,
    gains,
    proportional_derivative,
)
from cpfls_cli.control.plan import Plan, plan_of
from cpfls_cli.control.plants import Plant, model_plant, rigid_plant
from cpfls_cli.control.scores import Scores, scores
from cpfls_cli.control.track import Loop, Sensing, Tracked, start_of, track

__all__ = [
    "Actuators",
    "Controller",
    "Gains",
    "Loop",
    "Plan",
    "Plant",
    "RigidBody",
    "Scores",
    "Sensing",
    "TorqueModel",
    "Tracked",
    "computed_torque",
    "flown_signals",
    "gains",
    "model_plant",
    "plan_of",
    "proportional_derivative",
    "rigid_plant",
    "scores",
    "start_of",
    "track",
]
