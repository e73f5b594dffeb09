"""Modified Rodrigues parameters in kernels, against rotations by other means."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dockair.nav.pose.mrp import matrix_from_mrp, mrp_from_matrix, mrp_product, mrp_rate
from dockair.rotations import exp

ANGLES = (0.0, 1e-9, 0.4, 1.5, 3.0, np.pi - 1e-7)
AXES = [*np.eye(3), *-np.eye(3), np.array([0.6, 0.0, -0.8]), np.array([1.0, -2.0, 2.0]) / 3.0]


def turns():
    return [exp(angle * axis) for angle in ANGLES for axis in AXES]


def passive(R):
    return Rotation.from_matrix(R.T).as_mrp()


def test_the_parameters_of_a_matrix_are_scipys_of_the_passive_rotation():
    p = np.empty(3)
    for R in turns():
        mrp_from_matrix(R, p)
        np.testing.assert_allclose(p, passive(R), atol=1e-9)
        assert np.linalg.norm(p) <= 1.0


def test_half_a_turn_about_any_axis_has_parameters_of_length_one():
    p, R = np.empty(3), np.empty((3, 3))
    for axis in AXES:
        mrp_from_matrix(2.0 * np.outer(axis, axis) - np.eye(3), p)
        assert np.linalg.norm(p) == pytest.approx(1.0)
        assert abs(p @ axis) == pytest.approx(1.0)
        matrix_from_mrp(p, R)
        np.testing.assert_allclose(R, 2.0 * np.outer(axis, axis) - np.eye(3), atol=1e-12)


def test_the_matrix_is_that_of_the_parameters_and_of_their_shadow():
    C = np.empty((3, 3))
    for R in turns():
        p = passive(R)
        for same in (p, -p / (p @ p)) if p @ p > 1e-6 else (p,):
            matrix_from_mrp(same, C)
            np.testing.assert_allclose(C, R, atol=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_product_is_that_of_the_matrices(sign):
    """The second one inverted where its sign is less than zero."""
    product = np.empty(3)
    for R in turns():
        for S in turns()[::5]:
            mrp_product(passive(R), passive(S), sign, product)
            both = Rotation.from_mrp(product).as_matrix().T
            np.testing.assert_allclose(both, R @ (S if sign > 0.0 else S.T), atol=1e-8)
            assert np.linalg.norm(product) <= 1.0 + 1e-12


def test_the_rate_matrix_says_how_the_parameters_go_with_a_small_turn():
    """p' = B w / 4 of passive parameters; the other sign is the transposed, of a turn that acts on the other side."""
    B, step = np.empty((3, 3)), 1e-6
    for p in (np.zeros(3), np.array([0.1, -0.3, 0.2]), np.array([-0.5, 0.4, 0.3])):
        R = Rotation.from_mrp(p).as_matrix().T
        for sign, turned in ((1.0, lambda w, R=R: exp(w).T @ R), (-1.0, lambda w, R=R: R @ exp(w).T)):
            mrp_rate(p, sign, B)
            ends = [[passive(turned(s * step * e)) for e in np.eye(3)] for s in (1.0, -1.0)]
            np.testing.assert_allclose((np.array(ends[0]) - ends[1]).T / (2.0 * step), 0.25 * B, atol=1e-8)
