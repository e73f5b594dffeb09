"""Kernels on single vectors, against NumPy."""

import numpy as np

from dockair.vectors import cross


def test_cross_is_the_right_handed_one():
    np.testing.assert_array_equal(cross(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])), [0.0, 0.0, 1.0])
    a, b = np.random.default_rng(2).normal(size=(2, 3))
    np.testing.assert_allclose(cross(a, b), np.cross(a, b), rtol=1e-12)
