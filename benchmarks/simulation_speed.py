"""How long flights in closed loop take to simulate, against an older checkout: both in turn, processor time.

OLD is a folder with a checkout and its `.venv`. A kind of flight is integrated at 1 kHz; autopilots at their own rate.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

from benchmarks.shared.measure import program, table

HERE = Path(__file__).resolve().parents[1]
KINDS = {
    "plain": ("cpfls", {}),
    "rotor drag and damping": ("cpfls", {"rotor_drag": [1e-3], "linear_damping": [0.1, 0.1, 0.1]}),
    "load on a cable": ("cpfls", {"payload": [0.01, 0.0, 0.0, 0.3, 0.8, 0.2, 0.05]}),
    "lag, delay, filter, battery": (
        "cpfls",
        {"motor_lag": [0.03], "command_delay": [0.0127], "notch_filter": [8.0, 0.5], "battery_sag": [1.5]},
    ),
    "descent and ground": ("cpfls", {"vertical_descent": [0.1] * 6 + [0.7], "ground_effect": [4.0]}),
    "law of PX4": ("px4", {}),
    "law of Betaflight": ("betaflight", {}),
}
REPEATS = 3

WORKER = """
import sys, time
import numpy as np
from cpfls_cli.simulation.measured import measure
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from tests.builders.autopilots import CROSS
from tests.builders.closed_loop_flights import VEHICLE, planned
clock, plan = planned(float(sys.argv[1]))
for line in sys.stdin:
    autopilot, effects = eval(line)
    vehicle = VEHICLE if autopilot == "cpfls" else CROSS
    loop = ClosedLoopSettings(autopilot=autopilot, effects=effects, integration_rate_hz=1000.0)
    settings = SimulationSettings(mode="closed-loop", noise={"body_rate": 0.01}, closed_loop=loop)
    begin = time.process_time()
    measure(clock, plan, vehicle, settings, np.random.default_rng(1))
    print(time.process_time() - begin, flush=True)
"""


def worker(checkout: Path, seconds: float) -> subprocess.Popen[str]:
    """Start a process that flies with a checkout what it is asked for, line by line."""
    command = [str(checkout / ".venv/bin/python"), "-c", WORKER, str(seconds)]
    return subprocess.Popen(command, cwd=checkout, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def took(process: subprocess.Popen[str], kind: tuple[str, dict]) -> float:
    """Give the processor time of one flight, s."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(f"{kind!r}\n")
    process.stdin.flush()
    return float(process.stdout.readline())


def main(old: Path, seconds: float = 40.0) -> None:
    sides = [worker(checkout, seconds) for checkout in (old.resolve(), HERE)]
    for side in sides:
        took(side, KINDS["plain"])
    rows = []
    for name, kind in KINDS.items():
        pairs = [[took(side, kind) for side in sides] for _ in range(REPEATS)]
        before, after = (min(each) for each in zip(*pairs, strict=True))
        rows.append([name, f"{before:.2f}", f"{after:.2f}", f"{before / after:.1f}"])
    table("simulation_speed", "flight | old, s | new, s | old / new", rows)


if __name__ == "__main__":
    program(main)
