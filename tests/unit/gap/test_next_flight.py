"""The next flight: what rivals cannot imitate against formulas, how sure against draws, paths within their room."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.errors import ComputationError, InputError, SettingError
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.weak_flight import columns_of
from cpfls_cli.gap.naming.ranking import likely, odds, rank_effects
from cpfls_cli.gap.naming.results import Alternative
from cpfls_cli.gap.next_flight.rivals import (
    Evidence,
    Question,
    SizedEffect,
    answered,
    formulas_off,
    gathered,
    open_questions,
    physical_values,
    questions_between,
    require_visible,
    shared_noise,
    usual,
)
from cpfls_cli.gap.next_flight.room import HarmonicPath, room_of
from cpfls_cli.gap.next_flight.search import Logging, expected_floor, flown_signals, goal, next_flight, planned_signals
from cpfls_cli.gap.residual.air import Air
from cpfls_cli.gap.settings import NOISE, RARE, GapSettings
from cpfls_cli.playback.gusts import Gusts
from cpfls_cli.simulation.inverse import squared_speeds
from cpfls_cli.simulation.settings import ClosedLoopSettings, SimulationSettings
from cpfls_cli.stages._next_flight import _open_effects
from cpfls_cli.trajectory.profile import LimitSettings
from cpfls_cli.trajectory.settings import NextFlightSettings, TrajectorySettings
from cpfls_cli.weak_form.windows import windows
from tests.builders.gap_artifacts import named_effect
from tests.builders.gap_flights import VEHICLE, candidate, fly, weak

FLOOR = np.array([0.02, 0.02, 0.02, 0.1, 0.1, 0.1])
LOGGING = Logging(frozenset({"attitude", "position", "velocity", "acceleration"}), False, FLOOR, GapSettings())
FEW = NextFlightSettings(starts=4, iterations=12)
SETTINGS = TrajectorySettings(path="next-flight", duration_s=12.0, next_flight=FEW)
LEVER, BIAS = 0.002, 0.1


def room(**changed):
    return room_of(replace(SETTINGS, **changed), VEHICLE, 0.0, 0.02)


def path_of(axis, size, order=6):
    """One sine along one axis, at rest in nothing but the others."""
    sine = np.zeros((4, 1))
    sine[axis] = size
    return HarmonicPath(np.zeros(4), np.full((4, 1), order), np.zeros((4, 1)), sine, SETTINGS.duration_s)


def along(path):
    return planned_signals(room().planned(path), room(), LOGGING)


def question(true, linear, rival):
    return Question(SizedEffect(candidate(true), np.array(linear)), CATALOGUE[rival] if rival else None)


def result(asked, *paths):
    return LOGGING.gathered(asked, [LOGGING.weak(along(path)) for path in paths]).left.sum()


def thrusts(path):
    """Thrust of each window of a flight straight up and down, by Newton's law."""
    signals = along(path)
    return windows(signals.period, 0.4, 0.5).average(VEHICLE.mass_kg * (9.81 + signals.acceleration[:, 2]))


def test_an_offset_is_distinguished_from_a_bias_by_changes_of_thrust_alone():
    """The bias takes the mean of the torque ``c F``, an offset of the best length the part of ``M`` along ``F``."""
    path = path_of(2, 0.15)
    thrust = thrusts(path)
    assert np.ptp(thrust) > 5
    offset = question("com_offset", [LEVER, 0.0], "torque_bias")
    expected = LEVER**2 * ((thrust - thrust.mean()) ** 2).sum() / FLOOR[1] ** 2
    assert result(offset, path) == pytest.approx(expected, rel=1e-6)
    bias = question("torque_bias", [0.0, BIAS, 0.0], "com_offset")
    expected = BIAS**2 * (len(thrust) - thrust.sum() ** 2 / (thrust**2).sum()) / FLOOR[1] ** 2
    assert result(bias, path) == pytest.approx(expected, rel=1e-6)


def test_hovering_shows_nothing_of_the_two_whatever_the_yaw():
    for path in (path_of(2, 0.0), path_of(3, 0.3, 1)):
        assert result(question("com_offset", [LEVER, LEVER], "torque_bias"), path) < 1e-6


@pytest.mark.decides
def test_flights_are_taken_together():
    """Two hovers at different thrust would tell; two at the same do not: what is fitted is the same in both."""
    hover, climb = path_of(2, 0.0), path_of(2, 0.15)
    offset = question("com_offset", [LEVER, 0.0], "torque_bias")
    assert result(offset, hover, hover) < 1e-6
    assert result(offset, hover, climb) >= result(offset, climb)


def test_evidence_of_flights_adds_up_to_that_of_all():
    paths = path_of(2, 0.15), path_of(0, 1.0, 3)
    offset = question("com_offset", [LEVER, LEVER], "rotor_mismatch")
    one, two = (LOGGING.gathered(offset, [LOGGING.weak(along(path))]) for path in paths)
    assert two.after(one).left.sum() == pytest.approx(result(offset, *paths), rel=1e-9)


def test_effects_that_are_there_besides_are_free_too():
    """A bias that is named already takes the mean of the torque of an offset, whatever the rival."""
    path = path_of(2, 0.15)
    thrust = thrusts(path)
    alone = question("com_offset", [LEVER, 0.0], None)
    bias = SizedEffect(candidate("torque_bias"), np.array([0.0, BIAS, 0.0]))
    assert result(alone, path) == pytest.approx(LEVER**2 * (thrust**2).sum() / FLOOR[1] ** 2, rel=1e-6)
    both = LEVER**2 * ((thrust - thrust.mean()) ** 2).sum() / FLOOR[1] ** 2
    assert result(replace(alone, besides=(bias,)), path) == pytest.approx(both, rel=1e-6)


def test_without_a_rival_the_vehicles_own_numbers_are_all_that_imitates():
    hover = path_of(2, 0.0)
    count = windows(0.02, 0.4, 0.5).count(601)
    seen = result(question("torque_bias", [0.0, BIAS, 0.0], None), hover)
    assert seen == pytest.approx(count * (BIAS / FLOOR[1]) ** 2, rel=1e-6)
    assert result(question("torque_bias", [0.0, BIAS, 0.0], "parameter_error"), hover) == pytest.approx(seen)


def evidence(*left, off=0.0):
    """Blocks in which a rival without columns leaves that much of the true effect, in squared floors."""
    return Evidence(np.array(left)[:, None, None], np.zeros(0, dtype=int), (np.zeros(0, dtype=int),), False, off)


def test_where_nothing_shows_all_sets_stay_as_likely_as_before():
    answers = answered([evidence(0.0, 0.0, 0.0)] * 2)
    assert [answer.likely for answer in answers] == pytest.approx([1 / 3] * 2)
    assert [answer.sure for answer in answers] == pytest.approx([0.0] * 2, abs=0.01)
    assert not any(answer.settled for answer in answers)


def test_what_is_settled_is_so_from_a_smaller_size_on():
    (answer,) = answered([evidence(*[30.0] * 6)])
    assert answer.settled
    assert answer.sure > 0.95
    (smaller,) = answered([evidence(*[30.0 * answer.least_size**2] * 6)])
    assert answer.likely < smaller.likely == pytest.approx(0.01, abs=0.01)
    assert np.isnan(answered([evidence(*[0.0] * 6)])[0].least_size)


def test_formulas_that_are_off_leave_more_doubt():
    exact, off = (answered([evidence(*[20.0] * 6, off=share)])[0] for share in (0.0, 0.1))
    assert off.evidence.off_by == pytest.approx(exact.evidence.off_by + 0.1 * 120.0)
    assert off.likely > exact.likely
    assert off.sure < exact.sure


def test_flights_tell_how_much_formulas_are_off_by():
    """A bias next to the named offset is taken for what the offset's formula is off by, a tenth of it at most."""
    named, size = candidate("com_offset"), np.array([0.004, 0.0])
    floor = np.full(6, 0.01)
    alone, beside = (
        system([weak(fly(1, [(named, size), *others]))], [named])
        for others in ((), [(candidate("torque_bias"), np.array([0.0, 0.0, 0.02]))])
    )
    assert formulas_off(alone, floor) == 0.0
    assert 0.0 < formulas_off(beside, floor) <= 0.01


@pytest.mark.parametrize("strength", [0.5, 0.65, 0.8])
def test_the_share_of_right_answers_is_that_of_draws(strength):
    """Blocks with white noise in what the rival leaves, decided as a diagnosis decides."""
    rng = np.random.default_rng(3)
    true = strength * rng.standard_normal((8, 10))
    expected = answered([evidence(*(true**2).sum(axis=1))])[0]
    rows = true + rng.standard_normal((1000, 8, 10))
    more = (rows**2 - (rows - true) ** 2).sum(axis=2)
    weights = [likely([np.clip(-0.5 * each / NOISE, np.log(RARE), -np.log(RARE))]) for each in more]
    settled = [rival < RARE * own for own, rival in weights]
    assert np.mean(settled) == pytest.approx(expected.sure, abs=0.1)
    assert np.mean([rival for _, rival in weights]) == pytest.approx(expected.likely, abs=0.02)


@pytest.mark.parametrize("gust", [0.035, 0.04])
def test_in_gusts_the_share_of_right_answers_is_that_of_draws(gust):
    """Gusts that last 1.2 s, drawn as torques of a planned flight with an offset, compared as a diagnosis does."""
    size, lasting = np.full(6, gust), np.full(6, 1.2)
    found = SimpleNamespace(size=size, memory=lasting, noise=np.zeros((6, 2)))
    air = Air(found, np.ones(6, dtype=bool), np.ones(6, dtype=bool))
    still = LOGGING.weak(along(path_of(2, 0.15)))
    logging = replace(LOGGING, floor=air.floor([still], [still]) + 1e-9, air=air)
    true = SizedEffect(candidate("com_offset"), np.array([2.5 * LEVER, 0.0]))
    rival = CATALOGUE["torque_bias"]
    flight = logging.weak(along(path_of(2, 0.15)))
    (expected,) = answered([logging.gathered(Question(true, rival), [flight])])
    (in_still_air,) = answered([LOGGING.gathered(Question(true, rival), [still])])
    torque = columns_of(true.candidate, flight.signals).direct @ true.linear
    settled, above, rng = [], logging.floor * np.sqrt(system([flight]).most_noise), np.random.default_rng(6)
    for _ in range(60):
        blown = torque + Gusts(size, lasting).drawn(rng, flight.signals.period, len(torque))
        inertial = replace(flight.inertial, direct=flight.inertial.direct + blown)
        flown = replace(flight, inertial=inertial, seen={}).innovations
        step = rank_effects([flown], [], [rival], GapSettings(), None, also=(true.candidate,), floor=above)
        own, other = (next(s for s in step.ranking if s.candidate.effect.name == n) for n in ("com_offset", rival.name))
        first, second = likely([odds(own, other, step.above_floor)])
        settled.append(second < RARE * first)
    assert 0.1 < np.mean(settled) == pytest.approx(expected.sure, abs=0.15)
    assert in_still_air.sure > 0.95


def test_neighbouring_windows_share_noise_as_draws_do():
    through = windows(0.01, 0.4, 0.5)
    sums = through.average(np.random.default_rng(4).standard_normal((6000, 200)))
    single = float((through.weight**2).sum())
    assert sums.sum(axis=0).var() / (len(sums) * single) == pytest.approx(shared_noise(through), rel=0.3)
    assert shared_noise(windows(0.01, 0.4, 0.0)) == 1.0


def test_a_drawn_path_rests_at_both_ends_and_its_derivatives_fit():
    path = room().drawn(np.random.default_rng(5))
    ends = path.sample(np.array([0.0, path.duration]))
    largest = np.abs(path.sample(np.linspace(0, path.duration, 500))).max(axis=1)
    assert (np.abs(ends[1:5]) <= 1e-9 * largest[1:5, None] + 1e-12).all()
    np.testing.assert_allclose(ends[0, 0], ends[0, 1], atol=1e-9)
    step, time = 1e-4, np.linspace(1.0, 9.0, 7)
    values = path.sample(time)
    slopes = (path.sample(time + step) - path.sample(time - step)) / (2 * step)
    np.testing.assert_allclose(values[1:], slopes[:-1], rtol=1e-4, atol=1e-4 * np.abs(values[1:]).max())


@pytest.mark.parametrize("limits", [{}, {"velocity_m_s": 1.0}, {"acceleration_m_s2": (1.0, 2.0, 0.5)}])
def test_paths_keep_to_their_room(limits):
    there = room(limits=LimitSettings(**limits), tilt_max_rad=0.3)
    for seed in range(6):
        path = there.drawn(np.random.default_rng(seed))
        planned = there.planned(path, 0.005)
        outside = np.abs(planned.position - there.middle) - there.half
        assert outside.max() < 1e-2
        assert np.abs(planned.attitude[:, :2]).max() < 0.3 * 1.02
        squared = squared_speeds(vars(planned), VEHICLE)
        assert squared.min() > 0
        assert squared.max() < VEHICLE.rotor_speed_max_rad_s**2
        for key, limit in limits.items():
            values = getattr(planned, key.split("_")[0])
            taken = np.abs(values) / limit if isinstance(limit, tuple) else np.linalg.norm(values, axis=1) / limit
            assert taken.max() < 1.02
        # A limit is reached: nothing that could be flown is left.
        assert there.share_of_limits(path) > 0.9 or np.abs(outside).min() < 0.05


@pytest.mark.parametrize(
    ("asked", "key"),
    [
        ({"box_m": (0.9, 5.0, 2.0)}, "next_flight.box_m"),
        ({"box_m": (5.0, 5.0, 6.0), "height_m": 2.0}, "next_flight.height_m"),
    ],
)
def test_a_box_that_holds_no_flight_is_refused(asked, key):
    with pytest.raises(SettingError) as caught:
        room(next_flight=NextFlightSettings(**asked))
    assert caught.value.key == key


def test_a_vehicle_that_can_but_hover_has_no_room():
    with pytest.raises(ComputationError, match="rotor_speed_max_rad_s = 350"):
        room_of(SETTINGS, replace(VEHICLE, rotor_speed_max_rad_s=350.0), 0.0, 0.02)


@pytest.fixture(scope="module")
def asked():
    effects = [CATALOGUE[name] for name in ("com_offset", "torque_bias")]
    questions = [
        replace(q, true=replace(q.true, linear=0.02 * q.true.linear)) for q in questions_between(effects, VEHICLE)
    ]
    return goal(questions, [], room(), LOGGING)


@pytest.mark.decides
def test_a_search_improves_on_random_paths_and_is_the_same_by_seed(asked):
    found, again = (next_flight(asked, np.random.default_rng(7)) for _ in range(2))
    assert found.path.sine.tobytes() == again.path.sine.tobytes()
    scores = [asked.score(path) for path in found.random]
    assert scores == sorted(scores)
    assert (np.diff([scores[-1], *found.history]) >= 0).all()
    assert asked.score(found.path) == found.history[-1] > scores[-1]


def test_flights_that_are_there_count(asked):
    gentle = LOGGING.weak(along(path_of(2, 0.05)))
    known = goal(asked.questions, [gentle], room(), LOGGING)
    alone = known.answers(None)
    once = LOGGING.gathered(asked.questions[0], [gentle]).left.sum()
    assert alone[0].evidence.left.sum() == pytest.approx(2 * once)
    more = along(path_of(2, 0.15))
    assert known.answers(more)[0].evidence.left.sum() > asked.answers(more)[0].evidence.left.sum()


def test_flights_without_the_signal_of_a_rival_say_nothing():
    effects = [CATALOGUE[name] for name in ("torque_bias", "rotor_drag")]
    silent = weak(replace(fly(1), velocity=None, specific_force=None))
    known = goal(questions_between(effects, VEHICLE), [silent], room(), LOGGING)
    assert [answer.evidence.left.sum() for answer in known.answers(None)] == [0.0, 0.0]
    assert known.answers(along(path_of(0, 1.0, 3)))[1].evidence.left.sum() > 0


def test_a_special_case_is_not_distinguished_from_what_holds_it():
    drag, wind = CATALOGUE["rotor_drag"], CATALOGUE["wind"]
    (only,) = questions_between([drag, wind], VEHICLE)
    assert only.true.candidate.effect is wind


@pytest.mark.parametrize("names", [("gyro_bias",), ("motor_lag", "channel_delay")])
def test_what_no_flight_shows_is_refused(names):
    with pytest.raises(InputError, match=names[0]):
        require_visible([CATALOGUE[name] for name in names], "--separate", VEHICLE)


def test_an_effect_of_the_propellers_asks_for_their_size():
    bare = replace(VEHICLE, rotors=tuple(replace(rotor, radius_m=None) for rotor in VEHICLE.rotors))
    require_visible([CATALOGUE["ground_effect"]], "--separate", VEHICLE)
    with pytest.raises(InputError, match=r"ground_effect needs vehicle\.rotors\.radius_m"):
        require_visible([CATALOGUE["ground_effect"]], "--separate", bare)


def test_the_plan_counts_on_nothing_that_is_not_logged():
    path = room().drawn(np.random.default_rng(2))
    poor = replace(LOGGING, signals=frozenset())
    signals = planned_signals(room().planned(path), room(), poor)
    assert signals.attitude is signals.velocity is signals.acceleration is signals.specific_force is None
    flights = [logging.weak(planned_signals(room().planned(path), room(), logging)) for logging in (poor, LOGGING)]
    assert [flight.known.tolist() for flight in flights] == [[True] * 3 + [False] * 3, [True] * 6]


def test_a_rival_that_could_not_be_tried_is_asked_for_at_a_usual_size():
    named, size = candidate("linear_damping"), np.array([0.1, 0.1, 0.1])
    silent = weak(replace(fly(1, [(named, size)]), velocity=None, specific_force=None))
    effect = named_effect("linear_damping", linear=size)
    rivals = [Alternative("rotor_drag", "linear_damping", np.nan, "log velocity")]
    first, second, *_ = open_questions([effect], rivals, [], [silent], FLOOR, GapSettings())
    assert second.true.linear.tolist() == usual(CATALOGUE["rotor_drag"], VEHICLE).linear.tolist()
    known = goal([first, second], [silent], room(), LOGGING)
    assert min(answer.evidence.left.sum() for answer in known.answers(along(path_of(0, 1.0, 3)))) > 0


def test_a_rival_takes_the_size_that_imitates_the_named_effect():
    """Over flights with almost one thrust a bias is the offset times that thrust."""
    named, size = candidate("com_offset"), np.array([0.004, 0.0])
    flights = [weak(fly(seed, [(named, size)], speed=0.5, tilt=0.05)) for seed in (1, 2)]
    effect = named_effect("com_offset", linear=size)
    rivals = [Alternative("torque_bias", "com_offset", 1.0, "")]
    first, second, *others = open_questions([effect], rivals, [], flights, FLOOR, GapSettings())
    # What else looks like either by the catalogue must not take the place of the rival.
    asked = [(each.true.candidate.effect.name, each.rival.name) for each in others]
    assert ("com_offset", "rotor_mismatch") in asked
    # These flights tell a bias from a mismatch.
    assert ("torque_bias", "rotor_mismatch") not in asked
    assert len(set(asked)) == len(asked)
    assert (first.true.candidate.effect.name, first.rival.name) == ("com_offset", "torque_bias")
    assert (second.true.candidate.effect.name, second.rival.name) == ("torque_bias", "com_offset")
    bias = physical_values(second.true)
    assert bias["M_y"] == pytest.approx(0.004 * VEHICLE.mass_kg * 9.81, rel=0.1)
    assert abs(bias["M_x"]) < 0.05 * bias["M_y"]


def test_noise_of_the_sensors_makes_the_floors():
    quiet, loud = (
        expected_floor(
            room(),
            LOGGING,
            SimulationSettings(mode="closed-loop", noise={"acceleration": size, "body_rate": 0.002}),
            0.01,
            np.random.default_rng(1),
        )
        for size in (0.3, 0.6)
    )
    # White noise of 0.3 m/s^2 on 6 kg, averaged over a window.
    expected = 0.3 * VEHICLE.mass_kg * np.sqrt((windows(0.01, 0.4, 0.5).weight ** 2).sum())
    np.testing.assert_allclose(quiet[3:], expected, rtol=0.35)
    np.testing.assert_allclose(loud[3:] / quiet[3:], 2.0, rtol=0.15)


def test_in_closed_loop_the_flight_shows_about_as_much(asked):
    path = room().drawn(np.random.default_rng(11))
    planned = room().planned(path, 0.01)
    true = asked.questions[0].true
    flown = flown_signals(planned, [true], VEHICLE, LOGGING, ClosedLoopSettings(integration_rate_hz=200.0))
    expected = asked.answers(planned_signals(planned, room(), LOGGING))[0].evidence.left.sum()
    assert asked.answers(flown)[0].evidence.left.sum() == pytest.approx(expected, rel=0.4)


def test_judged_on_hover_is_not_sure():
    offset = question("com_offset", [LEVER, LEVER], "torque_bias")
    (answer,) = answered([gathered(offset, [LOGGING.weak(along(path_of(2, 0.0)))], FLOOR, GapSettings())])
    assert answer.sure < 0.01
    assert usual(CATALOGUE["motor_lag"], VEHICLE).linear.tolist() == [1.0]


def test_of_a_double_of_wrong_numbers_it_is_asked_whether_it_shows():
    """Numbers of the vehicle are free in every fit, and no effect that a flight could separate from another."""
    load = Alternative("payload", "parameter_error", 1.0, "wait for some swings")
    found = SimpleNamespace(alternatives=(load,), effects_of_motion=(), not_excited=(), verdict="AMBIGUOUS")
    study = SimpleNamespace(trajectory=TrajectorySettings(), vehicle=VEHICLE)
    assert _open_effects(study, found, [weak(fly(1))], "diagnosis.h5") == ([], [CATALOGUE["payload"]])
