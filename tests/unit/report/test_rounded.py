"""Values with intervals: ends that can be told apart, and no digits that nobody knows."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpfls_cli.report.rounded import printed, with_interval


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
