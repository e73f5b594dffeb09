"""What the lens sees as points: against the parts that find them one by one, and the motion against moved bodies."""

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from dockair.rotations import exp
from dockair.sim.camera.glints import find_glints
from dockair.sim.camera.led_reflections import find_led_reflections
from dockair.sim.camera.mirrors import Mirrors
from dockair.sim.camera.point_sources import PointSources, Sources, _as_received
from dockair.sim.camera.radiometry import Responses, extinction_1_m, led_electrons, responses
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.camera.sky import Sky
from dockair.sim.camera.sky_radiance import SkyRadiance
from dockair.sim.camera.solids import VISIBLE_GROUPS
from dockair.sim.camera.sun_view import SunView
from dockair.sim.camera.weather import Weather

SHEETS = CameraSheets.load()
SURFACES = replace(SHEETS.surfaces, metal_share=0.9, faintest_reflection=1e-7)  # so that there is something to find
SUN_W = np.array([-0.7, -0.3, 0.65]) / np.linalg.norm([-0.7, -0.3, 0.65])
EXPOSURE_S = 2e-5
BEAM = 0.5  # what the clouds let through
EXTINCTION_1_M = extinction_1_m(400.0)
LEDS = 8


class _Overcast(Sky):
    """Lets half of the Sun through, wherever one looks."""

    def beam(self, directions_W: np.ndarray) -> np.ndarray:
        return np.full(len(directions_W), BEAM)


def _response(built: Any) -> Responses:
    s = SHEETS
    return responses(s.lens, s.filter, s.sensor, s.leds, s.light, built.camera)


def _sources_of(world: Any, sun: bool = True, seat_m: float = SURFACES.led_seat_m) -> PointSources:
    built, view = world.as_built, None
    if sun:
        sky = _Overcast(SkyRadiance(SHEETS.sky, Weather(), SUN_W, 6000.0, 1))
        view = SunView(world.model, built.camera, sky, SUN_W, SHEETS.light.sun_angular_radius_rad, 3.0)
    sheets = replace(SHEETS, surfaces=replace(SURFACES, led_seat_m=seat_m))
    return PointSources(world.model, sheets, built, _response(built), view, EXTINCTION_1_M)


def _pose(world: Any, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """The lens, from MuJoCo's body and the mounting."""
    body, mounting = data.body("receiver"), world.as_built.mounting
    R_WB = body.xmat.reshape(3, 3)
    return R_WB @ mounting.R_BC, body.xpos + R_WB @ mounting.p_BC


def _placed(world: Any, range_m: float = 5.0) -> Any:
    R_WC, p_WC = _pose(world, world.data)
    world.put("drogue", p_WC + R_WC @ np.array([range_m, 0.2, -0.1]), R_WC @ exp(np.array([0.3, 0.1, -0.2])))
    return world


def _seen(world: Any, sources: PointSources, factors: np.ndarray | None = None) -> Sources:
    pose = _pose(world, world.data)
    return sources.of(world.data, pose, EXPOSURE_S, np.ones(LEDS) if factors is None else factors)


def test_reflections_and_glints_in_one_batch_are_those_found_by_themselves(small_world: Any) -> None:
    """Places, electrons by e = S I a cos t/r^2 exp(-b r) and order; LEDs of half their light have half reflections."""
    world = _placed(small_world)
    sources, (R_WC, p_WC) = _sources_of(world), _pose(world, world.data)
    factors, response, leds_W = np.full(LEDS, 0.5), _response(world.as_built), _sources_of(world).leds_W(world.data)
    mirrors, axis_W = Mirrors.of(world.model), -world.data.body("drogue").xmat.reshape(3, 3)[:, 0]
    intensity = world.as_built.led_intensity_w_sr * factors
    reflections = find_led_reflections(
        world.model, world.data, mirrors, p_WC, leds_W, axis_W, intensity, SHEETS.leds.pattern_exponent, SURFACES
    )
    glints = find_glints(world.model, world.data, mirrors, p_WC, SUN_W, SURFACES, SHEETS.light, R_WC[:, 0])
    assert len(reflections.p_W) > 0 and len(glints.p_W) > 0
    found = _seen(world, sources, factors)
    p_C = (np.vstack([leds_W, reflections.p_W, glints.p_W]) - p_WC) @ R_WC
    np.testing.assert_allclose(found.p_C, p_C, rtol=0.0, atol=1e-12)
    r = np.linalg.norm(p_C[LEDS:], axis=1)
    e_m2_s = np.append(
        response.led_e_m2_sr_w_s * reflections.intensity_w_sr, response.glint_e_m2_s * BEAM * glints.area_m2_sr
    )
    by_hand = EXPOSURE_S * e_m2_s * p_C[LEDS:, 0] / r**3 * np.exp(-EXTINCTION_1_M * r)
    np.testing.assert_allclose(found.electrons[LEDS:], by_hand, rtol=1e-12)
    axis_C, visible = axis_W @ R_WC, sources.visible_leds(world.data, p_WC)
    leds = led_electrons(response, SHEETS.leds, intensity, p_C[:LEDS], axis_C, EXPOSURE_S, EXTINCTION_1_M)
    assert visible.any() and (leds > 0.0).all()
    np.testing.assert_allclose(found.electrons[:LEDS], leds * visible, rtol=1e-12)


def test_without_sun_there_are_no_glints(small_world: Any) -> None:
    world = _placed(small_world)
    lit, dark = (_seen(world, _sources_of(world, sun)) for sun in (True, False))
    assert LEDS < len(dark.electrons) < len(lit.electrons)
    assert np.array_equal(dark.electrons, lit.electrons[: len(dark.electrons)])


def test_of_some_of_the_candidates_the_same_is_said_as_of_all(small_world: Any) -> None:
    """Mirrors are lit by LEDs that are not among them, too; the box stands in the way of each reflection in turn."""
    world = _placed(small_world)
    sources, pose = _sources_of(world, sun=False), _pose(world, world.data)
    found, put_out = sources.candidates(world.data, pose, EXPOSURE_S, np.ones(LEDS)), 0
    every, mirrored = np.arange(len(found.electrons)), np.arange(LEDS, len(found.electrons))
    for patch in found.patches_W[LEDS:]:
        world.put("box", 0.5 * (patch[:3] + found.patches_W[int(patch[9]), :3]), np.eye(3))
        seen, of_mirrored = (sources.are_seen(world.data, pose[1], found, which) for which in (every, mirrored))
        assert np.array_equal(of_mirrored, seen[LEDS:])
        put_out += int((~of_mirrored).sum())
    assert len(mirrored) <= put_out < len(mirrored) ** 2


def test_an_led_is_dark_in_the_batch_when_a_ray_to_it_alone_is_blocked(small_world: Any) -> None:
    """The box wanders across the ring; LEDs themselves are never left out of the list."""
    world = _placed(small_world)
    sources, (R_WC, p_WC) = _sources_of(world), _pose(world, world.data)
    hidden = 0
    for k, led_W in enumerate(sources.leds_W(world.data)):
        world.put("box", p_WC + 0.5 * (led_W - p_WC), R_WC)
        visible = sources.visible_leds(world.data, p_WC)
        found = _seen(world, sources)
        assert not visible[k]
        assert np.array_equal(found.electrons[:LEDS] > 0.0, visible)
        hidden += int((~visible).sum())
    assert LEDS <= hidden < LEDS * LEDS


def test_what_is_nearer_to_an_led_than_its_clearance_or_its_seat_hides_it_from_neither_lens_nor_mirror(
    small_world: Any,
) -> None:
    """The box, 4 cm thick: its face before an LED by half of the clearance, or more; then the LED in its middle."""
    world = _placed(small_world)
    sources, R_WC = _sources_of(world, sun=False), _pose(world, world.data)[0]
    led_W, clearance_m = sources.leds_W(world.data)[0], SHEETS.leds.occlusion_clearance_m
    for before_m, is_lit in ((0.5 * clearance_m, True), (1.5 * clearance_m, False)):
        world.put("box", led_W + (0.02 - before_m) * R_WC[:, 0], R_WC)
        assert (_seen(world, sources).electrons[0] > 0.0) == is_lit
    mirrored = {}
    for seat_m in (0.01, 0.1):
        mirrored[seat_m] = set()
        for k, place in enumerate(sources.leds_W(world.data)):
            world.put("box", place, np.eye(3))
            shown = _seen(world, _sources_of(world, sun=False, seat_m=seat_m)).patches_W[LEDS:, 9]
            mirrored[seat_m] |= {k} & set(shown.astype(int))
    assert mirrored[0.01] == set() and len(mirrored[0.1]) > 0


def test_a_patch_is_dark_in_the_batch_when_a_box_stands_between_it_and_its_light(small_world: Any) -> None:
    """Each reflection and glint in turn, the first of them too; the box is off the lens's line of sight."""
    world = _placed(small_world)
    sources, blocked = _sources_of(world), {True: 0, False: 0}
    leds_W, patches = sources.leds_W(world.data), _seen(world, sources).patches_W[LEDS:]
    for patch in patches:
        of_sun = patch[9] < 0.0
        place, way = patch[:3], SUN_W if of_sun else leds_W[int(patch[9])] - patch[:3]
        world.put("box", place + (0.3 if of_sun else 0.5) * way, np.eye(3))
        left = _seen(world, sources).patches_W[LEDS:]
        assert not ((left[:, 9] == patch[9]) & (np.linalg.norm(left[:, :3] - place, axis=1) < 1e-9)).any()
        blocked[of_sun] += 1
    assert blocked[True] > 0 and blocked[False] > 0


def test_the_way_in_an_exposure_is_the_difference_of_places_moved_by_hand(small_world: Any) -> None:
    """Both bodies fly and turn; LEDs move with the drogue, mirrored light as the places of the bodies it is on."""
    world = _placed(small_world)
    model, data, sources = world.model, world.data, _sources_of(world)
    rng = np.random.default_rng(2)
    data.qvel[:] = rng.normal(0.0, 1.0, model.nv)
    mujoco.mj_forward(model, data)
    found = _seen(world, sources)
    assert len(found.p_C) > LEDS
    R_WC, p_WC = _pose(world, data)
    bodies = model.geom_bodyid[found.patches_W[LEDS:, 10].astype(int)]
    assert len(set(bodies)) > 1
    R_WB, mirrored_W = data.xmat[bodies].reshape(-1, 3, 3), p_WC + found.p_C[LEDS:] @ R_WC.T
    mirrored_B = np.einsum("nji,nj->ni", R_WB, mirrored_W - data.xpos[bodies])
    dt, ends = 1e-4, []
    for half in (-0.5 * dt, 0.5 * dt):
        moved = mujoco.MjData(model)
        qpos = data.qpos.copy()
        mujoco.mj_integratePos(model, qpos, data.qvel, half)
        moved.qpos[:] = qpos
        mujoco.mj_forward(model, moved)
        R, p = _pose(world, moved)
        carried_W = moved.xpos[bodies] + np.einsum("nij,nj->ni", moved.xmat[bodies].reshape(-1, 3, 3), mirrored_B)
        ends.append((np.vstack([sources.leds_W(moved), carried_W]) - p) @ R)
    by_hand = (ends[1] - ends[0]) / dt * EXPOSURE_S
    assert np.abs(by_hand).max() > 1e-5
    np.testing.assert_allclose(found.way_C_m, by_hand, rtol=0.0, atol=1e-6 * np.abs(by_hand).max())


def test_mirrored_light_is_of_the_body_that_a_ray_from_the_lens_meets_there(small_world: Any) -> None:
    world = _placed(small_world)
    model, data, (_, p_WC) = world.model, world.data, _pose(world, world.data)
    found, met, groups = _seen(world, _sources_of(world)), np.zeros(1, np.int32), np.array(VISIBLE_GROUPS, np.uint8)
    of = [int(model.geom_bodyid[int(g)]) for g in found.patches_W[LEDS:, 10]]
    for body, patch in zip(of, found.patches_W[LEDS:], strict=True):
        way = patch[:3] - p_WC
        mujoco.mj_ray(model, data, p_WC, way / np.linalg.norm(way), groups, 1, -1, met)
        assert int(model.geom_bodyid[met[0]]) == body
    assert len(set(of)) > 1


def test_patches_are_points_below_half_a_pixel_and_whole_octaves_of_a_millimetre_above(small_world: Any) -> None:
    world = _placed(small_world)
    found = _seen(world, _sources_of(world))
    size, depth = found.size_m[LEDS:], found.p_C[LEDS:, 0]
    assert np.array_equal(found.size_m[:LEDS], np.full(LEDS, SHEETS.leds.die_size_m))
    sized = size > 0.0
    assert sized.any() and not sized.all()
    octaves = np.log2(size[sized] / 1e-3)
    assert np.allclose(octaves, np.round(octaves))
    # what is rounded down by at most sqrt(2) was at least half a pixel wide
    assert (size[sized] * world.as_built.camera.focal_length_px / depth[sized] > 0.5 / np.sqrt(2.0) - 1e-9).all()


@pytest.mark.parametrize(
    ("size_mm", "drawn_mm"),
    [(0.33, 0.0), (0.34, 0.25), (0.4, 0.5), (0.7, 0.5), (0.72, 1.0), (1.4, 1.0), (3.0, 4.0), (5.3, 4.0), (5.4, 5.4)],
)
def test_a_patch_is_drawn_as_wide_as_the_octave_nearest_to_its_own_width(size_mm: float, drawn_mm: float) -> None:
    """At 2 m depth, 1.5 px a millimetre: below 0.5 px it is a point, from 8 px on it keeps its width.

    Its light is e cos t/r^2 exp(-b r) t_exp, its range here 2.5 m.
    """
    p_C, electrons, size_m = np.array([[2.0, 1.5, 0.0]]), np.array([7.0]), np.array([1e-3 * size_mm])
    _as_received(p_C, 0, (0.2, 3000.0), EXPOSURE_S, electrons, size_m)
    assert size_m[0] == pytest.approx(1e-3 * drawn_mm, rel=1e-12)
    assert electrons[0] == pytest.approx(7.0 * 0.8 / 2.5**2 * np.exp(-0.2 * 2.5) * EXPOSURE_S, rel=1e-12)
