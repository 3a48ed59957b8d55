"""Simulation: the torques and rotor speeds with which the exact vehicle flies a planned motion."""

from cpfls_cli.simulation.settings import SimulationSettings
from cpfls_cli.simulation.simulate import SimulatedFlight, simulate

__all__ = ["SimulatedFlight", "SimulationSettings", "simulate"]
