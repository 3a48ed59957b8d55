"""The page of a vehicle found in flights: what it says, and draws, of what was learned."""

from dataclasses import replace

import numpy as np
import pytest
from cpfls_cli.artifacts.replay import HeldOutGroup, SignalErrorGroup
from cpfls_cli.pages.vehicle_model import (
    cautions,
    found_vehicle_blocks,
    grounds,
    loop_words,
    remainder_curves,
    slow_words,
    title,
    warnings,
)

from cpfls_cli.artifacts.parameters import parameters_of, vehicle_section
from cpfls_cli.artifacts.spec import InputFile
from cpfls_cli.artifacts.vehicle_model import (
    FoundNumbersGroup,
    InstrumentsGroup,
    LoopGroup,
    ResponsesGroup,
    TradesGroup,
)
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.pages.model import answer
from cpfls_cli.pages.repeats import WHAT_TO_FLY
from cpfls_cli.report.content import Plot, Table, Text, unfolded
from cpfls_cli.validation.trust import Trust, capped
from tests.builders.forms import source_of_record
from tests.builders.vehicle_models import record_of, remainder, whole

NAMES = ("inertia.Ixx", "rotor_drag.k_d", "remainder.0_0_0", "remainder_force.3_0_0", "remainder_force.3_0_1")


def found(model):
    """A record that names learned numbers, which the flights hardly tell and which trade."""
    record, count = record_of(model), len(NAMES)
    numbers = {name: np.ones(count) for name in ("value", "low", "high", "stated")}
    known = np.array([True, True, False, False, False])
    group = FoundNumbersGroup(
        name=NAMES, unit=("",) * count, determined=known, at_bound=np.zeros(count, dtype=bool), **numbers
    )
    pairs = (NAMES[3:5], (NAMES[1], NAMES[3]))
    first, second = zip(*pairs, strict=True)
    return replace(
        record, found=group, trade=TradesGroup(first=first, second=second, correlation=np.array([0.99, -0.97]))
    )


def test_numbers_without_a_meaning_of_their_own_are_counted_and_not_listed():
    tables = [block for block in unfolded(answer(source_of_record(found(whole())))) if isinstance(block, Table)]
    (table,) = [table for table in tables if table.name.startswith("vehicle-numbers")]
    assert [row[0].text for row in table.cells] == ["rotor drag k_d"]
    assert "3 more form the learned remainder" in table.caption


def test_they_are_warned_of_only_where_they_stand_for_a_number_with_a_name():
    said = " ".join(warnings(found(whole())))
    assert "only together (correlation): rotor drag k_d and remainder force 3_0_0 (-0.970)" in said
    assert "remainder_force.3_0_1" not in said
    assert "not determined" not in said


def test_the_curves_and_the_rotors_make_the_whole_wrench():
    model, record = whole(), record_of(whole())
    direction, learned, named = remainder_curves(record)
    angle = np.radians(direction)
    velocity = record.airspeed * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rotor = np.zeros((len(angle), 1 + 4 * model.rotors))
    rotor[:, 0], rotor[:, 1 : 1 + model.rotors] = 1.0, hover_speed(model.vehicle)
    rotors = rotor @ model.parts["rotors"][:, 0].T
    assert learned + named + rotors == pytest.approx(model.table.wrench(velocity, 0 * velocity, rotor))
    assert np.abs(learned).max() > 0


@pytest.mark.parametrize(("rows", "panels"), [((0, 2), 3), ((5,), 3), ((1, 4), 6)])
def test_torque_and_force_are_drawn_where_they_were_learned(rows, panels):
    source = source_of_record(record_of(replace(whole(), remainder=remainder(2, rows=rows))))
    (drawn,) = [
        block for block in found_vehicle_blocks(source, 1) if isinstance(block, Plot) and "remainder" in block.name
    ]
    assert len(drawn.picture.panels) == panels


@pytest.mark.parametrize(("moment", "told"), [(0.03, True), (0.02, False)])
def test_an_inertia_that_no_body_has_is_no_constant_however_narrow_its_interval(moment, told):
    record = found(whole())
    values = np.array([moment, *record.found.value[1:]])
    numbers = replace(
        record.found, value=values, stated=np.full(len(values), 0.004), determined=np.array([not told] * 5)
    )
    record = replace(record, found=numbers)
    (row,) = [each for each in parameters_of(record) if each.key == "inertia_kg_m2.0"]
    assert row.determined is not told
    assert ("too heavy for 0.9 kg between these rotors" in row.reason) is told
    assert any("Ixx 0.03 where" in line for line in cautions(record)) is told
    assert record.verdict == (Trust.NOT_DETERMINED if told else Trust.NOT_JUDGED)
    assert ("inertia and drag factor are not the body's" in title(record)) is told
    # What was stated stays where the flights do not tell better.
    assert vehicle_section(record)["inertia_kg_m2"][0] == pytest.approx(0.004 if told else record.vehicle.inertia[0])


@pytest.mark.parametrize(
    ("determined", "section"),
    [
        ([False, False], [0.004, 0.004, 0.005]),
        ([False, True], [0.004, 0.004, 0.005]),
        # Whatever a fit says of its intervals.
        ([True, True], [0.004, 0.004, 0.005]),
    ],
)
def test_no_config_gets_a_moment_of_inertia_that_no_body_has(determined, section):
    record = record_of(whole())
    found = replace(
        record.found,
        name=("inertia.Ixx", "inertia.Iyy"),
        value=np.array([0.03, 0.004]),
        stated=np.full(2, 0.004),
        determined=np.array(determined),
        at_bound=np.array([False, False]),
    )
    moments = np.array([0.03, 0.004, 0.005, 0.0, 0.0, 0.0])
    record = replace(record, found=found, vehicle=replace(record.vehicle, inertia=moments))
    assert vehicle_section(record)["inertia_kg_m2"] == section


def test_what_was_stated_and_does_not_go_with_what_was_found_is_to_be_found():
    found = FoundNumbersGroup(
        name=("inertia.Ixx", "inertia.Iyy", "inertia.Izz"),
        unit=("kg m^2",) * 3,
        value=np.array([0.008, 0.004, 0.009]),
        low=np.array([0.007, 0.003, 0.001]),
        high=np.array([0.009, 0.005, 0.050]),
        stated=np.array([np.nan, np.nan, 0.003]),
        determined=np.array([True, True, False]),
        at_bound=np.zeros(3, dtype=bool),
    )
    record = _of_inertia(0.008, 0.004, 0.009)(replace(record_of(whole()), found=found))
    assert vehicle_section(record)["inertia_kg_m2"] == [0.008, 0.004, None]


def test_a_number_that_no_vehicle_has_is_not_told_and_no_value_in_a_table():
    """A centre of mass beyond the hubs, and a damping beyond all that is tried, were printed as if found."""
    record = record_of(whole())
    names = ("inertia.Ixx", "com_offset.c_x", "linear_damping.d_x")
    numbers = FoundNumbersGroup(
        name=names,
        unit=("kg m^2", "m", "N m s/rad"),
        value=np.array([0.004, -0.83, 15.0]),
        low=np.array([0.0039, -3.0, 1.0]),
        high=np.array([0.0041, 2.0, 20.0]),
        stated=np.full(3, np.nan),
        determined=np.array([True, False, False]),
        at_bound=np.zeros(3, dtype=bool),
        possible=np.array([True, False, False]),
    )
    record = replace(record, found=numbers)
    assert record.untold == names[1:]
    tables = {block.name: block for block in unfolded(answer(source_of_record(record))) if isinstance(block, Table)}
    rows = [
        [cell.text for cell in row] for name in ("constants", "numbers") for row in tables[f"vehicle-{name}-1"].cells
    ]
    assert ["centre of mass along x, m", "—", "—", "—", "—", "no: impossible"] in rows
    assert ["linear damping d_x", "N m s/rad", "—", "—", "—"] in rows
    assert "centre of mass along x and linear damping d_x: impossible for such a vehicle" in " ".join(cautions(record))


def test_headline_table_and_section_follow_from_one_judgement_of_what_is_told():
    """Where instruments tell the constants, the body that a forecast turns by is no word against them."""
    record = _told(record_of(whole()))
    heavy = np.array([3.0, 3.0, 5.0, 0.0, 0.0, 0.0])
    record = replace(record, forecast=replace(record.vehicle, inertia=heavy))
    assert record.unreal == ("inertia.Ixx",)
    assert record.untold == ()
    assert title(record).endswith("its constants are told.")
    assert all(each.determined for each in parameters_of(record) if each.low is not None)
    assert vehicle_section(record)["inertia_kg_m2"][0] == record.vehicle.inertia[0]


def test_logs_too_slow_for_what_is_flown_are_to_be_faster_before_another_flight():
    record = record_of(whole())
    record = replace(record, found=replace(record.found, determined=np.zeros(2, dtype=bool)))
    assert record.verdict == Trust.NOT_DETERMINED
    (said,) = [line for line in cautions(replace(record, rotors_told=9.9)) if "rotors" in line]
    assert said == (
        "The rotors are logged 9.9 times a second, which shows no motion above 5.0 Hz. Flights logged so say no more; "
        "first log rotors and body rates at 100 Hz or more."
    )
    (own,) = slow_words(replace(record, rotors_told=9.9, logged_by=("Betaflight 4.5.1",)))
    assert own.endswith(
        "first log rotors and body rates at 100 Hz or more (Betaflight: blackbox_sample_rate = 1/4 and blackbox_device "
        "= SDCARD or SPIFLASH)."
    )
    assert not any("logged" in line for line in cautions(replace(record, rotors_told=25.1)))


def test_a_moment_that_no_body_has_is_said_with_its_reason():
    record = _of_inertia(0.02, 0.004, 0.007)(record_of(whole()))
    record = replace(record, found=replace(record.found, determined=np.array([False, True])))
    (row,) = [each for each in parameters_of(record) if each.key == "inertia_kg_m2.0"]
    assert row.reason.startswith("no body has it, for the other two are 0.011 kg m^2 together: a number that predicts")
    assert "Ixx: no body has it" in " ".join(cautions(record))
    assert "say too little about it: Ixx" not in " ".join(cautions(record))


def test_flights_that_show_the_loop_are_said_first_and_leave_no_good_word():
    record = record_of(whole())
    loop = LoopGroup(
        low=np.array([0.21, 0.23, np.nan]),
        high=np.array([2.6, 2.4, np.nan]),
        explained=np.array([0.45, 0.47, np.nan]),
        shown=True,
    )
    numbers = replace(record.found, determined=np.zeros(2, dtype=bool))
    (row,) = [
        each for each in parameters_of(replace(record, loop=loop, found=numbers)) if each.key == "inertia_kg_m2.0"
    ]
    assert row.reason == "these flights show the loop, not the vehicle"
    misled = replace(record, loop=loop, found=numbers)
    assert misled.held_out is None
    assert misled.verdict == Trust.LOOP
    assert not any("show the loop" in line for line in warnings(misled))
    first, said, *_ = cautions(misled)
    assert first == (
        "FORECAST NOT JUDGED; VEHICLE NOT JUDGED: THE FLIGHTS SHOW THE LOOP: not judged as a forecast; its constants "
        "are those of vehicle and autopilot together; 2 of 2 numbers are not determined."
    )
    assert "torque explains 45 % of the roll acceleration and 47 % of the pitch acceleration" in said
    assert "Ixx 0.21 to 2.6 times and Iyy 0.23 to 2.4 times what was found" in said
    assert said.endswith(f": {WHAT_TO_FLY}")
    assert "with larger and faster turns" in said
    for trust in (Trust.SIMULATION, Trust.CONTROL, Trust.INSIDE, Trust.NOT_JUDGED):
        assert capped(trust, (), loop=True) == Trust.LOOP
    assert capped(Trust.DO_NOT_USE, (), loop=True) == Trust.DO_NOT_USE
    assert capped(Trust.SIMULATION, ("rates are mirrored",), loop=True) == Trust.DO_NOT_USE


def test_the_band_in_which_torque_explains_little_is_said_beside_the_one_in_which_it_explains_most():
    loop = LoopGroup(
        low=np.array([0.21, 0.23, np.nan]),
        high=np.array([2.6, 2.4, np.nan]),
        explained=np.array([0.01, 0.47, np.nan]),
        shown=True,
        band_hz=np.array([[2.5, 6.7], [0.63, 1.7], [6.7, 20.0]]),
        by_band=np.array([[0.3, 0.47, np.nan], [0.01, 0.6, np.nan], [0.45, np.nan, np.nan]]),
        turning=np.array([3.0, 3.0, 1.0]),
    )
    said = loop_words(replace(record_of(whole()), loop=loop))
    assert "torque explains 1 % of the roll acceleration from 0.63 to 1.7 Hz (45 % from 6.7 to 20 Hz)" in said
    assert "and 47 % of the pitch acceleration from 2.5 to 6.7 Hz (60 % from 0.63 to 1.7 Hz)" in said
    assert "quick turns about one axis at a time" in said
    assert "larger" not in said
    origin = replace(record_of(whole()).origin, inputs={"flight-0": InputFile("fpv.bbl", "0" * 64, "bbl")})
    by_hand = loop_words(replace(record_of(whole()), loop=loop).with_header(origin))
    assert by_hand.endswith("stick left and right, then forward and back, about twice a second, with pauses.")
    assert WHAT_TO_FLY not in by_hand


def test_a_model_that_explains_less_than_its_rotors_alone_is_none_and_no_loop_is_blamed():
    loop = LoopGroup(
        low=np.full(3, 0.1),
        high=np.array([10.0, 10.0, np.nan]),
        explained=np.array([0.85, 0.79, np.nan]),
        shown=False,
        band_hz=np.array([[2.5, 6.7], [0.63, 1.7]]),
        by_band=np.array([[0.85, 0.86, np.nan], [0.91, 0.79, np.nan]]),
        missed=np.array([0.01, 0.02, np.nan]),
    )
    record = replace(record_of(whole()), loop=loop)
    assert record.verdict == Trust.NOT_DETERMINED
    assert "what was found does not explain these flights" in title(record)
    (said,) = [line for line in cautions(record) if line.startswith("What was found")]
    assert "its torque explains 1 % of roll and 2 % of pitch acceleration" in said
    assert "but a lag 85 % of the roll acceleration from 2.5 to 6.7 Hz (91 % from 0.63 to 1.7 Hz)" in said
    assert "the loop" not in " ".join(cautions(record))


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0.1, 0.104, "Ixx at most 0.10 times and"),
        (9.97, 10.0, "Ixx at least 10 times and"),
        (0.499, 0.501, "Ixx 0.50 times and"),
        (0.1, 10.0, "Ixx 0.10 to 10 times and"),
    ],
)
def test_bounds_that_meet_are_one_number(low, high, words):
    loop = replace(record_of(whole()).loop, low=np.array([low, 0.5, 1.0]), high=np.array([high, 2.0, 1.0]))
    assert words in loop_words(replace(record_of(whole()), loop=replace(loop, shown=True)))


def _told(record, cost=12.0, **given):
    """The same vehicle with constants that repeats tell."""
    numbers = replace(record.found, determined=np.ones(2, dtype=bool), at_bound=np.zeros(2, dtype=bool))
    group = InstrumentsGroup(
        kind="repeats",
        setpoint=(),
        first=np.array([0, 0, 1]),
        second=np.array([1, 2, 2]),
        likeness=np.array([0.9, 0.95, 0.97]),
        low=np.array([2.0, 1.0]),
        high=np.array([6.0, 3.0]),
        explained=np.full((2, 3), 0.97),
        used=np.ones(2, dtype=bool),
        total=np.full(3, 0.98),
        error=np.full(3, 0.01),
    )
    seen = ResponsesGroup(
        name=("roll", "pitch", "thrust"),
        cost=np.array([cost, 8.0, 300.0]),
        low=np.array([0.4, 0.5, 0.3]),
        high=np.array([9.0, 8.0, 2.0]),
    )
    return replace(record, found=numbers, instruments=replace(group, **given), responses=seen, forecast=record.vehicle)


def test_constants_that_repeats_tell_are_judged_by_what_comes_again_and_not_by_a_forecast():
    shown = replace(record_of(whole()).loop, shown=True)
    record = _told(replace(record_of(whole()), loop=shown))
    assert record.held_out is None
    assert record.forecast_verdict == Trust.NOT_JUDGED
    assert record.verdict == Trust.SIMULATION
    first, cost, *_ = grounds(record)
    assert "3 runs that repeat each other (correlation 0.90 to 0.97)" in first
    assert "From 1.0 to 6.0 Hz they explain 98 % (± 1 %) of the roll" in first
    assert cost.startswith("Mismatch J of its frequency responses (0 is none, up to 100 is acceptable): roll 12")
    said = [block.text for block in unfolded(answer(source_of_record(record))) if isinstance(block, Text)]
    assert any("`cpfls replay` plays" in line for line in said)
    assert not any("loop, not the vehicle" in line for line in said)


def test_a_response_that_is_off_is_none_of_the_vehicle_and_one_that_is_not_seen_judges_nothing():
    off, unseen = _told(record_of(whole()), cost=101.0), _told(record_of(whole()), cost=np.nan)
    assert off.verdict == Trust.LACKING
    assert "roll 101 (0.40 to 9.0 Hz), pitch 8.0" in " ".join(grounds(off))
    assert unseen.verdict == Trust.NOT_JUDGED
    assert "do not show the frequency responses of roll and pitch clearly enough" in " ".join(grounds(unseen))
    assert off.summary["responses"]["roll"] == {"word": "not-acceptable", "cost": 101.0, "band_hz": [0.4, 9.0]}
    assert off.summary["response"]["lag_s"] == off.vehicle.response.lag_s


@pytest.mark.parametrize(
    ("given", "found", "trust"),
    [
        ({"total": np.array([0.98, 0.7, 0.98])}, {}, Trust.LACKING),
        ({"used": np.array([True, False])}, {}, Trust.LACKING),
        ({}, {"determined": np.array([False, True])}, Trust.NOT_DETERMINED),
        ({}, {"at_bound": np.array([True, False])}, Trust.NOT_DETERMINED),
    ],
)
def test_constants_that_lack_something_are_not_good(given, found, trust):
    record = _told(record_of(whole()), **given)
    record = replace(record, found=replace(record.found, **found))
    assert record.verdict == trust
    assert replace(record, contradiction=("rates are mirrored",)).verdict == Trust.DO_NOT_USE
    said = " ".join(grounds(record))
    assert ("Below 2.0 Hz they explain less" in said) == ("used" in given)
    assert ("Other values of Ixx would explain about as much" in said) == (trust == Trust.NOT_DETERMINED)


def _held_out(velocity):
    """Playback over half a second that is twice as good as its rivals, but for the velocity."""
    horizon = np.linspace(0.02, 0.5, 25)

    def group(model):
        rows = [model * horizon, 2 * horizon, 2 * horizon, 9 * horizon]
        return SignalErrorGroup(mae=np.array(rows), rms=np.zeros((4, 25, 3)))

    return HeldOutGroup(
        flown=("other.h5",),
        windows=9,
        prediction=("model", "nothing-moves", "rate-stays", "stated"),
        horizon_s=horizon,
        diverged=np.zeros(4, dtype=np.int64),
        body_rate=group(1.0),
        velocity=group(velocity),
    )


def _of_inertia(*moments):
    def changed(record):
        return replace(record, vehicle=replace(record.vehicle, inertia=np.array([*moments, 0.0, 0.0, 0.0])))

    return changed


def _on_bound(record):
    return replace(record, found=replace(record.found, at_bound=np.array([True, True])))


def _off(record):
    names, known = ("roll", "pitch"), np.array([101.0, 8.0])
    return replace(record, responses=ResponsesGroup(name=names, cost=known, low=known, high=known))


@pytest.mark.parametrize(
    ("changed", "velocity", "why"),
    [
        (_on_bound, 1.0, "rests on Ixx at the limit of the search"),
        (_of_inertia(0.03, 0.02, 0.02), 1.0, "rests on Ixx that no such body has"),
        (_of_inertia(0.02, 0.004, 0.007), 1.0, "rests on Ixx that no such body has"),
        (_off, 1.0, "has a frequency response about roll or pitch that is off"),
        (replace, 2.1, "is worse in velocity than “nothing moves” and “rate stays” both"),
    ],
)
def test_a_forecast_that_beats_its_rivals_in_rates_is_not_good_where_no_vehicle_makes_it(changed, velocity, why):
    good = replace(record_of(whole()), held_out=_held_out(1.0))
    assert good.forecast_verdict == Trust.SIMULATION
    record = changed(replace(good, held_out=_held_out(velocity)))
    assert record.forecast_verdict == Trust.NOT_CONTROL
    assert record.verdict not in (Trust.SIMULATION, Trust.CONTROL)
    assert title(record).startswith(f"predicts body rates 0.50 s ahead, but {why}; ")
    said = [block.text for block in unfolded(answer(source_of_record(record))) if isinstance(block, Text)]
    assert f"Not for control: it {why}." in said


def test_the_size_of_a_thrust_factor_goes_with_the_full_speed_that_is_assumed():
    record = record_of(whole())
    numbers = replace(record.found, name=("thrust_factor", "drag_factor"), determined=np.array([True, False]))
    shares = replace(record, found=numbers, full_speed=1000.0)

    def named(record):
        tables = [block for block in unfolded(answer(source_of_record(record))) if isinstance(block, Table)]
        (table,) = [table for table in tables if table.name.startswith("vehicle-constants")]
        return [row[0].text for row in table.cells][:2]

    assert named(shares) == ["thrust factor (at an assumed 1000 rad/s full speed), N s^2", "drag factor, N m s^2"]
    assert named(replace(shares, full_speed=None)) == ["thrust factor, N s^2", "drag factor, N m s^2"]


@pytest.mark.parametrize("lacks", [True, False])
def test_velocity_is_asked_for_only_where_flights_lack_it(lacks):
    record = record_of(whole())
    if lacks:
        record = replace(record, guess=("thrust_factor",))
    else:
        found = replace(record.found, name=("thrust_factor", "drag_factor"), determined=np.array([False, True]))
        record = replace(record, found=found)
    (said,) = [
        block.text
        for block in unfolded(answer(source_of_record(record)))
        if isinstance(block, Text) and block.text.startswith("To know thrust factor")
    ]
    first = "log velocity (or position), and " if lacks else ""
    assert said == f"To know thrust factor: {first}climb and descend more: the known mass then tells thrust."
