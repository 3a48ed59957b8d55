"""The section of a config that has no defaults, for studies that need some vehicle, and a tiny study."""

import json

from cpfls_cli.config.study import parse_yaml, to_yaml

VEHICLE = f"""\
vehicle: {
    json.dumps(
        {
            "mass_kg": 6.0,
            "inertia_kg_m2": [0.6, 0.6, 1.2],
            "rotor_speed_max_rad_s": 1000.0,
            "rotors": [
                {"position_m": hub, "spin": spin, "thrust_factor_n_s2": 121.5e-6, "drag_factor_n_m_s2": 2.7e-6}
                for hub, spin in (
                    ([0.3, 0.0, 0.0], 1),
                    ([0.0, -0.3, 0.0], -1),
                    ([-0.3, 0.0, 0.0], 1),
                    ([0.0, 0.3, 0.0], -1),
                )
            ],
        }
    )
}
"""
"""The quadrotor of the paper, on one line, to be added to the text of a config."""

TINY = """\
seed: 1
trajectory: {sample_time_s: 0.1}
reduction: {size: 60}
identification:
  structure: cpfls
  input_map: data-range
  consequents: seesaw
  products: additive
  membership_functions: 5
  base: none
  population: 10
  generations: 1
  local_search: {enabled: false}
  validation: {draws: 20, windows: 20, horizon_samples: 6}
"""


def stages(study, folder):
    """Give the artifacts of a study by stage, and the commands that make them."""
    paths = {stage: folder / f"{stage}.h5" for stage in ("trajectory", "flight", "selection", "model")}
    return paths, {
        "trajectory": ("trajectory", study),
        "flight": ("simulate", study, paths["trajectory"]),
        "selection": ("reduce", study, paths["flight"]),
        "model": ("identify", study, paths["flight"], "--selection", paths["selection"]),
    }


def with_vehicle(text):
    """Give a config whose text leaves out keys of the vehicle those of the paper's."""
    data, usual = parse_yaml(text, "text"), parse_yaml(VEHICLE, "usual")["vehicle"]
    own = data.get("vehicle", {})
    return text if not isinstance(own, dict) else to_yaml(data | {"vehicle": usual | own})
