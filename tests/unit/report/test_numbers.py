import math

import pytest

from cpfls_cli.report.numbers import change, number, percent, plain, r_squared


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (5153.338, "5153"),
        (0.0123456, "0.01235"),
        (-0.5, "−0.5000"),
        (6.3e-9, "6.300 × 10⁻⁹"),
        (9.9999e5, "1.000 × 10⁶"),
        (math.inf, "∞"),
        (math.nan, "—"),
    ],
)
def test_a_number_keeps_its_significant_digits(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("value", "text"), [(121.5e-6, "121.5 × 10⁻⁶"), (2.7e-6, "2.7 × 10⁻⁶"), (9.81, "9.81"), (6.0, "6"), (0.0, "0")]
)
def test_settings_read_as_the_paper_prints_them(value, text):
    assert plain(value) == text


def test_a_share_of_variance_reads_one_only_when_nothing_is_missing():
    assert r_squared(1.0) == "1"
    assert r_squared(1.0 - 1e-6) == "> 0.9999"
    assert r_squared(0.98765) == "0.9877"
    assert r_squared(-1e-9) == "0.0000"
    assert r_squared(-56730.0) == "−56730"
    assert r_squared(math.nan) == "—"


def test_rounding_is_written_as_zero_and_a_small_error_is_not():
    assert percent(1.5e-15) == "0 %"
    assert percent(1.5e-6) == "0.000150 %"
    assert percent(0.01706) == "1.71 %"


def test_a_change_carries_its_sign():
    assert change(56805 / 56254 - 1) == "+0.98 %"
    assert change(-0.348) == "−34.80 %"
    assert change(-1e-9) == "0 %"
