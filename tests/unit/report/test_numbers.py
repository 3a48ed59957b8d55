"""Numbers with the digits that are known, and intervals whose ends can be told apart."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.report.content import (
    change,
    number,
    percent,
    plain,
    printed,
    probability,
    r_squared,
    sentence,
    whole_percent,
    with_interval,
)
from cpfls_cli.words import joined


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


@pytest.mark.parametrize(
    ("numbers", "written"),
    [
        ((0.0100000015, 0.0099995, 0.0100012), ("0.01000000", "0.00999950", "0.01000120")),
        ((0.0712, 0.0691, 0.0733), ("0.0712", "0.0691", "0.0733")),
        ((-0.0001395, -0.0001909, -8.812e-05), ("-0.000140", "-0.000191", "-0.000088")),
        ((-1.395e-5, -1.909e-5, -8.812e-06), ("-1.40e-5", "-1.91e-5", "-0.88e-5")),
        ((1234.5, 1100.0, 1400.0), ("1234", "1100", "1400")),
        ((0.001, -0.2, 0.2), ("0.00", "-0.20", "0.20")),
        ((-0.001, -0.2, 0.2), ("0.00", "-0.20", "0.20")),
        ((3.0, float("nan"), float("nan")), ("3", "—", "—")),
        ((2.0, 2.0, 2.0), ("2", "2", "2")),
        ((0.0, 0.0, 0.0), ("0", "0", "0")),
    ],
)
def test_rounding_by_the_width(numbers, written):
    assert with_interval(*numbers) == written


@given(st.floats(-1e3, 1e3), st.floats(1e-8, 1e3), st.floats(0.05, 1))
def test_ends_are_told_apart_and_right_to_a_tenth_of_the_width(value, width, share):
    low, high = value - share * width, value + width
    _, first, last = (float(text) for text in with_interval(value, low, high))
    assert first < last
    assert abs(first - low) <= 0.1 * (high - low)
    assert abs(last - high) <= 0.1 * (high - low)


def test_print():
    assert printed("-1.40e-4") == "−1.40 × 10⁻⁴"
    assert printed("0.25") == "0.25"


def test_numbers_are_not_rounded_into_certainty():
    assert [whole_percent(share) for share in (0.0, 0.001, 0.42, 0.9961, 1.0)] == [
        "0 %", "< 1 %", "42 %", "> 99 %", "100 %",
    ]  # fmt: skip
    assert probability(1e-9) == "< 10⁻⁶"
    assert probability(0.0123) == "0.012"


def test_words_become_phrases_and_sentences():
    assert joined(["a", "b", "c", "a"]) == "a, b and c"
    assert joined(["a", "b"], "or") == "a or b"
    assert sentence("no rotors") == "No rotors."
    assert sentence("log_1.csv: saturated?") == "log_1.csv: saturated?"
