"""Lofted surfaces: closed, outward, as large as the bodies they stand for."""

import numpy as np
import pytest

from dockair.sim.lofts import Mesh, body, joined, mirrored, surface

CYLINDER = np.array([[2.0, 0.5, 0.5, 0.1, -0.2, 2.0], [0.0, 0.5, 0.5, 0.1, -0.2, 2.0]])
BULGE = np.array([[3.0, 0.1, 0.1, 0.0, 0.0, 2.0], [1.0, 0.6, 0.4, 0.0, 0.1, 2.5], [-2.0, 0.3, 0.5, 0.0, 0.2, 2.0]])
WING = np.array([[0.0, 1.0, 0.0, 2.0, 0.12, 0.0], [-1.0, 5.0, 0.3, 1.0, 0.10, -0.05]])
MESHES = {
    "cylinder": body(CYLINDER, 64),
    "bulge": body(BULGE, 20, 4),
    "wing": surface(WING, 8),
    "right wing": mirrored(surface(WING, 8)),
    "fin": surface(np.array([[0.0, 0.0, 1.0, 2.0, 0.1, 0.0], [-1.0, 0.0, 3.0, 1.0, 0.1, 0.0]]), 5),
}


def _volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices_m[mesh.triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("name", MESHES)
def test_every_edge_lies_between_two_triangles_that_run_along_it_opposite_ways(name: str) -> None:
    """By places, as sharp edges have two corners in one."""
    mesh = MESHES[name]
    _, place = np.unique(np.round(mesh.vertices_m, 9), axis=0, return_inverse=True)
    corners = place.ravel()[mesh.triangles]
    edges = np.vstack([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    edges = edges[edges[:, 0] != edges[:, 1]]
    there, back = (np.unique(e, axis=0, return_counts=True) for e in (edges, edges[:, ::-1]))
    assert np.array_equal(there[0], back[0])
    assert (there[1] == 1).all() and (back[1] == 1).all()


@pytest.mark.parametrize("name", MESHES)
def test_volume_is_positive_and_normals_lean_outward(name: str) -> None:
    mesh = MESHES[name]
    assert _volume(mesh) > 0.01
    a, b, c = (mesh.vertices_m[mesh.triangles[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    assert (np.einsum("ij,ikj->ik", flat, mesh.normals[mesh.triangles]) > 0.0).all()
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)


def test_a_cylinder_has_the_volume_and_normals_of_one() -> None:
    """Inscribed 64-gon: sin(2 pi/64)/(2 pi/64) of the circle."""
    mesh = MESHES["cylinder"]
    polygon = 0.5 * 64 * np.sin(2.0 * np.pi / 64) * 0.25
    assert _volume(mesh) == pytest.approx(2.0 * polygon, rel=1e-9)
    side = mesh.normals[:128]
    outward = (mesh.vertices_m[:128] - [0.0, 0.1, -0.2]) * [0.0, 2.0, 2.0]
    np.testing.assert_allclose(side, outward, atol=1e-9)


def test_a_section_with_a_large_exponent_nears_its_box() -> None:
    """Area of a superellipse of exponent e: 4 a b Gamma(1 + 1/e)^2/Gamma(1 + 2/e); for e = 4, 0.927 of the box."""
    stations = np.array([[1.0, 0.5, 0.3, 0.0, 0.0, 4.0], [0.0, 0.5, 0.3, 0.0, 0.0, 4.0]])
    assert _volume(body(stations, 400)) == pytest.approx(0.92704 * 4.0 * 0.5 * 0.3, rel=2e-3)


def test_between_stations_nothing_bulges_that_the_table_does_not() -> None:
    y = MESHES["bulge"].vertices_m[:, 1]
    assert y.max() <= 0.6 + 1e-12
    widths = body(BULGE, 64, 10).vertices_m.reshape(-1, 3)
    ahead = widths[(widths[:, 0] > 1.0)]
    assert np.abs(ahead[:, 1]).max() <= 0.6 + 1e-12


def test_a_straight_wing_has_the_profiles_volume_and_thickness() -> None:
    """Of the closed four-digit profile: area 0.6811 h c^2, thickest h c at 0.3 c."""
    straight = surface(np.array([[0.0, 0.0, 0.0, 2.0, 0.12, 0.0], [0.0, 3.0, 0.0, 2.0, 0.12, 0.0]]), 200)
    u = np.linspace(0.0, 1.0, 200001)
    half = 5.0 * 0.12 * (0.2969 * np.sqrt(u) - 0.126 * u - 0.3516 * u**2 + 0.2843 * u**3 - 0.1036 * u**4)
    assert _volume(straight) == pytest.approx(2.0 * half.mean() * 2.0**2 * 3.0, rel=1e-3)
    assert np.ptp(straight.vertices_m[:, 2]) == pytest.approx(0.12 * 2.0, rel=2e-3)


def test_twist_lifts_the_nose_over_the_tail() -> None:
    twisted = surface(np.array([[0.0, 0.0, 0.0, 1.0, 0.01, 0.1], [0.0, 1.0, 0.0, 1.0, 0.01, 0.1]]), 6)
    tail = twisted.vertices_m[np.argmin(twisted.vertices_m[:, 0])]
    assert tail[2] == pytest.approx(-np.sin(0.1), abs=1e-3)
    assert tail[0] == pytest.approx(-np.cos(0.1), abs=1e-3)


def test_joining_keeps_every_triangle_where_it_was() -> None:
    one, other = MESHES["bulge"], MESHES["wing"]
    both = joined([one, other])
    assert _volume(both) == pytest.approx(_volume(one) + _volume(other), rel=1e-12)
