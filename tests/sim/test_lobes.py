"""How bright mirrors are: their light over all directions, rays on random facets, Fresnel, roughness. No OpenGL."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.stats import norm, truncnorm

from dockair.rotations import exp
from dockair.sim.camera.glints import glint_rows
from dockair.sim.camera.lobes import _strip
from dockair.sim.camera.mirrors import Mirrors
from mirror_scenes import EYE, IDEAL, LIGHT, POINT_SUN, SHEET, glints_in, metal_body, metal_sphere, scene_of, unit

# --------------------------------------------------------------------------------------------------- energy, rays

_G = mujoco.mjtGeom


def test_a_spheres_light_over_all_directions_is_the_light_it_catches() -> None:
    """Far away A = r^2/4 in every direction: over the sphere pi r^2, the light on its disc."""
    r, d = 0.3, 3e3
    for sun in (unit(-1, 0.1, 0), unit(-0.2, 0.5, 1.0), unit(0.6, 0, 0.8)):
        area = glints_in(scene_of(metal_sphere([d, 0.0, 0.0], r)), sun).area_m2_sr.sum()
        assert 4.0 * np.pi * area == pytest.approx(np.pi * r**2, rel=1e-3)


@pytest.mark.parametrize("roughness", [0.02, 0.08])
def test_a_cylinders_light_over_all_directions_is_the_light_that_falls_on_its_side(roughness: float) -> None:
    """2 r L sin(angle between Sun and axis); with h half-way, d(directions seen) is 4 (h.s) d(directions of h)."""
    radius, half, sun = 0.4, 1.5, unit(0.0, 0.8, 0.6)
    world = scene_of(metal_body(_G.mjGEOM_CYLINDER, EYE, [radius, half, 0.0]))
    surfaces = replace(IDEAL, metal_roughness_rad=roughness, patch_step_rad=1.0)
    azimuth = (np.arange(60) + 0.5) * np.pi / 60  # from -x over the lit side +y to +x
    out_of_plane = np.linspace(-4.5 * roughness, 4.5 * roughness, 25)
    total = 0.0
    for f in azimuth:
        for e in out_of_plane:
            h = np.array([np.cos(e) * np.cos(f), np.cos(e) * np.sin(f), np.sin(e)])
            v = 2.0 * (h @ sun) * h - sun
            area = glints_in(world, sun, surfaces, eye=2e3 * v).area_m2_sr.sum()
            total += area * 4.0 * (h @ sun) * np.cos(e)
    total *= (azimuth[1] - azimuth[0]) * (out_of_plane[1] - out_of_plane[0])
    assert total == pytest.approx(2.0 * radius * 2.0 * half * np.hypot(sun[0], sun[1]), rel=0.01)


def test_a_flat_faces_light_over_all_directions_is_the_light_that_falls_on_it() -> None:
    half, sun, roughness = [0.02, 0.9, 0.6], unit(-1.0, 0.4, 0.3), 0.05
    world = scene_of(metal_body(_G.mjGEOM_BOX, EYE, half))
    surfaces = replace(IDEAL, metal_roughness_rad=roughness)
    steps = np.linspace(-4.5, 4.5, 21) * roughness
    total = 0.0
    for a in steps:
        for b in steps:
            h = unit(-1.0, a, b)
            v = 2.0 * (h @ sun) * h - sun
            total += glints_in(world, sun, surfaces, eye=2e3 * v).area_m2_sr.sum() * 4.0 * (h @ sun) * abs(h[0]) ** 3
    total *= (steps[1] - steps[0]) ** 2
    assert total == pytest.approx(4.0 * half[1] * half[2] * abs(sun[0]), rel=0.01)


@pytest.mark.parametrize("off", [0.0, 0.1, 0.25])
def test_a_small_rough_face_shows_beckmanns_share_of_facets(off: float) -> None:
    """Far away A = area/4 x exp(-tan^2/(2 s^2))/(2 pi s^2 cos^4) at the angle `off` of face and half-way direction."""
    half, s, h = [0.02, 0.15, 0.1], 0.1, np.array([-np.cos(off), 0.6 * np.sin(off), 0.8 * np.sin(off)])
    sun = unit(-0.9, 0.3, -0.2)
    world = scene_of(metal_body(_G.mjGEOM_BOX, EYE, half))
    v = 2.0 * (h @ sun) * h - sun
    found = glints_in(world, sun, replace(IDEAL, metal_roughness_rad=s), eye=1e3 * v).area_m2_sr.sum()
    density = np.exp(-0.5 * (np.tan(off) / s) ** 2) / (2.0 * np.pi * s**2 * np.cos(off) ** 4)
    assert found == pytest.approx(0.25 * 4.0 * half[1] * half[2] * density, rel=2e-3)


@pytest.mark.parametrize("off", [0.1, 0.25])
def test_a_flat_end_of_a_cylinder_shows_its_own_areas_share_of_facets(off: float) -> None:
    """As a face does, by pi r^2."""
    radius, s, h = 0.1, 0.1, np.array([-np.cos(off), 0.6 * np.sin(off), 0.8 * np.sin(off)])
    sun, upright = unit(-0.9, 0.3, -0.2), exp(np.array([0.0, 0.5 * np.pi, 0.0]))
    world = scene_of(metal_body(_G.mjGEOM_CYLINDER, EYE, [radius, 0.02, 0.0], upright))
    v = 2.0 * (h @ sun) * h - sun
    found = glints_in(world, sun, replace(IDEAL, metal_roughness_rad=s), eye=1e3 * v).area_m2_sr.sum()
    density = np.exp(-0.5 * (np.tan(off) / s) ** 2) / (2.0 * np.pi * s**2 * np.cos(off) ** 4)
    assert found == pytest.approx(0.25 * np.pi * radius**2 * density, rel=2e-3)


def test_a_large_plane_mirror_shows_the_whole_sun() -> None:
    """A = d^2: the mirror takes nothing away and adds nothing."""
    d, n = 6.0, unit(-1.0, 0.3, 0.2)
    R = exp(np.array([0.0, 0.4, 0.0]))
    n = -R[:, 0]
    sun = 2.0 * (n @ [-1.0, 0.0, 0.0]) * n + np.array([1.0, 0.0, 0.0])
    world = scene_of(metal_body(_G.mjGEOM_BOX, np.array([d, 0.0, 0.0]) - 0.05 * n, [0.05, 1.0, 1.0], R))
    glints = glints_in(world, sun, light=LIGHT)
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
        e = unit(*(size * toward))
        e1 = unit(*np.cross(e, [0.31, 0.52, 0.79]))
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
    """Irradiance at the eye over the Sun's, and its standard error: sunlight on random facets, rays that come by."""
    rng, radius = np.random.default_rng(8), 0.04 * float(np.linalg.norm(centre))
    toward = unit(*(sun - unit(*centre))) @ R
    p, n, area = _points(kind, np.array(size), toward, cap, 600_000, rng)
    p, n = p @ R.T + centre, n @ R.T
    t1 = np.cross(n, unit(0.31, 0.52, 0.79))
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
    "engine": (_G.mjGEOM_ELLIPSOID, [2.3, 1.0, 1.0], [9.0, 1.0, 3.0], [0.3, 0.2, -0.1], 0.45, (-0.9, 0.2, -0.2)),
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
    n, v = R @ unit(*normal), -unit(*at)
    sun = 2.0 * (n @ v) * n - v
    expected, error = _rays_into_a_disc(kind, size, R, centre, sun, cap)
    surfaces = replace(IDEAL, metal_roughness_rad=_ROUGH)
    glints = glints_in(scene_of(metal_body(kind, centre, size, R)), sun, surfaces)
    found = (glints.area_m2_sr / (glints.p_W**2).sum(axis=1)).sum()
    assert 0.0 < error < 0.06 * expected
    assert found == pytest.approx(expected, abs=4.0 * error + 0.03 * expected)


# ------------------------------------------------------------------------------------- reflectance, size, roughness


def _painted_sphere_share(cos_incidence: float) -> float:
    """R from a far sphere's A = R r^2/4, the Sun at twice the incidence from the line of sight."""
    i = np.arccos(cos_incidence)
    sun = np.array([-np.cos(2.0 * i), np.sin(2.0 * i), 0.0])
    world = scene_of(metal_sphere([5e3, 0.0, 0.0], 0.5, name="tanker_under_test"))
    return float(glints_in(world, sun, replace(IDEAL, paint_share=1.0)).area_m2_sr.sum() / (0.25 * 0.5**2))


def test_paint_mirrors_by_fresnels_law_of_a_dielectric() -> None:
    """4 % at normal incidence; half of what is polarised across the plane at Brewster's angle; all of it grazing."""
    n = SHEET.refractive_index
    assert _painted_sphere_share(1.0 - 1e-9) == pytest.approx(((n - 1.0) / (n + 1.0)) ** 2, rel=1e-3)
    brewster = np.cos(np.arctan(n))
    assert _painted_sphere_share(brewster) == pytest.approx(0.5 * ((n**2 - 1.0) / (n**2 + 1.0)) ** 2, rel=1e-3)
    assert _painted_sphere_share(np.cos(1.56)) > 0.9


@pytest.mark.parametrize(("cos_incidence", "reflected"), [(1.0, 0.6), (0.5, 0.6125), (0.2, 0.731072)])
def test_metal_mirrors_by_schlicks_law(cos_incidence: float, reflected: float) -> None:
    """0.6 + 0.4 (1 - cos)^5."""
    i = np.arccos(cos_incidence - 1e-9)
    sun, metal = np.array([-np.cos(2.0 * i), np.sin(2.0 * i), 0.0]), replace(IDEAL, metal_reflectance=0.6)
    area = glints_in(scene_of(metal_sphere([5e3, 0.0, 0.0], 0.5)), sun, metal).area_m2_sr.sum()
    assert area == pytest.approx(0.25 * 0.5**2 * reflected, rel=1e-3)


@pytest.mark.parametrize(
    ("geom", "share"),
    [
        ("tanker_x", "paint_share"),
        ("basket_rib_3", "metal_share"),
        ("hose_4", "rubber_share"),
        ("skin_canopy", "glass_share"),
    ],
)
def test_a_glint_is_as_bright_as_its_materials_share(geom: str, share: str) -> None:
    world, sun = scene_of(metal_sphere([20.0, 0.0, 0.0], 0.5, name=geom)), unit(-1, 0, 1)
    bright, dim = (glints_in(world, sun, replace(IDEAL, **{share: value})).area_m2_sr.sum() for value in (1.0, 0.25))
    assert dim == pytest.approx(0.25 * bright, rel=1e-12)


@pytest.mark.parametrize("geom", ["tanker_x", "basket_rib_3", "hose_4", "skin_canopy"])
def test_a_balls_glint_is_as_wide_as_its_own_materials_slopes_make_it(geom: str) -> None:
    """A square of twelve times the variance, (r s)^2 a direction; each of the four materials as rough as no other."""
    rough = {"tanker_x": 0.01, "basket_rib_3": 0.015, "hose_4": 0.02, "skin_canopy": 0.025}
    names = ("paint_roughness_rad", "metal_roughness_rad", "rubber_roughness_rad", "glass_roughness_rad")
    surfaces = replace(IDEAL, **dict(zip(names, rough.values(), strict=True)))
    glints = glints_in(scene_of(metal_sphere([30.0, 0.0, 0.0], 0.5, name=geom)), unit(-1, 0, 1), surfaces)
    assert glints.size_m[0] == pytest.approx(np.sqrt(12.0) * 0.5 * rough[geom], rel=0.05)


def test_the_suns_image_in_a_ball_is_its_angle_times_half_the_radius() -> None:
    """A disc of half-width a r/2, variance (a r/2)^2/4 a direction; a square of that variance has twelve times it."""
    r, a = 0.4, LIGHT.sun_angular_radius_rad
    glints = glints_in(scene_of(metal_sphere([4e3, 0.0, 0.0], r)), unit(-1, 0.01, 0), light=LIGHT)
    assert glints.size_m[0] == pytest.approx(np.sqrt(12.0) * 0.25 * a * r, rel=1e-3)


def test_the_suns_image_in_a_ball_is_wider_across_the_plane_of_a_slanting_reflection() -> None:
    """The normal turns by half the Sun's angle in the plane of incidence i, by 1/(2 cos i) of it across."""
    r, a = 0.4, LIGHT.sun_angular_radius_rad
    glints = glints_in(scene_of(metal_sphere([4e3, 0.0, 0.0], r)), unit(0.0, 1.0, 0.0), light=LIGHT)
    variances = np.array([0.5 * r * a, 0.5 * r * a / np.cos(np.pi / 4)]) ** 2 / 4.0
    assert glints.size_m[0] == pytest.approx(np.sqrt(12.0 * variances.mean()), rel=1e-3)


@pytest.mark.parametrize(
    ("low", "high"),
    [(-0.3, 1.9), (0.8, 1.1), (-2.0, -0.9), (1.2, 30.0), (0.69, 0.6902), (-2.4, 3.2), (3.6, 3.9), (-9.0, -3.0)],
)
def test_a_strip_of_a_normal_law_has_its_part_mean_and_variance(low: float, high: float) -> None:
    mean, sd = 0.4, 0.7
    a, b = (low - mean) / sd, (high - mean) / sd
    cut = truncnorm(a, b, mean, sd)
    expected = (norm.cdf(b) - norm.cdf(a), cut.mean(), cut.var())
    assert _strip(low, high, mean, sd) == pytest.approx(expected, rel=1e-5)


def test_roughness_widens_a_balls_glint_and_leaves_its_light() -> None:
    world, sun = scene_of(metal_sphere([30.0, 0.0, 0.0], 0.5)), unit(-1, 0, 1)
    smooth, rough = (glints_in(world, sun, replace(IDEAL, metal_roughness_rad=s)) for s in (1e-4, 0.02))
    assert rough.area_m2_sr.sum() == pytest.approx(smooth.area_m2_sr.sum(), rel=1e-9)
    assert rough.size_m[0] == pytest.approx(np.sqrt(12.0) * 0.5 * 0.02, rel=0.05)
    assert smooth.size_m[0] < 0.01 * rough.size_m[0]


def test_a_streak_on_a_tube_is_a_row_of_points_with_the_light_of_one() -> None:
    world = scene_of(metal_body(_G.mjGEOM_CYLINDER, np.array([6.0, 0.0, 0.0]), [0.03, 0.6, 0.0]))
    rough = replace(IDEAL, metal_roughness_rad=0.05)
    sun = unit(-1.0, 0.4, 0.02)
    row, one = (glints_in(world, sun, replace(rough, patch_step_rad=step)) for step in (1e-3, 1.0))
    assert len(one.p_W) == 1 and len(row.p_W) == 48  # the most: the streak is as long as 200 steps
    assert row.area_m2_sr.sum() == pytest.approx(one.area_m2_sr[0], rel=1e-9)
    middle = row.area_m2_sr @ row.p_W / row.area_m2_sr.sum()
    np.testing.assert_allclose(middle, one.p_W[0], atol=1e-6)
    spacing = np.diff(row.p_W[:, 2])
    assert np.all(spacing > 0.02) and np.all(row.size_m < 0.02)
    # a square along the streak has the variance of the thin piece that it stands for
    assert np.median(row.size_m) == pytest.approx(np.median(spacing) / np.sqrt(2.0), rel=0.1)


def test_the_pieces_of_a_streak_lie_on_the_ellipsoid_they_are_of_and_have_its_light() -> None:
    axes, centre = np.array([10.4, 1.7, 1.5]), np.array([16.0, 2.0, 6.0])
    n, v = unit(-0.1, 0.2, -1.0), -unit(*centre)
    rough = replace(IDEAL, metal_roughness_rad=0.03)
    world, sun = scene_of(metal_body(_G.mjGEOM_ELLIPSOID, centre, list(axes))), 2.0 * (n @ v) * n - v
    glints, one = glints_in(world, sun, rough), glints_in(world, sun, replace(rough, patch_step_rad=1.0))
    assert len(glints.p_W) >= 8 and len(one.p_W) == 1
    assert glints.area_m2_sr.sum() == pytest.approx(one.area_m2_sr[0], rel=1e-9)  # the ends have what lies beyond them
    assert np.ptp(glints.p_W[:, 0]) > 2.0
    radius = np.sqrt((((glints.p_W - centre) / axes) ** 2).sum(axis=1))
    np.testing.assert_allclose(radius, 1.0, atol=4e-3)
    rows = glint_rows(world[1], Mirrors.of(world[0]), EYE, sun, rough, POINT_SUN)
    outward = (rows[:, :3] - centre) / axes**2
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    np.testing.assert_allclose(rows[:, 3:6], outward, atol=0.02)


@pytest.mark.parametrize("turn", [0.4, 1.1])
def test_a_faces_glint_is_as_bright_and_wide_however_the_face_is_turned_in_its_plane(turn: float) -> None:
    """A slanting one, far inside the edges; its rows say which geom it is of, the fourth."""
    dull = [metal_sphere([5.0, 9.0, 0.0], 0.1, name=f"hose_{k}") for k in range(3)]
    surfaces, found = replace(IDEAL, metal_roughness_rad=0.003), []
    for R in (np.eye(3), exp(np.array([turn, 0.0, 0.0]))):
        model, data = scene_of(*dull, metal_body(_G.mjGEOM_BOX, np.array([1.02, 0.0, 0.0]), [0.02, 0.14, 0.14], R))
        rows = glint_rows(data, Mirrors.of(model), np.array([0.0, -0.5, -0.9]), unit(-1.0, 0.5, 0.9), surfaces, LIGHT)
        found.append(rows[rows[:, 10] == 3.0])
    assert [len(rows) for rows in found] == [1, 1]
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=1e-3, atol=1e-3)
    assert found[1][0, 7] == pytest.approx(found[0][0, 7], rel=1e-4)


@pytest.mark.parametrize(("share", "count"), [(0.99, 1), (1.01, 0)])
@pytest.mark.parametrize("sun", [unit(-1, 0.01, 0), unit(0, 0.6, 0.8), unit(-0.3, 0.5, -0.6)])
def test_a_smooth_balls_highlight_is_as_bright_as_the_sun_however_it_slants(
    sun: np.ndarray, share: float, count: int
) -> None:
    """Mean R/(8 v.n sqrt(det S)), sqrt(det S) = (a^2/16)/cos i, v.n = cos i: 2/a^2 of a white surface in sunlight."""
    limit = replace(IDEAL, faintest_radiance=share * 2.0 / LIGHT.sun_angular_radius_rad**2)
    assert len(glints_in(scene_of(metal_sphere([3e3, 0.0, 0.0], 0.5)), sun, limit, light=LIGHT).p_W) == count


@pytest.mark.parametrize(("beyond_rad", "count"), [(-0.01, 0), (0.01, 1)])
@pytest.mark.parametrize("incidence", [0.9, 1.3])
def test_light_that_grazes_a_surface_beyond_the_limit_makes_no_glint(
    incidence: float, beyond_rad: float, count: int
) -> None:
    sun = np.array([-np.cos(2.0 * incidence), np.sin(2.0 * incidence), 0.0])
    limit = replace(IDEAL, grazing_rad=incidence + beyond_rad)
    assert len(glints_in(scene_of(metal_sphere([3e3, 0.0, 0.0], 0.5)), sun, limit).p_W) == count


def test_a_highlight_darker_than_the_limit_is_left_out() -> None:
    """A rough patch is R/(8 sigma^2 v.n) as bright as a white surface: 1/(8 x 0.05^2) = 50 at normal incidence."""
    world, sun = scene_of(metal_sphere([30.0, 0.0, 0.0], 0.5)), unit(-1, 0, 0.001)
    rough = replace(IDEAL, metal_roughness_rad=0.05)
    assert len(glints_in(world, sun, replace(rough, faintest_radiance=49.5)).p_W) == 1
    assert len(glints_in(world, sun, replace(rough, faintest_radiance=50.5)).p_W) == 0


@pytest.mark.parametrize(("share", "count"), [(0.99, 1), (1.01, 0)])
def test_a_slanting_highlight_is_brighter_by_the_cosine_at_which_it_is_seen(share: float, count: int) -> None:
    """1/(8 x 0.05^2 cos 45 degrees) = 70.7."""
    world, sun = scene_of(metal_sphere([3e3, 0.0, 0.0], 0.5)), unit(0, 1, 0)
    limit = replace(IDEAL, metal_roughness_rad=0.05, faintest_radiance=share * 50.0 * np.sqrt(2.0))
    assert len(glints_in(world, sun, limit).p_W) == count


@pytest.mark.parametrize(("share", "count"), [(0.99, 1), (1.01, 0)])
@pytest.mark.parametrize("off", [0.1, 0.25])
def test_a_small_face_is_as_bright_as_the_facets_that_lean_so_far(off: float, share: float, count: int) -> None:
    """exp(-tan^2/(2 s^2))/(8 s^2 cos^4 v.n), at the angle `off` of face and half-way direction."""
    s, h = 0.1, np.array([-np.cos(off), 0.6 * np.sin(off), 0.8 * np.sin(off)])
    sun = unit(-0.9, 0.3, -0.2)
    v = 2.0 * (h @ sun) * h - sun
    radiance = np.exp(-0.5 * (np.tan(off) / s) ** 2) / (8.0 * s**2 * np.cos(off) ** 4 * -v[0])
    world = scene_of(metal_body(_G.mjGEOM_BOX, EYE, [0.02, 0.15, 0.1]))
    limit = replace(IDEAL, metal_roughness_rad=s, faintest_radiance=share * radiance)
    assert len(glints_in(world, sun, limit, eye=1e3 * v).p_W) == count


def test_a_glint_weaker_than_the_limit_is_left_out() -> None:
    world, sun = scene_of(metal_sphere([3e3, 0.0, 0.0], 0.2)), unit(-1, 0, 1)
    assert len(glints_in(world, sun, replace(IDEAL, faintest_glint_m2_sr=0.99 * 0.01)).p_W) == 1
    assert len(glints_in(world, sun, replace(IDEAL, faintest_glint_m2_sr=1.01 * 0.01)).p_W) == 0
