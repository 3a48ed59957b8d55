"""Errors hidden in simulators' own files, on flights of the true vehicle in gusts: what is named, corrected, moved.

A vehicle flies four paths of 40 s in the gusts of real flights, with its setpoints in the log; the last is held out.
Its export is the right file, that of the config the wrong one. A number of a corrected file is judged where it stands,
against the number at the same place of the right file: hidden where the two differ, and touched without need where they
do not. Nothing of the package flies the vehicles.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.shared.measure import count, program, progress, table
from cpfls_cli.export.registry import FORMS
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.model import ModelEffect, VehicleModel
from cpfls_cli.playback.rotors import RotorResponse
from cpfls_cli.simulators.corrected import corrected
from cpfls_cli.simulators.formats import read_model
from cpfls_cli.simulators.results import Change
from cpfls_cli.simulators.study import of_log
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.exported_vehicles import sheet_of_vehicle
from tests.builders.gusty_flights import GUSTS, LARGE, SMALL, Flight, Truth, gusty_flights, logged

FORMATS = ("sdf", "urdf", "mjcf", "rotorpy", "crazyflow")
FLIGHTS, SECONDS, REACH_HZ, SWING = 4, 40.0, 3.0, 0.3
FOLLOWS = ("thrust2weight",)
"""What changes with another number of the same file."""

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")


class Hidden(NamedTuple):
    """What flies, what the right file and the wrong one hold, and the name; commands alone may be logged.

    A centre of mass, m, is where the wrong file's link has to have it; `formats` are those that can state the error.
    """

    truth: Truth
    right: VehicleModel
    wrong: VehicleModel
    name: str
    commands: bool = False
    centre: tuple[float, float] = (0.0, 0.0)
    formats: tuple[str, ...] = FORMATS


class Answer(NamedTuple):
    """What one draw came to: verdict, names, and by format each hidden number written, within, and others touched."""

    verdict: str
    names: tuple[str, ...]
    formats: Mapping[str, tuple[list[bool], int]]


def _hidden() -> Iterator[tuple[str, Hidden]]:
    true = SMALL._replace(drag=0.0, damping=0.0)
    right = VehicleModel(vehicle=true.vehicle, response=RotorResponse(lag_s=true.lag_s))
    yield "nothing", Hidden(true, right, right, "")
    for thrust in (0.8, 1.2):
        rotors = [
            replace(
                each,
                thrust_factor_n_s2=each.thrust_factor_n_s2 / thrust,
                drag_factor_n_m_s2=each.drag_factor_n_m_s2 / thrust,
            )
            for each in true.vehicle.rotors
        ]
        wrong = replace(true.vehicle, rotors=tuple(rotors))
        yield f"thrust {thrust - 1:+.0%}", Hidden(true, right, _of(right, wrong), "parameter_error")
    for inertia in (0.7, 1.3):
        x, y, z = true.inertia
        wrong = replace(true.vehicle, inertia_kg_m2=(x / inertia, y / inertia, z))
        yield f"inertia {inertia - 1:+.0%}", Hidden(true, right, _of(right, wrong), "parameter_error")
    for truth, offset in ((true, (0.002, -0.0015)), (LARGE._replace(drag=0.0, damping=0.0), (0.0064, -0.0048))):
        flown = VehicleModel(vehicle=truth.vehicle, response=RotorResponse(lag_s=truth.lag_s))
        moved = [replace(each, position_m=(*np.add(each.position_m[:2], offset), 0.0)) for each in truth.vehicle.rotors]
        size = f"centre of mass {1e3 * np.hypot(*offset):.1f} mm, {truth.mass:.2g} kg"
        wrong = replace(truth.vehicle, rotors=tuple(moved))
        yield size, Hidden(truth, flown, _of(flown, wrong), "com_offset", centre=offset)
    first, *others = true.vehicle.rotors
    wrong = replace(true.vehicle, rotors=(replace(first, spin=-first.spin), *others))
    # Directions are in the code of gym-pybullet-drones, not in its file.
    stating = tuple(form for form in FORMATS if form != "urdf")
    yield "a rotor's direction", Hidden(true, right, _of(right, wrong), "", formats=stating)
    late = true._replace(lag_s=0.03)
    wrong, slow = (VehicleModel(vehicle=true.vehicle, response=RotorResponse(lag_s=lag)) for lag in (0.001, 0.03))
    yield "lag of 30 ms", Hidden(late, slow, wrong, "motor_lag", commands=True)
    each, speed = 1e-5, (true.mass * 9.81 / 4 / true.thrust_factor) ** 0.5
    drag = ModelEffect("rotor_drag", {}, np.array([each]))
    dragged = true._replace(rotor_drag=each)
    yield (
        f"rotor drag of {4 * each * speed:.2g} N s/m",
        Hidden(dragged, replace(right, effects=(drag,)), right, "rotor_drag"),
    )


def _of(model: VehicleModel, vehicle: VehicleSettings) -> VehicleModel:
    return replace(model, vehicle=vehicle)


def main(draws: int = 10, only: str = "", first: int = 0) -> None:
    names, sizes = [], []
    with ProcessPoolExecutor(2) as pool:
        for what, hidden in _hidden():
            if only in what:
                answers = list(pool.map(partial(_answer, hidden), range(first, first + draws)))
                names.append([what, *_named(hidden, answers)])
                sizes += [[what, form, *_judged(form, answers)] for form in hidden.formats]
                progress(names[-1])
                progress([row[1:] for row in sizes[-len(hidden.formats) :]])
    table("simulator_files_names", "hidden | draws | right name | wrong name | verdicts", names)
    print()
    header = "hidden | file | corrected | hidden numbers within their intervals | draws with others touched"
    table("simulator_files", header, sizes)


def _answer(hidden: Hidden, draw: int) -> Answer:
    runs = range(FLIGHTS * draw, FLIGHTS * (draw + 1))
    asked = [
        Flight(hidden.truth, GUSTS, run, run, reach=REACH_HZ, swing=SWING, commands=hidden.commands) for run in runs
    ]
    vehicle = hidden.wrong.vehicle
    # The log has the direction that flies.
    flies = zip(vehicle.rotors, hidden.truth.vehicle.rotors, strict=True)
    stated = replace(vehicle, rotors=tuple(replace(own, spin=true.spin) for own, true in flies))
    parts = [logged(each, stated, commanded=hidden.commands).parts[0] for each in gusty_flights(asked, SECONDS)]
    flights = [replace(part, name=f"flight-{run}.csv") for run, part in zip(runs, parts, strict=True)]
    found = diagnose(flights[:-1], flights[-1:], GapSettings(), np.random.default_rng(draw)).diagnosis
    formats = {}
    with tempfile.TemporaryDirectory() as folder:
        for form in hidden.formats:
            right, wrong = (_written(Path(folder), form, each) for each in (hidden.right, hidden.wrong))
            of = of_log(read_model(wrong), None, None)
            of = replace(of, spins=tuple(each.spin for each in stated.rotors))
            said, _ = corrected(of, stated, found, flights[:-1])
            formats[form] = _compared(right, wrong, said.changes, hidden.centre)
    return Answer(found.verdict, tuple(each.name for each in found.effects), formats)


def _written(folder: Path, form: str, model: VehicleModel) -> Path:
    path = folder / f"{len([*folder.iterdir()])}{FORMS[form].ending}"
    held, _ = FORMS[form].held(model)
    path.write_text(FORMS[form].write(sheet_of_vehicle(model), held, (), "uav"))
    return path


def _compared(
    right: Path, wrong: Path, changes: Sequence[Change], centre: tuple[float, float]
) -> tuple[list[bool], int]:
    """Tell of each hidden number that is written whether its interval holds the truth, and count the others."""
    # Of words that are directions, the signs.
    texts = (path.read_text().replace(">ccw<", ">1<").replace(">cw<", ">-1<") for path in (wrong, right))
    wrongs, rights = (text.splitlines() for text in texts)
    # A gear is written where the gain of the same actuator is wrong.
    before_gain, true_gain = (stated.value for each in (wrong, right) if (stated := read_model(each).rotors[0].thrust))
    within, others = [], 0
    for change in changes:
        line = re.search(r" line (\d+)", change.where)
        assert line is not None, change.where
        # Comments in front of the vehicle may be longer in one of them, so lines are counted from the end.
        place = int(line[1]) - 1 - len(wrongs)
        numbers = zip(*(map(float, NUMBER.findall(lines[place])) for lines in (wrongs, rights)), strict=True)
        # Of equal numbers in a line the one that differs is meant.
        before, true = min(numbers, key=lambda pair: (abs(pair[0] - change.before), pair[0] == pair[1]))
        true = before * true_gain / before_gain if change.element == "gear z" else true
        if "mixing_matrix" in change.element:
            # In lengths L, which are another in each file.
            true_length, length = (float(found[1]) for text in (rights, wrongs) if (found := _length(text)))
            true *= true_length / length
        true = dict(zip(("pose x", "pose y"), centre, strict=True)).get(change.element, true) if any(centre) else true
        if abs(true - before) > 1e-3 * abs(before):
            within.append(change.low <= true <= change.high)
        elif change.element not in FOLLOWS:
            others += 1
    return within, others


def _length(lines: Sequence[str]) -> re.Match[str] | None:
    return re.search(r"^L *= *(\S+)", "\n".join(lines), re.MULTILINE)


def _named(hidden: Hidden, answers: Sequence[Answer]) -> Iterator[Any]:
    yield len(answers)
    sure = [each for each in answers if each.verdict in ("NAMED", "PARTIAL")]
    yield count([each.names == (hidden.name,) if hidden.name else each.verdict == "NO_GAP" for each in answers])
    yield sum(bool(set(each.names) - {hidden.name}) for each in sure)
    yield ", ".join(f"{number} {verdict}" for verdict, number in Counter(each.verdict for each in answers).items())


def _judged(form: str, answers: Sequence[Answer]) -> Iterator[Any]:
    numbers = [each.formats[form] for each in answers]
    yield count([bool(within) for within, _ in numbers])
    yield count([one for within, _ in numbers for one in within])
    yield sum(others > 0 for _, others in numbers)


if __name__ == "__main__":
    program(main)
