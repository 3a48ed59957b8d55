"""A small search for a vehicle: its config, and what it tries; and the search that fits whatever is tried."""

import numpy as np

from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.playback import structure
from cpfls_cli.playback.parameters import blocks_of

TRIED = ("inertia", "linear_damping", "rotor_drag", "lag")
CONFIG = """\
seed: 1
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


def _gained_before(_bench, present, gained, blocks):
    """Promise what a block gained when it was tried before, which bounds what it may gain now."""
    return {block: gained.get(block, np.inf) for block in blocks if block not in present.structure.blocks}


def _judge_all(bench, _near, others):
    for each in others:
        bench.judge(each)


def _shrunk_and_fitted(bench, everything):
    path = list(structure._shrinking(everything))
    _judge_all(bench, everything, path)
    return path


WITHOUT_FORESIGHT = {
    "_FORETOLD": 0,
    "_BENT": (),
    "_promised": _gained_before,
    "_shrunk": _shrunk_and_fitted,
    "_judge_hopeful": _judge_all,
}
"""What to put into `cpfls_cli.playback.structure` for a search that fits whatever it looks at."""
