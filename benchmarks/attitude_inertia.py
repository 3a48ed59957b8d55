"""Print what learners miss on held-out flights of a vehicle whose inertia depends on its attitude; draw the figure.

    python benchmarks/attitude_inertia.py

The vehicle carries two loads that slide with roll (`shared/sliding_loads.py`). All learn from the same 5487 samples, a
flight of full rotations on the path optimised for the paper's structure, with white noise on the torque, and choose on
it alone what they have to choose. Eight random flights, which nothing else uses, judge without noise: largest error
over largest torque of the worst axis, median and worst; behind it the root mean square of the error over that of the
torque, median. Times are of the processor.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, seconds, table

pin_threads()

import numpy as np
from matplotlib.figure import Figure

from benchmarks.shared.full_circle import (
    INERTIA,
    PAPER,
    Judged,
    judged,
    optimised_flight,
    random_flight,
    solved,
    torque_data,
    with_noise,
)
from benchmarks.shared.learners import (
    Learned,
    above_rigid_body,
    gaussian_processes,
    mechanics_ridge,
    polynomial_ridge,
    sparse,
)
from benchmarks.shared.sliding_loads import SlidingLoads
from cpfls_cli.identification.data import TorqueData
from cpfls_cli.identification.evaluator import uniform_chromosome
from cpfls_cli.identification.identify import model_evaluator
from cpfls_cli.identification.judge import fit_baselines
from cpfls_cli.identification.search import search
from cpfls_cli.identification.settings import IdentificationSettings
from cpfls_cli.regressor.motion import Motion
from cpfls_cli.report.canvas import GREY, plot

OUTPUT = Path(__file__).resolve().parents[1] / "docs" / "attitude-inertia.svg"
HELD_OUT = range(400, 408)
SEARCH = {"population": 20, "generations": 6}
ORDERS_AND_FUNCTIONS = ((2, 1), (4, 1), (1, 3), (1, 5), (2, 3))


Learner = Callable[[TorqueData], Learned]


@dataclass(frozen=True)
class Setting:
    """A vehicle, and what is learned from."""

    loads: SlidingLoads
    noise: float = 0.01
    random_path: bool = False


MAIN = "20 %"
SETTINGS = {
    "0 %": Setting(SlidingLoads(0.0)),
    "1 %": Setting(SlidingLoads(0.01)),
    "5 %": Setting(SlidingLoads(0.05)),
    MAIN: Setting(SlidingLoads(0.2)),
    "no noise": Setting(SlidingLoads(0.2), noise=0.0),
    "noise 5 %": Setting(SlidingLoads(0.2), noise=0.05),
    "random path": Setting(SlidingLoads(0.2), random_path=True),
    "stroke 0.3 m": Setting(SlidingLoads(0.2, stroke=0.3)),
    "by tilt": Setting(SlidingLoads(0.2, by="tilt")),
    "servos": Setting(SlidingLoads(0.2, held_by="servo")),
}
COLUMNS = ("learner", *SETTINGS, "s to learn", "µs a state", "µs a sample", "chosen")


def rigid_body(flight: TorqueData) -> Learned:
    return Learned(fit_baselines(flight, np.ones(3), 1e-9)[0].torque, np.nan, "")


def paper(base: str) -> Learner:
    """Search for the partitions of the paper's structure, and choose by the default rule."""
    settings = IdentificationSettings(**vars(PAPER), **SEARCH, base=base)

    def learn(flight: TorqueData) -> Learned:
        evaluator = model_evaluator(flight, flight, settings)
        front = search(evaluator, settings, np.random.default_rng(1)).front
        return Learned(solved(evaluator, front.chromosomes[front.chosen]).model.torque, np.nan, "")

    return learn


def harmonic(flight: TorqueData) -> Learned:
    """Choose order and number of functions by the error that the ridge was chosen by, with equidistant partitions."""
    tried = []
    for order, functions in ORDERS_AND_FUNCTIONS:
        settings = IdentificationSettings(harmonic_order=order, membership_functions=functions)
        evaluator = model_evaluator(flight, flight, settings)
        fit = evaluator.fit(uniform_chromosome(evaluator.structure))
        assert fit is not None
        name = "fuzzy part off" if np.isinf(fit.ridge_weight) else f"order {order}, {functions} functions"
        tried.append((fit.mean_squared_error, evaluator, name))
    error, evaluator, name = min(tried, key=lambda one: one[0])
    return Learned(solved(evaluator, uniform_chromosome(evaluator.structure)).model.torque, error, name)


def above(learner: Learner) -> Learner:
    return lambda flight: above_rigid_body(flight, learner)


FUZZY = {
    "the paper's rules, searched": paper("none"),
    "the same over a rigid body": paper("rigid-body"),
    "harmonic rules over a rigid body": harmonic,
}
RIVALS = {
    "polynomial ridge": polynomial_ridge,
    "ridge on terms of mechanics": mechanics_ridge,
    "PySINDy on terms of mechanics": sparse,
    "Gaussian process": gaussian_processes,
}
LEARNERS = {"rigid body": rigid_body, **FUZZY, **{f"{name}, over": above(learn) for name, learn in RIVALS.items()}}
ALONE = {f"{name}, alone": learn for name, learn in RIVALS.items()}
OWN_MOTION = "exact, without the loads' own motion"


@dataclass(frozen=True)
class Result:
    """One learner in one setting."""

    error: Judged
    learned: Learned
    seconds: float


def main() -> None:
    paths = {False: optimised_flight(PAPER), True: random_flight(399)}
    unseen = [random_flight(seed) for seed in HELD_OUT]
    results: dict[str, dict[str, Result]] = {}
    for name, setting in SETTINGS.items():
        exact = setting.loads.on(paths[setting.random_path])
        training = with_noise(exact, setting.noise, np.random.default_rng(7))
        judging = [setting.loads.on(flight) for flight in unseen]
        for learner, learn in learners(name, setting).items():
            results.setdefault(learner, {})[name] = result(learn, training, judging)
    rows = [row(learner, found, unseen[0]) for learner, found in results.items()]
    table("attitude_inertia", COLUMNS, rows, settings={name: details(name, results) for name in SETTINGS})
    caption = "Error on held-out flights, by learner"
    description = "Largest error of each learner on eight flights, median and worst; fuzzy rules have the smallest"
    drawn = plot("attitude-inertia", caption, description, 4.2, lambda figure: draw(figure, results))
    OUTPUT.write_text(drawn.picture.svg + "\n")
    print(f"wrote {OUTPUT}")


def learners(name: str, setting: Setting) -> Mapping[str, Learner]:
    """Give who learns in a setting; no learner is the one that knows all but what D11 and D12 are needed for."""
    more = ALONE if name == MAIN else {}
    known = {OWN_MOTION: without_own_motion(setting.loads)} if setting.loads.held_by == "cam" else {}
    return {**LEARNERS, **more, **known}


def without_own_motion(loads: SlidingLoads) -> Learner:
    def torque(motion: Motion) -> np.ndarray:
        return torque_data(motion, INERTIA).torque + loads.torque(motion) - loads.own_motion(motion)

    return lambda _flight: Learned(torque, np.nan, "")


def result(learn: Learner, training: TorqueData, judging: list[TorqueData]) -> Result:
    start = time.process_time()
    learned = learn(training)
    took = time.process_time() - start
    return Result(judged(learned.torque, judging), learned, took)


def row(learner: str, found: Mapping[str, Result], flight: TorqueData) -> tuple[object, ...]:
    main_result = found[MAIN]
    errors = [f"{found[name].error}; {found[name].error.rms:.2g}" if name in found else "" for name in SETTINGS]
    if learner == OWN_MOTION:
        return learner, *errors, "", "", "", ""
    torque, one = main_result.learned.torque, flight.motion[:1]
    by_itself = min(seconds(lambda: torque(one), time.process_time) for _ in range(20))
    whole = min(seconds(lambda: torque(flight.motion), time.process_time) for _ in range(3)) / len(flight)
    times = f"{main_result.seconds:.2g}", f"{1e6 * by_itself:.0f}", f"{1e6 * whole:.2g}"
    return learner, *errors, *times, main_result.learned.chosen


def details(name: str, results: Mapping[str, Mapping[str, Result]]) -> list[dict[str, object]]:
    """Give all of one setting, for the file."""
    return [
        {
            "learner": learner,
            "largest": found[name].error.largest.tolist(),
            "root_mean_square": found[name].error.root_mean_square.tolist(),
            "seconds": found[name].seconds,
            "chosen": found[name].learned.chosen,
        }
        for learner, found in results.items()
        if name in found
    ]


def draw(figure: Figure, results: Mapping[str, Mapping[str, Result]]) -> None:
    axes = figure.subplots()
    shown = [learner for learner in results if learner not in ALONE and learner != OWN_MOTION]
    for place, learner in enumerate(reversed(shown)):
        error, rms = results[learner][MAIN].error.largest, results[learner][MAIN].error.rms
        colour = GREY if learner == "rigid body" else "black"
        face = "white" if learner not in FUZZY and learner != "rigid body" else colour
        axes.plot([np.median(error), error.max()], [place, place], color=colour, linewidth=1.2)
        axes.plot(np.median(error), place, "o", color=colour, markerfacecolor=face, markersize=7)
        axes.plot(error.max(), place, "|", color=colour, markersize=9)
        axes.plot(rms, place, "x", color=colour, markersize=6)
    for beaten in (np.median(results["rigid body"][MAIN].error.largest), results["rigid body"][MAIN].error.rms):
        axes.axvline(beaten, color=GREY, linewidth=0.9, linestyle="--")
    axes.set_yticks(range(len(shown)), list(reversed(shown)))
    axes.set_xscale("log")
    axes.set_xticks([0.01, 0.1], ["0.01", "0.1"])
    axes.set_xlabel("error on held-out flights, share of the torque")


if __name__ == "__main__":
    main()
