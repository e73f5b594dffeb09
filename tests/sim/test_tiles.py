"""Surfaces cut into tiles: they cover what they are of, lie on it, and curve as it does."""

import mujoco
import numpy as np
import pytest

from dockair.sim.camera.mirrors import Mirrors
from dockair.sim.camera.tiles import EDGE_COS, ellipsoid_tiles, face, triangle_tile
from mirror_scenes import EYE, metal_body, scene_of

FLAT = np.array([2.9, 11.3, 0.33])  # half-axes of a wing


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_tiles_of_a_boxs_face_cover_it_once_and_look_outward(axis: int, side: float) -> None:
    """Every one of 4000 random points of the face is in one tile; none is longer than half a metre."""
    half = np.array([0.4, 0.9, 0.7])
    tiles = face(half, axis, side)
    p = np.random.default_rng(1).uniform(-1.0, 1.0, (4000, 3)) * half
    p[:, axis] = side * half[axis]
    inside = np.zeros(len(p), dtype=int)
    for frame, sides, curvature in tiles:
        assert frame[1] @ frame[0] == pytest.approx(half[axis], abs=1e-12)
        np.testing.assert_allclose(frame[1:] @ frame[1:].T, np.eye(3), atol=1e-12)
        assert 0.25 / 2.0 < min(sides) and max(sides) <= 0.25 and curvature == (0.0, 0.0, 0.0)
        off = (p - frame[0]) @ frame[1:].T
        inside += (np.abs(off) <= [1e-12, *sides]).all(axis=1)
    assert (inside == 1).all()


@pytest.mark.parametrize(("width_m", "count"), [(0.019, 0), (0.021, 1)])
def test_a_face_narrower_than_two_centimetres_is_an_edge(width_m: float, count: int) -> None:
    for half in (np.array([0.2, 0.5 * width_m, 0.2]), np.array([0.2, 0.2, 0.5 * width_m])):
        assert len(face(half, 0, 1.0)) == count


@pytest.mark.parametrize(("thickness", "is_flat"), [(1.01, False), (0.99, True)])
def test_an_ellipsoid_more_than_ten_times_as_long_as_thick_is_cut_and_keeps_a_ball_for_its_edge(
    thickness: float, is_flat: bool
) -> None:
    """The ball leaves out what the tiles show: normals within 0.4 rad of the thin axis."""
    model, _ = scene_of(metal_body(mujoco.mjtGeom.mjGEOM_ELLIPSOID, EYE, [10.0, thickness, 4.0]))
    mirrors = Mirrors.of(model)
    assert len(mirrors.balls.geom) == 1 and mirrors.balls.thin[0] == 1
    assert (len(mirrors.facets.geom) > 0) == is_flat
    assert mirrors.balls.most_cos[0] == (np.cos(0.4) if is_flat else 2.0)
    assert (np.abs(mirrors.facets.frame[:, 1, 1]) >= np.cos(0.4)).all()


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
def test_tiles_of_a_flat_ellipsoid_lie_on_it_with_its_normal_and_its_curvatures(order: tuple[int, int, int]) -> None:
    """Gaussian and mean curvature from the level set sum x_k^2/a_k^2 = 1, with q = sum x_k^2/a_k^4.

    K = 1/(a b c q)^2,    H = (a^2 + b^2 + c^2 - |x|^2)/(2 (a b c)^2 q^(3/2))
    """
    a = FLAT[list(order)]
    tiles = ellipsoid_tiles(a)
    assert len(tiles) > 100
    for frame, _, (c_11, c_12, c_22) in tiles:
        p = frame[0]
        assert np.sum((p / a) ** 2) == pytest.approx(1.0, abs=1e-12)
        normal = p / a**2
        q = normal @ normal
        np.testing.assert_allclose(frame[1], normal / np.sqrt(q), atol=1e-12)
        np.testing.assert_allclose(frame[1:] @ frame[1:].T, np.eye(3), atol=1e-12)
        assert c_11 * c_22 - c_12**2 == pytest.approx(1.0 / (np.prod(a) ** 2 * q**2), rel=1e-9)
        mean = (a @ a - p @ p) / (2.0 * np.prod(a) ** 2 * q**1.5)
        assert 0.5 * (c_11 + c_22) == pytest.approx(mean, rel=1e-9)


def test_tiles_of_a_flat_ellipsoid_have_the_area_of_its_two_flat_sides() -> None:
    """Those parts whose normals stand within 0.4 rad of the thin axis, by 400 000 random points; to 3 %."""
    q = np.random.default_rng(2).normal(size=(400_000, 3))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    gradient = q / FLAT
    length = np.linalg.norm(gradient, axis=1)
    is_flat = np.abs(gradient[:, 2]) > EDGE_COS * length
    area = 4.0 * np.pi * np.prod(FLAT) * (length * is_flat).mean()
    assert sum(4.0 * half[0] * half[1] for _, half, _ in ellipsoid_tiles(FLAT)) == pytest.approx(area, rel=0.03)


@pytest.mark.parametrize(("base", "height"), [(4.0, 1.0), (0.5, 3.0)])
def test_a_triangle_counts_as_the_rectangle_of_its_area_and_its_ratio_of_inertias(base: float, height: float) -> None:
    """Isosceles: variance b^2/24 along the base and h^2/18 across, of a rectangle side^2/12; the longer side first."""
    corners = np.array([[-0.5 * base, 0.0, 2.0], [0.5 * base, 0.0, 2.0], [0.0, height, 2.0]])
    frame, half, curvature = triangle_tile(corners, np.tile([0.0, 0.0, 1.0], (3, 1)))
    ratio = base / np.sqrt(24.0) / (height / np.sqrt(18.0))
    assert 4.0 * half[0] * half[1] == pytest.approx(0.5 * base * height)
    assert half[0] / half[1] == pytest.approx(max(ratio, 1.0 / ratio))
    assert abs(frame[2, 0 if ratio > 1.0 else 1]) == pytest.approx(1.0)
    np.testing.assert_allclose(frame[:2], [[0.0, height / 3.0, 2.0], [0.0, 0.0, 1.0]], atol=1e-12)
    assert curvature == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
