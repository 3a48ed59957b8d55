"""When a fault is named: Holm's correction, practical size, and the pull of noise."""

import numpy as np
import pytest
from scipy import stats

from cpfls_cli.consistency.gyroscope import GyroFit
from cpfls_cli.consistency.sensors import CheckedFault, findings
from cpfls_cli.effects.registry import CATALOGUE

NAMES = ("gyro_bias", "gyro_scale", "imu_misalignment", "channel_delay")


def fit(place=0, value=0.0, error=1e-4, pull=0.0, blocks=21):
    values, errors, pulls = np.zeros(13), np.full(13, error), np.zeros(13)
    values[place], pulls[place] = value, pull
    nothing = np.zeros((1, 3))
    return GyroFit(values, errors, pulls, np.ones(13, dtype=bool), blocks, np.ones(3), nothing, nothing)


def checked(fitted, names=NAMES):
    return [CheckedFault(CATALOGUE[name], fitted.of(CATALOGUE[name].test.estimate)) for name in names]


def named(fitted, period=0.01):
    return [finding.name for finding in findings(checked(fitted), period) if finding.named]


@pytest.mark.parametrize(
    ("place", "small", "large", "name"),
    [
        (0, 0.0014, 0.0016, "gyro_bias"),
        (4, 0.0029, 0.0031, "gyro_scale"),
        (8, 0.0024, 0.0026, "imu_misalignment"),
        (12, 0.0019, 0.0021, "channel_delay"),
    ],
)
def test_significant_but_small_is_not_named(place, small, large, name):
    assert named(fit(place, -small)) == []
    assert named(fit(place, -large)) == [name]


def test_a_delay_must_exceed_a_fifth_of_a_sample():
    assert named(fit(12, 0.003), period=0.01) == ["channel_delay"]
    assert named(fit(12, 0.003), period=0.02) == []


def test_the_first_of_ten_counts_ten_times():
    [bias, *_] = findings(checked(fit(0, 0.01075, error=0.005)), 0.01)
    assert bias.p_value == pytest.approx(10 * 2 * stats.t.sf(2.0, 20))
    [alone] = findings(checked(fit(0, 0.01075, error=0.005), ("gyro_bias",)), 0.01)
    assert alone.p_value == pytest.approx(3 * 2 * stats.t.sf(2.0, 20))


def test_what_noise_can_have_pulled_does_not_count():
    assert named(fit(3, 0.02, pull=0.0)) == ["gyro_scale"]
    assert named(fit(3, 0.02, pull=0.02)) == []
    [scale] = findings(checked(fit(3, 0.02, pull=0.01), ("gyro_scale",)), 0.01)
    assert scale.coefficients[0].high == pytest.approx(0.02 + 0.01 + 1e-4 * stats.t.ppf(0.975, 20))


def test_sentences_say_which_way():
    say = {
        f.name: f.sentence
        for place, v in ((3, 0.02), (12, -0.005))
        for f in findings(checked(fit(place, v)), 0.01)
        if f.named
    }
    assert say["gyro_scale"] == "The gyroscope reads 2 % too much about x."
    assert say["channel_delay"] == "The gyroscope runs 5 ms ahead of the attitude."
