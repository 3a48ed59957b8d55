import numpy as np
import pytest

from cpfls_cli.errors import ComputationError, InputError, SettingError
from cpfls_cli.flightlog.importing import import_log
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap
from cpfls_cli.flightlog.smoothing import derivative
from cpfls_cli.rotations import body_acceleration, body_rate, generalised_torque

INERTIA = np.array([0.6, 0.7, 1.2])
PERIOD = 0.004


def motion(time):
    """Attitude and its first two derivatives, in closed form."""
    frequency, phase = np.array([2.1, 3.3, 0.9]), np.array([0.1, 1.1, 2.3])
    angle = frequency * time[:, None] + phase
    size = np.array([0.5, 0.4, 1.5])
    return size * np.sin(angle), size * frequency * np.cos(angle), -size * frequency**2 * np.sin(angle)


def torque_at(time):
    attitude, rate, acceleration = motion(time)
    omega = body_rate(attitude, rate)
    return INERTIA * body_acceleration(attitude, rate, acceleration) + np.cross(omega, INERTIA * omega)


def log(delay=0.0, samples=5000):
    time = PERIOD * np.arange(samples)
    attitude, rate, _ = motion(time)
    signals = {"angle": attitude, "gyro": body_rate(attitude, rate), "torque": torque_at(time + delay)}
    return {"t": time} | {f"{name}{axis}": values[:, axis] for name, values in signals.items() for axis in range(3)}


def mapped(gyro=True):
    units = {"attitude": ("angle", "rad"), "body_rate": ("gyro", "rad/s"), "body_torque": ("torque", "N m")}
    signals = {
        name: SignalMap(columns=tuple(f"{column}{axis}" for axis in range(3)), unit=unit)
        for name, (column, unit) in units.items()
    }
    return signals if gyro else {name: signal for name, signal in signals.items() if name != "body_rate"}


@pytest.mark.parametrize("gyro", [True, False])
def test_derivatives_of_a_known_motion_come_back(gyro):
    flight = import_log(log(), ImportSettings(signals=mapped(gyro)))
    attitude, rate, acceleration = motion(flight.time)
    np.testing.assert_allclose(flight.attitude, attitude, atol=1e-12)
    np.testing.assert_allclose(flight.attitude_rate, rate, atol=1e-4)
    inner = slice(20, -20)
    np.testing.assert_allclose(flight.attitude_acceleration[inner], acceleration[inner], atol=1e-4)
    np.testing.assert_allclose(flight.torque, generalised_torque(attitude, torque_at(flight.time)), atol=1e-10)


def test_an_estimated_delay_puts_command_and_motion_in_step():
    flight = import_log(log(delay=0.0613), ImportSettings(signals=mapped(), delay_s="estimate", lowpass_hz=20.0))
    assert flight.delay_s == pytest.approx(0.0613, abs=1e-4)
    start = flight.span_s[0]
    assert start == pytest.approx(PERIOD * np.ceil(0.0613 / PERIOD))
    inner = slice(100, -100)
    expected = torque_at(flight.time + start)[inner]
    np.testing.assert_allclose(flight.body_torque[inner], expected, atol=2e-3 * np.abs(expected).max())


def test_filtering_keeps_the_torque_equation():
    """Inertia regressed from noisy data stays within 2 % because torque and motion lose the same."""
    rng = np.random.default_rng(5)
    columns = log()
    for name in [name for name in columns if name != "t"]:
        columns[name] = columns[name] + 0.02 * columns[name].std() * rng.standard_normal(5000)
    flight = import_log(columns, ImportSettings(signals=mapped(), lowpass_hz=3.0))
    rate, acceleration = flight.body_rate, derivative(flight.time, flight.body_rate)
    regressor = np.stack([acceleration * e + np.cross(rate, rate * e) for e in np.eye(3)], axis=2)
    inner = slice(200, -200)
    found = np.linalg.lstsq(regressor[inner].reshape(-1, 3), flight.body_torque[inner].ravel(), rcond=None)[0]
    np.testing.assert_allclose(found, INERTIA, rtol=0.02)


def test_the_generalised_torque_of_a_log_is_the_same_flight():
    columns = log()
    general = generalised_torque(motion(columns["t"])[0], torque_at(columns["t"]))
    columns |= {f"general{axis}": general[:, axis] for axis in range(3)}
    signals = mapped()
    del signals["body_torque"]
    signals["torque"] = SignalMap(columns=("general0", "general1", "general2"), unit="N m")
    flight = import_log(columns, ImportSettings(signals=signals))
    np.testing.assert_allclose(flight.body_torque, torque_at(flight.time), atol=1e-10)


def test_another_rate_is_interpolated_and_thinning_without_a_filter_is_warned_of():
    flight = import_log(log(), ImportSettings(signals=mapped(), rate_hz=100.0))
    assert flight.rate_hz == 100
    np.testing.assert_allclose(flight.attitude, motion(flight.time)[0], atol=1e-8)
    assert any("aliases" in sentence for sentence in flight.warnings)
    assert import_log(log(), ImportSettings(signals=mapped(), rate_hz=100.0, lowpass_hz=20.0)).warnings == ()


def test_rotors_give_the_torque_through_the_function_of_the_caller():
    columns = log() | {f"rpm{rotor}": 60 / (2 * np.pi) * np.full(5000, 100.0 + rotor) for rotor in range(4)}
    signals = mapped() | {"rotor_speed": SignalMap(columns=tuple(f"rpm{i}" for i in range(4)), unit="rpm")}
    del signals["body_torque"]
    settings = ImportSettings(signals=signals, torque_source="rotor-speed")
    flight = import_log(columns, settings, rotor_torque=lambda log: log.rotor_speed[:, :3] ** 2)
    np.testing.assert_allclose(flight.body_torque[0], [100**2, 101**2, 102**2], rtol=1e-12)
    with pytest.raises(InputError, match="needs a vehicle"):
        import_log(columns, settings)


def test_a_vertical_nose_stops_with_the_time():
    columns = log()
    columns["angle1"][2500:2600] = np.deg2rad(89.5)
    with pytest.raises(ComputationError, match=r"at 10\.000 s"):
        import_log(columns, ImportSettings(signals=mapped()))


def test_a_log_without_attitude_keeps_its_body_axes():
    signals = {name: signal for name, signal in mapped().items() if name != "attitude"}
    flight = import_log(log(), ImportSettings(signals=signals))
    assert flight.attitude is None
    assert flight.torque is None
    np.testing.assert_allclose(flight.body_torque, torque_at(flight.time), atol=1e-10)


@pytest.mark.parametrize(("source", "shifted"), [("column", False), ("rotor-speed", True)])
def test_measured_rotor_speeds_are_shifted_only_where_the_torque_comes_from_them(source, shifted):
    """The command is always shifted; with a delay of 10 samples the cut log starts at the tenth."""
    ramp = np.arange(5000.0)
    columns = log() | {"om": ramp, "u": ramp}
    signals = mapped() | {"rotor_speed": SignalMap(columns=("om",), unit="rad/s")}
    signals["rotor_command"] = SignalMap(columns=("u",), unit="1")
    settings = ImportSettings(signals=signals, torque_source=source, delay_s=10 * PERIOD)
    flight = import_log(columns, settings, rotor_torque=lambda log: log.rotor_speed[:, [0, 0, 0]])
    np.testing.assert_allclose(flight.body_rate, body_rate(*motion(flight.time + 10 * PERIOD)[:2]), atol=1e-9)
    np.testing.assert_allclose(flight.rotor_command[:, 0], ramp[:-10], atol=1e-6)
    np.testing.assert_allclose(flight.rotor_speed[:, 0], ramp[:-10] if shifted else ramp[10:], atol=1e-6)
    torque = torque_at(flight.time) if source == "column" else ramp[:-10, None] * np.ones(3)
    np.testing.assert_allclose(flight.body_torque, torque, atol=1e-6)


@pytest.mark.parametrize(
    ("key", "changes"),
    [
        ("lowpass_hz", {"lowpass_hz": 125.0}),
        ("lowpass_hz", {"lowpass_hz": 125.0, "delay_s": "estimate"}),
        ("delay_max_s", {"delay_s": "estimate", "delay_max_s": 19.9}),
        ("delay_max_s", {"delay_s": "estimate", "delay_max_s": 1e9}),
        ("delay_s", {"delay_s": 20.0}),
        ("delay_s", {"delay_s": 1e12}),
        ("rate_hz", {"rate_hz": 1e12}),
        ("rate_hz", {"rate_hz": 2501.0}),
        ("rate_hz", {"rate_hz": 0.4}),
        ("crop_s", {"crop_s": (20.5, 30.0)}),
        ("crop_s", {"crop_s": (1.0, 1.001)}),
    ],
)
def test_a_setting_that_does_not_suit_the_log_is_refused_at_its_key(key, changes):
    """The log lasts 20 s at 250 Hz."""
    with pytest.raises(SettingError) as caught:
        import_log(log(), ImportSettings(signals=mapped(), **changes))
    assert caught.value.key == key


def test_a_delay_cannot_be_estimated_without_torque():
    signals = {name: signal for name, signal in mapped().items() if name != "body_torque"}
    with pytest.raises(SettingError, match="needs a torque") as caught:
        import_log(log(), ImportSettings(signals=signals, torque_source=None, delay_s="estimate"))
    assert caught.value.key == "delay_s"
