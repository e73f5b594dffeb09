"""Vectors as three numbers against numpy's."""

import numpy as np
import pytest

from dockair.triples import cross, dot, plus, tangents, turned, turned_back, unit

RNG = np.random.default_rng(0)
A, B, C = RNG.standard_normal((3, 100, 3))


def test_sums_and_products_are_numpys():
    for a, b in zip(A, B, strict=True):
        one, other = tuple(a.tolist()), tuple(b.tolist())
        assert dot(one, other) == pytest.approx(a @ b, abs=1e-15)
        np.testing.assert_allclose(cross(one, other), np.cross(a, b), rtol=0, atol=1e-15)
        np.testing.assert_allclose(plus(one, -0.3, other), a - 0.3 * b, rtol=0, atol=1e-15)


def test_a_matrix_by_rows_turns_a_vector_and_its_transpose_turns_it_back():
    for a, b, c in zip(A, B, C, strict=True):
        M = np.stack([a, b, c])
        np.testing.assert_allclose(turned(M.ravel(), tuple(a.tolist())), M @ a, rtol=0, atol=1e-14)
        np.testing.assert_allclose(turned_back(M.ravel(), tuple(a.tolist())), M.T @ a, rtol=0, atol=1e-14)


def test_a_unit_vector_and_its_tangents_are_right_handed_axes():
    for a in [*A, *np.eye(3), *-np.eye(3)]:
        n, length = unit(tuple(a.tolist()))
        axes = np.stack([n, *tangents(n)])
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-14)
        assert np.linalg.det(axes) == pytest.approx(1.0) and length == pytest.approx(np.linalg.norm(a))


def test_of_no_vector_the_unit_vector_is_none():
    assert unit((0.0, 0.0, 0.0)) == ((0.0, 0.0, 0.0), 0.0)
