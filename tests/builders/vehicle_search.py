"""A small search for a vehicle: its config, and what it tries."""

from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.playback.parameters import blocks_of

TRIED = ("inertia", "linear_damping", "rotor_drag", "lag")
CONFIG = """\
vehicle:
  mass_kg: 0.8
  inertia_kg_m2: [0.0040, 0.0044, 0.0075]
  rotor_speed_max_rad_s: 1500.0
  rotors:
    - {position_m: [0.12, -0.11, 0.0], spin: 1, thrust_factor_n_s2: 6.0e-6, drag_factor_n_m_s2: 1.4e-7}
    - {position_m: [-0.12, -0.11, 0.0], spin: -1, thrust_factor_n_s2: 6.0e-6, drag_factor_n_m_s2: 1.4e-7}
    - {position_m: [-0.12, 0.11, 0.0], spin: 1, thrust_factor_n_s2: 6.0e-6, drag_factor_n_m_s2: 1.4e-7}
    - {position_m: [0.12, 0.11, 0.0], spin: -1, thrust_factor_n_s2: 6.0e-6, drag_factor_n_m_s2: 1.4e-7}
trajectory: {legs: 2, displacement_m: 2.0, period_s: 0.12, sample_time_s: 0.01, duration_s: 4.0, yaw_turn_rad: 4.0}
simulation:
  mode: closed-loop
  closed_loop:
    attitude_frequency_hz: 2.5
    yaw_frequency_hz: 1.0
    effects: {linear_damping: [0.012, 0.012, 0.012]}
  noise: {attitude: 0.002, body_rate: 0.01, velocity: 0.01, position: 0.002, rotor_speed: 1.0}
"""


def left_out(tried):
    vehicle = validate(parse_config(CONFIG, "config"), "config").vehicle
    return [block for block in blocks_of(vehicle) if block not in tried]
