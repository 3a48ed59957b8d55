"""A small search for a vehicle: its config, and what it tries; and the search that fits whatever is tried."""

import numpy as np

from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.playback.parameters import blocks_of
from cpfls_cli.rounding import smallest

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


def _shrunk_by_loss(bench, everything):
    """Take out the block that the loss near the fit of all misses least: by ``1/2 b' ((H^-1)_bb)^-1 b``, and fit."""
    kept, fitted = everything.structure.blocks, everything.fit
    numbers, inverse = fitted.free.numbers, np.linalg.inv(fitted.hessian)
    away = (fitted.values - [number.absent for number in numbers]) / fitted.free.scales

    def missed(blocks):
        at = [index for index, number in enumerate(numbers) if number.block not in blocks]
        return away[at] @ np.linalg.solve(inverse[np.ix_(at, at)], away[at])

    path = []
    while len(kept) > 1:
        fewer = [tuple(block for block in kept if block != gone) for gone in kept]
        kept = smallest(fewer, missed)
        path.append(everything.structure._replace(blocks=kept))
    _judge_all(bench, everything, path)
    return path


WITHOUT_FORESIGHT = {
    "_FORETOLD": 0,
    "_BENT": (),
    "_promised": _gained_before,
    "_shrunk": _shrunk_by_loss,
    "_judge_hopeful": _judge_all,
}
"""What to put into `cpfls_cli.playback.structure` for a search that fits whatever it looks at."""
