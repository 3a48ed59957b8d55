"""How a vehicle was found in flights: its numbers, what was tried, and what has no name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.parameters import (
    CENTRE,
    DELAY,
    DRAG,
    FOUND_AS,
    INERTIA,
    LAG,
    OF_NONE,
    OF_TURNING,
    ON_BOUND,
    THRUST,
    THRUST_LAW,
    Parameter,
    excess,
    is_learned,
    name_of,
    parameters_of,
    too_heavy,
    vehicle_section,
)
from cpfls_cli.artifacts.playback import HeldOutGroup, by_horizon
from cpfls_cli.artifacts.rebuilt import vehicle_model
from cpfls_cli.artifacts.spec import rows_of
from cpfls_cli.artifacts.vehicle_model import InstrumentsGroup, LoopGroup, ResponsesGroup, VehicleRecord
from cpfls_cli.config.yaml_text import to_yaml
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.flightlog.stated_vehicle import FAST_HZ, SLOW_HZ, log_faster
from cpfls_cli.inertia import INERTIA_PARAMETERS
from cpfls_cli.pages.disturbance import gust_blocks
from cpfls_cli.pages.playback import (
    against_rivals,
    errors_table,
    lost_words,
    playback_figure,
    trust_sentences,
    with_past_words,
)
from cpfls_cli.pages.repeats import BY_HAND, FLOWN_BY_HAND, WHAT_TO_FLY
from cpfls_cli.pages.source import Source
from cpfls_cli.pages.trust import model_words
from cpfls_cli.playback.loop import ANY
from cpfls_cli.playback.table import wrench_of
from cpfls_cli.report.canvas import BASELINE, GREY, legend_over, line, plot, style_of
from cpfls_cli.report.content import Block, Cell, Facts, Folded, Heading, Listing, Plot, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, number, percent, whole_percent
from cpfls_cli.response.mismatch import ACCEPTABLE
from cpfls_cli.rounding import levelled
from cpfls_cli.validation.trust import Trust
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NAMES = {
    "chosen": "chosen",
    "best": "smallest error",
    "greedy": "one by one",
    "everything": "all blocks",
    "nothing": "stated vehicle",
}
_REMAINDER, _ROTORS = "remainder", "rotors"
_AXES = ("x", "y", "z")
_ENDS = (
    ("body_rate", "rad/s", 1.0),
    ("attitude", "degrees", 180.0 / np.pi),
    ("velocity", "m/s", 1.0),
    ("position", "m", 1.0),
)
_TURNS = ("x (roll to the right)", "y (nose down)", "z (yaw to the left)")
_PUSHES = ("x (ahead)", "y (left)", "z (up)")
_KINDS = {"torque": ("N m", {0, 1, 2}), "force": ("N", {3, 4, 5})}
_FLIGHTS = {
    THRUST: "climb and descend more: the known mass then tells thrust",
    DRAG: "turn about yaw with fast steps while rolling and pitching, or state Izz; else only their ratio is known",
    INERTIA[0]: "roll with fast steps or a multisine: several changes of direction a second",
    INERTIA[1]: "pitch with fast steps or a multisine: several changes of direction a second",
    INERTIA[
        2
    ]: "turn about yaw fast while rolling and pitching fast: the gyroscopic torque alone tells Izz from the drag "
    "factor; or state one of the two",
    **dict.fromkeys(INERTIA[3:], "roll and yaw fast at once"),
    LAG: "steps of thrust, with rotor speeds or commands logged at 100 Hz or faster",
    DELAY: "steps of thrust, with rotor speeds or commands logged at 100 Hz or faster",
    **dict.fromkeys(CENTRE, "climb and descend with much and little thrust: what an offset turns grows with thrust"),
}
"""What would tell a constant that the flights do not."""

_OF_IT = {"repeats": "comes again", "setpoints": "follows them", "past": "was foretold"}
"""Rotation that instruments know of, by their kind."""

_LIVELY_RAD_S = 1.0
"""Body rate, root mean square, above which larger turns show no more of the vehicle."""

_FAR = 3.0
"""Factor from the stated number from which on a found one is called effective, and no property of a part."""


def title(record: VehicleRecord) -> str:
    """Say in one sentence how far it predicts, whose its constants are, and how many numbers are not told."""
    said = [_as_forecast(record), _as_vehicle(record)]
    if record.untold:
        said.append(f"{len(record.untold)} of {record.numbers} numbers are not determined")
    return f"{'; '.join(part for part in said if part)}."


def _as_forecast(record: VehicleRecord) -> str:
    held, word = record.held_out, record.forecast_verdict
    if record.contradiction:
        return "its flights contradict themselves"
    if held is None:
        return "not judged as a forecast"
    if word is Trust.DO_NOT_USE:
        return "predicts no better than a baseline without a model"
    signals = ("body_rate", "velocity") if word is Trust.SIMULATION else ("body_rate",)
    far = min(map(held.by_horizon.better_to, signals))
    what = "motion" if word is Trust.SIMULATION else "body rates"
    against = f", but {_against_control(record, held)}" if word is Trust.NOT_CONTROL else ""
    return f"predicts {what} {number(far, 2)} s ahead{against}"


def _against_control(record: VehicleRecord, held: HeldOutGroup) -> str:
    """Say why no control may rest on its forecast."""
    said = lost_words(held.by_horizon)
    if record.unreal:
        limit = set(record.unreal) <= set(record.on_bound)
        said.append(f"rests on {joined(map(name_of, record.unreal))} {ON_BOUND if limit else 'that no such body has'}")
    if record.responses is not None and record.responses.off:
        said.append("has a frequency response about roll or pitch that is off")
    return joined(said)


def _as_vehicle(record: VehicleRecord) -> str:
    if record.contradiction:
        return ""
    if record.trust == Trust.LOOP:
        return "its constants are those of vehicle and autopilot together"
    if record.trust == Trust.NOT_DETERMINED and too_heavy(record):
        return "inertia and drag factor are not the body's"
    if record.loop.misses and record.instruments is None:
        return "what was found does not explain these flights"
    constants = [name_of(name) for name in record.untold if name in FOUND_AS.values()]
    lacks = ["an effect is missing besides its constants"] if record.trust == Trust.LACKING else []
    if constants:
        lacks.append(f"{joined(constants)} {'is' if len(constants) == 1 else 'are'} not the vehicle's own")
    return "; ".join(lacks) or "its constants are told"


def grounds(record: VehicleRecord) -> Iterator[str]:
    """Say what its constants rest on, and what speaks against them."""
    if record.instruments is not None and not record.contradiction:
        yield from instrument_words(record, record.instruments)
    yield from _against(record)


def cautions(record: VehicleRecord) -> Iterator[str]:
    """Say what speaks against a vehicle that was found, wherever it is taken."""
    if model_words(record).tone == "warning":
        yield _headline(record)
    yield from _against(record)


def _headline(record: VehicleRecord) -> str:
    return f"{model_words(record).short.upper()}: {title(record)}"


def _against(record: VehicleRecord) -> Iterator[str]:
    if record.contradiction:
        yield from trust_sentences(Trust.DO_NOT_USE, None, None, record.contradiction)
        return
    if record.trust in (Trust.LOOP, Trust.LACKING, Trust.NOT_DETERMINED, Trust.DO_NOT_USE):
        yield from slow_words(record)
    if record.trust == Trust.LOOP or (record.loop.shown and record.instruments is None):
        yield loop_words(record)
    elif record.loop.misses and record.instruments is None:
        yield _missed_words(record.loop)
    heavy = too_heavy(record)
    if heavy:
        yield f"Inertia and drag factor: {heavy}."
    bound = [name_of(name) for name in record.on_bound]
    if bound:
        many = "they are no numbers" if len(bound) > 1 else "it is no number"
        yield f"{joined(bound)}: {ON_BOUND}; the flights ask for more, so {many} of the vehicle."
    too_much = {} if heavy else excess(record)
    for name, why in too_much.items():
        yield f"{name_of(name)}: {why}; a number that predicts, not the body's, and no config gets it."
    told = {*record.on_bound, *(OF_TURNING if heavy else too_much)}
    others = [name_of(name) for name in record.impossible if name not in told]
    if others:
        yield f"{joined(others)}: {OF_NONE}."
    told |= set(record.impossible)
    open_ = [name_of(name) for name in record.untold if name not in told]
    if open_ and record.trust != Trust.LOOP:
        yield f"Not determined, because the flights say too little about it: {joined(open_)}."


def _grounds_of_forecast(record: VehicleRecord) -> Iterator[str]:
    """Say what its forecast is good for, which model makes it, what it is beside, and how it was chosen."""
    held, word = record.held_out, record.forecast_verdict
    if held is not None and word is Trust.NOT_CONTROL:
        yield f"Not for control: it {_against_control(record, held)}."
    elif not record.contradiction:
        yield from trust_sentences(word, by_horizon(held), None if held is None else held.region, None)
    if record.instruments is None and record.responses is not None:
        yield from response_words(record.responses)
    if record.forecast is not None:
        yield (
            "Besides its constants, the file holds a forecast along logged rotor speeds, loop included, which `cpfls "
            "replay` plays: good for forecasting such flights, but not a model of the vehicle. The errors are those "
            "of the forecast."
        )
    if record.held_out is not None:
        own = record.held_out.by_horizon
        yield from against_rivals(own)
        yield from () if record.history is None else with_past_words(own, record.history.past)
    errors = dict(zip(record.structure.name, record.structure.error, strict=True))
    alone = "the constants" if _guessed(record) else "the stated vehicle"
    yield (
        f"On parts of the flights kept aside in turn, its error is {number(errors['chosen'], 3)}; with all blocks "
        f"{number(errors['everything'], 3)}, with blocks added one by one {number(errors['greedy'], 3)}, with "
        f"{'the constants alone' if _guessed(record) else alone} {number(errors['nothing'], 3)}; rates that stay have "
        "about 1.1."
    )
    chosen = record.structure.blocks[record.structure.name.index("chosen")].split()
    blocks = [block.replace("_", " ") for block in chosen]
    yield f"It holds {joined(blocks)}." if blocks else f"It holds nothing but {alone}."


def details(vehicle: Source[VehicleRecord], index: int = 1) -> Iterator[Block]:
    """Say its constants first, then how well it predicts, its other numbers, and what to be careful with."""
    record = vehicle.record
    yield _constants_table(record, index)
    yield from _differences_table(record, index)
    yield Folded("Errors of the forecast, by horizon", list(_forecast_blocks(record, index)), shown=True)
    yield Folded("Other numbers, and what would tell them", list(_number_blocks(vehicle, index)), shown=True)
    careful = [Text(each, "warning") for each in warnings(record)]
    yield from [Folded("What to be careful with", careful, shown=True)] if careful else []
    text = to_yaml({"vehicle": vehicle_section(record)})
    yield Folded("The section vehicle to paste", [Listing("With what was found", text, shown=True)])


def _forecast_blocks(record: VehicleRecord, index: int) -> Iterator[Block]:
    yield from map(Text, _grounds_of_forecast(record))
    if record.held_out is not None:
        held = record.held_out
        yield from errors_table(f"replay-{index}", held.by_horizon, "the vehicle found", held.windows, held.flown)


def _number_blocks(vehicle: Source[VehicleRecord], index: int) -> Iterator[Block]:
    record = vehicle.record
    yield from _about_constants(record)
    yield from _numbers_table(vehicle, index)
    yield from gust_blocks(record, index)


def _guessed(record: VehicleRecord) -> bool:
    """Tell whether the config leaves constants open: then they are free in every structure."""
    return bool(record.structure.numbers[record.structure.name.index("nothing")])


def worth(record: VehicleRecord) -> Iterator[str]:
    """Say what a vehicle that is used elsewhere is worth, beside what speaks against it, and how far off it is."""
    if model_words(record).tone != "warning":
        yield _headline(record)
    if record.instruments is not None and not record.contradiction:
        yield next(instrument_words(record, record.instruments))
    held = record.held_out
    if record.forecast is not None:
        yield "These are its constants; its forecast, loop included, stays in the file, and the errors are those of it."
    elif held is not None:
        last = {signal: own.mae[-1] for signal, own in held.by_horizon.model.signals.items()}
        ends = joined(f"{number(last[name] * scale, 3)} {unit}" for name, unit, scale in _ENDS if name in last)
        after = f"{held.horizon_s[-1]:.3g} s"
        yield f"On held-out flights it ends {ends} off the measured motion after {after}, on average."


def instrument_words(record: VehicleRecord, given: InstrumentsGroup) -> Iterator[str]:
    """Say what the constants rest on, how much of what comes again they explain, and where they lack something."""
    of_it = _OF_IT[given.kind]
    if given.kind == "repeats":
        alike = f"{number(float(given.likeness.min()), 2)} to {number(float(given.likeness.max()), 2)}"
        told = (
            f"{given.runs} runs that repeat each other (correlation {alike}): gusts do not come again, what the vehicle"
            " does comes again"
        )
    elif given.kind == "setpoints":
        told = (
            f"logged setpoints ({joined(given.setpoint)}): gusts do not follow them, what the vehicle does follows them"
        )
    else:
        told = (
            "what was before: the flights show the loop, but nothing foretells what is new in a gust, and no loop "
            "answers it before it comes; what the vehicle does is foretold"
        )
    yield (
        f"The constants rest on {told}. From "
        f"{number(float(given.low[given.used].min()), 2)} to {number(float(given.high[given.used].max()), 2)} Hz they "
        f"explain {_share_words(given.total, given.error)} acceleration that {of_it}."
    )
    below = given.lacks_below
    if below is not None:
        yield (
            f"Below {number(below, 2)} Hz they explain less, or would need a different body: the vehicle does "
            f"something there that no constant can stand for; `cpfls response` shows it, `cpfls gap` looks for it."
        )
    if record.responses is not None:
        yield from response_words(record.responses)
    if not record.tells_turning:
        open_ = [name_of(FOUND_AS[key]) for key in INERTIA[:2] if FOUND_AS[key] in record.untold]
        yield f"Other values of {joined(open_)} would explain about as much: fly more runs, or larger ones."
    elif record.trust == Trust.NOT_JUDGED and given.kind == "past":
        yield (
            "Frequency responses do not judge the model, for these flights show those of the loop: fly in still air, or"
            f" the same path several times, as {WHAT_TO_FLY} plans it."
        )
    elif record.trust == Trust.NOT_JUDGED:
        yield (
            "The flights do not show the frequency responses of roll and pitch clearly enough to judge the model by "
            f"them: fly with faster turns, as {WHAT_TO_FLY} plans them."
        )


def response_words(given: ResponsesGroup) -> Iterator[str]:
    """Say how far the model's frequency responses are from those of the flights."""
    judged = [
        f"{row['name']} {number(row['cost'], 2)} ({number(row['low'], 2)} to {number(row['high'], 2)} Hz)"
        for row in rows_of(given)
        if np.isfinite(row["cost"])
    ]
    if judged:
        off = "; it lacks an effect there, `cpfls response` shows where" if given.off else ""
        limit = f"0 is none, up to {ACCEPTABLE:g} is acceptable"
        yield f"Mismatch J of its frequency responses ({limit}): {', '.join(judged)}{off}."


def _share_words(share: Array, error: Array) -> str:
    """Give shares about roll and pitch with their errors."""
    roll, pitch = (
        f"{whole_percent(float(np.clip(value, 0.0, 1.0)))} (± {whole_percent(float(within))})"
        for value, within in zip(share[:2], error[:2], strict=True)
    )
    return f"{roll} of the roll and {pitch} of the pitch"


def slow_words(record: VehicleRecord) -> Iterator[str]:
    """Say of logs too slow for what a flight is asked to show that no flight helps before they are faster, and how."""
    if record.rotors_told is not None and record.rotors_told < SLOW_HZ:
        faster = log_faster("rotors and body rates", FAST_HZ, *(record.logged_by or ()))
        yield f"{_slowly_logged(record.rotors_told)} Flights logged so say no more; first {faster}."


def _slowly_logged(told_hz: float) -> str:
    return (
        f"The rotors are logged {number(told_hz, 2)} times a second, which shows no motion above "
        f"{number(told_hz / 2, 2)} Hz."
    )


def too_slow(told_hz: float) -> str:
    """Say of rotors logged so slowly that no body can be found what is computed then; the answer says what to set."""
    return (
        f"{_slowly_logged(told_hz)} Inertia, drag factor, lag and effects cannot be found in these flights; only the "
        "constants that the config leaves open are fitted, of which the thrust factor may be found. --anyway searches "
        "all the same."
    )


def loop_words(record: VehicleRecord) -> str:
    """Say how far the loop may have misled the fit, and what to fly."""
    loop = record.loop
    shares = joined(_of_bands(loop, index, axis) for index, axis in enumerate(("roll", "pitch")))
    ends = zip(INERTIA_PARAMETERS[:2], loop.low.tolist(), loop.high.tolist(), strict=False)
    times = joined(f"{name} {_times(low, high)}" for name, low, high in ends if np.isfinite(low))
    return (
        f"These flights show the loop, not the vehicle: torque explains {shares}. An autopilot that answers gusts, or "
        f"an effect that is missing here, makes a body look heavier or lighter than it is: {times} what was found."
        + ("" if any(slow_words(record)) else f" Fly in still air, {_turns_to_fly(record)}")
    )


def _times(low: float, high: float) -> str:
    """Give the factors that bounds allow; those at the limit of what is told may lie beyond it."""
    least, most = number(low, 2), number(high, 2)
    if least != most:
        return f"{least} to {most} times"
    beyond = "at most " if low <= 1 / ANY else "at least " if high >= ANY else ""
    return f"{beyond}{most} times"


def _missed_words(loop: LoopGroup) -> str:
    """Say that rotors that only lag explain more of the flights than what was found, and what to do."""
    assert loop.missed is not None, "where more is missed"
    turns = list(enumerate(("roll", "pitch")))
    missed = joined(f"{_share(share)} of {axis}" for (_, axis), share in zip(turns, loop.missed, strict=False))
    better = joined(_of_bands(loop, index, axis) for index, axis in turns)
    return (
        f"What was found does not explain these flights: its torque explains {missed} acceleration, that of the rotors "
        f"with nothing but a lag {better}. Its numbers are not the vehicle's: state what is known of the vehicle, or "
        "leave blocks out (playback.leave_out)."
    )


def _share(share: float) -> str:
    return whole_percent(float(np.clip(share, 0.0, 1.0))) if np.isfinite(share) else "nothing known"


def _of_bands(loop: LoopGroup, index: int, axis: str) -> str:
    """Say what torque explains about an axis where it explains least, and where most."""
    least, whole = loop.explained[index], f"{axis} acceleration"
    if loop.by_band is None or loop.band_hz is None or not np.isfinite(least):
        return f"{_share(least)} of the {whole}"
    shares = loop.by_band[:, index]
    known = np.flatnonzero(np.isfinite(shares))
    worst = int(known[np.argmin(np.abs(shares[known] - least))])
    best = int(known[np.argmax(levelled(shares[known]))])
    hz = [f"from {number(low, 2)} to {number(high, 2)} Hz" for low, high in loop.band_hz.tolist()]
    most = f" ({_share(shares[best])} {hz[best]})" if best != worst else ""
    return f"{_share(shares[worst])} of the {whole} {hz[worst]}{most}"


def _turns_to_fly(record: VehicleRecord) -> str:
    """Say how to turn: larger where the vehicle hardly turned, by stick where its autopilot flies no mission."""
    turning = record.loop.turning
    lively = turning is not None and bool((turning[:2] > _LIVELY_RAD_S).all())
    how = "with quick turns about one axis at a time" if lively else "with larger and faster turns"
    formats = {file.format.lower() for role, file in record.origin.inputs.items() if not role.startswith("config")}
    if formats and formats <= FLOWN_BY_HAND:
        return f"{how}: {BY_HAND}."
    return f"{how}, the same path several times ({BY_HAND}; or as a mission): {WHAT_TO_FLY}"


def warnings(record: VehicleRecord) -> list[str]:
    """Warn of numbers that mean something only together, or are no property of a part, and of the flights."""
    said = list(record.warning)
    none = [name_of(row["name"]) for row in rows_of(record.found) if row["at_bound"] and row["value"] == 0]
    if none:
        said.append(f"{joined(none)}: 0, the least that it can be; the flights show none of it")
    # Numbers of the remainder have no meaning of their own, together or apart.
    trades = [row for row in rows_of(record.trade) if not (is_learned(row["first"]) and is_learned(row["second"]))]
    if trades:
        pairs = "; ".join(
            f"{name_of(row['first'])} and {name_of(row['second'])} ({row['correlation']:.3f})" for row in trades
        )
        said.append(f"numbers that trade against each other and mean something only together (correlation): {pairs}")
    stated = [row for row in rows_of(record.found) if np.isfinite(row["stated"]) and row["stated"] > 0]
    far = [name_of(row["name"]) for row in stated if not 1 / _FAR < row["value"] / row["stated"] < _FAR]
    if far:
        said.append(
            f"{joined(far)}: more than {_FAR:g} times off the stated value: an effective number that predicts, not a "
            f"property of the part that it is named after"
        )
    if _guessed(record) and record.held_out is not None:
        said.append("the stated vehicle has guesses where the config leaves constants open")
    if not record.complete:
        said.append("the search was stopped before its end; other structures may be better")
    return said


def _numbers_table(found: Source[VehicleRecord], index: int) -> Iterator[Table]:
    """Show what was found beside the constants, if anything was."""
    record, constants = found.record, FOUND_AS.values()
    numbers = rows_of(record.found)
    rows = [
        [
            name_of(row["name"]),
            row["unit"],
            Cell(
                _or_unknown(_if_possible(record, row, "value"), 4),
                "warning" if row["name"] in record.untold else "plain",
            ),
            *(_or_unknown(_if_possible(record, row, end), 3) for end in ("low", "high")),
        ]
        for row in numbers
        if row["name"] not in constants and not is_learned(row["name"])
    ]
    learned = sum(is_learned(row["name"]) for row in numbers)
    more = f" {learned} more form the learned remainder; they are in /found of the file." if learned else ""
    caption = f"Other numbers of the vehicle with 95 % intervals from blocks of the flights.{more}"
    header = ("Number", "Unit", "Value", "From", "To")
    if rows or learned:
        yield Table(f"vehicle-numbers-{index}", caption, header, rows, frozenset({0, 1}))


def _if_possible(record: VehicleRecord, row: dict[str, Any], name: str) -> float | None:
    """Give a value of a number that was found; None where no vehicle has the number."""
    return None if row["name"] in record.impossible else row[name]


def _about_constants(record: VehicleRecord) -> Iterator[Block]:
    """Say what scale the constants of a vehicle have, and what would tell the open ones."""
    listed = list(parameters_of(record))
    yield Text(" ".join(_scale(record, {each.key: each for each in listed})))
    idle = [each.name for each in listed if not each.needed]
    if idle:
        yield Text(f"Left at 0, because freeing it does not lower the error: {joined(idle)}.")
    for reason, same in groupby(filter(_wanting, listed), key=lambda each: each.reason):
        yield Text(f"{joined(each.name for each in same)}: {reason}.")
    for flight, wanting in groupby(filter(_wanting, listed), key=_to_fly):
        yield Text(f"To know {joined(each.name for each in wanting)}: {flight}.", "warning")


def _to_fly(parameter: Parameter) -> str:
    """Say what would tell a constant; thrust without a value is that of flights that lack velocity."""
    lacking = parameter.key == THRUST and parameter.value is None
    return f"{'log velocity (or position), and ' if lacking else ''}{_FLIGHTS[parameter.key]}"


def _differences_table(record: VehicleRecord, index: int) -> Iterator[Table]:
    """Show what other configurations have of their own; nothing where there is none."""
    if record.difference is not None:
        rows = [
            [row["name"], row["unit"], number(row["value"]), number(row["low"], 3), number(row["high"], 3)]
            for row in rows_of(record.difference)
        ]
        caption = "What other configurations have that the vehicle of the config has not, with 95 % intervals."
        header = ("Difference", "Unit", "Value", "From", "To")
        yield Table(f"vehicle-differences-{index}", caption, header, rows, frozenset({0, 1}))


def _wanting(parameter: Parameter) -> bool:
    """Tell whether a number was looked for and not found."""
    return parameter.value is None or (parameter.low is not None and not parameter.determined)


def _constants_table(record: VehicleRecord, index: int) -> Table:
    listed = [each for each in parameters_of(record) if each.needed]
    full = "" if record.full_speed is None else f" (at an assumed {number(record.full_speed, 4)} rad/s full speed)"
    stated = any(each.stated is not None for each in listed)
    rows: list[list[str | Cell]] = [
        [
            f"{each.name}{full if each.key in (THRUST, DRAG) and each.determined else ''}, {each.unit}",
            Cell(_or_unknown(each.value if each.possible else None, 4), "warning" if _wanting(each) else "plain"),
            *(_or_unknown(value if each.possible else None, 3) for value in (each.low, each.high)),
            *([_or_unknown(each.stated, 3)] if stated else []),
            each.told,
        ]
        for each in listed
    ]
    caption = f"Constants with 95 % intervals.{_law_words(record)}"
    header = ("Constant", "Value", "From", "To", *(["In the config"] if stated else []), "Flights tell it")
    return Table(f"vehicle-constants-{index}", caption, header, rows, frozenset({0, len(header) - 1}))


def _law_words(record: VehicleRecord) -> str:
    """Say of which law of the rotors the thrust factor is, where the square of the speed alone is not it."""
    linear = {row["name"]: row["value"] for row in rows_of(record.found)}.get(THRUST_LAW, 0.0)
    if not linear:
        return ""
    limit = f" ({ON_BOUND})" if THRUST_LAW in record.on_bound else ""
    return f" Thrust is the thrust factor times w (w + {number(linear, 3)}{limit} w_h), with w_h the speed in hover."


def _or_unknown(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else number(value, digits)


def _scale(record: VehicleRecord, known: dict[str, Parameter]) -> Iterator[str]:
    """Say what gives the numbers their size in N and kg m^2, and what stays a ratio."""
    mass = number(record.vehicle.mass, 4)
    if known[THRUST].value is None:
        yield (
            "The flights lack velocity, so nothing separates thrust from weight: only ratios of thrust, inertia and "
            "drag factor are known."
        )
        return
    if known[THRUST].low is not None:
        yield f"The mass of {mass} kg, which the thrust lifts, gives all forces their size, and the arms all torques."
    else:
        yield "The stated thrust factor gives all forces and torques their size."
    yaw = [known[DRAG], known[INERTIA[2]]]
    if all(each.low is not None for each in yaw):
        told = [each for each in yaw if each.determined]
        if len(told) == len(yaw):
            yield "About yaw the gyroscopic torque tells the drag factor from Izz."
        else:
            yield f"About yaw {joined(each.name for each in yaw)} are known only as a ratio."


def found_vehicle_blocks(found: Source[VehicleRecord], index: int) -> Iterator[Block]:
    """Show a vehicle found in flights."""
    record = found.record
    yield Heading(found.label)
    yield Facts(
        [
            ("Structures judged", str(record.evaluated)),
            ("Blocks of windows behind the intervals", str(record.blocks)),
            ("Named and learned shares of the torque", _share_in_words(record.share.name, record.share.torque)),
            ("Of the force", _share_in_words(record.share.name, record.share.force)),
        ]
    )
    yield from details(found, index)
    if record.held_out is not None:
        drawn = playback_figure(f"vehicle-errors-{index}", record.held_out.by_horizon, "the vehicle found")
        yield from [drawn] if drawn else []
    yield _structures_table(record, index)
    yield _structures_figure(record, index)
    yield _shares_table(record, index)
    if record.vehicle.remainder is not None:
        yield _remainder_figure(record, index)


def _share_in_words(parts: Sequence[str], wrench: Array) -> str:
    """Compare what has a name with what is learned, beside the rotors."""
    sizes = dict(zip(parts, np.linalg.norm(wrench, axis=1).tolist(), strict=True))
    learned = sizes.pop(_REMAINDER, 0.0)
    sizes.pop(_ROTORS)
    named = float(np.sqrt(sum(value**2 for value in sizes.values())))
    if named + learned == 0:
        return "the rotors alone"
    share = learned**2 / (named**2 + learned**2)
    return f"named {percent(1 - share)}, learned {percent(share)} (squares, beside the rotors)"


def _structures_table(record: VehicleRecord, index: int) -> Table:
    rows = [
        [
            _NAMES[row["name"]],
            number(row["error"], 4),
            f"{number(row['worse'], 2)} ± {number(row['uncertain'], 2)}" if row["worse"] else UNKNOWN,
            str(row["numbers"]),
            number(row["condition_number"], 2),
            row["blocks"].replace(" ", ", "),
        ]
        for row in rows_of(record.structure)
        if row["name"] in _NAMES
    ]
    caption = (
        "Structures, judged on parts of the flights kept aside in turn. Chosen: the fewest numbers within one standard "
        "error of the smallest error, or not visibly worse; one by one: blocks added while they lower the error."
    )
    header = ("Structure", "Error", "Worse than the best", "Numbers", "Condition", "Blocks")
    return Table(f"vehicle-structures-{index}", caption, header, rows, frozenset({0, 5}), frozenset({0, 5}))


def _structures_figure(record: VehicleRecord, index: int) -> Plot:
    rows = rows_of(record.structure)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        front = sorted((row["numbers"], row["error"]) for row in rows if row["name"] == "front")
        count, error = (np.array(values, dtype=float) for values in zip(*front, strict=True))
        axes.plot(count, error, "o", label="Pareto front", color=GREY, markersize=4)
        markers = {"chosen": "s", "best": "^", "greedy": "v", "everything": "D", "nothing": "x"}
        for place, (name, marker) in enumerate(markers.items()):
            row = next(each for each in rows if each["name"] == name)
            look = {"label": _NAMES[name], "color": style_of(place)["color"], "markersize": 7, "linestyle": "none"}
            axes.plot([row["numbers"]], [row["error"]], marker, **look)
        axes.axhline(1.1, label="rates stay", **BASELINE)
        axes.set_xlabel("free numbers")
        axes.set_ylabel("error on flights kept aside")
        axes.set_yscale("log")
        legend_over(figure, axes)

    caption = "Playback error by the number of free numbers; the chosen structure is the simplest that is as good."
    return plot(f"vehicle-structures-figure-{index}", caption, caption, 3.4, draw)


def _shares_table(record: VehicleRecord, index: int) -> Table:
    rows = [
        [name.replace("_", " "), *(number(float(value), 3) for value in (*torque, *force))]
        for name, torque, force in zip(record.share.name, record.share.torque, record.share.force, strict=True)
    ]
    header = ("Part", *(f"torque {a}, N m" for a in _AXES), *(f"force {a}, N" for a in _AXES))
    caption = "What each part of the model does along the training flights, root mean square."
    return Table(f"vehicle-shares-{index}", caption, header, rows)


def _remainder_figure(record: VehicleRecord, index: int) -> Plot:
    direction, learned, named = remainder_curves(record)
    remainder = record.vehicle.remainder
    assert remainder is not None, "drawn only where there is one"
    kinds = [kind for kind, (_, rows) in _KINDS.items() if rows & set(remainder.rows.tolist())]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(3, len(kinds), sharex=True, sharey="col", squeeze=False)
        for column, kind in enumerate(kinds):
            unit, rows = _KINDS[kind]
            for axes, row in zip(panels[:, column], sorted(rows), strict=True):
                line(axes, direction, named[:, row], label="all effects that have a name", **BASELINE)
                line(axes, direction, learned[:, row], label="learned", **{**style_of(0), "linewidth": 2.0})
                axes.set_title(f"{kind} {_TURNS[row % 3] if kind == 'torque' else _PUSHES[row % 3]}, {unit}")
            panels[-1, column].set_xticks(np.arange(-180, 181, 90), ["back", "right", "ahead", "left", "back"])
        figure.supxlabel("direction of flight in the plane of the rotors", fontsize=9.5)
        legend_over(figure, panels[0, 0])

    speed = number(record.airspeed, 2)
    caption = (
        f"The unnamed part, by direction of flight: level, at {speed} m/s, without turning, with "
        "the rotors at the speed of hover. Grey: what the named effects add there."
    )
    return plot(f"vehicle-remainder-{index}", caption, caption, 5.2, draw)


def remainder_curves(record: VehicleRecord) -> tuple[Array, Array, Array]:
    """Evaluate the remainder, and the effects that have a name, over the direction of flight.

    Returns
    -------
    direction : array, shape (73,), degrees
        0 ahead, 90 left.
    learned, named : array, shape (73, 6), N m and N
    """
    model = vehicle_model(record.vehicle)
    direction = np.linspace(-180.0, 180.0, 73)
    angle = np.radians(direction)
    velocity = record.airspeed * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rotor = np.zeros((len(angle), 1 + 4 * model.rotors))
    rotor[:, 0] = 1.0
    rotor[:, 1 : 1 + model.rotors] = hover_speed(model.vehicle)
    parts, terms = model.parts, model.table.terms(velocity, np.zeros_like(velocity))
    learned, others = parts[_REMAINDER], (name for name in parts if name not in (_ROTORS, _REMAINDER))
    named = np.sum([parts[name] for name in others], axis=0) + np.zeros_like(learned)
    return direction, wrench_of(learned, terms, rotor), wrench_of(named, terms, rotor)
