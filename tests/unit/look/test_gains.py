"""Gains from one log: what is sure of them, over plants whose loops are computed here by their formula."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from control import FRD, stability_margins

import cpfls_cli.look.gains
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.flight import AXES, TOO_SLOW
from cpfls_cli.look.gains import LogGains, tuned_gains
from cpfls_cli.page import blocks
from cpfls_cli.report.content import Text
from cpfls_cli.stage import loaded
from cpfls_cli.tuning.gains import AskedMargins
from cpfls_cli.tuning.margins import crossing_margins
from tests.builders.looked import NARROW, PLANTS, SYSTEMS, looked_flight, looked_plant

HELD_DISK = 2 * np.tan(np.radians(45) / 2)


AT_ONCE, ACCEPTABLE = cpfls_cli.look.gains._AT_ONCE, cpfls_cli.look.gains.ACCEPTABLE


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    """Tune for fewer plants one by one, which takes a quarter of the time, and all the way at once."""
    monkeypatch.setattr(cpfls_cli.look.gains, "DRAWS", 10)
    monkeypatch.setattr(cpfls_cli.look.gains, "_AT_ONCE", 1e6)
    monkeypatch.setattr(cpfls_cli.look.gains, "ACCEPTABLE", AskedMargins(4.0, 30.0, 179.0))


def found(autopilot, values=None, own=None, **options):
    weak = {"identified": False, "reason": "sticks rest", "parameters": None, "draws": None, "band_hz": None}
    others = (SimpleNamespace(axis=axis, **weak) for axis in ("pitch", "yaw"))
    plants = [own or looked_plant(*PLANTS[autopilot]), *others]
    return tuned_gains(looked_flight(autopilot, values, **options), plants)


@cache
def default_gains(autopilot):
    """Find those of the defaults once for all tests."""
    return found(autopilot)


def loops(autopilot, values, draws):
    """Rate loops about roll by the formula of the plant, of which a log's delay has all of the law's steps."""
    law = AUTOPILOTS[autopilot].law(values)
    frequency = np.geomspace(0.2, 0.45 * law.rate_hz, 600)
    s = 2j * np.pi * frequency
    gain, delay, lag, damping, _ = draws.T[:, :, None]
    moved = gain * np.exp(-s * delay) / ((1 + s * lag) * (s + damping))
    return frequency, moved * law.response(0, frequency).feedback


def answer(gains):
    """What is said of them."""
    return blocks(loaded("tune").text(LogGains(**vars(gains))))


def by_term(gains):
    return {row.term: row for row in gains.rows}


@pytest.mark.parametrize("autopilot", PLANTS)
def test_proposed_gains_hold_the_asked_margin_with_nineteen_of_twenty_plants(autopilot):
    own = looked_plant(*PLANTS[autopilot], (0.1, 0.003, 0.2))
    gains = found(autopilot, own=own)
    values = AUTOPILOTS[autopilot].defaults()
    named = {AUTOPILOTS[autopilot].firmware.names(SYSTEMS[autopilot]).get(name, name): name for name in values}
    new = values | {named[row.parameter]: row.proposed for row in gains.rows}
    frequency, loop = loops(autopilot, new, own.draws)
    disk = 1 / np.abs(0.5 * (1 - loop) / (1 + loop)).max(axis=-1)
    assert np.mean(disk > 0.97 * HELD_DISK) > 0.94
    # Nor are they far slower than that margin needs.
    assert np.quantile(disk, 0.05) < 1.25 * HELD_DISK
    after = gains.axes[0].after
    low, high = np.quantile(crossing_margins(frequency, loop)[1], [0.025, 0.975])
    # Plants with which the loop that flew would be unstable are not among them.
    assert low - 1 < after.phase_deg.low < low + 3
    assert high - 2 < after.phase_deg.high < high + 1
    exact = stability_margins(FRD(loops(autopilot, new, own.parameters[None])[1][0], 2 * np.pi * frequency))
    assert after.phase_deg.value == pytest.approx(exact[1], abs=0.5)
    assert after.holds > 0.94


def test_gains_go_with_the_inverse_of_effectiveness():
    usual, stronger = (by_term(found("px4", own=looked_plant(scale * 130.0, 0.02, 0.03))) for scale in (1, 2))
    for term in ("P", "I", "D"):
        assert usual[term].proposed / stronger[term].proposed == pytest.approx(2, rel=0.02)
        assert usual[term].low / stronger[term].low == pytest.approx(2, rel=0.02)


def test_the_interval_is_that_of_the_plants():
    sure, open_ = (
        by_term(found("px4", own=looked_plant(*PLANTS["px4"], spread))) for spread in (NARROW, (0.15, 0.002, 0.1))
    )
    # Ten of a normal spread of 15 % reach over some three times as much.
    assert np.log(open_["P"].high / open_["P"].low) > 0.3
    assert 0.05 < np.log(sure["P"].high / sure["P"].low) < 0.4
    assert open_["P"].low <= open_["P"].proposed < sure["P"].proposed


def test_gains_that_suit_are_kept():
    gains = default_gains("px4")
    assert {row.direction for row in gains.rows} != {"keep"}
    again = found("px4", {row.parameter: 0.5 * (row.low + row.high) for row in gains.rows})
    assert [row.direction for row in again.rows] == ["keep"] * 3
    assert again.axes[0].before.phase_deg.value == again.axes[0].after.phase_deg.value
    assert not again.axes[0].changed
    assert again.changes == ()


@pytest.mark.parametrize(("factor", "direction"), [(0.3, "raise"), (1.6, "lower")])
def test_what_is_far_off_is_moved(factor, direction):
    suited = {row.parameter: row.proposed for row in default_gains("px4").rows}
    rows = by_term(found("px4", {name: factor * value for name, value in suited.items()}))
    assert rows["P"].direction == direction
    assert {row.direction for row in rows.values()} <= {direction, "keep"}


def test_one_log_bears_one_step(monkeypatch):
    suited = {row.parameter: row.proposed for row in default_gains("px4").rows}
    monkeypatch.setattr(cpfls_cli.look.gains, "_AT_ONCE", AT_ONCE)
    row = by_term(found("px4", {name: 0.3 * value for name, value in suited.items()}))["P"]
    assert (row.direction, row.why) == ("raise", "step")
    assert row.proposed == pytest.approx(1.25 * row.today, rel=0.01)
    assert row.proposed <= 1.25 * row.today
    assert row.low > row.proposed


def test_gains_go_down_only_where_margins_are_surely_too_small(monkeypatch):
    suited = {row.parameter: row.proposed for row in default_gains("px4").rows}
    monkeypatch.setattr(cpfls_cli.look.gains, "ACCEPTABLE", ACCEPTABLE)

    def way(factor, spread=NARROW):
        own = looked_plant(*PLANTS["px4"], spread)
        gains = found("px4", {name: factor * value for name, value in suited.items()}, own=own)
        return by_term(gains)["P"].direction, gains.axes[0].before.disk_deg

    kept, acceptable = way(1.3)
    assert (kept, acceptable.value > 25) == ("keep", True)
    lowered, little = way(2.5)
    assert (lowered, little.high < 25) == ("lower", True)
    # The same loop with a vehicle that is hardly known may have enough.
    assert way(2.5, (0.4, 0.004, 0.3))[0] == "keep"


def test_the_factor_on_all_gains_stays():
    once, twice = (by_term(found("px4", {"MC_ROLLRATE_K": factor})) for factor in (1.0, 2.0))
    assert "MC_ROLLRATE_K" not in {row.parameter for row in twice.values()}
    assert twice["P"].low == pytest.approx(0.5 * once["P"].low, rel=0.02)


def test_noise_gives_one_end_only():
    quiet = {"p_roll": 8.0, "i_roll": 8.0, "d_roll": 2.0, "d_max_roll": 0.0}
    row = by_term(found("betaflight", quiet, own=looked_plant(300.0, 0.003, 0.006)))["P"]
    assert (row.direction, row.why) == ("raise", "noise")
    assert row.high == np.inf
    assert 8 < row.low <= row.proposed


def test_a_loop_that_would_not_fly_is_of_another_law():
    gains = found("px4", {"MC_ROLLRATE_P": 0.5, "MC_ROLLRATE_D": 0.01})
    assert (gains.axes[0].reason, gains.rows) == ("law", ())


def test_gains_do_not_go_beyond_the_band():
    own = looked_plant(*PLANTS["px4"])
    own.band_hz = np.array([0.3, 0.8])
    assert found("px4", own=own).axes[0].reason == "band"


def test_a_weak_axis_gets_sticks_to_move():
    gains = default_gains("betaflight")
    assert [(axis.axis, axis.reason) for axis in gains.axes[1:]] == [("pitch", "weak"), ("yaw", "weak")]
    assert [(each.axis, each.mode) for each in gains.fly] == [("pitch", "acro"), ("yaw", "acro")]
    assert {row.axis for row in gains.rows} == {"roll"}


def test_the_angle_is_tuned_where_one_is_flown():
    assert "P of the angle" not in by_term(default_gains("px4"))
    assert by_term(found("px4", attitude=True))["P of the angle"].parameter == "MC_ROLL_P"


@pytest.mark.parametrize(
    ("autopilot", "system", "reason"),
    [
        ("betaflight", "Betaflight 3.0.1", "version"),
        ("ardupilot", "ArduCopter 3.3", "version"),
        ("ardupilot", "ArduPlane 4.3", "autopilot"),
        ("betaflight", "Betaflight 3.5.0", ""),
    ],
)
def test_versions_whose_gains_count(autopilot, system, reason):
    assert found(autopilot, system=system).reason == reason


def test_names_are_those_of_the_version():
    assert {"d_min_roll", "d_roll"} <= {row.parameter for row in default_gains("betaflight").rows}
    assert {row.parameter for row in found("betaflight", system="Betaflight 3.5.0").rows} == {
        "p_roll",
        "i_roll",
        "d_roll",
    }


def test_crossings_are_those_of_python_control():
    frequency = np.geomspace(0.1, 100, 400)
    s = 2j * np.pi * frequency
    loop = np.stack([12 * gain * np.exp(-0.02 * s) / (s * (1 + 0.03 * s)) * (1 + 1 / s) for gain in (0.4, 1.0, 1.6)])
    gain, phase, crossover = crossing_margins(frequency, loop)
    for each in range(3):
        exact = stability_margins(FRD(loop[each], 2 * np.pi * frequency))
        assert gain[each] == pytest.approx(20 * np.log10(exact[0]), abs=0.05)
        assert phase[each] == pytest.approx(exact[1], abs=0.2)
        assert crossover[each] == pytest.approx(exact[4] / (2 * np.pi), rel=0.02)


def test_axes_are_in_their_order():
    gains = tuned_gains(looked_flight("px4"), [looked_plant(*PLANTS["px4"], axis=axis) for axis in AXES])
    assert [axis.axis for axis in gains.axes] == list(AXES)
    assert replace(gains, rows=()).changes == ()


def test_what_is_logged_too_slowly_is_not_asked_to_be_flown():
    gains = default_gains("betaflight")
    weak = gains.axes[1]
    said = [each.text for each in answer(gains) if isinstance(each, Text)]
    assert "To see it: fly acro and move the pitch stick" in said[0]
    slow = replace(gains, axes=(replace(weak, fact=TOO_SLOW),))
    (said,) = [each.text for each in answer(slow) if isinstance(each, Text)]
    assert said == "Pitch: logged too slowly. `cpfls look` says what to set."


def test_a_log_of_nobody_known_has_no_name_in_its_answer():
    nobody = replace(default_gains("betaflight"), version="", title="", reason="autopilot", axes=(), rows=(), fly=())
    assert [block.title for block in answer(nobody)] == ["No gains."]
