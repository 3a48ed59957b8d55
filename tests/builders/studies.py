"""The section of a config that has no defaults, for studies that need some vehicle, and a tiny study."""

import json
from dataclasses import asdict

from cpfls_cli.config.study import parse_yaml, to_yaml
from cpfls_cli.vehicle.settings import VehicleSettings

VEHICLE = f"vehicle: {json.dumps(asdict(VehicleSettings()))}\n"
"""The quadrotor of the paper, on one line, to be added to the text of a config."""

IDENTIFICATION = """\
identification:
  input_map: data-range
  consequents: seesaw
  products: additive
  membership_functions: 5
  base: none
  population: 10
  generations: 1
  local_search: {enabled: false}
"""
TINY = f"""\
trajectory: {{sample_time_s: 0.1}}
reduction: {{size: 60}}
{IDENTIFICATION}\
  validation: {{draws: 20, windows: 20, horizon_samples: 6}}
"""
LOG_STUDY = """\
import:
  signals:
    attitude: {columns: [roll, pitch, yaw], unit: rad}
    body_torque: {columns: [mx, my, mz], unit: N m}
"""


def put_file(path, content):
    """Write a file; give its path."""
    (path.write_bytes if isinstance(content, bytes) else path.write_text)(content)
    return path


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
