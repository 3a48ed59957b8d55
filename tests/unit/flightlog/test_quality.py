import numpy as np
import pytest

from cpfls_cli.flightlog.importing import import_log
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap
from cpfls_cli.rotations import body_rate

TIME = np.arange(2000) / 250
SIGNALS = {
    "attitude": SignalMap(columns=("a0", "a1", "a2"), unit="rad"),
    "body_rate": SignalMap(columns=("w0", "w1", "w2"), unit="rad/s"),
}


def log(sizes=(0.4, 0.35, 0.8), noise=0.0, held=1):
    """A flight of one tone about each angle; an attitude that is held is logged at a lower rate, in steps."""
    sizes, frequency = np.array(sizes), np.array([5.1, 4.3, 1.7])
    angle = frequency * TIME[:, None] + [0.0, 1.3, 2.1]
    attitude, rate = sizes * np.sin(angle), sizes * frequency * np.cos(angle)
    gyro = body_rate(attitude, rate) + noise * np.random.default_rng(7).standard_normal(attitude.shape)
    stepped = attitude[np.arange(len(attitude)) // held * held]
    return {"t": TIME} | {f"a{i}": stepped[:, i] for i in range(3)} | {f"w{i}": gyro[:, i] for i in range(3)}


def warnings(columns, signals=SIGNALS, **changes):
    settings = ImportSettings(signals=signals, torque_source=None, **changes)
    return [text for text in import_log(columns, settings).report.warnings if "hardly agree" in text]


@pytest.mark.parametrize("lowpass_hz", [None, 8.0])
@pytest.mark.parametrize("columns", [log(), log(noise=0.3, held=5)], ids=["clean", "noisy gyroscope, held attitude"])
def test_one_motion_is_not_warned_of(columns, lowpass_hz):
    assert warnings(columns, lowpass_hz=lowpass_hz) == []


@pytest.mark.parametrize("signal", ["a", "w"])
def test_swapped_roll_and_pitch_are_named_with_axis_and_key(signal):
    columns = log(noise=0.1)
    columns[f"{signal}0"], columns[f"{signal}1"] = columns[f"{signal}1"], columns[f"{signal}0"]
    found = warnings(columns)
    assert [text.split(" the ")[0] for text in found[:2]] == ["about body x (roll)", "about body y (pitch)"]
    assert all("check columns, signs and frames of import.signals.attitude" in text for text in found)
    assert all("import.signals.body_rate" in text for text in found)


@pytest.mark.parametrize(("axis", "words"), [(0, "x (roll)"), (1, "y (pitch)"), (2, "z (yaw)")])
def test_a_wrong_sign_is_found_about_its_axis_alone(axis, words):
    signs = [1.0, 1.0, 1.0]
    signs[axis] = -1.0
    flipped = SIGNALS | {"body_rate": SignalMap(columns=("w0", "w1", "w2"), unit="rad/s", sign=tuple(signs))}
    (found,) = warnings(log(noise=0.1), flipped)
    assert words in found


def test_an_attitude_in_other_axes_than_the_gyroscope_is_found():
    """An attitude in FRD against NED of a gyroscope in FLU: pitch and yaw have the other sign."""
    columns = log()
    assert len(warnings(columns | {"a1": -columns["a1"], "a2": -columns["a2"]})) == 2


def test_a_gyroscope_that_stands_still_in_a_flight_that_moves_is_found():
    assert len(warnings(log() | {"w1": np.zeros(2000)})) == 1


def test_an_axis_that_hardly_turns_is_not_judged():
    columns = log(sizes=(0.4, 0.35, 0.001))
    columns["w2"] = -columns["w2"]
    assert warnings(log(sizes=(0.001, 0.001, 0.001), noise=0.05)) == []
    assert not any("yaw" in text for text in warnings(log(sizes=(0.01, 0.9, 0.001)) | {"w2": 0 * TIME}))


def gains(columns, signals=SIGNALS):
    settings = ImportSettings(signals=signals, torque_source=None)
    return [text for text in import_log(columns, settings).report.warnings if "times the attitude's derivative" in text]


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize(
    ("factor", "unit"), [(180 / np.pi, "deg/s"), (np.pi / 180, "rad/s")], ids=["taken for rad/s", "taken for deg/s"]
)
def test_rates_in_the_other_unit_are_named_by_their_gain(factor, unit, noise):
    columns = log(noise=noise)
    columns |= {name: factor * columns[name] for name in ("w0", "w1", "w2")}
    found = gains(columns)
    assert [text.split(" the ")[0] for text in found] == [
        "about body x (roll)",
        "about body y (pitch)",
        "about body z (yaw)",
    ]
    values = [float(text.split("rate is ")[1].split(" ")[0]) for text in found]
    np.testing.assert_allclose(values, factor, rtol=0.1 if noise else 0.005)
    assert all(f"does the log hold rates in {unit} (import.signals.body_rate.unit" in text for text in found)


@pytest.mark.parametrize(("gain", "warned"), [(0.45, True), (0.55, False), (1.9, False), (2.1, True)])
def test_a_gain_between_a_half_and_two_is_let_pass(gain, warned):
    columns = log()
    columns["w1"] = gain * columns["w1"]
    found = gains(columns)
    assert len(found) == warned
    assert all("about body y (pitch)" in text and "check the units" in text for text in found)


def test_noise_alone_is_no_gain():
    assert gains(log(noise=0.3, held=5)) == []
    assert gains(log(noise=5.0)) == []
