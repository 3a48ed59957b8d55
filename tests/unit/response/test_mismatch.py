"""The cost between a model and a measured response by hand, the band that is judged, and where a model is off."""

import numpy as np
import pytest

from cpfls_cli.response.spectra import FrequencyResponse, clearness, judged_band, mismatch

FREQUENCY = 10.0 ** (np.arange(-24, 25) / 24)


def response(ratio, coherence=1.0, error=0.01, model=True, instrumented=False):
    """A measured gain of 5 with some phase, and a model that is off by a ratio."""
    gain = np.full(len(FREQUENCY), 5.0 * np.exp(-0.3j))
    return FrequencyResponse(
        frequency=FREQUENCY,
        gain=gain,
        model=gain * ratio if model else None,
        direct=gain,
        coherence_input=np.ones_like(FREQUENCY),
        coherence_output=np.broadcast_to(np.asarray(coherence, dtype=float), FREQUENCY.shape),
        random_error=np.full(len(FREQUENCY), error),
        averages=np.full(len(FREQUENCY), 50.0),
        instrumented=instrumented,
    )


def test_the_cost_by_hand():
    """One decibel everywhere at a coherence of 1: W = (1.58 (1 - 1/e))^2 = 0.9975; a degree counts 0.01745 of that."""
    weight = (1.58 * (1 - np.exp(-1))) ** 2
    assert mismatch(response(10 ** (1 / 20))).cost == pytest.approx(20 * weight, rel=1e-9)
    turned = mismatch(response(np.exp(1j * np.radians(10.0)))).cost
    assert turned == pytest.approx(20 * weight * 0.01745 * 100, rel=1e-9)
    assert mismatch(response(1.0)).cost == 0.0


def test_less_coherence_counts_less():
    weight = (1.58 * (1 - np.exp(-0.7))) ** 2
    assert mismatch(response(2.0, coherence=0.7)).cost == pytest.approx(20 * weight * (20 * np.log10(2)) ** 2)


def test_the_band_is_the_widest_of_coherence_with_short_dips():
    coherence = np.zeros(49)
    coherence[2:6], coherence[10:30] = 0.9, 0.9
    coherence[[15, 16]] = 0.3
    assert judged_band(response(1.0, coherence)) == slice(10, 30)
    coherence[[17, 18]] = 0.3
    assert judged_band(response(1.0, coherence)) == slice(19, 30)
    coherence[26:] = 0.0
    # Less than an octave is no band.
    assert judged_band(response(1.0, coherence)) is None
    assert judged_band(response(1.0, 0.59)) is None
    assert mismatch(response(1.0, 0.59)).band is None
    assert np.isnan(mismatch(response(1.0, 0.59)).cost)


def test_without_a_model_there_is_a_band_and_no_cost():
    found = mismatch(response(1.0, model=False))
    assert found.band == (pytest.approx(0.1), pytest.approx(10.0))
    assert np.isnan(found.cost)
    assert found.deviations == ()


def test_a_model_is_off_where_it_is():
    """Twice too strong below 0.5 Hz, right to 4 Hz, then 20 degrees late."""
    ratio = np.where(FREQUENCY < 0.5, 2.0, np.where(FREQUENCY > 4.0, np.exp(-1j * np.radians(20)), 1.0))
    strong, right, late = mismatch(response(ratio)).deviations
    assert (strong.right, right.right, late.right) == (False, True, False)
    assert strong.gain == pytest.approx(2.0)
    assert strong.high < 0.5 < right.low
    assert right.high < 4.0 < late.low
    assert late.phase == pytest.approx(-20.0)


def test_what_chance_explains_is_not_off_nor_is_a_single_point():
    assert all(each.right for each in mismatch(response(1.5, error=0.3)).deviations)
    assert not any(each.right for each in mismatch(response(1.5, error=0.1)).deviations)
    ratio = np.ones(49)
    ratio[[20, 21]] = 4.0
    (only,) = mismatch(response(ratio)).deviations
    assert only.right


def test_a_model_that_does_nothing_has_a_cost():
    found = mismatch(response(0.0))
    assert np.isfinite(found.cost)
    assert found.deviations[0].gain == pytest.approx(1e-6)


def test_many_repeats_make_up_for_little_coherence():
    """A random error of 10 % is that of a coherence of 0.6 in 33 windows; without instruments it counts for nothing."""
    few, enough = (response(1.0, 0.2, error, instrumented=True) for error in (0.11, 0.09))
    assert judged_band(few) is None
    assert judged_band(enough) == slice(0, 49)
    assert judged_band(response(1.0, 0.2, 0.01)) is None
    expected = np.sqrt((1 - 0.6) / (2 * 33 * 0.6))
    assert clearness(np.array(0.4), np.array(expected), np.array(33.0), True) == pytest.approx(0.6)
    assert mismatch(response(1.0, 0.2, 0.09, instrumented=True)).cost == 0.0


def test_weak_instruments_make_up_for_nothing():
    """They give the loop again, as sure of itself as it is: F = (n - 1) g^2 / (1 - g^2) has to be above 10."""
    weak, strong = (clearness(np.array(g), np.array(0.01), np.array(101.0), True) for g in (0.08, 0.1))
    assert weak == 0.08
    assert strong > 0.98
