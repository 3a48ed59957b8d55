"""Regressors of the torque."""

import numpy as np
import pytest

from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure

ROLL, PITCH = 0, 1
PLACES = {"D11": (0, 0, ()), "D13": (0, 2, (PITCH,)), "D22": (1, 1, (ROLL,))}
PLACES |= {"D23": (1, 2, (ROLL, PITCH)), "D33": (2, 2, (ROLL, PITCH))}
SEESAW = {"consequents": "seesaw", "products": "additive"}
HARMONIC = {"consequents": "harmonic"}
STRUCTURES = {
    "paper": {**SEESAW, "membership_functions": 5},
    "paper-data-range": {**SEESAW, "membership_functions": 5, "input_map": "data-range"},
    "classic": {**SEESAW, "membership_functions": 3, "structure": "fls"},
    "unequal": {**SEESAW, "membership_functions": (1, 2, 3, 5, 7, 4)},
    "harmonic-additive": {**HARMONIC, "harmonic_order": 1, "products": "additive", "membership_functions": 3},
    "harmonic-tensor": {
        **HARMONIC,
        "harmonic_order": 2,
        "products": "tensor",
        "membership_functions": (1, 4, 2, 3, 5, 1),
    },
}
STATES = 40
STEP = 1e-5


def triangle(angle):
    """Equation (11) by another formula."""
    return 2 / np.pi * np.arcsin(np.sin(angle))


def zadeh(x, b):
    """Degrees of membership for one input, equation (8)."""
    mu = np.zeros(len(b))
    if len(b) == 1:
        return np.ones(1)
    k = min(int(np.searchsorted(b, x, side="right")) - 1, len(b) - 2)
    u = (x - b[k]) / (b[k + 1] - b[k])
    mu[k] = 1 - 2 * u**2 if u < 0.5 else 2 * (1 - u) ** 2
    mu[k + 1] = 1 - mu[k]
    return mu


def scaled(angle, training, settings):
    """Antecedent and consequent input."""
    if settings.input_map == "full-circle":
        if settings.structure == "cpfls":
            return (angle % (2 * np.pi)) / (2 * np.pi), triangle(angle)
        # The classic system's seam lies opposite to hover.
        return (((angle + np.pi) % (2 * np.pi)) / (2 * np.pi),) * 2
    low, high = triangle(training).min(), triangle(training).max()
    return ((triangle(angle) - low) / (high - low),) * 2


def one_input_features(angle, consequent, settings):
    if settings.consequents == "seesaw":
        return [1.0, consequent]
    orders = range(1, settings.harmonic_order + 1)
    return [1.0, *(np.sin(k * angle) for k in orders), *(np.cos(k * angle) for k in orders)]


def fuzzy_output(angles, training, partitions, coefficients, settings):
    """Equations (7) and (9), rule by rule."""
    firing, parts = np.ones(1), []
    for angle, data, b in zip(angles, training, partitions, strict=True):
        x, consequent = scaled(angle, data, settings)
        mu = zadeh(x, b)
        if settings.structure == "cpfls" and len(mu) > 1:
            mu = np.array([mu[0] + mu[-1], *mu[1:-1]])
        firing = np.outer(firing, mu).ravel()
        parts.append(one_input_features(angle, consequent, settings))
    if len(parts) == 2 and settings.products == "additive":
        features = np.array([*parts[0], *parts[1][1:]])
    else:
        features = np.outer(parts[0], parts[1]).ravel() if len(parts) == 2 else np.array(parts[0])
    return sum(w * (c @ features) for w, c in zip(firing, coefficients.reshape(len(firing), -1), strict=True))


def inertia_matrix(q, training, structure, partitions, coefficients):
    J = np.zeros((3, 3))
    for block in structure.blocks:
        row, column, inputs = PLACES[block.function.name]
        own = coefficients[block.columns]
        value = own[0]
        if inputs:
            b = [partitions[i] for i in block.partitions]
            value = fuzzy_output(q[list(inputs)], training[list(inputs)], b, own, structure.settings)
        J[row, column] = J[column, row] = value
    return J


def christoffel_torque(q, qd, qdd, inertia):
    """Equations (3) and (4) with dD/dq by central differences."""
    J = inertia(q)
    dJ = np.stack([(inertia(q + STEP * e) - inertia(q - STEP * e)) / (2 * STEP) for e in np.eye(3)], axis=2)
    tau = J @ qdd
    for i in range(3):
        for j in range(3):
            for k in range(3):
                tau[i] += 0.5 * (dJ[i, j, k] + dJ[i, k, j] - dJ[j, k, i]) * qd[j] * qd[k]
    return tau


def random_states():
    rng = np.random.default_rng(8)
    attitude = rng.uniform(-np.pi, np.pi, (STATES, 3))
    # Away from the corners of the seesaw, where the derivative is not defined.
    attitude[:, :2] = np.pi / 2 * (rng.integers(-2, 2, (STATES, 2)) + rng.uniform(0.01, 0.99, (STATES, 2)))
    return attitude, rng.standard_normal((STATES, 3)), rng.standard_normal((STATES, 3))


@pytest.mark.parametrize("name", STRUCTURES)
def test_regressor_gives_the_torque_of_its_inertia_matrix(name):
    structure = model_structure(StructureSettings(**STRUCTURES[name]))
    rng = np.random.default_rng(9)
    states = random_states()
    partitions = decode(structure, rng.uniform(1, 3, structure.genes))
    coefficients = rng.standard_normal(structure.parameters)
    regressor = Regressor(structure, Motion(*states), data_ranges(structure, states[0]))
    torque = regressor.matrix(partitions) @ coefficients

    def inertia(q):
        return inertia_matrix(q, states[0].T, structure, partitions, coefficients)

    # The extreme samples define the range, where finite differences leave it.
    inner = np.abs(triangle(states[0][:, :2]))
    inner = np.flatnonzero((inner < inner.max(axis=0)).all(axis=1))[1:-1] if "range" in name else range(STATES)
    expected = np.array([christoffel_torque(*(s[n] for s in states), inertia) for n in inner])
    np.testing.assert_allclose(torque[inner], expected, atol=2e-6 * np.abs(expected).max())
    np.testing.assert_allclose(
        regressor.inertia(partitions, coefficients).value[inner], [inertia(states[0][n]) for n in inner], atol=1e-12
    )


@pytest.mark.parametrize("name", STRUCTURES)
def test_first_column_is_the_constant_roll_inertia(name):
    structure = model_structure(StructureSettings(**STRUCTURES[name]))
    states = random_states()
    partitions = decode(structure, np.ones(structure.genes))
    column = Regressor(structure, Motion(*states), data_ranges(structure, states[0])).matrix(partitions)[:, :, 0]
    np.testing.assert_array_equal(column, states[2] * [1, 0, 0])


@pytest.mark.parametrize("name", STRUCTURES)
def test_faster_motion_scales_the_regressor(name):
    """Flying the same path s times as fast multiplies every torque by s squared."""
    structure = model_structure(StructureSettings(**STRUCTURES[name]))
    q, qd, qdd = random_states()
    ranges = data_ranges(structure, q)
    partitions = decode(structure, np.ones(structure.genes))
    slow, fast = (Regressor(structure, Motion(q, s * qd, s**2 * qdd), ranges).matrix(partitions) for s in (1, 3))
    np.testing.assert_allclose(fast, 9 * slow, atol=1e-12 * np.abs(fast).max())


def test_yaw_does_not_enter():
    structure = model_structure(StructureSettings())
    q, qd, qdd = random_states()
    ranges = data_ranges(structure, q)
    turned = q + np.array([0, 0, 1.3])
    first, second = (
        Regressor(structure, Motion(a, qd, qdd), ranges).matrix(decode(structure, np.empty(0))) for a in (q, turned)
    )
    np.testing.assert_array_equal(first, second)


def relative_residual(tensor, **settings):
    """Largest error of the best coefficients over the largest torque, on random states of the whole circle."""
    rng = np.random.default_rng(11)
    states = rng.uniform(-np.pi, np.pi, (300, 3)), rng.standard_normal((300, 3)), rng.standard_normal((300, 3))
    structure = model_structure(StructureSettings(**settings))
    Q = Regressor(structure, Motion(*states), data_ranges(structure, states[0])).matrix(uniform_breakpoints(structure))
    torque = newton_euler_torque(*states, np.array(tensor)).ravel()
    columns = Q.reshape(len(torque), -1)
    return np.abs(columns @ np.linalg.lstsq(columns, torque, rcond=1e-12)[0] - torque).max() / np.abs(torque).max()


@pytest.mark.parametrize("moments", [(0.6, 0.6, 1.2), (0.3, 0.9, 1.1)])
def test_order_2_tensor_is_exact(moments):
    assert relative_residual(np.diag(moments)) < 1e-12


@pytest.mark.parametrize("settings", [{"harmonic_order": 1}, {"products": "additive"}])
def test_less_is_not(settings):
    assert relative_residual(np.diag((0.3, 0.9, 1.1)), **settings) > 0.05


def test_products_of_inertia_are_outside_the_structure():
    """D12 is zero in equation (15), and D11 and D22 depend on nothing more; method.md section 2."""
    assert relative_residual([[0.6, 0.1, 0.0], [0.1, 0.7, 0.0], [0.0, 0.0, 1.2]]) > 0.05
