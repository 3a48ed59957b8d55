"""What the flights tell of the constants of a vehicle, which scale they have, and which flight would tell the rest."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.artifacts.parameters import (
    CENTRE,
    DELAY,
    DRAG,
    INERTIA,
    LAG,
    THRUST,
    Parameter,
    parameters_of,
    vehicle_section,
)
from cpfls_cli.artifacts.vehicle_model import VehicleRecord
from cpfls_cli.config.yaml_text import to_yaml
from cpfls_cli.report.content import Block, Cell, Listing, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, joined, number

_FLIGHTS = {
    THRUST: "log velocity (or position), and climb and descend: the known mass then tells thrust",
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


def constants(record: VehicleRecord, index: int) -> Iterator[Block]:
    """Show the constants of a vehicle by key, say what scale they have and what would tell the open ones."""
    listed = list(parameters_of(record))
    yield _table(listed, index)
    yield Text(" ".join(_scale(record, {each.key: each for each in listed})))
    wanting = [each for each in listed if (each.low is not None and not each.determined) or each.value is None]
    yield from (Text(f"To know {each.key}: {_FLIGHTS[each.key]}.", "warning") for each in wanting)


def section_to_paste(record: VehicleRecord) -> Listing:
    """Write the section of the config with what was found."""
    return Listing("The section vehicle with what was found, ready to paste", config_text(record))


def config_text(record: VehicleRecord) -> str:
    """Write the section `vehicle` as YAML."""
    return to_yaml({"vehicle": vehicle_section(record)})


def _wanting(parameter: Parameter) -> bool:
    """Tell whether a number was looked for and not found."""
    return parameter.value is None or (parameter.low is not None and not parameter.determined)


def _table(listed: list[Parameter], index: int) -> Table:
    rows: list[list[str | Cell]] = [
        [
            each.key,
            each.unit,
            UNKNOWN
            if each.value is None
            else Cell(number(each.value), "plain" if each.low is None or each.determined else "warning"),
            UNKNOWN if each.low is None else number(each.low, 3),
            UNKNOWN if each.high is None else number(each.high, 3),
            each.reason,
        ]
        for each in listed
    ]
    caption = "Constants of the vehicle by key of the config, with 95 % intervals."
    header = ("Key", "Unit", "Value", "From", "To", "Why")
    return Table(f"vehicle-constants-{index}", caption, header, rows, frozenset({0, 1, 5}), frozenset({5}))


def _scale(record: VehicleRecord, known: dict[str, Parameter]) -> Iterator[str]:
    """Say what gives the numbers their size in N and kg m^2, and what stays a ratio."""
    mass = number(record.vehicle.mass, 4)
    if known[THRUST].value is None:
        yield (
            "The flights lack velocity, so nothing tells thrust from weight: of thrust, inertia and drag factor only "
            "ratios are known."
        )
        return
    if known[THRUST].low is not None:
        yield f"The mass of {mass} kg, which the thrust lifts, gives all forces their size, and the arms all torques."
    else:
        yield "The stated thrust factor gives all forces and torques their size."
    yaw = [known[DRAG], known[INERTIA[2]]]
    if all(each.low is not None for each in yaw):
        told = [each.key for each in yaw if each.determined]
        if len(told) == len(yaw):
            yield "About yaw the gyroscopic torque tells the drag factor from Izz."
        else:
            yield f"About yaw {joined(each.key for each in yaw)} are known as a ratio alone."
