"""Vehicles whose rotors are alike, and vehicles as a section of a config."""

from cpfls_cli.vehicle.settings import RotorSettings

OPEN_FACTORS = {"thrust_factor_n_s2": None, "drag_factor_n_m_s2": None}


def alike(places, thrust=121.5e-6, drag=2.7e-6, arm=1.0, height=0.0):
    """Rotors at x and y, in units of an arm, each with its spin."""
    return tuple(
        RotorSettings(
            position_m=(x * arm, y * arm, height), spin=spin, thrust_factor_n_s2=thrust, drag_factor_n_m_s2=drag
        )
        for x, y, spin in places
    )
