"""Gusts called gusts where instruments tell, names and numbers next to them, in flights of known truth."""

import tracemalloc
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap import diagnose as diagnose_module
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.weak_flight import Candidate, weak_flight
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.extended import extend, plain
from cpfls_cli.gap.naming import by_instruments as by_instruments_module
from cpfls_cli.gap.naming.by_instruments import _windows_of_runs, by_instruments
from cpfls_cli.gap.naming.by_samples import _Sampled, small_effects
from cpfls_cli.gap.naming.estimate import fitted
from cpfls_cli.gap.naming.ranking import best_floor, block_index
from cpfls_cli.gap.naming.results import GapVerdict
from cpfls_cli.gap.residual.air import air, known_motion
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.playback.disturbance import gusts_in
from cpfls_cli.weak_form.windows import common_windows
from tests.builders.gusty_flights import CALM, GRAVITY, GUSTS, MEMORY_S, SMALL, STORM, Flight, gusty_flights, logged

HEAVY = 1.15
"""What the config takes the inertia about x for, over the true one."""

TRUE = SMALL._replace(drag=0.0, damping=0.0)
DAMPED = TRUE._replace(damping=6e-5)
SMALL_DAMPING = 2e-5
"""A third of what averages over windows show in these gusts, N m s."""
SPUN = TRUE._replace(rotor_inertia=1e-7)
INERTIA = np.array(TRUE.inertia)
FEW = GapSettings(shifts=39)


@pytest.fixture(scope="module")
def flown():
    """Four flights of as many paths, and four of one, in gusts; three in which damping is missed, in both airs.

    Four that log commands, in a storm; and four of one path with heavy rotors, and with light ones that swing more.
    """
    asked = [Flight(TRUE, GUSTS, path, path, reach=3.0) for path in range(4)]
    again = [Flight(TRUE, GUSTS, 9, run, reach=3.0) for run in range(4)]
    late = [Flight(TRUE, STORM, path, path, reach=3.0, commands=True) for path in range(4)]
    damped = [Flight(DAMPED, gusts, path, path, reach=3.0) for gusts in (CALM, GUSTS) for path in range(3)]
    swung = [
        Flight(truth, GUSTS, 99, run, reach=3.0, swing=swing)
        for truth, swing in ((SPUN, 0.15), (TRUE, 0.5))
        for run in range(10, 14)
    ]
    # Rotor speeds are logged with three times the noise, which no loop sees.
    small = [
        Flight(truth._replace(speed_noise=0.003), GUSTS, path, path, reach=3.0, swing=0.15)
        for truth in (TRUE._replace(damping=SMALL_DAMPING), TRUE)
        for path in range(20, 26)
    ]
    each = list(gusty_flights([*asked, *again, *damped, *late, *swung, *small], 30.0))
    parts = {"asked": 4, "again": 4, "calm": 3, "damped": 3, "late": 4, "spun": 4, "turned": 4, "small": 6, "noisy": 6}
    return {name: [each.pop(0) for _ in range(count)] for name, count in parts.items()}


@pytest.fixture(scope="module")
def of_small(flown):
    """What a small damping is found as, with or without setpoints, and what is asked of samples for it; each once."""

    @cache
    def found(setpoints):
        asked, recordings = [], recorded(flown["small"], TRUE.vehicle, setpoints=setpoints)

        def remembered(*given):
            asked.append(given)
            return small_effects(*given)

        with pytest.MonkeyPatch.context() as monkeypatch:
            monkeypatch.setattr("cpfls_cli.gap.diagnose.small_effects", remembered)
            return diagnosed(recordings).diagnosis, asked[-1]

    return found


def recorded(flights, vehicle, *, setpoints, commanded=False):
    known = [each if setpoints else replace(each, setpoints={}) for each in flights]
    return [logged(each, vehicle, commanded=commanded).parts[0] for each in known]


def heavier(vehicle):
    return replace(vehicle, inertia_kg_m2=(HEAVY * vehicle.inertia_kg_m2[0], *vehicle.inertia_kg_m2[1:]))


def diagnosed(recordings):
    return diagnose(recordings[:3], recordings[3:], FEW, np.random.default_rng(1))


def tells_sizes(found):
    sizes, memories = found.size[:3] / INERTIA / GUSTS, found.memory[:3] / MEMORY_S
    assert np.all((sizes > 0.7) & (sizes < 1.3))
    assert np.all((memories > 0.5) & (memories < 2.0))


def in_what_is_left(recordings):
    windows, model = common_windows(recordings, FEW), plain(None)
    hypothesis = model.system([weak_flight(each, windows, None, force=True) for each in recordings])
    return air(hypothesis, model.linear, block_index(hypothesis, FEW), known_motion(recordings), FEW)


@pytest.mark.parametrize(("kind", "setpoints"), [("asked", True), ("again", False)])
def test_a_wrong_inertia_is_named_in_gusts_with_its_number(flown, kind, setpoints):
    run = diagnosed(recorded(flown[kind], heavier(TRUE.vehicle), setpoints=setpoints))
    assert run.air is not None
    assert run.air.gusts_only[:3].all()
    tells_sizes(run.air.found)
    assert run.diagnosis.verdict is GapVerdict.NAMED
    (effect,) = run.diagnosis.effects
    (number,) = effect.numbers
    assert (effect.name, number.name) == ("parameter_error", "inertia_x")
    assert number.low < 1 / HEAVY - 1 < number.high < 0


def test_a_centre_of_mass_is_distinguished_from_a_constant_torque_in_gusts(flown):
    at = np.array([0.002, -0.0015])
    rotors = [replace(each, position_m=(*np.add(each.position_m[:2], at), 0.0)) for each in TRUE.vehicle.rotors]
    aside = recorded(flown["asked"], replace(TRUE.vehicle, rotors=tuple(rotors)), setpoints=True)
    # Rotors that carry a constant torque turn as much faster and slower as it takes.
    carried = np.linalg.solve(TRUE.mixer, [0.0, *(TRUE.mass * GRAVITY * at[::-1] * [1, -1]), 0.0])
    pushed = [replace(each, speed=np.sqrt(each.speed**2 + carried)) for each in flown["asked"]]
    for name, recordings in (("com_offset", aside), ("torque_bias", recorded(pushed, TRUE.vehicle, setpoints=True))):
        found = diagnosed(recordings).diagnosis
        assert (found.verdict, [each.name for each in found.effects]) == (GapVerdict.NAMED, [name])
        assert not found.alternatives


@pytest.mark.parametrize(("kind", "name"), [("spun", "rotor_acceleration"), ("turned", "parameter_error")])
def test_an_inertia_is_not_wrong_where_rotors_that_accelerate_do_as_much(flown, kind, name):
    """The loop answers gusts by its rotors: their acceleration and half the inertia about z leave equal residuals."""
    x, y, z = TRUE.vehicle.inertia_kg_m2[:3]
    stated = replace(TRUE.vehicle, inertia_kg_m2=(x, y, z if kind == "spun" else 1.5 * z, 0.0, 0.0, 0.0))
    found = diagnosed(recorded(flown[kind], stated, setpoints=False)).diagnosis
    assert found.verdict in {GapVerdict.NAMED, GapVerdict.AMBIGUOUS}
    (effect,) = found.effects
    assert effect.name == name
    numbers = {each.name: each for each in effect.numbers}
    number, truth = (numbers["J_r"], SPUN.rotor_inertia) if kind == "spun" else (numbers["inertia_z"], 1 / 1.5 - 1)
    assert number.low < truth < number.high


@pytest.mark.parametrize(("heavy", "extends"), [(HEAVY, False), (1.25, True)])
def test_an_inertia_that_nothing_was_asked_of_is_said_by_what_was_before(flown, heavy, extends):
    """A model is extended where the gap shrinks by 0.3 floors; 15 % of this inertia are 0.29 of the gusts'."""
    x, y, z = TRUE.vehicle.inertia_kg_m2[:3]
    stated = replace(TRUE.vehicle, inertia_kg_m2=(x, heavy * y, z, *TRUE.vehicle.inertia_kg_m2[3:]))
    # Nobody knows what was asked along y, so that nothing but the loop rolls.
    along_x = [
        replace(each, setpoints={name: asked * [1, 0, 1] for name, asked in each.setpoints.items()})
        for each in flown["asked"]
    ]
    recordings = recorded(along_x, stated, setpoints=True)
    run = diagnosed(recordings)
    result, found = run.diagnosis, [run.estimates]
    if extends:
        refit = extend(recordings[:3], recordings[3:], result.effects, run.audit, FEW, None, result.gap.floor)
        found.append(refit.estimates)
    for estimates in found:
        numbers = {each.name: each for each in estimates.parameters}
        assert -0.1 < numbers["inertia_x"].low < 0 < numbers["inertia_x"].high < 0.1
        assert numbers["inertia_y"].low < 1 / heavy - 1 < numbers["inertia_y"].high


@pytest.mark.parametrize("differs", [False, True])
def test_a_lag_is_distinguished_from_a_delay_and_from_the_loop_by_what_was_before(flown, monkeypatch, differs):
    """Also where a fit to all motion, which is the loop's, says that flights differ."""
    recordings = recorded(flown["late"], TRUE.vehicle, setpoints=True, commanded=True)
    if differs:
        named = diagnose_module._named
        monkeypatch.setattr(
            diagnose_module, "_named", lambda *given: named(*given)._replace(differ=("the flights differ",))
        )
    run = diagnosed(recordings)
    assert run.diagnosis.verdict is GapVerdict.NAMED
    assert not run.diagnosis.alternatives
    (effect,) = run.diagnosis.effects
    (number,) = effect.numbers
    assert effect.name == "motor_lag"
    # The gyroscope's noise is inside of the loop.
    assert number.low < TRUE.lag_s < number.high < 1.25 * TRUE.lag_s


def test_flights_that_differ_in_gusts_are_said_to(flown):
    """The centre of mass of those that were learned from is 4 mm farther back than that of the one held out."""
    rotors = [
        replace(each, position_m=(each.position_m[0] + 0.004, *each.position_m[1:])) for each in TRUE.vehicle.rotors
    ]
    behind = recorded(flown["asked"], replace(TRUE.vehicle, rotors=tuple(rotors)), setpoints=True)[:3]
    found = diagnosed([*behind, *recorded(flown["asked"], TRUE.vehicle, setpoints=True)[3:]]).diagnosis
    assert found.verdict is GapVerdict.FLIGHTS_DIFFER
    assert "the held-out flights have none" in found.differences[0]


@pytest.mark.parametrize("setpoints", [True, False])
def test_what_is_small_against_gusts_is_found_by_samples(of_small, setpoints):
    """Both of a damping's rivals do without it, and it without them, so that they are listed."""
    found, _ = of_small(setpoints)
    (effect,) = found.effects
    assert (found.verdict, effect.name) == (GapVerdict.AMBIGUOUS, "linear_damping")
    assert "rotor_plane_damping" in {each.name for each in found.alternatives}
    roll, pitch, yaw = effect.numbers
    assert all(each.low < SMALL_DAMPING < each.high for each in (roll, pitch, yaw))
    # Noise of the rotors does not bias it, and the loop's answers to gusts do not.
    assert all(abs(each.value / SMALL_DAMPING - 1) < 0.25 for each in (roll, pitch))


@pytest.mark.parametrize("setpoints", [True, False])
def test_noise_of_rotors_that_no_loop_sees_is_no_small_effect(flown, setpoints):
    run = diagnosed(recorded(flown["noisy"], TRUE.vehicle, setpoints=setpoints))
    assert run.air is not None
    assert run.air.split.all()
    assert run.diagnosis.verdict is GapVerdict.NO_GAP


def test_what_instruments_identify_hangs_on_no_inertia_that_a_loop_gave_a_fit(flown):
    recordings = recorded(flown["asked"], TRUE.vehicle, setpoints=True)
    windows = common_windows(recordings, FEW)
    flights = [weak_flight(each, windows, None, force=True) for each in recordings]
    found = fitted(flights, [], best_floor(system(flights)), FEW)
    # Inertia, and couplings of rates that no instrument moves.
    of_loop = found.estimates.linear + np.repeat([-0.3, 0.7, 0.0], [3, 3, 4])
    given = known_motion(recordings)
    own, other = (
        by_instruments(found._replace(estimates=replace(found.estimates, linear=linear)), given).estimates
        for linear in (found.estimates.linear, of_loop)
    )
    assert own.parameters[:6] == other.parameters[:6]
    x, y, z, *couplings = own.parameters[:6]
    assert all(each.low < 0 < each.high for each in (x, y))
    assert all(each.value == 0 for each in (z, *couplings))


def test_a_number_that_instruments_moved_has_the_error_that_it_was_moved_with(flown, monkeypatch):
    """The past predicts innovations of a residual that a wrong inertia makes, and none of what is left without it."""
    recordings = recorded(flown["asked"], heavier(TRUE.vehicle), setpoints=True)
    windows = common_windows(recordings, FEW)
    flights = [weak_flight(each, windows, None, force=True) for each in recordings]
    found = fitted(flights, [], best_floor(system(flights)), FEW)
    calls = []

    def once(at, given, held, own=by_instruments_module._sources):
        calls.append(at)
        x = np.arange(len(at.values)) == 0
        return [each._replace(numbers=each.numbers & ~(x & (len(calls) > 1))) for each in own(at, given, held)]

    monkeypatch.setattr(by_instruments_module, "_sources", once)
    number = by_instruments(found, known_motion(recordings)).estimates.parameters[0]
    assert len(calls) > 1
    assert number.low < 1 / HEAVY - 1 < number.high < 0
    assert 0 < number.high - number.low < 0.2


def test_a_shape_that_instruments_lose_where_a_long_step_has_taken_it_stays(flown, monkeypatch):
    """Its slopes were others where it was identified: the lag of 20 ms is begun at 60 ms, and known there alone."""
    recordings = recorded(flown["late"], TRUE.vehicle, setpoints=True, commanded=True)
    windows = common_windows(recordings, FEW)
    flights = [weak_flight(each, windows, None, force=True) for each in recordings]
    lag = Candidate(CATALOGUE["motor_lag"], {"time_constant_s": 0.06})
    given, found = known_motion(recordings), fitted(flights, [lag], best_floor(system(flights)), FEW)
    assert by_instruments(found, given).estimates.effects[0][0].high < 0.05

    def there(at, given, held, own=by_instruments_module._sources):
        known = (at.values == found.values) | (np.arange(len(at.values)) < len(at.values) - 1)
        return [each._replace(numbers=each.numbers & known) for each in own(at, given, held)]

    monkeypatch.setattr(by_instruments_module, "_sources", there)
    assert by_instruments(found, given).estimates.effects[0] == found.estimates.effects[0]


@pytest.mark.parametrize("kind", ["asked", "again"])
def test_blocks_of_a_run_follow_each_other_in_time(flown, kind):
    """Errors by neighbouring blocks compare blocks of one run: numbers of several runs may not alternate."""
    recordings = recorded(flown[kind], TRUE.vehicle, setpoints=kind == "asked")
    windows = common_windows(recordings, FEW)
    flights = [weak_flight(each, windows, None, force=True) for each in recordings]
    of_paths, of_runs = _windows_of_runs(fitted(flights, [], np.ones(6), FEW), known_motion(recordings))
    for runs in (of_runs, of_paths):
        blocks = [run.block for run in runs]
        assert all(np.isin(np.diff(each), [0, 1]).all() for each in blocks)
        # Runs of one path share their blocks; others have none between those of another.
        ranges = sorted({(each.min(), each.max()) for each in blocks})
        assert kind == "again" or all(last < first for (_, last), (first, _) in pairwise(ranges))
    ranges = sorted((run.block.min(), run.block.max()) for run in of_runs)
    assert all(last < first for (_, last), (first, _) in pairwise(ranges))


@pytest.mark.parametrize(("setpoints", "instrument_kind"), [(True, "setpoints"), (False, "past")])
def test_gusts_alone_are_no_gap(flown, setpoints, instrument_kind):
    run = diagnosed(recorded(flown["asked"], TRUE.vehicle, setpoints=setpoints))
    assert run.diagnosis.verdict is GapVerdict.NO_GAP
    assert run.air is not None
    assert run.air.found.instrument_kind == instrument_kind
    assert run.air.gusts_only.all()
    tells_sizes(run.air.found)


@pytest.mark.parametrize(("kind", "setpoints"), [("asked", True), ("again", False)])
@pytest.mark.filterwarnings("error")
def test_gusts_about_axes_are_said_of_flights_without_velocity(flown, kind, setpoints):
    known = recorded(flown[kind], TRUE.vehicle, setpoints=setpoints)
    found = in_what_is_left([replace(each, velocity=None) for each in known])
    assert found.gusts_only.tolist() == [True] * 3 + [False] * 3
    tells_sizes(found.found)
    assert np.isnan(found.found.size[3:]).all()


def test_where_instruments_know_too_little_what_was_before_shows(flown, monkeypatch):
    recordings = recorded(flown["asked"], TRUE.vehicle, setpoints=False)
    # No path comes again.
    monkeypatch.setattr("cpfls_cli.gap.residual.air._WITNESSES", {"none": ("repeats", "past")})
    found = in_what_is_left(recordings)
    assert found.found.instrument_kind == "past"
    assert found.gusts_only.all()
    monkeypatch.setattr("cpfls_cli.gap.residual.air._WITNESSES", {"none": ("repeats",)})
    assert diagnosed(recordings).air is None


def test_an_axis_that_other_runs_do_not_size_is_said_by_what_was_before(flown, monkeypatch):
    def without_pitch(sides, given, instrument_kind):
        found = gusts_in(sides, given, instrument_kind)
        if instrument_kind == "repeats":
            found.size[1] = np.nan
        return found

    monkeypatch.setattr("cpfls_cli.gap.residual.air.gusts_in", without_pitch)
    found = in_what_is_left(recorded(flown["again"], TRUE.vehicle, setpoints=False))
    assert found.found.instrument_kind == "repeats"
    assert found.gusts_only.all()
    assert found.split.all()
    tells_sizes(found.found)


def test_what_does_not_come_again_is_noise_next_to_what_does(flown):
    # Half of the inertia is missed about x, which comes again; nothing is about the other axes.
    vehicle = replace(TRUE.vehicle, inertia_kg_m2=(2 * INERTIA[0], *INERTIA[1:]))
    found = in_what_is_left(recorded(flown["again"], vehicle, setpoints=False))
    assert found.gusts_only[:3].tolist() == [False, True, True]
    assert found.split[:3].all()
    assert 0.5 < found.found.size[0] / INERTIA[0] / GUSTS[0] < 2.0


@pytest.mark.parametrize(("offset_m", "stands"), [(3e-3, True), (2e-4, False)], ids=["above the gusts", "among them"])
def test_what_stands_above_the_gusts_is_none_of_them(flown, monkeypatch, offset_m, stands):
    rotors = TRUE.vehicle.rotors
    moved = tuple(replace(each, position_m=(each.position_m[0] + offset_m, *each.position_m[1:])) for each in rotors)
    recordings = recorded(flown["asked"], replace(TRUE.vehicle, rotors=moved), setpoints=True)
    # As if instruments told nothing.
    monkeypatch.setattr("cpfls_cli.gap.diagnose.significant_effects", lambda *_: [])
    names = [effect.name for effect in diagnosed(recordings).diagnosis.effects]
    assert names == (["com_offset"] if stands else [])


def test_a_copy_of_a_flight_repeats_none(flown):
    first, second, *_ = recorded(flown["asked"], TRUE.vehicle, setpoints=True)
    assert known_motion([first, replace(first, name="copy"), second]).kind == "setpoints"
    runs = recorded(flown["again"][:2], TRUE.vehicle, setpoints=False)
    assert list(known_motion([*runs, replace(runs[0], name="copy")]).repeats.likeness) == [(0, 1)]


def test_what_the_vehicle_does_is_not_called_gusts_where_nothing_was_asked(flown):
    found = in_what_is_left(recorded(flown["calm"], TRUE.vehicle, setpoints=False))
    assert not found.gusts_only.any()
    assert np.isnan(found.found.size).all()
    assert np.all(found.found.predicted[:2] > 3 * found.found.predicted_error[:2])


@pytest.mark.parametrize(("kind", "turning"), [("calm", [False, False]), ("damped", [True, True])])
def test_what_the_vehicle_does_is_not_called_gusts(flown, kind, turning):
    found = in_what_is_left(recorded(flown[kind], TRUE.vehicle, setpoints=True))
    # In gusts four fifths of what is left are theirs.
    assert found.gusts_only[:2].tolist() == turning
    assert np.all(found.found.predicted[:2] > 3 * found.found.predicted_error[:2])


def test_flights_of_which_some_lack_a_signal_are_tried_by_what_all_have(flown):
    recordings = recorded(flown["small"], TRUE.vehicle, setpoints=True)
    lacking = replace(recordings[2], velocity=None)
    for held in (recordings[3:4], [recordings[3], replace(recordings[4], velocity=None)]):
        run = diagnose([*recordings[:2], lacking], held, FEW, np.random.default_rng(1))
        assert {each.name for each in run.diagnosis.effects} <= {"linear_damping"}


@pytest.mark.parametrize("every", [1, 2])
def test_stretches_and_blocks_of_4_s_end_with_their_flight(flown, every):
    """Logs of 100 and of 50 Hz, in which a row is a sample."""
    recordings = [
        replace(
            each,
            **{
                name: getattr(each, name)[:end:every]
                for name in ("time", "body_rate", "attitude", "velocity", "position", "rotor_speed")
            },
        )
        for each, end in zip(recorded(flown["small"], TRUE.vehicle, setpoints=False), (3000, 1500, 2300), strict=False)
    ]
    windows = common_windows(recordings, FEW)
    flights = tuple(weak_flight(each, windows, None, force=True) for each in recordings)
    found = fitted(flights, [], best_floor(system(flights)), FEW)
    products = _Sampled(found, flights, None, np.ones(6, dtype=bool)).products([])
    # Less the past of 64 rows, and 20 ahead of a row.
    stretches = [round((end / every - 86) / 40) for end in (3000, 1500, 2300)]
    assert len(products.each) == sum(stretches)
    assert {0, *np.cumsum(stretches)[:-1]} <= set(products.starts)
    seconds = np.diff([*products.starts, len(products.each)]) * 40 * every / 100
    assert np.all(np.abs(seconds - 4.0) < 1.0)


def test_a_place_of_the_sensors_that_windows_miss_is_no_small_effect(flown):
    """In gusts a fit gives it what the loop does; as free as the inertia it leaves nothing to a weak rotor."""
    recordings = recorded(flown["noisy"][:3], TRUE.vehicle, setpoints=False)
    windows, gusty = common_windows(recordings, FEW), np.ones(6, dtype=bool)
    flights = tuple(weak_flight(each, windows, None, force=True) for each in recordings)
    found = fitted(flights, [], best_floor(system(flights)), FEW)
    linear = found.estimates.linear + np.repeat([0.0, 0.1, 0.0], [7, 2, 1])
    apart = found._replace(estimates=replace(found.estimates, linear=linear))
    weak_rotor = Candidate(CATALOGUE["rotor_mismatch"], {})
    products = _Sampled(apart, flights, _Sampled(found, flights, None, gusty).white, gusty).products([weak_rotor])
    assert products.tested(weak_rotor.effect, products.places[0], []).chance > 0.05


def test_products_are_made_in_little_memory(flown, monkeypatch):
    asked = []
    monkeypatch.setattr("cpfls_cli.gap.diagnose.small_effects", lambda *given: asked.append(given) or [])
    recordings = recorded(flown["small"], TRUE.vehicle, setpoints=False)
    diagnose(recordings[:5], recordings[5:], FEW, np.random.default_rng(1))
    tracemalloc.start()
    small_effects(*asked[-1])
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 300e6 * 5 * 30 / 1000


def test_a_copy_of_an_effect_is_no_second_one(of_small):
    _, (found, held, candidates, gusty) = of_small(True)
    one = next(each for each in candidates if each.effect.name == "linear_damping")
    copy = one._replace(effect=replace(one.effect, name="copy"))
    (effect,) = small_effects(found, held, [one, copy], gusty)
    assert [each.name for each in effect.rivals] == [copy.effect.name if effect.candidate is one else one.effect.name]
