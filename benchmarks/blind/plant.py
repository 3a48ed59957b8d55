"""The craft that really flies: nominal numbers altered by hidden effects of mass, geometry and drive."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .vehicles import GRAVITY

USUAL_LAG = 0.05


@dataclass
class Plant:
    """True numbers of one craft; hubs are relative to the true centre of mass."""

    mass: float
    inertia: np.ndarray
    hubs: np.ndarray
    thrust_factor: np.ndarray
    torque_factor: np.ndarray
    spin: np.ndarray
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    lag_up: float = USUAL_LAG
    lag_down: float = USUAL_LAG
    resonance: tuple[float, float] | None = None
    delay: float = 0.0
    sag_exponent: float = 0.0
    sag_depth: float = 0.03
    sag_start: float = 0.0
    sag_load: float = 0.01
    notch: tuple[float, float] | None = None
    curve: float = 0.0
    euler_axis: bool = False

    @property
    def carrying(self):
        """Rotor speed that carries the weight, rad/s."""
        return float(np.sqrt(self.mass * GRAVITY / self.thrust_factor.sum()))


def nominal(vehicle):
    """Take the maker's word."""
    return Plant(
        vehicle.mass,
        np.diag(vehicle.inertia).astype(float),
        vehicle.hubs.copy(),
        vehicle.thrust_factors,
        np.full(vehicle.count, vehicle.torque_factor),
        np.array(vehicle.spin, dtype=float),
    )


def com_offset(plant, offset):
    """Move the centre of mass; the log keeps following the old origin."""
    offset = np.asarray(offset)
    plant.hubs = plant.hubs - offset[:, None]
    plant.origin = -offset


def products_of_inertia(plant, xy, xz, yz):
    """Tilt the principal axes."""
    plant.inertia = plant.inertia + np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])


def rotor_mismatch(plant, gain):
    """Let rotors be stronger or weaker than one another, in thrust and in reaction torque."""
    plant.thrust_factor = plant.thrust_factor * (1 + np.asarray(gain))
    plant.torque_factor = plant.torque_factor * (1 + np.asarray(gain))


def parameter_error(plant, mass, inertia, arm, thrust, torque):
    """Let the craft differ from its description by relative errors."""
    plant.mass *= 1 + mass
    plant.inertia = plant.inertia * np.diag(1 + np.asarray(inertia))
    plant.hubs = plant.hubs * np.array([[1 + arm], [1 + arm], [1.0]])
    plant.thrust_factor = plant.thrust_factor * (1 + thrust)
    plant.torque_factor = plant.torque_factor * (1 + torque)


def drag_factor(plant, error):
    """Let the rotors turn the craft about yaw more or less than its description says."""
    plant.torque_factor = plant.torque_factor * (1 + error)


def quick_rotors(plant):
    """Let rotors follow their command at once, as in simulators that know no motors."""
    plant.lag_up = plant.lag_down = 0.002


def notch_filter(plant, frequency, width):
    """Let the autopilot take a band out of the commands that it logs, before the rotors get them."""
    plant.notch = (frequency, width)


def motor_lag(plant, time_constant):
    """Let rotors follow their command with another first-order lag than usual."""
    plant.lag_up = plant.lag_down = time_constant


def lag_uneven(plant, up, down):
    """Let rotors brake more slowly than they spin up."""
    plant.lag_up, plant.lag_down = up, down


def lag_second_order(plant, frequency, damping):
    """Let rotors follow like a damped oscillator."""
    plant.resonance = (frequency, damping)


def command_delay(plant, delay):
    """Let commands arrive late."""
    plant.delay = delay


def battery_sag(plant, depth, exponent, start, load):
    """Let rotor speed fall with the voltage: speed = command * volt**exponent."""
    plant.sag_depth, plant.sag_exponent, plant.sag_start, plant.sag_load = depth, exponent, start, load


def thrust_curve(plant, share):
    """Let a share of the thrust that hovers go with the command, and the rest with its square."""
    plant.curve = share


def euler_axis_torque(plant):
    """Let the rotor torque act along the axes of the Euler angles."""
    plant.euler_axis = True


_ALL = (
    com_offset, products_of_inertia, rotor_mismatch, parameter_error, drag_factor, quick_rotors, notch_filter,
    motor_lag, lag_uneven, lag_second_order, command_delay, battery_sag, thrust_curve, euler_axis_torque,
)  # fmt: skip
ALTERATIONS = {alter.__name__: alter for alter in _ALL}
