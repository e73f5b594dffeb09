"""Glints at true mirror points, with the light that rays and facets of their own account for. No OpenGL is needed."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import exp, quaternion_from_matrix
from dockair.sim.camera.glints import Glints, find_glints
from dockair.sim.camera.mirrors import GLASS, METAL, PAINT, RUBBER, Mirrors, material_of, rim_of
from dockair.sim.camera.sheets import LightParameters, SurfaceParameters

LIGHT = load_parameters("light", LightParameters)
SHEET = load_parameters("surfaces", SurfaceParameters)
#: Everything counts, and metal mirrors all light at every angle
IDEAL = replace(
    SHEET,
    metal_reflectance=1.0,
    metal_share=1.0,
    grazing_rad=1.57,
    faintest_glint_m2_sr=0.0,
    faintest_radiance=0.0,
    metal_roughness_rad=1e-5,
)
POINT_SUN = replace(LIGHT, sun_angular_radius_rad=1e-6)
EYE = np.zeros(3)
_G = mujoco.mjtGeom
_METAL = "probe_under_test"


def _unit(*v: float) -> np.ndarray:
    return np.array(v) / np.linalg.norm(v)


def _world(*geoms: dict) -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec()
    for geom in geoms:
        spec.worldbody.add_geom(**geom)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _body(kind: mujoco.mjtGeom, at: np.ndarray, size: list[float], R: np.ndarray | None = None) -> dict:
    quat = quaternion_from_matrix(np.eye(3) if R is None else R)
    return {"name": _METAL, "type": kind, "pos": list(at), "size": size, "quat": quat}


def _sphere(at: list[float], radius: float, **more: object) -> dict:
    return {"name": _METAL, "type": _G.mjGEOM_SPHERE, "pos": at, "size": [radius, 0.0, 0.0], **more}


def _glints(
    world: tuple[mujoco.MjModel, mujoco.MjData],
    sun: np.ndarray,
    surfaces: SurfaceParameters = IDEAL,
    light: LightParameters = POINT_SUN,
    eye: np.ndarray = EYE,
    ahead: np.ndarray | None = None,
) -> Glints:
    return find_glints(*world, Mirrors.of(world[0]), eye, sun, surfaces, light, ahead)


def _mirror_error_rad(p: np.ndarray, n: np.ndarray, sun: np.ndarray, eye: np.ndarray = EYE) -> float:
    """Angle between the Sun and the mirror image of the line of sight: the law of reflection, independently."""
    sight = _unit(*(p - eye))
    reflected = sight - 2.0 * (sight @ n) * n
    return float(2.0 * np.arcsin(min(0.5 * np.linalg.norm(reflected - sun), 1.0)))


# ------------------------------------------------------------------------------------------- places and curvatures


@pytest.mark.parametrize("sun", [_unit(-1, 0, 1), _unit(-0.8, 0.5, 0.2), _unit(0.3, -1, 0.4)])
@pytest.mark.parametrize("distance", [1.0, 8.0])
def test_a_spheres_glint_obeys_the_law_of_reflection_near_and_far(sun: np.ndarray, distance: float) -> None:
    centre, radius = distance * np.array([1.0, 0.12, -0.06]), 0.6
    glints = _glints(_world(_sphere(list(centre), radius)), sun)
    assert glints.p_W.shape == (1, 3)
    n = (glints.p_W[0] - centre) / radius
    assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-6)
    assert _mirror_error_rad(glints.p_W[0], n, sun) < 1e-5


@pytest.mark.parametrize("axes", [[2.0, 0.5, 0.8], [10.4, 1.7, 1.5], [0.3, 0.3, 0.2]])
def test_an_ellipsoids_glint_obeys_the_law_of_reflection_however_near(axes: list[float]) -> None:
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(30):
        R, sun = exp(rng.normal(size=3)), _unit(*rng.normal(size=3))
        centre = R @ (np.array(axes) * _unit(*rng.normal(size=3)) * rng.uniform(1.5, 6.0))
        glints = _glints(_world(_body(_G.mjGEOM_ELLIPSOID, centre, axes, R)), sun)
        if len(glints.p_W) == 0:
            continue
        # pieces of one streak: their common middle is the mirror point to first order; of a smooth body all coincide
        local = (glints.p_W[0] - centre) @ R
        assert ((local / axes) ** 2).sum() == pytest.approx(1.0, abs=1e-6)
        assert _mirror_error_rad(glints.p_W[0], R @ _unit(*(local / np.square(axes))), sun) < 1e-4
        found += 1
    assert found > 10


def test_far_away_an_ellipsoids_glint_is_its_gaussian_curvature() -> None:
    """From second differences of the depth under the tangent plane."""
    axes, sun = np.array([2.0, 0.5, 0.8]), _unit(-0.6, 0.3, 0.7)
    centre = np.array([9e4, -1e4, 7e3])
    glints = _glints(_world(_body(_G.mjGEOM_ELLIPSOID, centre, list(axes))), sun)
    local = glints.p_W[0] - centre
    n = _unit(*(local / axes**2))
    e1 = _unit(*np.cross(n, [0.0, 0.0, 1.0]))
    e2 = np.cross(n, e1)
    h = 1e-3

    def depth(a: float, b: float) -> float:
        q = local + a * e1 + b * e2  # drop along n onto the ellipsoid
        A, B, C = ((n / axes) ** 2).sum(), (n * q / axes**2).sum(), ((q / axes) ** 2).sum() - 1.0
        return float((-B + np.sqrt(B * B - A * C)) / A)

    Lxx = (depth(h, 0) - 2 * depth(0, 0) + depth(-h, 0)) / h**2
    Lyy = (depth(0, h) - 2 * depth(0, 0) + depth(0, -h)) / h**2
    Lxy = (depth(h, h) - depth(h, -h) - depth(-h, h) + depth(-h, -h)) / (4 * h**2)
    assert glints.area_m2_sr.sum() == pytest.approx(0.25 / (Lxx * Lyy - Lxy**2), rel=2e-4)


def test_a_tubes_glint_obeys_the_law_of_reflection_and_lies_on_its_side() -> None:
    rng, found = np.random.default_rng(4), 0
    for _ in range(40):
        R, centre, sun = exp(rng.normal(size=3)), rng.normal(size=3) * 4.0, _unit(*rng.normal(size=3))
        glints = _glints(_world(_body(_G.mjGEOM_CYLINDER, centre, [0.3, 4.0, 0.0], R)), sun)
        for p in glints.p_W:
            local = (p - centre) @ R
            if abs(local[2]) > 4.0 - 1e-3:  # an end, whose disc may glint
                continue
            n = R @ np.array([local[0], local[1], 0.0]) / 0.3
            assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-5)
            assert _mirror_error_rad(p, n, sun) < 1e-3
            found += 1
    assert found > 10


# --------------------------------------------------------------------------------------------------- energy, rays


def test_a_spheres_light_over_all_directions_is_the_light_it_catches() -> None:
    """Far away A = r^2/4 in every direction: over the sphere pi r^2, the light on its disc."""
    r, d = 0.3, 3e3
    for sun in (_unit(-1, 0.1, 0), _unit(-0.2, 0.5, 1.0), _unit(0.6, 0, 0.8)):
        area = _glints(_world(_sphere([d, 0.0, 0.0], r)), sun).area_m2_sr.sum()
        assert 4.0 * np.pi * area == pytest.approx(np.pi * r**2, rel=1e-3)


@pytest.mark.parametrize("roughness", [0.02, 0.08])
def test_a_cylinders_light_over_all_directions_is_the_light_that_falls_on_its_side(roughness: float) -> None:
    """2 r L sin(angle between Sun and axis); with h half-way, d(directions seen) is 4 (h.s) d(directions of h)."""
    radius, half, sun = 0.4, 1.5, _unit(0.0, 0.8, 0.6)
    world = _world(_body(_G.mjGEOM_CYLINDER, EYE, [radius, half, 0.0]))
    surfaces = replace(IDEAL, metal_roughness_rad=roughness, patch_step_rad=1.0)
    azimuth = (np.arange(60) + 0.5) * np.pi / 60  # from -x over the lit side +y to +x
    out_of_plane = np.linspace(-4.5 * roughness, 4.5 * roughness, 25)
    total = 0.0
    for f in azimuth:
        for e in out_of_plane:
            h = np.array([np.cos(e) * np.cos(f), np.cos(e) * np.sin(f), np.sin(e)])
            v = 2.0 * (h @ sun) * h - sun
            area = _glints(world, sun, surfaces, eye=2e3 * v).area_m2_sr.sum()
            total += area * 4.0 * (h @ sun) * np.cos(e)
    total *= (azimuth[1] - azimuth[0]) * (out_of_plane[1] - out_of_plane[0])
    assert total == pytest.approx(2.0 * radius * 2.0 * half * np.hypot(sun[0], sun[1]), rel=0.01)


def test_a_flat_faces_light_over_all_directions_is_the_light_that_falls_on_it() -> None:
    half, sun, roughness = [0.02, 0.9, 0.6], _unit(-1.0, 0.4, 0.3), 0.05
    world = _world(_body(_G.mjGEOM_BOX, EYE, half))
    surfaces = replace(IDEAL, metal_roughness_rad=roughness)
    steps = np.linspace(-4.5, 4.5, 21) * roughness
    total = 0.0
    for a in steps:
        for b in steps:
            h = _unit(-1.0, a, b)
            v = 2.0 * (h @ sun) * h - sun
            total += _glints(world, sun, surfaces, eye=2e3 * v).area_m2_sr.sum() * 4.0 * (h @ sun) * abs(h[0]) ** 3
    total *= (steps[1] - steps[0]) ** 2
    assert total == pytest.approx(4.0 * half[1] * half[2] * abs(sun[0]), rel=0.01)


def test_a_large_plane_mirror_shows_the_whole_sun() -> None:
    """A = d^2: the mirror takes nothing away and adds nothing."""
    d, n = 6.0, _unit(-1.0, 0.3, 0.2)
    R = exp(np.array([0.0, 0.4, 0.0]))
    n = -R[:, 0]
    sun = 2.0 * (n @ [-1.0, 0.0, 0.0]) * n + np.array([1.0, 0.0, 0.0])
    world = _world(_body(_G.mjGEOM_BOX, np.array([d, 0.0, 0.0]) - 0.05 * n, [0.05, 1.0, 1.0], R))
    glints = _glints(world, sun, light=LIGHT)
    assert glints.area_m2_sr.sum() == pytest.approx(d**2, rel=0.02)
    middle = (glints.area_m2_sr @ glints.p_W) / glints.area_m2_sr.sum()
    np.testing.assert_allclose(middle, [d, 0.0, 0.0], atol=2e-3)


def _points(
    kind: mujoco.mjtGeom, size: np.ndarray, toward: np.ndarray, cap: float, n: int, rng: np.random.Generator
) -> tuple[np.ndarray, ...]:
    """Random points, normals and the area each stands for, in the body's own axes.

    On ellipsoids only those within an angle `cap`, before stretching, of the point whose normal is `toward`.
    """
    if kind == _G.mjGEOM_ELLIPSOID:
        cos, f = rng.uniform(np.cos(cap), 1.0, n), rng.uniform(0.0, 2.0 * np.pi, n)
        e = _unit(*(size * toward))
        e1 = _unit(*np.cross(e, [0.31, 0.52, 0.79]))
        sin = np.sqrt(1.0 - cos**2)
        q = np.outer(cos, e) + np.outer(sin * np.cos(f), e1) + np.outer(sin * np.sin(f), np.cross(e, e1))
        gradient = np.linalg.norm(q / size, axis=1)
        return q * size, q / size / gradient[:, None], 2.0 * np.pi * (1 - np.cos(cap)) / n * np.prod(size) * gradient
    if kind == _G.mjGEOM_CYLINDER:
        f, z = rng.uniform(0.0, 2.0 * np.pi, n), rng.uniform(-size[1], size[1], n)
        normal = np.column_stack([np.cos(f), np.sin(f), np.zeros(n)])
        return normal * size[0] + np.outer(z, [0, 0, 1]), normal, np.full(n, 4.0 * np.pi * size[0] * size[1] / n)
    p = rng.uniform(-1.0, 1.0, (n, 3)) * size  # the two faces across y
    p[:, 1] = size[1] * rng.choice([-1.0, 1.0], n)
    return p, np.sign(p[:, 1:2]) * [0.0, 1.0, 0.0], np.full(n, 8.0 * size[0] * size[2] / n)


def _rays_into_a_disc(
    kind: mujoco.mjtGeom, size: list[float], R: np.ndarray, centre: np.ndarray, sun: np.ndarray, cap: float
) -> tuple[float, float]:
    """Irradiance at the eye over the Sun's, and its standard error: sunlight on random facets, what comes by counted."""
    rng, radius = np.random.default_rng(8), 0.04 * float(np.linalg.norm(centre))
    toward = _unit(*(sun - _unit(*centre))) @ R
    p, n, area = _points(kind, np.array(size), toward, cap, 600_000, rng)
    p, n = p @ R.T + centre, n @ R.T
    t1 = np.cross(n, _unit(0.31, 0.52, 0.79))
    t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
    slope = _ROUGH * rng.normal(size=(2, len(p), 1))
    facet = n + slope[0] * t1 + slope[1] * np.cross(n, t1)  # as long as the facet is larger than its shadow on n
    caught = area * np.maximum(facet @ sun, 0.0) * (n @ sun > 0.0)
    m = facet / np.linalg.norm(facet, axis=1, keepdims=True)
    out = 2.0 * (m @ sun)[:, None] * m - sun
    ray = EYE - p
    nearest = np.linalg.norm(ray - (ray * out).sum(axis=1)[:, None] * out, axis=1)
    hit = caught * ((nearest < radius) & ((ray * out).sum(axis=1) > 0.0) & ((out * n).sum(axis=1) > 0.0))
    weight = 1.0 / (np.pi * radius**2)
    return float(hit.sum() * weight), float(np.sqrt((hit**2).sum()) * weight)


_ROUGH = 0.05
#: Kind, half sizes, place, turn, part of the body that can glint, normal that would mirror the Sun, in the body's axes
_BRUTE = {
    "engine": (_G.mjGEOM_ELLIPSOID, [2.3, 1.0, 1.0], [9.0, 1.0, 3.0], [0.3, 0.2, -0.1], 0.7, (-0.9, 0.2, -0.2)),
    "tail cone": (_G.mjGEOM_ELLIPSOID, [10.4, 1.7, 1.5], [16.0, 2.0, 6.0], [0.0, 0.05, 0.1], 0.8, (-0.1, 0.2, -1.0)),
    "wing": (_G.mjGEOM_ELLIPSOID, [2.9, 11.3, 0.33], [14.0, 1.0, 5.0], [0.05, 0.4, 0.2], np.pi, (0.02, 0.03, -1.0)),
    "fuselage": (_G.mjGEOM_CYLINDER, [1.9, 10.0, 0.0], [14.0, 2.0, 9.0], [0.0, 1.5, 0.05], 0.0, (0.4, -1.0, 0.06)),
    "fin": (_G.mjGEOM_BOX, [1.5, 0.12, 3.2], [9.0, 9.0, 3.0], [0.1, 0.1, 0.2], 0.0, (-0.06, -1.0, 0.05)),
}


@pytest.mark.parametrize("name", _BRUTE)
def test_a_glints_light_is_that_of_rays_thrown_at_random_facets(name: str) -> None:
    """4 standard errors of the count, and 3 % for the width of the eye's disc and the lobe's linear map."""
    kind, size, at, turn, cap, normal = _BRUTE[name]
    R, centre = exp(np.array(turn)), np.array(at)
    n, v = R @ _unit(*normal), -_unit(*at)
    sun = 2.0 * (n @ v) * n - v
    expected, error = _rays_into_a_disc(kind, size, R, centre, sun, cap)
    surfaces = replace(IDEAL, metal_roughness_rad=_ROUGH)
    glints = _glints(_world(_body(kind, centre, size, R)), sun, surfaces)
    found = (glints.area_m2_sr / (glints.p_W**2).sum(axis=1)).sum()
    assert 0.0 < error < 0.05 * expected
    assert found == pytest.approx(expected, abs=4.0 * error + 0.03 * expected)
