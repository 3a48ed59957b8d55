"""How well thinned motors are rebuilt, and what wrong ones do to the constants that are found with them.

Simulated flights under the laws of PX4 and ArduPilot, in gusts, with commands that reach their limits.
Their motors are thinned to what each autopilot logs by default, rebuilt, and compared with all of its steps. Then the
angular acceleration is explained by commands with a lag: what is found with all steps, with the thinned ones, with
rebuilt ones, and with rebuilt ones that are made worse. Logs that are given are rebuilt and compared in the same way.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.shared.measure import program, table
from cpfls_cli.arrays import Array
from cpfls_cli.flightlog.rebuilt import Rebuilt, rebuilt_rotors
from cpfls_cli.flightlog.smoothing import low_pass
from cpfls_cli.lag import lagged
from cpfls_cli.logs.formats import log_contents
from tests.builders.thinned_logs import AP, CA, COPTER, Flown

BAND_HZ = 10.0
LAGS_S = np.arange(0.0, 0.2, 0.002)
SEEDS = range(1, 5)
COLUMNS = "flight | Hz | roll | pitch | yaw | mean | lag, ms | scale | error, % | refused"


def main(logs: list[Path] | None = None) -> None:
    rows = []
    for size in (0.25, 0.9):
        px4, copter = Flown("px4", seconds=20.0, size=size), Flown("ardupilot", AP, seconds=20.0, size=size)
        rows.append(row(f"PX4, {size:g}", rebuilt_rotors(px4.px4_topics(), CA, "PX4 1.15.0")))
        rows.append(row(f"PX4, stamps apart, {size:g}", rebuilt_rotors(px4.px4_topics(motors_hz=9.7), CA, "PX4 1.15")))
        for late in (0.0, 0.05):
            found = rebuilt_rotors(copter.ardupilot_topics(late_s=late), COPTER, "ArduCopter 4.5.1")
            rows.append(row(f"ArduPilot, {1e3 * late:g} ms late, {size:g}", found))
    table("rebuilt-motors", COLUMNS, rows)
    table("rebuilt-constants", "commands | effectiveness | lag, ms | explained", constants())
    known = [(path, log_contents(path)) for path in logs or ()]
    found = [(path.name, rebuilt_rotors(own.topics, own.parameters, own.system)) for path, own in known]
    if found:
        table("rebuilt-logs", COLUMNS, [row(name, own) for name, own in found])


def row(name: str, found: Rebuilt | None) -> tuple[str, ...]:
    """Write a line of a flight."""
    if found is None:
        return (name, *["-"] * 8, "nothing to rebuild")
    shares = (*found.by_axis, found.common)
    numbers = (f"{own:.4f}" for own in shares)
    rest = (f"{1e3 * found.lag:.1f}", f"{found.scale:.3f}", f"{100 * found.error:.2f}")
    return (name, f"{found.logged_hz:.0f} to {found.rate_hz:.0f}", *numbers, *rest, found.refused or "no")


def constants() -> list[tuple[str, ...]]:
    """Find effectiveness about roll and its lag with several commands, as medians over flights."""
    found: dict[str, list[tuple[float, float, float]]] = {}
    for seed in SEEDS:
        flight = Flown("px4", seconds=40.0, seed=seed)
        rng = np.random.default_rng(seed)
        every, slow = flight.at(50.0), flight.at(10.0)
        time = flight.time
        true = flight.command @ np.sign([-1.0, 1.0, 1.0, -1.0]) / 4
        held = {"all steps, 400 Hz": (time, true), "logged, 10 Hz": (time[slow], true[slow])}
        held["rebuilt, 50 Hz, on a line"] = time, np.interp(time, time[every], true[every])
        size = float(true.std())
        noise = size * rng.standard_normal(len(every))
        made = {f"rebuilt, explains {share:g}": (0.0, np.sqrt(1 - share)) for share in (1.0, 0.99, 0.95, 0.9, 0.8)}
        made |= {f"rebuilt, {1e3 * late:g} ms late": (late, 0.0) for late in (0.005, 0.01, 0.02)}
        for name, (late, share) in made.items():
            held[name] = time[every] + late, true[every] + share * noise
        for name, (stamps, values) in held.items():
            found.setdefault(name, []).append(effectiveness(flight, stamps, values))
    whole = np.array(found["all steps, 400 Hz"])[:, 0]
    rows = []
    for name, own in found.items():
        size, lag, share = np.median(np.array(own) / np.column_stack([whole, np.ones((len(whole), 2))]), axis=0)
        rows.append((name, f"{size:.3f}", f"{1e3 * lag:.0f}", f"{share:.3f}"))
    return rows


def effectiveness(flight: Flown, stamps: Array, values: Array) -> tuple[float, float, float]:
    """Explain the acceleration about roll below `BAND_HZ` by held commands with a lag: size, lag in s, share."""
    time, rate_hz = flight.motion_time, 250.0
    held = values[np.maximum(np.searchsorted(stamps, time + 1e-9, side="right") - 1, 0)]
    wanted = low_pass(flight.change[:, 9:10], rate_hz, BAND_HZ, 2)[250:-250, 0]
    tried = []
    for lag in LAGS_S:
        own = low_pass(lagged(held[:, None], rate_hz * lag).start, rate_hz, BAND_HZ, 2)[250:-250, 0]
        own = own - own.mean()
        size = float(own @ wanted / (own @ own))
        tried.append(
            (size, float(lag), 1 - float(((wanted - size * own) ** 2).sum() / ((wanted - wanted.mean()) ** 2).sum()))
        )
    return max(tried, key=lambda each: each[2])


if __name__ == "__main__":
    program(main)
