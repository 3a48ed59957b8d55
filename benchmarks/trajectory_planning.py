"""The planner in figures: five million random moves, a general minimiser, speed, and what smoothness costs.

    python benchmarks/trajectory_planning.py [--moves 5000000] [--plot docs/planner-cost.svg]

It needs ruckig, of the ``bench`` extra, which plans the shortest move under limits on velocity, acceleration and jerk.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import astuple, dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.measure import pin_threads, seconds, table

pin_threads()

import numpy as np
import ruckig
from matplotlib.figure import Figure

from benchmarks.shared.brute_force import shortest_duration
from benchmarks.shared.exact_move import integrated
from cpfls_cli.report.canvas import legend_above, plot, style_of
from cpfls_cli.trajectory.legs import synchronised
from cpfls_cli.trajectory.limits import LIMIT_NAMES, Limits
from cpfls_cli.trajectory.moves import Moves, plan_move, plan_moves

PLOT = Path(__file__).resolve().parents[1] / "docs" / "planner-cost.svg"
BATCH = 100_000
# The paper's move over 64 m reaches all of these. Each variant has the limits of the one before, and one more.
SLOW = {"velocity": 8.0, "acceleration": 2.0, "jerk": 1.0}
PAPER = {**SLOW, "snap": 1.0, "crackle": 2.0, "pop": 2 * np.pi}
# Over 6400 m a move holds every derivative that can be held.
HELD = {"velocity": 20.0, "acceleration": 2.0, "jerk": 0.5, "snap": 0.25, "crackle": 2.0, "pop": 20.0}
VARIANTS = {
    "as ruckig": (SLOW, None),
    "and snap": ({**SLOW, "snap": 1.0}, None),
    "and crackle": ({**SLOW, "snap": 1.0, "crackle": 2.0}, None),
    "and pop": (PAPER, None),
    "period 1 s": (SLOW, 1.0),
}
TABULATED = np.array([0.001, 0.01, 0.1, 1.0, 10.0, 64.0, 100.0, 1000.0, 10_000.0])


def random_cases(rng: np.random.Generator, moves: int, chosen: bool):
    """Draw displacements and limits over six decades, each limit absent in three of ten, and periods over three."""
    displacement, limits = 10 ** rng.uniform(-3, 3, moves) * rng.choice([-1, 1], moves), random_limits(rng, moves)
    return displacement, limits, None if chosen else 10 ** rng.uniform(-2, 1, moves)


def random_limits(rng: np.random.Generator, moves: int) -> np.ndarray:
    limits = 10 ** rng.uniform(-3, 3, (6, moves))
    limits[rng.random((6, moves)) < 0.3] = np.inf
    return limits


def planned(displacement, limits, period) -> Moves:
    return plan_moves(displacement, Limits(**dict(zip(LIMIT_NAMES, limits, strict=True))), period)


@dataclass
class Tally:
    """What was found wrong in random moves, and the largest errors."""

    moves: int = 0
    without_limits: int = 0
    unsolved: int = 0
    not_numbers: int = 0
    excess: float = -np.inf
    ends: int = 0
    errors: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def count(self, moves: Moves, limits: np.ndarray, unlimited: np.ndarray) -> None:
        solved = moves.outcome == 0
        self.moves += len(moves)
        self.without_limits += int(unlimited.sum())
        self.unsolved += int((~solved & ~unlimited).sum())
        self.not_numbers += int(np.isnan([*moves.peaks, *moves.holds, moves.period, moves.duration]).any(axis=0).sum())
        bounded = np.isfinite(limits) & solved
        self.excess = max(self.excess, float((moves.peaks[1:][bounded] / limits[bounded]).max()) - 1)

    def sample_ends(self, moves: Moves, every: int) -> None:
        """Compare the last instant before the end with the end, each derivative in parts of its peak.

        That instant is one rounding of the time away, and what the next derivative makes of that is no error.
        """
        for index in np.flatnonzero(moves.outcome == 0)[::every]:
            move, peaks = moves[int(index)], moves.peaks[:, index]
            instant = np.nextafter(move.duration, 0.0)
            last = move.profile.sample(np.array([instant]))[0, :3]
            last[0] -= moves.displacement[index]
            with np.errstate(invalid="ignore"):
                errors = np.maximum(np.abs(last) - (move.duration - instant) * peaks[1:4], 0.0) / peaks[:3]
            self.errors = np.fmax(self.errors, errors)
            self.ends += 1


def correctness(total: int) -> None:
    rng, tally = np.random.default_rng(7), Tally()
    for batch in range(max(total // BATCH, 1)):
        displacement, limits, period = random_cases(rng, min(BATCH, total), chosen=batch % 2 == 0)
        moves = planned(displacement, limits, period)
        unlimited = np.isinf(limits).all(axis=0) & (period is None)
        tally.count(moves, limits, unlimited)
        tally.sample_ends(moves, every=100)
    rows = [
        ("random moves, every second batch with a given period", tally.moves),
        ("of these without any limit, and told so", tally.without_limits),
        ("limited, and not solved", tally.unsolved),
        ("anything not a number", tally.not_numbers),
        ("largest excess over a limit, relative", tally.excess),
        ("moves sampled at the last instant before their end", tally.ends),
        *zip(
            ("largest error of the end position, relative", "end velocity over its peak", "end acceleration over its"),
            tally.errors.tolist(),
            strict=True,
        ),
    ]
    table("planner_correctness", ("random moves over six decades", "figure"), rows)


def exactness(cases: int) -> None:
    """Compare samples, and the end, with an integration that has sixty digits."""
    rng, inside, end = np.random.default_rng(10), np.zeros(7), np.zeros(7)
    displacement, limits, _ = random_cases(rng, cases, True)
    # Without limits on crackle and pop there are jumps, and nothing to integrate there.
    limits[5] = 10 ** rng.uniform(-3, 3, cases)
    for move in planned(displacement, limits, None):
        times, states = integrated(move.profile)
        peaks = np.array(astuple(move.peaks))
        slopes = np.append(peaks[1:], 2 * np.pi * peaks[6] / move.profile.period)
        rounding = np.finfo(float).eps * (peaks + move.duration * slopes)
        before = times < move.duration
        errors = np.abs(move.profile.sample(times[before]) - states[before]) / rounding
        inside = np.maximum(inside, errors.max(axis=0))
        end = np.maximum(end, np.abs(states[-1] - np.append(move.profile.displacement, np.zeros(6))) / peaks)
    names = ("displacement", *LIMIT_NAMES)
    rows = [(name, float(one), f"{other:.1e}") for name, one, other in zip(names, inside, end, strict=True)]
    columns = (f"{cases} moves against sixty digits", "sample, in roundings of value and time", "end, over the peak")
    table("planner_exactness", columns, rows)


def optimality(cases: int) -> None:
    rng, rows = np.random.default_rng(8), []
    for chosen in (True, False):
        displacement, limits, period = random_cases(rng, cases // 2, chosen)
        moves, slower = planned(displacement, limits, period), []
        for index in np.flatnonzero(moves.outcome == 0):
            given = None if period is None else float(period[index])
            brute = shortest_duration(abs(float(displacement[index])), limits[:, index], given, rng)
            slower.append(moves.duration[index] / brute - 1)
        rows.append(("chosen" if chosen else "given", len(slower), f"{max(slower):.1e}", f"{min(slower):.1e}"))
    columns = ("period", "random moves", "slowest against the minimiser", "fastest")
    table("planner_optimality", columns, rows)


def best(work, calls: int, repeats: int = 5) -> float:
    """Microseconds of one call, the best of several runs."""
    return min(seconds(work) for _ in range(repeats)) / calls * 1e6


def speed() -> None:
    rng = np.random.default_rng(9)
    limits, six = Limits(**PAPER), np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    free, given = random_cases(rng, BATCH, True), random_cases(rng, BATCH, False)
    alone = best(lambda: [plan_move(64.0, limits) for _ in range(200)], 200)
    together = best(lambda: [synchronised(six, limits, None, "each-axis") for _ in range(200)], 200)
    rows = [
        (f"plan, batches of {BATCH}, period chosen", best(lambda: planned(*free), BATCH), "µs a move"),
        (f"plan, batches of {BATCH}, period given", best(lambda: planned(*given), BATCH), "µs a move"),
        ("plan, one move at a time", alone, "µs a plan"),
        ("plan, six axes together", together, "µs a plan"),
    ]
    rows += [
        ("ruckig, one axis", ruckig_time(rng, 1), "µs a plan"),
        ("ruckig, six axes", ruckig_time(rng, 6), "µs a plan"),
    ]
    rows.append(("sample, seven derivatives", sampling_rate(64.0), "million values a second"))
    rows.append(("sample, with all holds", sampling_rate(6400.0), "million values a second"))
    table("planner_speed", ("what", "figure", "unit"), rows)


def sampling_rate(displacement: float, samples: int = 2_000_000) -> float:
    move = plan_move(displacement, Limits(**HELD))
    time = np.linspace(0, move.duration, samples)
    return 7 / best(lambda: move.profile.sample(time), samples)


def ruckig_input(displacements, velocity: float, acceleration: float, jerk: float):
    axes = len(displacements)
    given = ruckig.InputParameter(axes)
    given.current_position, given.target_position = [0.0] * axes, list(displacements)
    given.max_velocity, given.max_acceleration, given.max_jerk = [velocity] * axes, [acceleration] * axes, [jerk] * axes
    return given


def ruckig_plan(displacement: float):
    trajectory = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(ruckig_input([displacement], *SLOW.values()), trajectory)
    return trajectory


def ruckig_time(rng: np.random.Generator, axes: int, plans: int = 5000) -> float:
    """Time ruckig's own call, with its input ready; it refuses what takes two hours or longer."""
    draws = 10 ** rng.uniform(-1, 1, (plans, axes + 3))
    inputs = [ruckig_input(row[:axes].tolist(), *row[axes:].tolist()) for row in draws]
    planner, trajectory = ruckig.Ruckig(axes), ruckig.Trajectory(axes)
    return best(lambda: [planner.calculate(given, trajectory) for given in inputs], plans)


def durations(displacement: np.ndarray) -> dict[str, np.ndarray]:
    shortest = {"ruckig": np.array([ruckig_plan(float(value)).duration for value in displacement])}
    return shortest | {
        name: plan_moves(displacement, Limits(**limits), period).duration for name, (limits, period) in VARIANTS.items()
    }


def cost(output: Path) -> None:
    found = durations(TABULATED)
    rows = [
        (f"{displacement:g}", *(f"{values[row]:.4g}" for values in found.values()))
        for row, displacement in enumerate(TABULATED)
    ]
    columns = ("displacement / m", "ruckig / s", *(f"{name} / s" for name in VARIANTS))
    table("planner_cost", columns, rows)
    print()
    agreement = float(np.max(np.abs(found["as ruckig"] / found["ruckig"] - 1)))
    rows = [(f"{step:g} s", ruckig_snap(step), sampled_snap(step)) for step in (1e-1, 1e-2, 1e-3, 1e-4)]
    table("planner_snap", ("samples every", "ruckig's largest snap, m/s^4", "ours"), rows, agreement=agreement)
    print(f"\nwithout more limits than ruckig's, durations agree to {agreement:.1e}")
    draw(output)


def ruckig_snap(step: float) -> float:
    """Largest snap in samples of 64 m: the second difference of the acceleration, which grows without bound."""
    trajectory = ruckig_plan(64.0)
    # An odd start keeps the jumps of the jerk off the samples, as they fall in practice.
    acceleration = [trajectory.at_time(time)[2][0] for time in np.arange(0.3 * step, trajectory.duration, step)]
    return float(np.abs(np.diff(acceleration, 2)).max() / step**2)


def sampled_snap(step: float) -> float:
    move = plan_move(64.0, Limits(**PAPER))
    acceleration = move.profile.sample(np.arange(0.3 * step, move.duration, step))[:, 2]
    return float(np.abs(np.diff(acceleration, 2)).max() / step**2)


def draw(output: Path) -> None:
    displacement = np.geomspace(1e-3, 1e4, 400)
    found = durations(displacement)
    caption = "What smoothness costs in time"
    description = (
        "Duration over that of ruckig against displacement, for equal limits on velocity, acceleration and jerk. With "
        "limits on snap, crackle and pop besides, a move takes eight times as long over a millimetre and hardly longer "
        "over a kilometre; with a given period of 1 s every move lasts 16 s at least"
    )

    def fill(figure: Figure) -> None:
        axes = figure.subplots()
        for index, name in enumerate(VARIANTS):
            axes.plot(displacement, found[name] / found["ruckig"], label=name, **style_of(index))
        axes.set(xscale="log", yscale="log", xlabel="displacement, m", ylabel="duration over that of ruckig")
        axes.set_ylim(0.95, 60)
        axes.set_yticks([1, 2, 5, 10, 20, 50], ["1", "2", "5", "10", "20", "50"])
        axes.set_yticks([], minor=True)
        legend_above(axes, columns=3)

    output.write_text(plot("planner-cost", caption, description, 3.6, fill).picture.svg + "\n", encoding="utf-8")
    print(f"wrote {output}")


def main(moves: int, cases: int, output: Path) -> None:
    correctness(moves)
    print()
    exactness(cases)
    print()
    optimality(cases)
    print()
    speed()
    print()
    cost(output)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--moves", type=int, default=5_000_000)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--plot", type=Path, default=PLOT)
    options = parser.parse_args()
    main(options.moves, options.cases, options.plot)
