"""A quadrotor of a common size, to be flown by the control laws of autopilots."""

from cpfls_cli.vehicle.settings import RotorSettings, VehicleSettings

ARM = 0.16
CROSS = VehicleSettings(
    mass_kg=1.2,
    inertia_kg_m2=(0.011, 0.012, 0.02),
    rotors=tuple(
        RotorSettings(
            position_m=(x * ARM, y * ARM, 0.0), spin=spin, thrust_factor_n_s2=1.0e-5, drag_factor_n_m_s2=1.6e-7
        )
        for x, y, spin in ((1, -1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1))
    ),
    rotor_speed_max_rad_s=900.0,
)
"""An X of 450 mm: 1.2 kg, hovers at 0.36 of its full thrust."""
