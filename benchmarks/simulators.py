"""Vehicles exported for simulators and libraries: flown along flights next to the library, and what a step takes.

Parts, both if none is named: playback and steps. Flights: the example's kind (a vehicle with lag, damping, drag and
flapping, noise in its log), RotorPy's with its own hidden effects, and a real Crazyflie with motor commands and a
gyroscope alone, by the vehicle that its config states with the lag of its motors; the last two are read from
CPFLS_FLIGHTS. Times are processor times, in turn.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.shared.measure import program, seconds, table
from cpfls_cli.config.load import load_study
from cpfls_cli.export.registry import FORMS, exported
from cpfls_cli.export.source import c_source
from cpfls_cli.flights.playback import flights_to_play
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.playback.player import Course, player_of
from cpfls_cli.playback.rotors import RotorResponse
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.flown_exports import FLYING, text_of
from tests.builders.playback_flights import MIDDLING, ROTORPY, ROTORPY_HIDDEN, flown, rotorpy_flight, truth
from tests.builders.recorded_flights import FLIGHTS
from tests.builders.verified_exports import verified

ROOT = Path(__file__).resolve().parents[1]
WINDOWS, BATCH = 4, 1000
MOTORS_S = 0.072
LOOP = """
#include "vehicle.h"
void steps(double *state, const double *rotor, long n)
{
    for (long i = 0; i < n; ++i)
        vehicle_step((vehicle_state *)state, rotor, 0.001);
}
"""


def main(parts: list[str] | None = None) -> None:
    for name in parts or PARTS:
        print(f"\n{name}:\n")
        PARTS[name]()


def flights():
    """Models with the flights that they are flown along."""
    model = truth()
    yield "example", model, flown(model, ("multisine",), noise=MIDDLING, hold="linear", duration_s=12.0)[0]
    for name in ("com", "drag"):
        yield f"RotorPy, {name}", VehicleModel(vehicle=ROTORPY, effects=ROTORPY_HIDDEN[name]), rotorpy_flight(name)
    study = load_study(ROOT / "configs" / "gap" / "arpl.yaml")
    (logged,) = flights_to_play([FLIGHTS / "real" / "arpl_crazyflie_1khz" / "log15_55_90s.csv"], study)
    yield "real Crazyflie", VehicleModel(vehicle=study.vehicle, response=RotorResponse(lag_s=MOTORS_S)), logged.playback


def playback() -> None:
    rows = []
    for name, model, flight in flights():
        for form in FLYING:
            made = exported(sheet_of_vehicle(model), form, "vehicle.py")
            horizon = round(0.5 / flight.motion.period)
            found = verified(form, made, flight, (flight, player_of(model, flight)), horizon, WINDOWS)
            off = [f"{value:.2g}" for value in (*found.errors[:, 3], found.missing[3], found.step[3])]
            rows.append((name, FORMS[form].title, *off, f"{found.equations.max():.1g}"))
    columns = (
        "flight | target | playback - measured | target - measured | target - playback | not held | step | equations"
    )
    print("Body rate after 0.5 s, rad/s, mean; what is not held and the step: largest; equations: largest, SI.\n")
    table("simulators_playback", columns, rows)


def steps() -> None:
    """One step of 1 ms of the vehicle of the example in each target, next to one in C."""
    model = truth()
    flight = flown(model, ("multisine",), hold="linear", duration_s=2.0, rate_hz=1000.0)[0]
    course = Course(flight, np.array([0]), 400)
    state = np.concatenate([part[0].ravel() for part in course.start])
    rotor = model.response.terms_by_step(flight.speed, 0.001, "linear")[0]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        call = in_c(model, Path(folder))
        count = 100_000
        for form in FLYING:
            text = text_of(form, exported(sheet_of_vehicle(model), form, "v.py"))
            # The second flight less the first: what does not grow with the steps is left out.
            short = Course(flight, course.starts, 100)
            FLYING[form].fly(text, short)
            times = []
            for _ in range(3):
                fast = seconds(lambda: call(state, rotor, count)) / count
                long, brief = (seconds(partial(FLYING[form].fly, text, one)) for one in (course, short))
                times.append(((long - brief) / 300, fast))
            own, c = np.median(times, axis=0)
            rows.append((FORMS[form].title, f"{1e6 * own:.3g}", f"{1e6 * c:.3g}", f"{own / c:.3g}"))
    table("simulators_step", "target, through Python | us a step | C, us a step | ratio", rows)


def in_c(model, folder):
    """Compile the C of a vehicle, and give a call of many steps."""
    written = c_source(sheet_of_vehicle(model), "vehicle")
    (folder / "vehicle.c").write_text(written.source)
    (folder / "vehicle.h").write_text(written.header)
    (folder / "loop.c").write_text(LOOP)
    flags = ["gcc", "-std=c99", "-O2", "-shared", "-fPIC", "-o", "v.so", "vehicle.c", "loop.c", "-lm"]
    subprocess.run(flags, cwd=folder, check=True)
    steps = ctypes.CDLL(str(folder / "v.so")).steps
    pointer = ctypes.POINTER(ctypes.c_double)

    def call(state, rotor, count):
        own = state.copy()
        steps(own.ctypes.data_as(pointer), rotor.ctypes.data_as(pointer), ctypes.c_long(count))

    return call


PARTS = {"playback": playback, "steps": steps}

if __name__ == "__main__":
    program(main)
