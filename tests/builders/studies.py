"""The section of a config that has no defaults, for studies that need some vehicle."""

import json

from cpfls_cli.config.yaml_text import parse_yaml, to_yaml

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


def with_vehicle(text):
    """Give a config whose text leaves out keys of the vehicle those of the paper's."""
    data, usual = parse_yaml(text, "text"), parse_yaml(VEHICLE, "usual")["vehicle"]
    own = data.get("vehicle", {})
    return text if not isinstance(own, dict) else to_yaml(data | {"vehicle": usual | own})
