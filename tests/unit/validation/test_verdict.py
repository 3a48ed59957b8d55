"""Regions in words, worked by hand: cells of 5 degrees from -180 on."""

from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.playback.loop import LoopBounds
from cpfls_cli.validation.evidence import MODEL, Evidence
from cpfls_cli.validation.replay import NOTHING_MOVES
from cpfls_cli.validation.trust import Trust
from cpfls_cli.validation.verdict import Reason, Verdict, _band, beside_loop, confirmed_axes, region_in_words

LOOP = LoopBounds(np.full(3, 0.5), np.full(3, 2.0), np.array([0.5, 0.8, 0.1]))


def visited(roll, pitch):
    cells = np.zeros((72, 72), dtype=bool)
    cells[np.ix_(roll, pitch)] = True
    return cells


@pytest.mark.parametrize(
    ("roll", "pitch", "words"),
    [
        (range(32, 40), range(36, 37), "roll -20 to 20 degrees, pitch 0 to 5 degrees (0.154 %"),
        ([70, 71, 0, 1], range(72), "roll 170 to 190 degrees, pitch all round (5.56 %"),
        ([10, 20, 60], [71], "roll 120 to 285 degrees, pitch 175 to 180 degrees (0.0579 %"),
        (range(72), range(72), "roll all round, pitch all round (100 %"),
        ([], [], "roll nowhere, pitch nowhere (0 %"),
    ],
)
def test_ranges(roll, pitch, words):
    assert region_in_words(visited(list(roll), list(pitch))).startswith(words)


def evidence(model_error, still_error, r2=(0.95, 0.95, 0.95)):
    """What `confirmed_axes` asks of evidence, with the squared errors of replayed rates in one window."""
    steps = SimpleNamespace(model=(MODEL, NOTHING_MOVES), window_error=np.array([[model_error], [still_error]]))
    known = SimpleNamespace(replayed={"rest": steps}, r2_min=0.8, r2=lambda _: np.array(r2))
    known.predicts = lambda predictor: Evidence.predicts(known, predictor)
    return known


def test_an_axis_that_torque_confirms_and_playback_denies_is_not_confirmed():
    judged = evidence((1.0, 3.0, 1.0), (2.0, 2.0, 2.0))
    assert confirmed_axes(judged, MODEL).tolist() == [True, False, True]


def test_playback_does_not_confirm_what_torque_denies():
    judged = evidence((1.0, 1.0, 1.0), (2.0, 2.0, 2.0), r2=(0.9, 0.5, 0.9))
    assert confirmed_axes(judged, MODEL).tolist() == [True, False, True]


def test_without_windows_torque_decides():
    judged = evidence((np.nan,) * 3, (np.nan,) * 3)
    assert confirmed_axes(judged, MODEL).all()


@pytest.mark.parametrize("by_past", [False, True])
@pytest.mark.parametrize("label", [Trust.CONTROL, Trust.INSIDE, Trust.RIGID_BODY])
def test_no_model_of_flights_that_show_the_loop_is_good(label, by_past):
    found = beside_loop(Verdict(label, "", (Reason("better", 1),)), LOOP, by_past=by_past)
    assert found.label == Trust.LOOP
    assert "50 % of roll, 80 % of pitch" in found.reasons[0].text
    assert ("The past identifies roll and pitch" in found.reasons[0].text) is by_past
    assert [each.speaks for each in found.reasons] == [-1, 1]


def test_a_loop_does_not_save_what_is_not_to_be_used():
    found = beside_loop(Verdict(Trust.DO_NOT_USE, "", (Reason("no body", -1),)), LOOP)
    assert (found.label, found.reasons[0].text, len(found.reasons)) == (Trust.DO_NOT_USE, "no body", 2)


@pytest.mark.parametrize("loop", [None, LOOP._replace(explained=np.array([0.95, 0.95, 0.1]))])
def test_flights_that_explain_roll_and_pitch_leave_the_verdict(loop):
    found = Verdict(Trust.INSIDE, "", (Reason("better", 1),))
    assert beside_loop(found, loop) is found


def test_the_band_of_a_moment_is_no_narrower_than_instruments_know_it():
    told = SimpleNamespace(half=np.array([0.1, 0.05, np.inf]), identified=np.array([True, True, False]))
    known = SimpleNamespace(band=np.full(3, 0.005), identification=SimpleNamespace(freed=told))
    (reason,) = _band(known)
    assert "20 %" in reason.text
    known.identification.freed = None
    (reason,) = _band(known)
    assert "0.5 %" in reason.text
