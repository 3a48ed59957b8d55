"""The page of a vehicle found in flights: what it says, and draws, of what was learned."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli import page
from cpfls_cli.artifacts.model import LearnedFlight, joined_flights
from cpfls_cli.artifacts.vehicle_model import ResponseMismatch, vehicle_section
from cpfls_cli.effects.scales import hover_speed
from cpfls_cli.errors import InputError
from cpfls_cli.flights.training import refuse_seen
from cpfls_cli.pages.gap_words import BY_HAND, WHAT_TO_FLY
from cpfls_cli.pages.model import against, slow_words
from cpfls_cli.pages.trust import seen_warnings
from cpfls_cli.playback.constants import ExplainedBand, Repeat, UsedInstruments
from cpfls_cli.playback.loop import LoopBounds
from cpfls_cli.playback.vehicle import Trade
from cpfls_cli.report.content import Heading, Plot, Table, Text, unfolded
from cpfls_cli.result import plain
from cpfls_cli.stages.vehicle import remainder_curves, vehicle
from cpfls_cli.validation.trust import Trust, capped
from tests.builders.vehicle_models import held_out, number_of, remainder, source_of_vehicle, vehicle_of, whole

NAMES = ("inertia.Ixx", "rotor_drag.k_d", "remainder.0_0_0", "remainder_force.3_0_0", "remainder_force.3_0_1")
LOOP = LoopBounds(np.array([0.21, 0.23, np.nan]), np.array([2.6, 2.4, np.nan]), np.array([0.45, 0.47, np.nan]))
LAST_UNUSED = (ExplainedBand(2.0, 6.0, np.full(3, 0.97), True), ExplainedBand(1.0, 3.0, np.full(3, 0.97), False))


def blocks_of(own):
    return list(unfolded(page.blocks(vehicle.text(own, about=source_of_vehicle(own)))))


def box_of(own):
    return page.blocks(vehicle.text(own, about=source_of_vehicle(own)))[0]


def title(own):
    return box_of(own).title.removeprefix("vehicle.h5: ")


def evidence(own):
    return list(box_of(own).sentences)


def texts(own):
    return [block.text for block in blocks_of(own) if isinstance(block, Text)]


def rows_of(own, first):
    (table,) = [block for block in blocks_of(own) if isinstance(block, Table) and block.header[0] == first]
    return [[cell.text for cell in row] for row in table.cells]


def learned():
    """A vehicle that names learned numbers, which the flights hardly identify and which trade."""
    numbers = tuple(number_of(name, stated=1.0, determined=place < 2) for place, name in enumerate(NAMES))
    return vehicle_of(whole(), numbers=numbers, trades=(Trade(*NAMES[3:5], 0.99), Trade(NAMES[1], NAMES[3], -0.97)))


def with_first(own, **changed):
    first, *others = own.numbers
    return replace(own, numbers=(first._replace(**changed), *others))


def of_inertia(own, *moments):
    return replace(own, model=replace(own.model, vehicle=replace(own.model.vehicle, inertia_kg_m2=moments)))


def test_numbers_without_a_meaning_of_their_own_are_counted_and_warned_of_where_they_stand_for_one_with_a_name():
    assert [row[0] for row in rows_of(learned(), "Number")] == ["rotor drag k_d"]
    assert any("3 more form the learned remainder" in text for text in texts(learned()))
    said = " ".join(texts(learned()))
    assert "only together (correlation): rotor drag k_d and remainder force 3_0_0 (-0.970)" in said
    assert "remainder_force.3_0_1" not in said


def test_the_curves_and_the_rotors_make_the_whole_wrench():
    model, own = whole(), vehicle_of(whole())
    direction, learned, named = remainder_curves(own)
    angle = np.radians(direction)
    velocity = own.airspeed_m_s * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rotor = np.zeros((len(angle), 1 + 4 * model.rotors))
    rotor[:, 0], rotor[:, 1 : 1 + model.rotors] = 1.0, hover_speed(model.vehicle)
    rotors = replace(model, effects=(), remainder=None).wrench(velocity, 0 * velocity, rotor)
    assert learned + named + rotors == pytest.approx(model.wrench(velocity, 0 * velocity, rotor))
    assert np.abs(learned).max() > 0


@pytest.mark.parametrize(("rows", "panels"), [((0, 2), 3), ((5,), 3), ((1, 4), 6)])
def test_torque_and_force_are_drawn_where_they_were_learned(rows, panels):
    section = vehicle.section(source_of_vehicle(vehicle_of(replace(whole(), remainder=remainder(2, rows=rows)))), 1)
    (drawn,) = [
        block for block in unfolded(section.blocks) if isinstance(block, Plot) and block.name.endswith("remainder")
    ]
    assert len(drawn.picture.figure().axes) == panels


@pytest.mark.parametrize(("moment", "heavy"), [(0.03, True), (0.02, False)])
def test_an_inertia_that_no_body_has_is_no_constant_however_narrow_its_interval(moment, heavy):
    own = learned()
    numbers = (own.numbers[0]._replace(value=moment), *own.numbers[1:])
    own = replace(own, numbers=tuple(each._replace(stated=0.004, determined=not heavy) for each in numbers))
    row = own.parameters["inertia_kg_m2.0"]
    assert row.determined is not heavy
    assert ("too heavy for 0.9 kg between these rotors" in row.reason) is heavy
    assert any("Ixx 0.03 where" in line for line in against(own)) is heavy
    assert own.verdict == (Trust.NOT_DETERMINED if heavy else Trust.NOT_JUDGED)
    assert ("inertia and drag factor are not the body's" in title(own)) is heavy
    # What was stated stays where the flights do not identify better.
    stated = own.model.vehicle.inertia_kg_m2[0]
    assert vehicle_section(own)["inertia_kg_m2"][0] == pytest.approx(0.004 if heavy else stated)


@pytest.mark.parametrize("determined", [(False, False), (False, True), (True, True)])
def test_no_config_gets_a_moment_of_inertia_that_no_body_has(determined):
    """Whatever a fit says of its intervals."""
    pairs = zip(("inertia.Ixx", "inertia.Iyy"), (0.03, 0.004), determined, strict=True)
    numbers = tuple(number_of(name, value, stated=0.004, determined=known) for name, value, known in pairs)
    own = of_inertia(vehicle_of(whole(), numbers=numbers), 0.03, 0.004, 0.005)
    assert vehicle_section(own)["inertia_kg_m2"] == [0.004, 0.004, 0.005]


def test_what_was_stated_and_does_not_go_with_what_was_found_is_to_be_found():
    numbers = (
        number_of("inertia.Ixx", 0.008, 0.007, 0.009),
        number_of("inertia.Iyy", 0.004, 0.003, 0.005),
        number_of("inertia.Izz", 0.009, 0.001, 0.050, 0.003, determined=False),
    )
    own = of_inertia(vehicle_of(whole(), numbers=numbers), 0.008, 0.004, 0.009)
    assert vehicle_section(own)["inertia_kg_m2"] == [0.008, 0.004, None]


def test_a_number_that_no_vehicle_has_is_not_identified_and_no_value_in_a_table():
    """A centre of mass beyond the hubs, and a damping beyond all that is tried, were printed as if found."""
    names = ("com_offset.c_x", "linear_damping.d_x")
    numbers = (
        number_of("inertia.Ixx", 0.004, 0.0039, 0.0041),
        number_of(names[0], -0.83, -3.0, 2.0, determined=False, possible=False),
        number_of(names[1], 15.0, 1.0, 20.0, determined=False, possible=False)._replace(unit="N m s/rad"),
    )
    own = vehicle_of(whole(), numbers=numbers)
    assert own.not_determined == names
    assert ["centre of mass along x, m", "—", "—", "—", "—", "no: impossible"] in rows_of(own, "Another constant")
    assert ["linear damping d_x", "N m s/rad", "—", "—", "—"] in rows_of(own, "Number")
    assert "centre of mass along x and linear damping d_x: impossible for such a vehicle" in " ".join(against(own))


def test_headline_table_and_section_follow_from_one_judgement_of_what_is_identified():
    """Where instruments identify the constants, the body that a forecast turns by is no word against them."""
    own = instrumented(vehicle_of(whole()))
    own = replace(own, forecast=of_inertia(own, 3.0, 3.0, 5.0).model)
    assert (own.unreal, own.not_determined) == (("inertia.Ixx",), ())
    assert title(own).endswith("its constants are identified.")
    assert all(each.determined for each in own.parameters.values() if each.low is not None)
    assert vehicle_section(own)["inertia_kg_m2"][0] == own.model.vehicle.inertia_kg_m2[0]


def test_logs_too_slow_for_what_is_flown_are_to_be_faster_before_another_flight():
    own = vehicle_of(whole())
    own = replace(own, numbers=tuple(each._replace(determined=False) for each in own.numbers))
    assert own.verdict == Trust.NOT_DETERMINED
    (said,) = [line for line in against(replace(own, rotors_logged_hz=9.9)) if "rotors" in line]
    assert said == (
        "The rotors are logged 9.9 times a second, which shows no motion above 5 Hz. Flights logged so say no more; "
        "first log rotors and body rates at 100 Hz or more."
    )
    assert slow_words(replace(own, rotors_logged_hz=9.9, logged_by=("Betaflight 4.5.1",))).endswith(
        "first log rotors and body rates at 100 Hz or more (Betaflight: blackbox_sample_rate = 1/4 and blackbox_device "
        "= SDCARD or SPIFLASH)."
    )
    assert not any("logged" in line for line in against(replace(own, rotors_logged_hz=25.1)))


def test_a_moment_that_no_body_has_is_said_with_its_reason():
    own = with_first(of_inertia(vehicle_of(whole()), 0.02, 0.004, 0.007), determined=False)
    reason = own.parameters["inertia_kg_m2.0"].reason
    assert reason.startswith("no body has it, for the other two are 0.011 kg m^2 together: a number that predicts")
    assert "Ixx: no body has it" in " ".join(against(own))
    assert "say too little about it: Ixx" not in " ".join(against(own))


def test_flights_that_show_the_loop_are_said_first_and_leave_no_good_word():
    own = vehicle_of(whole(), loop=LOOP)
    own = replace(own, numbers=tuple(each._replace(determined=False) for each in own.numbers))
    assert own.parameters["inertia_kg_m2.0"].reason == "these flights show the loop, not the vehicle"
    assert own.held_out is None
    assert own.verdict == Trust.LOOP
    first, said, *_ = against(own)
    assert first == (
        "FORECAST NOT JUDGED; VEHICLE NOT JUDGED: THE FLIGHTS SHOW THE LOOP: no flight was held out to judge its "
        "forecast; its constants are those of vehicle and autopilot together; 2 of 2 numbers are not determined."
    )
    assert "torque explains 45 % of the roll acceleration and 47 % of the pitch acceleration" in said
    assert "Ixx 0.21 to 2.6 times and Iyy 0.23 to 2.4 times what was found" in said
    assert said.endswith(f": {WHAT_TO_FLY}")
    assert "with larger and faster turns" in said
    for trust in (Trust.SIMULATION, Trust.CONTROL, Trust.INSIDE, Trust.NOT_JUDGED):
        assert capped(trust, (), loop=True) == Trust.LOOP
    assert capped(Trust.DO_NOT_USE, (), loop=True) == Trust.DO_NOT_USE
    assert capped(Trust.SIMULATION, ("rates are mirrored",), loop=True) == Trust.DO_NOT_USE


def test_the_band_in_which_torque_explains_little_is_said_with_the_one_in_which_it_explains_most():
    loop = LOOP._replace(
        explained=np.array([0.01, 0.47, np.nan]),
        band_hz=np.array([[2.5, 6.7], [0.63, 1.7], [6.7, 20.0]]),
        by_band=np.array([[0.3, 0.47, np.nan], [0.01, 0.6, np.nan], [0.45, np.nan, np.nan]]),
        turning=np.array([3.0, 3.0, 1.0]),
    )
    own = vehicle_of(whole(), loop=loop)
    said = " ".join(against(own))
    assert "torque explains 1 % of the roll acceleration from 0.63 to 1.7 Hz (45 % from 6.7 to 20 Hz)" in said
    assert "and 47 % of the pitch acceleration from 2.5 to 6.7 Hz (60 % from 0.63 to 1.7 Hz)" in said
    assert "quick turns about one axis at a time" in said
    assert "larger" not in said
    by_hand = " ".join(against(replace(own, learned=(LearnedFlight("fpv.bbl", "0" * 64, "bbl"),))))
    assert "stick left and right, then forward and back, about twice a second, with pauses." in by_hand
    assert WHAT_TO_FLY not in by_hand


def bounded(*ends, **changed):
    """A vehicle whose body is held between bounds on the moments of inertia about roll and pitch."""
    loop = LoopBounds(
        np.array([0.75, 0.77, np.nan]),
        np.array([1.33, 1.3, np.nan]),
        np.array([0.85, 0.79, np.nan]),
        np.array([[2.5, 6.7], [0.63, 1.7]]),
        np.array([[0.85, 0.86, np.nan], [0.91, 0.79, np.nan]]),
        missed=np.array([0.01, 0.02, np.nan]),
    )
    numbers = tuple(
        number_of(f"inertia.{name}", np.sqrt(low * high), low, high, determined=high < 2 * low)
        for name, (low, high) in zip(("Ixx", "Iyy"), ends, strict=False)
    )
    return vehicle_of(whole(), loop=loop, **{"numbers": numbers, "correlation": np.eye(len(numbers))} | changed)


def test_a_body_that_is_held_between_bounds_is_known_as_far_as_they_are_narrow():
    own = bounded((1.3e-5, 2.3e-5), (1.4e-5, 2.5e-5), trades=(Trade("drag_factor", "inertia.Izz", 1.0),))
    assert (own.by_bounds, own.verdict) == (True, Trust.NOT_JUDGED)
    assert "Ixx and Iyy are known by bounds alone" in title(own)
    (said,) = [line for line in against(own) if line.startswith("What fits")]
    assert "its torque explains 1 % of roll and 2 % of pitch acceleration" in said
    assert "such rotors 85 % of the roll acceleration from 2.5 to 6.7 Hz (91 % from 0.63 to 1.7 Hz)" in said
    assert "(Ixx from 1.3 × 10⁻⁵ to 2.3 × 10⁻⁵ and Iyy from 1.4 × 10⁻⁵ to 2.5 × 10⁻⁵ kg m²)" in said
    assert {own.parameters[key].identified for key in ("inertia_kg_m2.0", "inertia_kg_m2.1")} == {"by bounds"}
    assert "the loop," not in " ".join(against(own))
    wide = bounded((1.3e-5, 2.7e-5), (1.4e-5, 2.9e-5))
    assert wide.verdict == Trust.NOT_DETERMINED
    assert "bounds leave Ixx and Iyy open" in title(wide)
    assert wide.parameters["inertia_kg_m2.0"].reason == "bounds from 1.3e-05 to 2.7e-05 leave it open"


def test_of_a_body_by_bounds_what_has_none_is_not_said_to_have_them():
    """Neither a ratio that is open as well, nor what was not tried with such a body."""
    names = ("inertia.Ixx", "inertia.Iyy", "inertia.Izz", "drag_factor")
    numbers = tuple(number_of(name, 2e-5, 1e-5, 4e-5, determined=False) for name in names)
    own = replace(bounded(numbers=numbers, correlation=np.eye(4)), forecast=whole())
    assert own.bounded == names[:2]
    for key in ("inertia_kg_m2.2", "rotors.drag_factor_n_m_s2"):
        assert own.parameters[key].reason == "the flights set no bounds to it: taken as open by a factor of ten"
    said = " ".join(texts(own))
    assert "About yaw the flights leave drag factor, Izz and their ratio open." in said
    assert "freeing it does not lower the error" not in said


def test_where_flights_show_the_loop_too_no_forecast_judges_a_body_by_bounds():
    narrow, trades = ((1.3e-5, 2.3e-5), (1.4e-5, 2.5e-5)), (Trade("drag_factor", "inertia.Izz", 1.0),)
    alone = bounded(*narrow, trades=trades, held_out=held_out(1.0))
    both = replace(alone, forecast=alone.model)
    assert (alone.forecast_verdict, alone.verdict) == (Trust.SIMULATION, Trust.SIMULATION)
    assert (both.forecast_verdict, both.verdict) == (Trust.SIMULATION, Trust.NOT_JUDGED)
    assert "and the rest was found with it." in " ".join(against(alone))
    assert "with the lag that explains most." in " ".join(against(both))
    assert any("`cpfls replay` plays" in line for line in texts(both))


def test_a_body_that_bounds_enclose_stays_as_stated():
    assert "the body is held as stated" in " ".join(against(bounded()))


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
    loop = LOOP._replace(low=np.array([low, 0.5, 1.0]), high=np.array([high, 2.0, 1.0]))
    assert words in " ".join(against(vehicle_of(whole(), loop=loop)))


def instrumented(own, cost=12.0, **given):
    """The same vehicle with constants that repeats identify."""
    bands = tuple(ExplainedBand(low, high, np.full(3, 0.97), True) for low, high in ((2.0, 6.0), (1.0, 3.0)))
    used = {
        "kind": "repeats",
        "repeats": (Repeat(0, 1, 0.9), Repeat(0, 2, 0.95), Repeat(1, 2, 0.97)),
        "bands": bands,
        "explained": np.full(3, 0.98),
        "explained_error": np.full(3, 0.01),
    }
    return replace(
        own,
        numbers=tuple(each._replace(determined=True, at_bound=False) for each in own.numbers),
        instruments=UsedInstruments(**used | given),
        responses=(
            ResponseMismatch("roll", cost, 0.4, 9.0),
            ResponseMismatch("pitch", 8.0, 0.5, 8.0),
            ResponseMismatch("thrust", 300.0, 0.3, 2.0),
        ),
        forecast=own.model,
    )


def test_constants_that_repeats_identify_are_judged_by_what_is_repeatable_and_not_by_a_forecast():
    own = instrumented(vehicle_of(whole(), loop=LOOP))
    assert own.held_out is None
    assert (own.forecast_verdict, own.verdict) == (Trust.NOT_JUDGED, Trust.SIMULATION)
    (said,) = evidence(own)
    assert "3 runs that repeat each other (correlation 0.90 to 0.97)" in said
    assert "From 1.0 to 6.0 Hz they explain 98 % (± 1 %) of the roll" in said
    assert "Mismatch J of its frequency responses (0 is none, up to 100 is acceptable): roll 12" in said
    assert any("`cpfls replay` plays" in line for line in texts(own))
    assert not any("loop, not the vehicle" in line for line in texts(own))


def test_a_response_that_is_off_is_none_of_the_vehicle_and_one_that_is_not_seen_judges_nothing():
    off, unseen = instrumented(vehicle_of(whole()), cost=101.0), instrumented(vehicle_of(whole()), cost=np.nan)
    assert off.verdict == Trust.LACKING
    assert "roll 101 (0.40 to 9.0 Hz), pitch 8.0" in " ".join(evidence(off))
    assert unseen.verdict == Trust.NOT_JUDGED
    assert "do not show the frequency responses of roll and pitch clearly enough" in " ".join(evidence(unseen))
    for kind in ("repeats", "past"):
        own = instrumented(vehicle_of(whole()), cost=np.nan, kind=kind)
        assert WHAT_TO_FLY in " ".join(evidence(own))
        by_hand = " ".join(evidence(replace(own, logged_by=("Betaflight 4.5",))))
        assert BY_HAND in by_hand
        assert WHAT_TO_FLY not in by_hand
    assert plain(off)["responses"][0] == {"name": "roll", "cost": 101.0, "low": 0.4, "high": 9.0}


@pytest.mark.parametrize(
    ("given", "number", "trust"),
    [
        ({"explained": np.array([0.98, 0.7, 0.98])}, {}, Trust.LACKING),
        ({"bands": LAST_UNUSED}, {}, Trust.LACKING),
        ({}, {"determined": False}, Trust.NOT_DETERMINED),
        ({}, {"at_bound": True}, Trust.NOT_DETERMINED),
    ],
)
def test_constants_that_lack_something_are_not_good(given, number, trust):
    own = with_first(instrumented(vehicle_of(whole()), **given), **number)
    assert own.verdict == trust
    assert replace(own, contradictions=("rates are mirrored",)).verdict == Trust.DO_NOT_USE
    said = " ".join(evidence(own))
    assert ("Below 2.0 Hz they explain less" in said) == ("bands" in given)
    assert ("Other values of Ixx would explain about as much" in said) == (trust == Trust.NOT_DETERMINED)


def on_bound(own):
    return replace(own, numbers=tuple(each._replace(at_bound=True) for each in own.numbers))


def off(own):
    known = (("roll", 101.0), ("pitch", 8.0))
    return replace(own, responses=tuple(ResponseMismatch(name, cost, cost, cost) for name, cost in known))


@pytest.mark.parametrize(
    ("changed", "velocity", "why"),
    [
        (on_bound, 1.0, "rests on Ixx at the limit of the search"),
        (lambda own: of_inertia(own, 0.03, 0.02, 0.02), 1.0, "rests on Ixx that no such body has"),
        (lambda own: of_inertia(own, 0.02, 0.004, 0.007), 1.0, "rests on Ixx that no such body has"),
        (off, 1.0, "has a frequency response about roll or pitch that is off"),
        (replace, 2.1, "is worse in velocity than “nothing moves” and “rate stays” both"),
    ],
)
def test_a_forecast_that_beats_its_rivals_in_rates_is_not_good_where_no_vehicle_makes_it(changed, velocity, why):
    good = vehicle_of(whole(), held_out=held_out(1.0))
    assert good.forecast_verdict == Trust.SIMULATION
    own = changed(replace(good, held_out=held_out(velocity)))
    assert own.forecast_verdict == Trust.NOT_CONTROL
    assert own.verdict not in (Trust.SIMULATION, Trust.CONTROL)
    assert title(own).startswith(f"predicts body rates 0.50 s ahead, but {why}; ")
    assert f"Not for control: it {why}." in texts(own)


@pytest.mark.parametrize("fades", [1.05, 4.0])
def test_a_forecast_that_is_no_better_than_fading_rates_is_not_said_to_predict(fades):
    """It predicted "0.50 s ahead, but is no better at 0.25 s than", where `replay` called it better."""
    own = held_out(1.0)
    rates = own.models["rate-stays"].body_rate
    fading = replace(own.models["rate-stays"], body_rate=replace(rates, mae=0.5 * fades * rates.mae))
    found = vehicle_of(whole(), held_out=replace(own, models={**own.models, "rate-fades": fading}))
    said = "its forecast is not clearly better in body rate at 0.24 s than “rate fades” (no model); "
    assert title(on_bound(found)).startswith("predicts body rates" if fades > 2 else said.replace(";", " and rests on"))
    assert title(found).startswith("predicts motion 0.50 s ahead; " if fades > 2 else said)


def test_a_number_at_the_limit_of_the_search_is_no_value_in_a_table():
    """A drag factor was printed below its own interval, whose end it was."""
    own = vehicle_of(whole(), numbers=(number_of("drag_factor", 1.987e-9, 1.99e-9, 6e-5)._replace(at_bound=True),))
    (row,) = [row for row in rows_of(own, "Constant") if row[0].startswith("drag factor")]
    assert row[1:4] == ["—", "—", "—"]
    assert row[-1] == "no: at the limit of the search"


def test_a_sentence_lists_no_more_numbers_than_anybody_reads():
    effects = ("linear_damping.d", "inertia_ratio.e", "wind.v")
    numbers = tuple(number_of(f"{name}_{axis}", determined=False) for name in effects for axis in "xyz")
    (said,) = [line for line in against(vehicle_of(whole(), numbers=numbers)) if "say too little about it" in line]
    assert said.endswith("inertia ratio e_z and 3 more.")


def test_the_log_that_a_flight_was_imported_from_is_one_that_was_learned_from():
    own = LearnedFlight("one.h5", "5" * 64, "cpfls/flight", log="9" * 64, begins=1.0, ends=9.0)
    logs = [LearnedFlight(f"{name}.ulg", sha256 * 64, "ulg") for name, sha256 in (("one", "9"), ("other", "8"))]
    (said,) = seen_warnings("vehicle.h5", [own], logs)
    assert said.startswith("one.ulg: vehicle.h5 has learned from it")
    # Another stretch of that log is another flight; the same one under another name is not.
    later = own._replace(name="two.h5", sha256="6" * 64, begins=9.0, ends=12.0)
    assert not [*seen_warnings("vehicle.h5", [own], [later])]
    refuse_seen([own], [later])
    assert own._replace(ends=9.0 + 1e-13).shared_with(later) is None
    (said,) = seen_warnings("vehicle.h5", [own], [later._replace(begins=8.0)])
    assert said.startswith("two.h5: vehicle.h5 has learned from 8.0 to 9.0 s of its log")
    again = own._replace(name="two.h5", sha256="6" * 64)
    (said,) = seen_warnings("vehicle.h5", [own], [again])
    assert said.startswith("two.h5: vehicle.h5 has learned from it")
    with pytest.raises(InputError, match=r"two\.h5: is both learned from \(as one\.h5\) and held out"):
        refuse_seen([own], [again])


def test_the_log_of_a_flight_is_kept_where_a_gap_was_found_in_it_too():
    known = LearnedFlight("one.h5", "5" * 64, "cpfls/flight", 9, 9, "9" * 64, begins=1.0, ends=9.0)
    again = known._replace(log="", begins=0.0, ends=0.0)
    assert joined_flights([again], [known]) == joined_flights([known], [again]) == (known,)


def test_a_table_has_a_column_of_what_is_stated_where_it_has_any():
    """Centres of mass and products alone are stated, which are behind the first five."""
    names = ("thrust_factor", "drag_factor", *(f"inertia.I{axis}" for axis in ("xx", "yy", "zz")))
    numbers = [number_of(name) for name in names] + [
        number_of(f"products.{name}", stated=0.0) for name in ("Ixy", "Ixz")
    ]
    tables = [block for block in blocks_of(vehicle_of(whole(), numbers=tuple(numbers))) if isinstance(block, Table)]
    stated = {each.header[0]: "In the config" in each.header for each in tables}
    assert (stated["Constant"], stated["Another constant"]) == (False, True)


def test_a_thrust_factor_comes_with_the_law_that_it_is_of():
    numbers = (number_of("thrust_factor"), number_of("thrust_slope.linear", -0.45, -0.8, -0.1))
    said = blocks_of(vehicle_of(whole(), numbers=numbers))
    law = "; thrust is the thrust factor times w (1.45 w − 0.450 w_h), with w_h the speed in hover"
    (head,) = [block.text for block in said if isinstance(block, Heading) and law in block.text]
    assert head.startswith("Constants with 95 % intervals")


def test_flights_that_bound_no_body_name_no_bounds():
    nothing = np.full(3, np.nan)
    open_ = LoopBounds(nothing, nothing, LOOP.explained)
    said = " ".join(against(vehicle_of(whole(), loop=open_)))
    assert "45 % of the roll acceleration and 47 % of the pitch acceleration where it explains least. Fly in" in said
    assert "By frequency" not in said


def test_the_size_of_a_thrust_factor_goes_with_the_full_speed_that_is_assumed():
    numbers = (number_of("thrust_factor"), number_of("drag_factor", determined=False))
    shares = vehicle_of(whole(), numbers=numbers, full_speed_rad_s=1000.0)
    thrust, drag, *_ = [row[-1] for row in rows_of(shares, "Constant")]
    assert thrust.endswith(", at an assumed 1000 rad/s")
    assert "assumed" not in drag
    assert "assumed" not in rows_of(replace(shares, full_speed_rad_s=None), "Constant")[0][-1]


@pytest.mark.parametrize("lacks", [True, False])
def test_velocity_is_asked_for_only_where_flights_lack_it(lacks):
    numbers = (number_of("thrust_factor", determined=False), number_of("drag_factor"))
    own = vehicle_of(whole(), guessed=("thrust_factor",)) if lacks else vehicle_of(whole(), numbers=numbers)
    (said,) = [text for text in texts(own) if text.startswith("To know thrust factor")]
    first = "log velocity (or position), and " if lacks else ""
    assert said == f"To know thrust factor: {first}climb and descend more: the known mass then identifies thrust."


def test_constants_without_a_number_are_one_row():
    names = ("Ixx", "Iyy", "Izz")
    numbers = tuple(number_of(f"inertia.{name}", determined=False, possible=name == "Izz") for name in names)
    rows = [row for row in rows_of(vehicle_of(whole(), numbers=numbers), "Constant") if "I" in row[0]]
    assert [row[0] for row in rows] == ["Ixx, Iyy, kg m^2", "Izz, kg m^2"]
