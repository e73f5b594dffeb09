"""Kernels on single vectors and matrices, against NumPy."""

import numpy as np
import pytest

from dockair.vectors import cross, is_finite, largest_sigma


def test_cross_is_the_right_handed_one():
    np.testing.assert_array_equal(cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])), [0.0, 0.0, 1.0])
    a, b = np.random.default_rng(2).normal(size=(2, 3))
    np.testing.assert_allclose(cross(a, b), np.cross(a, b), rtol=1e-12)


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf])
def test_an_array_with_one_number_that_is_none_is_not_finite(odd):
    for shape in ((3,), (9, 9)):
        a = np.ones(shape)
        assert is_finite(a)
        assert is_finite(a.T)
        a.flat[-1] = odd
        assert not is_finite(a)


def test_the_worst_direction_of_a_pair_is_the_larger_root_of_its_covariance():
    rng = np.random.default_rng(5)
    for _ in range(20):
        root = rng.normal(size=(2, 2))
        P = root @ root.T
        assert largest_sigma(P) == pytest.approx(np.sqrt(np.linalg.eigvalsh(P)[-1]), rel=1e-12)
    assert largest_sigma(np.diag([1.0, 4.0])) == 2.0
    assert np.isnan(largest_sigma(np.full((2, 2), np.nan)))
