"""Simulation: the exact vehicle along a planned motion, or a flight in closed loop with what its model lacks."""

from cpfls_cli.simulation.flown_effects import FlownEffect, FlownEffects, flown_effects
from cpfls_cli.simulation.flown_model import FlownModel, flown_model
from cpfls_cli.simulation.flyable import Flyability, TooMuch, flyability
from cpfls_cli.simulation.measured import MeasuredFlight, measure
from cpfls_cli.simulation.settings import ClosedLoopSettings, ComputedTorqueSettings, SimulationSettings
from cpfls_cli.simulation.simulate import SimulatedFlight, simulate

__all__ = [
    "ClosedLoopSettings",
    "ComputedTorqueSettings",
    "FlownEffect",
    "FlownEffects",
    "FlownModel",
    "Flyability",
    "MeasuredFlight",
    "SimulatedFlight",
    "SimulationSettings",
    "TooMuch",
    "flown_effects",
    "flown_model",
    "flyability",
    "measure",
    "simulate",
]
