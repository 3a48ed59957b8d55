"""Attitude errors under computed torque: identified model, rigid body, PD alone, exact vehicle.

    python benchmarks/tracking.py [FOLDER]     --> a table; artifacts are made in FOLDER, or taken from there

The models of configs/paper-gentle.yaml (of a small search), hexarotor.yaml and full-circle.yaml control their exact
rigid-body vehicles, at 400 commands in a second so that the models show and not the time between two commands.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import mean

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import table

CONFIGS = Path(__file__).resolve().parents[1] / "configs"
PAPER_FASTER = ("trajectory.period_s=0.6", "trajectory.duration_s=40")
SMALL_SEARCH = ("identification.population=20", "identification.generations=4", "identification.start=with-uniform")
HEXAROTOR_FASTER = ("trajectory.period_s=0.3",)
CONTROL = "simulation.computed_torque."
RATE = f"{CONTROL}control_rate_hz=400"
REAL = (
    f"{CONTROL}rotor_time_constant_s=0.03",
    f"{CONTROL}attitude_noise_rad=0.002",
    f"{CONTROL}body_rate_noise_rad_s=0.01",
)
# Title, study of vehicle and path, study of the model, changes of the path, settings of the control.
CASES = (
    ("paper's vehicle, training path", "paper-gentle", "paper-gentle", (), (RATE,)),
    ("the same at 100 commands in a second", "paper-gentle", "paper-gentle", (), ()),
    ("the same, rotors of 30 ms and noisy sensors", "paper-gentle", "paper-gentle", (), (RATE, *REAL)),
    ("the same, the model in place of the vehicle", "paper-gentle", "paper-gentle", (), (f"{CONTROL}plant=model",)),
    ("paper's vehicle, faster path", "paper-gentle", "paper-gentle", PAPER_FASTER, (RATE,)),
    ("the same, model of the whole circle", "paper-gentle", "full-circle", PAPER_FASTER, (RATE,)),
    ("hexarotor, training path", "hexarotor", "hexarotor", (), (RATE,)),
    ("hexarotor, faster path", "hexarotor", "hexarotor", HEXAROTOR_FASTER, (RATE,)),
)
COLUMNS = ("flight", "controller", "roll", "pitch", "yaw", "largest", "torque rms / N m", "outside")


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else temporary)
        folder.mkdir(parents=True, exist_ok=True)
        rows = [row for case in CASES for row in compared(folder, *case)]
    print("Attitude errors after 4.4 s, deg: rms by axis and the largest of all axes\n")
    table("tracking", COLUMNS, rows)


def compared(folder: Path, title: str, study: str, learned: str, changes: tuple[str, ...], control: tuple[str, ...]):
    """Run one case, and make a row of each controller."""
    model, path = identified(folder, learned), trajectory(folder, study, changes)
    words = (
        "simulate",
        config(study),
        path,
        "--model",
        model,
        *overrides(control),
        "--set",
        "simulation.relative_noise={}",
    )
    summary = json.loads(run(*words, "-o", folder / "tracked.h5", "--force", "--json", "-q"))
    for one in summary["controllers"]:
        if one["lost_at_s"] is not None:
            yield (title, one["name"], *("lost",) * 4, one["lost_at_s"], summary["outside"] / summary["samples"])
            continue
        rms, largest = ([degrees(value) for value in one[f"settled_{kind}_rad"]] for kind in ("rms", "max"))
        effort = mean(value**2 for value in one["torque_rms_n_m"]) ** 0.5
        yield (title, one["name"], *rms, max(largest), effort, summary["outside"] / summary["samples"])


def identified(folder: Path, study: str) -> Path:
    """Run the pipeline of a study up to its model."""
    path, flight, selection, model = (folder / f"{study}-{n}.h5" for n in ("path", "flight", "selection", "model"))
    if not model.exists():
        trajectory(folder, study, ())
        run("simulate", config(study), path, "-o", flight, "--force")
        run("reduce", config(study), flight, "-o", selection, "--force")
        search = overrides(SMALL_SEARCH if study == "paper-gentle" else ())
        run("identify", config(study), flight, "--selection", selection, *search, "-o", model)
    return model


def trajectory(folder: Path, study: str, changes: tuple[str, ...]) -> Path:
    """Plan the path of a study, or a changed one."""
    path = folder / f"{study}-{'faster' if changes else 'path'}.h5"
    if not path.exists():
        run("trajectory", config(study), *overrides(changes), "-o", path)
    return path


def config(study: str) -> Path:
    return CONFIGS / f"{study}.yaml"


def overrides(changes: tuple[str, ...]) -> list[str]:
    return [word for change in changes for word in ("--set", change)]


def degrees(angle: float) -> float:
    return angle * 57.29577951308232


def run(*words: object) -> str:
    command = [sys.executable, "-m", "cpfls_cli", *map(str, words)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


if __name__ == "__main__":
    main()
