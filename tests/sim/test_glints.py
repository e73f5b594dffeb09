"""Glints at true mirror points that nothing hides, in small worlds and in the whole scene. No OpenGL is needed."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dockair.rotations import exp, quaternion_from_matrix
from dockair.sim.camera.glints import find_glints, glint_rows
from dockair.sim.camera.meshes import Meshes
from dockair.sim.camera.mirrors import GLASS, METAL, PAINT, RUBBER, Mirrors, material_of, rim_of
from dockair.sim.camera.solids import VISIBLE_GROUPS
from mirror_scenes import EYE, IDEAL, LIGHT, POINT_SUN, SHEET, glints_in, metal_body, metal_sphere, scene_of, unit


def _mirror_error_rad(p: np.ndarray, n: np.ndarray, sun: np.ndarray, eye: np.ndarray = EYE) -> float:
    """Angle between the Sun and the mirror image of the line of sight: the law of reflection, independently."""
    sight = unit(*(p - eye))
    reflected = sight - 2.0 * (sight @ n) * n
    return float(2.0 * np.arcsin(min(0.5 * np.linalg.norm(reflected - sun), 1.0)))


_G = mujoco.mjtGeom


# ------------------------------------------------------------------------------------------- places and curvatures


@pytest.mark.parametrize("sun", [unit(-1, 0, 1), unit(-0.8, 0.5, 0.2), unit(0.3, -1, 0.4)])
@pytest.mark.parametrize("distance", [1.0, 8.0])
def test_a_spheres_glint_obeys_the_law_of_reflection_near_and_far(sun: np.ndarray, distance: float) -> None:
    centre, radius = distance * np.array([1.0, 0.12, -0.06]), 0.6
    glints = glints_in(scene_of(metal_sphere(list(centre), radius)), sun)
    assert glints.p_W.shape == (1, 3)
    n = (glints.p_W[0] - centre) / radius
    assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-6)
    assert _mirror_error_rad(glints.p_W[0], n, sun) < 1e-5


@pytest.mark.parametrize("axes", [[2.0, 0.5, 0.8], [10.4, 1.7, 1.5], [0.3, 0.3, 0.2]])
def test_an_ellipsoids_glint_obeys_the_law_of_reflection_however_near(axes: list[float]) -> None:
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(30):
        R, sun = exp(rng.normal(size=3)), unit(*rng.normal(size=3))
        centre = R @ (np.array(axes) * unit(*rng.normal(size=3)) * rng.uniform(1.5, 6.0))
        glints = glints_in(scene_of(metal_body(_G.mjGEOM_ELLIPSOID, centre, axes, R)), sun)
        if len(glints.p_W) == 0:
            continue
        # pieces of one streak: their common middle is the mirror point to first order; of a smooth body all coincide
        local = (glints.p_W[0] - centre) @ R
        assert ((local / axes) ** 2).sum() == pytest.approx(1.0, abs=1e-6)
        assert _mirror_error_rad(glints.p_W[0], R @ unit(*(local / np.square(axes))), sun) < 1e-4
        found += 1
    assert found > 10


def test_far_away_an_ellipsoids_glint_is_its_gaussian_curvature() -> None:
    """From second differences of the depth under the tangent plane."""
    axes, sun = np.array([2.0, 0.5, 0.8]), unit(-0.6, 0.3, 0.7)
    centre = np.array([9e4, -1e4, 7e3])
    glints = glints_in(scene_of(metal_body(_G.mjGEOM_ELLIPSOID, centre, list(axes))), sun)
    local = glints.p_W[0] - centre
    n = unit(*(local / axes**2))
    e1 = unit(*np.cross(n, [0.0, 0.0, 1.0]))
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
        R, centre, sun = exp(rng.normal(size=3)), rng.normal(size=3) * 4.0, unit(*rng.normal(size=3))
        glints = glints_in(scene_of(metal_body(_G.mjGEOM_CYLINDER, centre, [0.3, 4.0, 0.0], R)), sun)
        for p in glints.p_W:
            local = (p - centre) @ R
            if abs(local[2]) > 4.0 - 1e-3:  # an end, whose disc may glint
                continue
            n = R @ np.array([local[0], local[1], 0.0]) / 0.3
            assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-5)
            assert _mirror_error_rad(p, n, sun) < 1e-3
            found += 1
    assert found > 10


# ------------------------------------------------------------------------------------------------------------ hiding


@pytest.mark.parametrize("sun", [unit(-1.0, 0.3, 0.9), unit(-1.0, 0.3, -0.9), unit(-1.0, 0.5, 0.02)])
def test_a_capsule_mirrors_as_a_tube_with_a_ball_at_either_end(sun: np.ndarray) -> None:
    """Upright, its ends' outer halves alone: where the Sun stands high the upper one, where low the lower one."""
    place, radius, half = np.array([6.0, 0.3, 0.1]), 0.2, 0.7
    capsule = glints_in(scene_of(metal_body(_G.mjGEOM_CAPSULE, place, [radius, half, 0.0])), sun)
    if abs(sun[2]) > 0.1:
        end = metal_sphere(list(place + [0.0, 0.0, np.sign(sun[2]) * half]), radius)
        alone = glints_in(scene_of(end), sun)
    else:
        alone = glints_in(scene_of(metal_body(_G.mjGEOM_CYLINDER, place, [radius, half, 0.0])), sun)
    assert len(alone.p_W) > 0
    np.testing.assert_allclose(capsule.p_W, alone.p_W, atol=1e-9)
    np.testing.assert_allclose(capsule.area_m2_sr, alone.area_m2_sr, rtol=1e-9)


def test_something_in_the_way_of_the_sun_or_of_the_camera_puts_a_glint_out() -> None:
    sun = unit(-0.2, 0.0, 1.0)
    ball = metal_sphere([8.0, 0.0, 0.0], 0.5)
    assert len(glints_in(scene_of(ball), sun).p_W) == 1
    for at in ([7.0, 0.0, 4.0], [4.0, 0.0, 0.2]):
        box = {"type": _G.mjGEOM_ELLIPSOID, "pos": at, "size": [0.5, 1.0, 0.3], "name": "hose_dull"}
        dull = replace(IDEAL, rubber_share=0.0)
        assert len(glints_in(scene_of(ball, box), sun, dull).p_W) == 0
        assert len(glints_in(scene_of(ball, box | {"group": 3}), sun, dull).p_W) == 1


def test_a_body_alone_hides_none_of_its_own_patches() -> None:
    """Large ones, whose middles lie under its surface."""
    centre, n = np.array([16.0, 2.0, 6.0]), unit(-0.1, 0.2, -1.0)
    v, surfaces = -unit(*centre), replace(IDEAL, metal_roughness_rad=0.03)
    sun = 2.0 * (n @ v) * n - v
    model, data = scene_of(metal_body(_G.mjGEOM_ELLIPSOID, centre, [10.4, 1.7, 1.5]))
    rows = glint_rows(data, Mirrors.of(model), EYE, sun, surfaces, POINT_SUN)
    assert len(rows) >= 8
    assert len(glints_in((model, data), sun, surfaces).p_W) == len(rows)


def test_the_sun_behind_a_body_makes_no_glint() -> None:
    assert len(glints_in(scene_of(metal_sphere([8.0, 0.0, 0.0], 0.5)), unit(1.0, 0.0, 0.01)).p_W) == 0


def test_what_is_not_drawn_does_not_glint() -> None:
    sun, ball = unit(-1, 0, 1), metal_sphere([8.0, 0.0, 0.0], 0.5)
    assert len(glints_in(scene_of(ball), sun).p_W) == 1
    assert len(glints_in(scene_of(ball | {"group": 3}), sun).p_W) == 0
    assert len(glints_in(scene_of(ball | {"rgba": [1.0, 1.0, 1.0, 0.0]}), sun).p_W) == 0


@pytest.mark.parametrize("distance", [0.2, 8.0])
def test_what_lies_behind_the_lens_is_left_out_when_its_axis_is_given(distance: float) -> None:
    world, sun = scene_of(metal_sphere([distance, 0.0, 0.0], 0.06 * distance)), unit(-1, 0, 1)
    assert len(glints_in(world, sun, ahead=unit(1, 0, 0)).p_W) == 1
    assert len(glints_in(world, sun, ahead=unit(-1, 0, 0)).p_W) == 0


def test_however_many_tiles_shine_none_is_left_out() -> None:
    """Eight rough walls side by side, each cut into 144 tiles, and a ball before them that comes last in the scene."""
    walls = [
        {"name": f"probe_{k}", "type": _G.mjGEOM_BOX, "pos": [100.0, 6.0 * k - 21.0, 0.0], "size": [0.005, 3.0, 3.0]}
        for k in range(8)
    ]
    ball = metal_sphere([50.0, 0.0, -9.0], 0.5)
    glints = glints_in(scene_of(*walls, ball), unit(-1, 0, 0), replace(IDEAL, metal_roughness_rad=0.15))
    x, y, _ = glints.p_W.T
    assert np.bincount(((y[x > 99.0] + 24.0) // 6.0).astype(int)).tolist() == [144] * 8
    assert (x < 51.0).sum() == 1


def test_materials_go_by_the_names_of_the_scene() -> None:
    names = [
        "tanker_pod",
        "fuselage_nose",
        "basket_rib_0",
        "coupling_body",
        "probe_tip",
        "hose_3",
        "skin_canopy",
        "canopy_7",
    ]
    assert [material_of(n) for n in names] == [PAINT, PAINT, METAL, METAL, METAL, RUBBER, GLASS, PAINT]


# --------------------------------------------------------------------------------------------------- rim, whole scene


def _rim_world(tube: float = 0.008) -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="drogue", pos=[6.0, 0.3, 0.2])
    angle = 2.0 * np.pi * np.arange(24) / 24
    at = 0.25 * np.column_stack([np.zeros(24), np.cos(angle), np.sin(angle)]) + [0.01, 0.0, 0.0]
    for k in range(24):
        ends = [*at[k], *at[(k + 1) % 24]]
        body.add_geom(name=f"basket_rim_{k}", type=_G.mjGEOM_CAPSULE, fromto=ends, size=[tube, 0.0, 0.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_the_rim_is_read_back_from_its_capsules() -> None:
    rim = rim_of(_rim_world()[0])
    assert rim is not None
    assert rim.radius_m == pytest.approx(0.25, abs=1e-9)
    assert rim.tube_radius_m == pytest.approx(0.008)
    assert rim.centre_x_m == pytest.approx(0.01)
    assert rim.skin_m == pytest.approx(0.25 * (1.0 - np.cos(np.pi / 24)) + 1e-3)
    assert rim_of(scene_of(metal_sphere([1.0, 0.0, 0.0], 0.1))[0]) is None


def test_the_rims_torus_goes_through_its_capsules_however_its_body_is_turned() -> None:
    """Ends of the pieces stand on its circle; its axis is the body's x."""
    model, data = _rim_world()
    rim, body = rim_of(model), model.body("drogue")
    body.quat = quaternion_from_matrix(exp(np.array([0.4, -0.9, 0.7])))
    mujoco.mj_forward(model, data)
    assert rim is not None
    centre, axis, radius, tube = (np.array(part) for part in rim.torus_W(data))
    np.testing.assert_allclose(axis, data.body("drogue").xmat[::3], atol=1e-12)
    for side in (1.0, -1.0):
        ends = data.geom_xpos + side * model.geom_size[:, 1:2] * data.geom_xmat[:, 2::3]
        np.testing.assert_allclose((ends - centre) @ axis, 0.0, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(ends - centre, axis=1), radius, atol=1e-12)
    assert tube == pytest.approx(0.008)


@pytest.mark.parametrize("sun", [unit(-0.8, 0.1, 0.6), unit(-0.5, -0.8, -0.3), unit(-0.6, 0.6, 0.1)])
def test_the_rims_two_glints_obey_the_law_of_reflection_on_a_torus(sun: np.ndarray) -> None:
    glints = glints_in(_rim_world(), sun)
    assert len(glints.p_W) == 2
    centre, sides = np.array([6.01, 0.3, 0.2]), set()
    for p, area in zip(glints.p_W, glints.area_m2_sr, strict=True):
        q = p - centre
        ring = 0.25 * q * [0, 1, 1] / np.hypot(q[1], q[2])
        n = (q - ring) / 0.008
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-5)
        assert _mirror_error_rad(p, n, sun) < 1e-5
        cos_phi = float(n @ ring / 0.25)
        sides.add(np.sign(cos_phi))
        # a torus has curvature cos phi/(r (R + r cos phi)); do Carmo, section 3-3, example 6; 6 m away within 10 %
        assert area == pytest.approx(0.25 * 0.008 * (0.25 + 0.008 * cos_phi) / abs(cos_phi), rel=0.1)
    assert sides == {1.0, -1.0}


def test_far_away_the_rims_glints_have_the_toruss_gaussian_curvature() -> None:
    model, data = _rim_world()
    eye, sun = np.array([-4e3, 500.0, 0.0]), unit(-0.8, 0.1, 0.6)
    glints = glints_in((model, data), sun, eye=eye)
    assert len(glints.p_W) == 2
    for p, area in zip(glints.p_W, glints.area_m2_sr, strict=True):
        q = p - [6.01, 0.3, 0.2]
        ring = 0.25 * q * [0, 1, 1] / np.hypot(q[1], q[2])
        cos_phi = float((q - ring) @ ring / 0.25 / 0.008)
        assert area == pytest.approx(0.25 * 0.008 * (0.25 + 0.008 * cos_phi) / abs(cos_phi), rel=1e-3)


def test_a_rim_lit_and_seen_along_its_axis_shows_two_arcs_of_two_radians() -> None:
    """Every point of the ring mirrors: A = arc tube/(4 sqrt(2 pi) slope) while the slopes reach over the arc."""
    rough = replace(IDEAL, metal_roughness_rad=0.1)
    glints = glints_in(_rim_world(), unit(-1, 0, 0), rough, eye=np.array([0.0, 0.3, 0.2]))
    arcs = 2.0 * (2.0 * 0.25)
    assert glints.area_m2_sr.sum() == pytest.approx(arcs * 0.008 / (4.0 * np.sqrt(2.0 * np.pi) * 0.1), rel=0.03)


def _suns(world, p_WC: np.ndarray, rng: np.random.Generator) -> list[np.ndarray]:
    """A hundred of all directions, and 150 that a random triangle of the tanker's skin mirrors to the lens."""
    meshes, toward = Meshes.of(world.model), []
    while len(toward) < 150:
        t = rng.integers(len(meshes.triangles))
        g = meshes.geoms[np.searchsorted(meshes.first_triangle, t, side="right") - 1]
        R, corners = world.data.geom_xmat[g].reshape(3, 3), meshes.triangles[t]
        n = unit(*(R @ meshes.normals[corners].mean(axis=0)))
        sight = unit(*(p_WC - world.data.geom_xpos[g] - R @ meshes.corners_m[corners].mean(axis=0)))
        if n @ sight > 0.05 and world.model.geom(int(g)).name.startswith("tanker"):
            toward.append(2.0 * (n @ sight) * n - sight)
    return [unit(*rng.normal(size=3)) for _ in range(100)] + toward


def test_in_the_scene_the_surface_halves_the_angle_where_it_glints(make_world) -> None:
    """By the normal of MuJoCo's own ray, within three rms slopes, for 97 % of every part's light.

    The rest lies where two bodies meet or at a patch's faint end. The rim is drawn in straight pieces, 7.5 degrees off;
    MuJoCo's rays see a skin's triangles flat, up to half a slice of 22.5 degrees off the round surface.
    """
    world = make_world(p_PD_B=(4.0, 0.0, 0.0))
    p_WC = world.truth.p_WB + world.truth.R_WB @ world.parameters.mounting.p_BC
    mirrors, found = Mirrors.of(world.model), {}
    smooth = {f"{material}_roughness_rad": 0.02 for material in ("paint", "metal", "rubber", "glass")}
    surfaces = replace(SHEET, metal_share=1.0, faintest_radiance=0.2, **smooth)
    for sun in _suns(world, p_WC, np.random.default_rng(2)):
        normal, geom = np.zeros(3), np.zeros(1, dtype=np.int32)
        glints = find_glints(world.model, world.data, mirrors, p_WC, sun, surfaces, LIGHT)
        for p, area in zip(glints.p_W, glints.area_m2_sr, strict=True):
            sight, d = unit(*(p - p_WC)), np.linalg.norm(p - p_WC)
            if mujoco.mj_ray(world.model, world.data, p_WC, sight, VISIBLE_GROUPS, 1, -1, geom, normal) >= 0.0:
                half_way = np.arccos(np.clip(normal @ unit(*(sun - sight)), -1.0, 1.0))
                part = "_".join(world.model.geom(int(geom[0])).name.replace("skin_", "").split("_")[:2])
                found.setdefault(part, []).append((half_way, area / d**2))
    parts = {part: np.array(rows).T for part, rows in found.items()}
    assert np.median(parts["basket_rim"][0]) < 0.15
    flat = {"probe_mast": 0.06, "basket_rib": 0.06, "tanker_wing": 0.06, "tanker_tailplane": 0.06}
    for part, limit in (flat | {"tanker_fuselage": 0.2, "tanker_engine": 0.25}).items():
        half_way, light = parts[part]
        assert len(light) > 50
        assert light[half_way > limit].sum() < 0.03 * light.sum(), part


def test_the_same_world_gives_the_same_glints_to_the_bit(make_world) -> None:
    world, sun = make_world(p_PD_B=(4.0, 0.0, 0.0)), unit(0.5, -0.5, 0.7)
    p_WC = world.truth.p_WB + world.truth.R_WB @ world.parameters.mounting.p_BC
    args = (world.model, world.data, Mirrors.of(world.model), p_WC, sun, SHEET, LIGHT)
    first, second = find_glints(*args), find_glints(*args)
    assert len(first.p_W) > 3
    for name in ("p_W", "area_m2_sr", "size_m"):
        assert np.array_equal(getattr(first, name), getattr(second, name))


def test_with_the_sheets_a_glint_of_the_rim_is_of_an_leds_order() -> None:
    """0.015 W/sr against sunlight of 175 W/m^2 in the band."""
    glints = glints_in(_rim_world(0.02), unit(-0.8, 0.1, 0.6), SHEET, LIGHT)
    assert len(glints.p_W) >= 2
    ratio = glints.area_m2_sr.sum() * 175.0 / 0.015
    assert 0.3 < ratio < 5.0, ratio
