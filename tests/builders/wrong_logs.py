"""A log of a flight that is right, and what makes its config wrong of it: axes, signs, units, order, numbers."""

import json
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from tests.builders.closed_loop_flights import COARSE, PERIOD, VEHICLE, flown
from tests.builders.vehicle_search import left_out

NOISE = {"body_rate": 0.01, "attitude": 0.003, "velocity": 0.02, "position": 0.005, "rotor_speed": 1.0}
SEARCH = {"search_windows": 20, "folds": 2, "horizon_s": 0.2}
LEARNED = {
    "consequents": "seesaw",
    "products": "additive",
    "membership_functions": 3,
    "base": "rigid-body",
    "population": 4,
    "generations": 1,
    "subpopulations": 1,
    "local_search": {"enabled": False},
    "training_share": 0.6,
    "validation": {"structures": False, "draws": 20, "windows": 20, "horizon_samples": 20},
}
UPSIDE_DOWN = "the vehicle is upside down on average"
TRIED = ("linear_damping",)


class WrongLog(NamedTuple):
    """What is wrong, as settings of a command or as columns of the log, and the words that have to be said of it."""

    settings: tuple[str, ...]
    words: str
    sign: tuple[float, ...] = (1.0, 1.0, 1.0)


def _reversed_spins():
    rotors = [_rotor(rotor, -rotor.spin) for rotor in VEHICLE.rotors]
    return f"vehicle.rotors={json.dumps(rotors)}"


def _rotor(rotor, spin):
    return {
        "position_m": list(rotor.position_m),
        "spin": spin,
        "thrust_factor_n_s2": rotor.thrust_factor_n_s2,
        "drag_factor_n_m_s2": rotor.drag_factor_n_m_s2,
        "radius_m": rotor.radius_m,
    }


WRONG = {
    "gyroscope mirrored about x": WrongLog((), "opposite signs", (-1.0, 1.0, 1.0)),
    "spins swapped": WrongLog((_reversed_spins(),), "the motion, the rotors are"),
    "FLU declared FRD": WrongLog(("import.body_frame=FRD",), UPSIDE_DOWN),
    "a mass 20 times too large": WrongLog((f"vehicle.mass_kg={20 * VEHICLE.mass_kg}",), "which lifts no vehicle"),
    "ENU declared NED": WrongLog(("import.world_frame=NED",), UPSIDE_DOWN),
}


def config_of(folder):
    """Write the config that reads the log rightly."""
    columns = {
        "quaternion": (["qw", "qx", "qy", "qz"], "1"),
        "body_rate": (["p", "q", "r"], "rad/s"),
        "velocity": (["vx", "vy", "vz"], "m/s"),
        "position": (["x", "y", "z"], "m"),
        "rotor_speed": (["w1", "w2", "w3", "w4"], "rad/s"),
    }
    signals = {name: {"columns": names, "unit": unit} for name, (names, unit) in columns.items()}
    vehicle = {
        "mass_kg": VEHICLE.mass_kg,
        "inertia_kg_m2": list(VEHICLE.inertia_kg_m2),
        "rotor_speed_max_rad_s": VEHICLE.rotor_speed_max_rad_s,
        "rotors": [_rotor(rotor, rotor.spin) for rotor in VEHICLE.rotors],
    }
    study = {
        "seed": 1,
        "vehicle": vehicle,
        "import": {"time_column": "t", "signals": signals, "torque_source": "rotor-speed"},
        "gap": {"shifts": 39},
        "identification": LEARNED,
        "playback": {**SEARCH, "leave_out": left_out(TRIED)},
    }
    path = folder / "quad.yaml"
    path.write_text(json.dumps(study, indent=1))
    return path


def log_of(path, seed, sign=(1.0, 1.0, 1.0), duration=8.0):
    """Write a log of a flight with measured rotor speeds; its gyroscope with these signs."""
    logged = flown(duration, seed=seed, noise=NOISE, also=0.05, integration_rate_hz=COARSE).signals
    turned = Rotation.from_euler("ZYX", logged["attitude"][:, ::-1]).as_quat()[:, [3, 0, 1, 2]]
    time = PERIOD * np.arange(len(turned))
    values = np.column_stack(
        [time, turned, logged["body_rate"] * sign, logged["velocity"], logged["position"], logged["rotor_speed"]]
    )
    header = "t,qw,qx,qy,qz,p,q,r,vx,vy,vz,x,y,z,w1,w2,w3,w4"
    np.savetxt(path, values, delimiter=",", header=header, comments="", fmt="%.9g")
    return path
