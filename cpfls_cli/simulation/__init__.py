"""Simulation: the exact vehicle along a planned motion, or a closed loop with effects that its model lacks."""

from cpfls_cli.simulation.inverse import Flyability, SimulatedFlight, TooMuch, flyability, simulate
from cpfls_cli.simulation.measured import MeasuredFlight, measure
from cpfls_cli.simulation.model import (
    SimulatedEffect,
    SimulatedEffects,
    SimulatedModel,
    simulated_effects,
    simulated_model,
    simulated_vehicle,
)
from cpfls_cli.simulation.settings import ClosedLoopSettings, ComputedTorqueSettings, SimulationSettings

__all__ = [
    "ClosedLoopSettings",
    "ComputedTorqueSettings",
    "Flyability",
    "MeasuredFlight",
    "SimulatedEffect",
    "SimulatedEffects",
    "SimulatedFlight",
    "SimulatedModel",
    "SimulationSettings",
    "TooMuch",
    "flyability",
    "measure",
    "simulate",
    "simulated_effects",
    "simulated_model",
    "simulated_vehicle",
]
