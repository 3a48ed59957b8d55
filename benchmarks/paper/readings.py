"""The paper in all the ways that its text can be read: each reading's numbers and claims next to what is printed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.paper.claims import (
    Claim,
    ClaimVerdict,
    Measurement,
    PaperSources,
    Settings,
    compares_readings,
    reading_of,
)
from benchmarks.paper.printed import LEAST_TORQUE, TABLE_4, TABLE_5, PrintedColumn
from benchmarks.paper.replicates import ALL_SAMPLES, Setting, Sweep, joined_sweeps, spread
from benchmarks.paper.search_claims import AS_GOOD, paired_ratio
from cpfls_cli.arrays import Array
from cpfls_cli.report.canvas import GREY, plot, style_of
from cpfls_cli.report.content import UNKNOWN, Block, Cell, Folded, Plot, Table, Text, number, percent
from cpfls_cli.report.source import Source
from cpfls_cli.simulation.model import Simulated
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BASES = {"training": "the whole flight", "learned": "the samples learned from"}
_FAR = 2.0
_RATIOS = (0.1, 0.2, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
_RULE = (
    "How far a reading is off: the geometric mean of the factors between its numbers and the printed ones, namely mean "
    "squared error, largest error and condition number of FLS, of cpFLS and of cpFLS on the fewest samples (medians "
    "over the seeds), condition numbers of all and of the fewest samples with uniform partitions, and the largest "
    f"torque as far as it lies below {number(LEAST_TORQUE, 3)} N m."
)


Verdicts = Sequence[Sequence[Measurement]]
"""What was measured, by reading and claim."""


@dataclass(frozen=True)
class Reading:
    """One way to read the paper, and the searches that follow it.

    The path in words, the noise of the torque as a share of its standard deviation, what chose the samples, and what
    errors are taken over, as the config calls it.
    """

    flight: str
    noise: float
    criterion: str
    judged_on: str
    settings: Settings

    @property
    def name(self) -> str:
        """All of it in words."""
        return f"{self.flight}, {_noise(self.noise)}, {self.criterion}, errors over {_BASES[self.judged_on]}"

    @property
    def places(self) -> list[str]:
        """Its words for the first columns of a table."""
        return [self.flight, _noise(self.noise), self.criterion, _BASES[self.judged_on]]

    @property
    def search(self) -> str:
        """Sizes of its searches."""
        return joined(dict.fromkeys(f"{setting.population} × {setting.generations}" for setting in self.settings))

    @cached_property
    def numbers(self) -> list[tuple[str, float, float]]:
        """Its numbers on all samples and on the fewest next to the printed ones, each with what it is."""
        return [number for number in self._numbers() if np.isfinite(number[1])]

    @property
    def factor(self) -> float:
        """How far its numbers are from the printed ones."""
        return float(np.exp(np.mean([abs(np.log(ours / printed)) for _, ours, printed in self.numbers])))

    def _numbers(self) -> Iterator[tuple[str, float, float]]:
        for name, setting, table in (("all", self.full, TABLE_4[0]), ("the fewest", self.fewest, TABLE_4[-1])):
            if setting is not None:
                yield f"uniform condition number, {name}", setting.uniform_condition_number, table.condition_number
        columns = (("FLS", self.classic, TABLE_5[0]), ("cpFLS", self.full, TABLE_5[1]))
        for name, setting, column in (*columns, ("cpFLS on the fewest", self.fewest, TABLE_5[-2])):
            if setting is not None:
                for what, ours, printed in _beside(setting, column):
                    yield f"{what} of {name}", ours, printed
        yield "largest torque", min(self.fewest.largest_torque, LEAST_TORQUE), LEAST_TORQUE

    @property
    def classic(self) -> Setting | None:
        """The classic system on all samples."""
        return next((s for s in self.settings if s.structure == "fls" and s.criterion == ALL_SAMPLES), None)

    @property
    def full(self) -> Setting | None:
        """The periodic system on all samples."""
        return next((s for s in self.settings if s.structure == "cpfls" and s.criterion == ALL_SAMPLES), None)

    @property
    def fewest(self) -> Setting:
        """The smallest set that was chosen; of several searches the first."""
        return min((s for s in self.settings if s.criterion != ALL_SAMPLES), key=lambda setting: setting.samples)

    def measured(self, claims: Sequence[Claim]) -> list[Measurement]:
        """Judge claims on its searches alone."""
        return [claim.of_searches([self.settings]) for claim in claims if claim.of_searches is not None]


def _beside(setting: Setting, column: PrintedColumn) -> Iterator[tuple[str, float, float]]:
    """Pair medians over the runs with what is printed of ten."""
    yield "MSE", _median(setting.errors[:, 0]), float(column.mse_of_runs[0])
    yield "largest error", _median(setting.errors[:, 1]), float(column.max_error_of_runs[0])
    yield "condition number", _median(setting.of("condition_number")), float(column.condition_number_of_runs[0])


def _median(runs: Array) -> float:
    """Take the median of the runs that found a model; NaN for none."""
    known = runs[np.isfinite(runs)]
    return float(np.median(known)) if len(known) else float("nan")


def readings(sources: PaperSources) -> list[Reading]:
    """Tell the readings of the paper apart that the sweeps of a report follow, in order of flight and noise."""
    found: dict[tuple[str, float, str, str], Reading] = {}
    for sweep in joined_sweeps(sources.sweeps):
        for reading in _of_sweep(sweep):
            key = (reading.flight, reading.noise, reading.criterion, reading.judged_on)
            # Of two sweeps in one reading the larger searches tell more.
            found[key] = max(found.get(key, reading), reading, key=_most)
    return [found[key] for key in sorted(found, key=lambda key: (key[0], key[1]))]


def _of_sweep(sweep: Source[Sweep]) -> Iterator[Reading]:
    settings = sweep.record.settings
    for key in dict.fromkeys(reading_of(setting) for setting in settings if setting.criterion != ALL_SAMPLES):
        own = [setting for setting in settings if setting.criterion == ALL_SAMPLES or reading_of(setting) == key]
        yield Reading(_flight(sweep.config), _noise_of(sweep.config), *key, own)


def _most(reading: Reading) -> int:
    return min(setting.chromosomes for setting in reading.settings)


def _flight(config: Mapping[str, Any]) -> str:
    path = config["trajectory"]
    moves = f"{path['legs']} × {path['displacement_m']:g} m" if path["displacement_m"] else path["path"]
    return moves if path["period_s"] is None else f"{moves} at P = {path['period_s']:g} s"


def _noise_of(config: Mapping[str, Any]) -> float:
    return float(config["simulation"]["relative_noise"].get("torque", 0.0))


def _noise(share: float) -> str:
    return f"{percent(share, 1)} noise" if share else "no noise"


def readings_blocks(sources: PaperSources, claims: Sequence[Claim]) -> tuple[list[Block], list[Block]]:
    """Show how each claim about searches fares in each reading, where a report has several: answer, and details."""
    found = readings(sources)
    if len(found) < 2:
        return [], []
    about = [claim for claim in claims if claim.of_searches is not None]
    verdicts = [reading.measured(about) for reading in found]
    known = [
        index for index in range(len(about)) if any(row[index].verdict != ClaimVerdict.NOT_MEASURED for row in verdicts)
    ]
    about, verdicts = [about[index] for index in known], [[row[index] for index in known] for row in verdicts]
    answer: list[Block] = [*_answer(found, about, verdicts), *_judged_here(sources)]
    details = Folded("Every reading: its numbers, and each claim", [_numbers(found), _each(found, about, verdicts)])
    return answer, [_by_flight(found, about, verdicts), readings_figure(found), details]


def _answer(found: Sequence[Reading], claims: Sequence[Claim], verdicts: Verdicts) -> Iterator[Text]:
    groups: dict[str, list[str]] = {"in every reading": [], "in some": [], "in none": []}
    for claim, judged in zip(claims, zip(*verdicts, strict=True), strict=True):
        if any(measurement.verdict == ClaimVerdict.NOT_MEASURED for measurement in judged):
            continue
        passed = [measurement.verdict == ClaimVerdict.PASS for measurement in judged]
        groups["in every reading" if all(passed) else "in some" if any(passed) else "in none"].append(claim.name)
    shown = "; ".join(f"{where}: {joined(names)}" for where, names in groups.items() if names)
    yield Text(
        "The paper leaves open which path it flew, with what noise, how samples were chosen and what errors are taken "
        f"over: {len(found)} readings of it are searched here. Of the claims that all of them can judge, these pass "
        f"{shown}.",
        "note",
    )
    nearest = min(found, key=lambda reading: reading.factor)
    yield Text(
        f"Nearest to the printed numbers are those of {nearest.flight} with {_noise(nearest.noise)}: off by a factor "
        f"of {_span(_of_flight(found, nearest))}, whatever chose the samples. {_RULE}"
    )


def _judged_here(sources: PaperSources) -> Iterator[Text]:
    """Name the reading that the report's own searches follow, and which of its numbers are far from the printed."""
    for sweep in joined_sweeps(sources.sweeps):
        if compares_readings(sweep.record.settings):
            continue
        noise = _mean_square_noise(sources, sweep)
        alone = f" Its noise alone has a mean square of {number(noise, 3)} (N m)²." if noise else ""
        for reading in _of_sweep(sweep):
            far = [
                f"{name} ({number(ours, 3)}, printed {number(printed, 3)})"
                for name, ours, printed in reading.numbers
                if abs(np.log(ours / printed)) > np.log(_FAR)
            ]
            off = f"Off by more than a factor of {_FAR:g}: {joined(far)}." if far else "No number is off by more."
            yield Text(f"The claims below are judged in this one: {reading.name}.{alone} {off}")


def _mean_square_noise(sources: PaperSources, sweep: Source[Sweep]) -> float:
    """Find the mean square of the noise that was put on the torque of a sweep's flight; 0 where none is known."""
    flight = sources.by_hash(sweep.made_from("flight"))
    if flight is None or not isinstance(flight.record, Simulated) or "torque" not in flight.record.noise_std:
        return 0.0
    return float(np.mean(flight.record.noise_std["torque"].std ** 2))


def _of_flight(found: Sequence[Reading], one: Reading) -> list[Reading]:
    return [reading for reading in found if (reading.flight, reading.noise) == (one.flight, one.noise)]


def _span(found: Sequence[Reading]) -> str:
    factors = sorted(reading.factor for reading in found)
    return " to ".join(dict.fromkeys(number(factor, 2) for factor in (factors[0], factors[-1])))


def _by_flight(found: Sequence[Reading], claims: Sequence[Claim], verdicts: Verdicts) -> Table:
    ones = list({(reading.flight, reading.noise): reading for reading in found}.values())
    columns = []
    for one in ones:
        own = _of_flight(found, one)
        judged = [row for reading, row in zip(found, verdicts, strict=True) if reading in own]
        columns.append([str(len(own)), _span(own), *(_counted(column) for column in zip(*judged, strict=True))])
    names = ["readings", "off by a factor of", *(claim.name for claim in claims)]
    rows = [[name, *row] for name, *row in zip(names, *columns, strict=True)]
    header = ("Passed in", *(f"{one.flight}, {_noise(one.noise)}" for one in ones))
    caption = (
        "In how many readings of each flight a claim passes (of those in which it could be measured and decided): the "
        "choice of samples and what errors are taken over differ."
    )
    return Table("readings", caption, header, rows)


def _counted(measured: Iterable[Measurement]) -> str:
    counts = Counter(measurement.verdict for measurement in measured)
    decided = counts[ClaimVerdict.PASS] + counts[ClaimVerdict.FAIL]
    shown = [f"{counts[ClaimVerdict.PASS]} of {decided}"] if decided else []
    if counts[ClaimVerdict.UNDECIDED]:
        shown.append(f"{counts[ClaimVerdict.UNDECIDED]} undecided")
    return ", ".join(shown) or UNKNOWN


def _numbers(found: Sequence[Reading]) -> Table:
    header = (
        "Flight", "Noise", "Samples by", "Errors over", "Search", "Largest torque, N m", "Uniform condition: all",
        "chosen", "MSE, (N m)²: all", "chosen", "Largest error, N m", "Relative, whole flight",
        "Condition number", "Off by a factor of",
    )  # fmt: skip
    printed, full = TABLE_5[-2], TABLE_5[1]
    rows: list[list[str | Cell]] = [[*reading.places, *_numbers_of(reading)] for reading in found]
    rows.append(
        [
            "the paper", UNKNOWN, UNKNOWN, UNKNOWN, f"{full.population} × {full.generations}",
            f"> {number(LEAST_TORQUE, 3)}", str(TABLE_4[0].condition_number), str(TABLE_4[-1].condition_number),
            full.mse_of_runs[0], printed.mse_of_runs[0], printed.max_error_of_runs[0], "< 10 %",
            printed.condition_number_of_runs[0], "1",
        ]
    )  # fmt: skip
    caption = (
        "The numbers of each reading beside the paper's. Chosen: the smallest set that was learned from. Errors and "
        "condition numbers are means over the seeds."
    )
    return Table("readings-numbers", caption, header, rows, frozenset(range(5)))


def _numbers_of(reading: Reading) -> list[str]:
    full, fewest = reading.full, reading.fewest
    whole = [UNKNOWN] * 2 if full is None else [number(full.uniform_condition_number, 4), number(_mean(full, 0), 3)]
    return [
        reading.search,
        number(fewest.largest_torque, 3),
        whole[0],
        number(fewest.uniform_condition_number, 4),
        whole[1],
        number(_mean(fewest, 0), 3),
        number(_mean(fewest, 1), 3),
        percent(fewest.relative_error.mean, 2),
        number(fewest.condition_number.mean, 3),
        number(reading.factor, 2),
    ]


def _mean(setting: Setting, column: int) -> float:
    return spread(setting.errors[:, column]).mean


def _each(found: Sequence[Reading], claims: Sequence[Claim], verdicts: Verdicts) -> Table:
    rows: list[list[str | Cell]] = [
        [*reading.places, *map(_verdict, row)] for reading, row in zip(found, verdicts, strict=True)
    ]
    header = ("Flight", "Noise", "Samples by", "Errors over", *(claim.name for claim in claims))
    words = frozenset(range(len(header)))
    caption = "Every claim about searches in every reading; the rules are those above."
    return Table("readings-claims", caption, header, rows, words, words - frozenset(range(4)))


def _verdict(measured: Measurement) -> Cell:
    if measured.verdict == ClaimVerdict.NOT_MEASURED:
        return Cell(UNKNOWN)
    return Cell(f"{measured.verdict}: {measured.ours}", "plain" if measured.verdict == ClaimVerdict.PASS else "note")


def readings_figure(found: Sequence[Reading]) -> Plot:
    """Draw the error on the fewest samples over that on all, in a row for each flight, noise and what is judged on."""
    rows = list(dict.fromkeys((r.flight, r.noise, r.judged_on) for r in found))
    criteria = list(dict.fromkeys(reading.criterion for reading in found))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for index, criterion in enumerate(criteria):
            own = [reading for reading in found if reading.criterion == criterion]
            heights = [rows[::-1].index((r.flight, r.noise, r.judged_on)) + 0.15 * (1.5 - index) for r in own]
            # A ratio is not finite where nothing can be compared, or a seed found no model.
            known = [(ratio, y) for r, y in zip(own, heights, strict=True) if np.isfinite((ratio := _ratio(r))[0])]
            ratios, places = np.array([ratio for ratio, _ in known]).reshape(-1, 3), [y for _, y in known]
            color, marker = style_of(index)["color"], "osD^v<>"[index % 7]
            axes.hlines(places, ratios[:, 1], ratios[:, 2], color=color, linewidth=1.6)
            axes.plot(ratios[:, 0], places, marker, markersize=5, markerfacecolor="none", color=color, label=criterion)
        axes.axvline(AS_GOOD, color=GREY, linestyle="--", linewidth=1.2, label="4/3, the paper's largest")
        axes.axvline(1.0, color="black", linewidth=0.6)
        axes.set_yticks(range(len(rows)), [f"{f}, {_noise(n)}\n{_BASES[j]}" for f, n, j in reversed(rows)], fontsize=7)
        axes.set_xscale("log")
        low, high = axes.get_xlim()
        ticks = [tick for tick in _RATIOS if low <= tick <= high]
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
        axes.set_xlabel("MSE on the fewest samples over MSE on all of them, with 95 % intervals")
        axes.grid(visible=False, axis="y")
        axes.legend(loc="upper center", bbox_to_anchor=(0.4, 1.12), ncols=5, frameon=False, fontsize=7)

    caption = (
        "How much worse models of the fewest samples are, by reading: left of the dashed line they are as good as "
        "those of all samples, by the paper's own margin."
    )
    description = "Ratio of mean squared errors by flight, noise, choice of samples and what errors are taken over"
    return plot("readings-ratios", caption, description, 1.2 + 0.42 * len(rows), draw)


def _ratio(reading: Reading) -> tuple[float, float, float]:
    if reading.full is None or reading.full.size != reading.fewest.size:
        return np.nan, np.nan, np.nan
    paired = paired_ratio(reading.fewest, reading.full)
    return paired.ratio, paired.low, paired.high
