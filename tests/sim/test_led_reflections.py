"""LEDs mirrored in spheres, tubes and the rim: mirror equations, ray bundles, hiding. No OpenGL is needed."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.rotations import exp, quaternion_from_matrix
from dockair.sim.camera import led_reflections
from dockair.sim.camera.glints import find_glints
from dockair.sim.camera.led_reflections import LedReflections, find_led_reflections
from dockair.sim.camera.mirrors import Mirrors, finishes, vector
from dockair.sim.camera.sheets import LightParameters, SurfaceParameters
from mirror_scenes import EYE, SHEET, scene_of, unit
from mirror_scenes import IDEAL as PERFECT

#: All light is mirrored, an LED shines alike to all sides, nothing is too faint
IDEAL = replace(PERFECT, led_side_light=1.0, led_seat_m=0.0, faintest_reflection=0.0)
AFT = np.array([-1.0, 0.0, 0.0])
_G = mujoco.mjtGeom


def _sphere(at: np.ndarray, radius: float) -> dict:
    return {"name": "probe_tip", "type": _G.mjGEOM_SPHERE, "pos": list(at), "size": [radius, 0.0, 0.0]}


def _tube(at: np.ndarray, radius: float, half: float, R: np.ndarray) -> dict:
    size, quat = [radius, half, 0.0], quaternion_from_matrix(R)
    return {"name": "probe_boom", "type": _G.mjGEOM_CYLINDER, "pos": list(at), "size": size, "quat": quat}


def _find(
    world: tuple[mujoco.MjModel, mujoco.MjData],
    leds: np.ndarray,
    surfaces: SurfaceParameters = IDEAL,
    axis: np.ndarray = AFT,
    exponent: float = 2.6,
) -> LedReflections:
    leds = np.atleast_2d(leds)
    return find_led_reflections(
        *world, Mirrors.of(world[0]), EYE, leds, axis, np.full(len(leds), 2.0), exponent, surfaces
    )


def _bound(
    world: tuple[mujoco.MjModel, mujoco.MjData], led: np.ndarray, axis: np.ndarray, surfaces: SurfaceParameters
) -> float:
    """Of the only pair there is, on an LED of 1 W/sr."""
    (model, data), side = world, surfaces.led_side_light
    mirrors, poses = Mirrors.of(model), (data.geom_xpos, data.geom_xmat)
    near = mirrors.near_balls, mirrors.near_tubes
    return led_reflections._bound(near, poses, led[None], vector(axis), vector(EYE), finishes(surfaces), side).max()


def _mirror_error_rad(p: np.ndarray, n: np.ndarray, led: np.ndarray) -> float:
    sight = unit(*(p - EYE))
    reflected = sight - 2.0 * (sight @ n) * n
    return float(np.linalg.norm(reflected - unit(*(led - p))))


def _coddington(d1: float, d: float, cos_i: float, r_in: float, r_across: float) -> float:
    """I_ref/I by the mirror equations of a narrow bundle, in and across the plane of incidence."""
    s_in, s_across = 1.0 / (1.0 / d1 + 2.0 / (r_in * cos_i)), 1.0 / (1.0 / d1 + 2.0 * cos_i / r_across)
    return s_in * s_across / d1**2 * d**2 / ((d + s_in) * (d + s_across))


# ---------------------------------------------------------------------------------------------- closed forms


def test_on_axis_a_ball_images_an_led_as_the_mirror_equation_says() -> None:
    """1/image = 1/object + 2/r; the image is nearer than the LED by s/d1, so I falls with its square."""
    r, d, d1 = 0.3, 5.0, 0.4
    found = _find(scene_of(_sphere(np.array([d + r, 0.0, 0.0]), r)), np.array([d - d1, 1e-9, 0.0]))
    s = 1.0 / (1.0 / d1 + 2.0 / r)
    assert len(found.p_W) == 1
    np.testing.assert_allclose(found.p_W[0], [d, 0.0, 0.0], atol=1e-6)
    assert found.intensity_w_sr[0] == pytest.approx(2.0 * (s / d1) ** 2 * (d / (d + s)) ** 2, rel=1e-6)


def test_a_balls_reflections_are_coddingtons_bundles_however_near_and_oblique() -> None:
    rng, radius, found_count = np.random.default_rng(1), 0.05, 0
    for _ in range(60):
        centre = unit(1.0, *rng.normal(size=2) * 0.3) * rng.uniform(0.2, 4.0)
        led = centre + unit(*rng.normal(size=3)) * radius * rng.uniform(1.05, 20.0)
        found = _find(scene_of(_sphere(centre, radius)), led)
        for p, intensity in zip(found.p_W, found.intensity_w_sr, strict=True):
            n = (p - centre) / radius
            assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-9)
            assert _mirror_error_rad(p, n, led) < 1e-9
            d1, d = np.linalg.norm(led - p), np.linalg.norm(p)
            cos_i = float(n @ (led - p) / d1)
            assert intensity == pytest.approx(2.0 * _coddington(d1, d, cos_i, radius, radius), rel=1e-6)
            found_count += 1
    assert found_count > 20


def test_a_tubes_reflections_obey_the_law_and_are_coddingtons_in_the_two_principal_planes() -> None:
    radius, R = 0.03, np.eye(3)
    for centre, led, r_in, r_across in (
        (np.array([4.0, 0.0, 0.0]), np.array([3.5, 0.8, 0.0]), radius, np.inf),  # plane across the tube
        (np.array([4.0, 0.0, 0.0]), np.array([3.7, 0.0, 0.9]), np.inf, radius),  # plane along it
    ):
        found = _find(scene_of(_tube(centre, radius, 2.0, R)), led)
        assert len(found.p_W) == 1
        p = found.p_W[0]
        n = (p - centre) * [1, 1, 0] / radius
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-6)
        assert _mirror_error_rad(p, n, led) < 1e-4
        d1, d = np.linalg.norm(led - p), np.linalg.norm(p)
        expected = 2.0 * _coddington(d1, d, float(n @ (led - p) / d1), r_in, r_across)
        assert found.intensity_w_sr[0] == pytest.approx(expected, rel=1e-4)


def test_from_far_away_an_led_is_mirrored_as_the_sun_is() -> None:
    """I/d1^2 is its irradiance: the A of both must agree on ball and tube."""
    direction, far = unit(-0.6, 0.5, 0.1), 1e5
    light = replace(load_parameters("light", LightParameters), sun_angular_radius_rad=1e-9)
    for geom in (
        _sphere(np.array([6.0, 0.5, 0.2]), 0.3),
        _tube(np.array([6.0, 0.0, 0.0]), 0.05, 3.0, exp(np.array([0.1, 0.1, 0.3]))),
    ):
        world = scene_of(geom)
        sun = find_glints(*world, Mirrors.of(world[0]), EYE, direction, replace(IDEAL, patch_step_rad=1.0), light)
        led = _find(world, far * direction)
        assert len(sun.p_W) == len(led.p_W) == 1
        assert led.intensity_w_sr[0] / 2.0 * far**2 == pytest.approx(sun.area_m2_sr[0], rel=1e-3)
        np.testing.assert_allclose(led.p_W[0], sun.p_W[0], atol=1e-3)


# ------------------------------------------------------------------------------------------------- ray bundles


def _rim_world() -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="drogue", pos=[4.0, 0.3, 0.2])
    angle = 2.0 * np.pi * np.arange(24) / 24
    at = 0.25 * np.column_stack([np.zeros(24), np.cos(angle), np.sin(angle)])
    for k in range(24):
        ends = [*at[k], *at[(k + 1) % 24]]
        body.add_geom(name=f"basket_rim_{k}", type=_G.mjGEOM_CAPSULE, fromto=ends, size=[0.02, 0.0, 0.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _bundle_intensity(led: np.ndarray, p: np.ndarray, gradient, height) -> float:
    """I_ref/I by four rays of a narrow bundle: from the LED, off the surface height(q) = 0, to the plane of the eye."""
    main = unit(*(p - led))
    e1 = unit(*np.cross(main, [0.3, 0.5, 0.8]))
    e2, landed, angle = np.cross(main, e1), [], 1e-6
    to_eye = unit(*(EYE - p))
    for k1, k2 in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        ray = unit(*(main + angle * (k1 * e1 + k2 * e2)))
        t = float(np.linalg.norm(p - led))
        for _ in range(20):
            q = led + t * ray
            t -= height(q) / float(gradient(q) @ ray)
        n = unit(*gradient(led + t * ray))
        out = ray - 2.0 * (ray @ n) * n
        q = led + t * ray
        landed.append(q + out * ((EYE - q) @ to_eye) / (out @ to_eye))
    spread = np.linalg.norm(np.cross(landed[0] - landed[1], landed[2] - landed[3])) / (2.0 * angle) ** 2
    return float((EYE - p) @ (EYE - p) / spread)


def test_the_rims_reflections_obey_the_law_and_are_as_bright_as_a_bundle_of_rays() -> None:
    """On both sides of the torus; the inner one is curved like a saddle."""
    world, centre, sides = _rim_world(), np.array([4.0, 0.3, 0.2]), set()

    def ring_point(q: np.ndarray) -> np.ndarray:
        flat = (q - centre) * [0, 1, 1]
        return centre + 0.25 * flat / np.linalg.norm(flat)

    def height(q: np.ndarray) -> float:
        return float(np.linalg.norm(q - ring_point(q)) - 0.02)

    def gradient(q: np.ndarray) -> np.ndarray:
        return unit(*(q - ring_point(q)))

    for led in np.array([[3.97, 0.3, 0.45], [3.7, 0.5, 0.3], [3.0, 0.3, 0.9], [3.9, 0.1, -0.3]]):
        found = _find(world, led)
        for p, intensity in zip(found.p_W, found.intensity_w_sr, strict=True):
            n = gradient(p)
            assert height(p) == pytest.approx(0.0, abs=1e-6)
            assert _mirror_error_rad(p, n, led) < 1e-4
            sides.add(bool(n @ (ring_point(p) - centre) > 0.0))
            assert intensity == pytest.approx(2.0 * _bundle_intensity(led, p, gradient, height), rel=2e-3)
    assert sides == {True, False}


def test_an_oblique_tubes_reflection_is_as_bright_as_a_bundle_of_rays() -> None:
    rng, count = np.random.default_rng(5), 0
    for _ in range(20):
        R, centre, radius = exp(rng.normal(size=3)), np.array([3.0, 0.2, -0.1]), 0.04

        def flat(q: np.ndarray, R: np.ndarray = R, centre: np.ndarray = centre) -> np.ndarray:
            return (q - centre) - ((q - centre) @ R[:, 2]) * R[:, 2]

        led = centre + unit(*rng.normal(size=3)) * 0.5
        found = _find(scene_of(_tube(centre, radius, 5.0, R)), led)
        for p, intensity in zip(found.p_W, found.intensity_w_sr, strict=True):
            expected = _bundle_intensity(
                led, p, lambda q: unit(*flat(q)), lambda q: float(np.linalg.norm(flat(q)) - 0.04)
            )
            assert intensity == pytest.approx(2.0 * expected, rel=2e-3)
            count += 1
    assert count > 5


def test_an_ellipsoids_reflection_is_as_bright_as_a_bundle_of_rays() -> None:
    rng, count, axes, centre = np.random.default_rng(6), 0, np.array([0.12, 0.08, 0.05]), np.array([3.0, 0.2, -0.1])
    for _ in range(10):
        R = exp(rng.normal(size=3))
        form, led = R / axes**2 @ R.T, centre + unit(-1.0, *rng.normal(size=2)) * 0.5
        quat = quaternion_from_matrix(R)
        tip = {"name": "probe_tip", "type": _G.mjGEOM_ELLIPSOID, "pos": list(centre), "size": axes, "quat": quat}

        def gradient(q: np.ndarray, form: np.ndarray = form) -> np.ndarray:
            return form @ (q - centre)

        def height(q: np.ndarray, form: np.ndarray = form) -> float:
            return float(0.5 * ((q - centre) @ form @ (q - centre) - 1.0))

        found = _find(scene_of(tip), led)
        for p, intensity in zip(found.p_W, found.intensity_w_sr, strict=True):
            assert height(p) == pytest.approx(0.0, abs=1e-6)
            assert _mirror_error_rad(p, unit(*gradient(p)), led) < 1e-4
            assert intensity == pytest.approx(2.0 * _bundle_intensity(led, p, gradient, height), rel=2e-3)
            count += 1
    assert count >= 8


def test_a_balls_reflected_light_over_all_directions_is_the_light_it_catches() -> None:
    """The share of an LED's light that a ball of radius r at the distance b catches is (1 - sqrt(1 - r^2/b^2))/2."""
    r, b, far = 0.2, 0.5, 2e3
    cos = (np.arange(800) + 0.5) / 400 - 1.0
    total = 0.0
    for c in cos:  # directions of the eye, round about the line from ball to LED
        centre = np.array([far, 0.0, 0.0])
        led = centre + b * np.array([-c, np.sqrt(1.0 - c * c), 0.0])
        total += _find(scene_of(_sphere(centre, r)), led).intensity_w_sr.sum() / 2.0
    caught = 0.5 * (1.0 - np.sqrt(1.0 - (r / b) ** 2))
    assert total * 2.0 * np.pi * (cos[1] - cos[0]) == pytest.approx(4.0 * np.pi * caught, rel=5e-3)


# ------------------------------------------------------------------------------------- pattern, hiding, bounds


def test_the_main_beam_and_the_side_light_follow_the_leds_pattern() -> None:
    world, led = scene_of(_sphere(np.array([3.0, 0.0, 0.0]), 0.05)), np.array([2.8, 0.3, 0.0])
    all_around = _find(world, led).intensity_w_sr[0]
    ray = unit(*(_find(world, led).p_W[0] - led))
    side = replace(IDEAL, led_side_light=0.01)
    tilted = exp(np.array([0.0, 0.0, 0.7])) @ ray
    assert _find(world, led, side, axis=tilted).intensity_w_sr[0] == pytest.approx(
        np.cos(0.7) ** 2.6 * all_around, rel=1e-9
    )
    assert _find(world, led, side, axis=-ray).intensity_w_sr[0] == pytest.approx(0.01 * all_around, rel=1e-9)


def test_something_between_led_mirror_and_lens_puts_a_reflection_out() -> None:
    ball, led = _sphere(np.array([4.0, 0.0, 0.0]), 0.2), np.array([3.0, 1.5, 0.0])
    assert len(_find(scene_of(ball), led).p_W) == 1
    for at in ([3.4, 0.75, 0.0], [2.0, 0.0, 0.0]):
        box = {"type": _G.mjGEOM_BOX, "pos": at, "size": [0.15, 0.15, 0.15]}
        assert len(_find(scene_of(ball, box), led).p_W) == 0
        assert len(_find(scene_of(ball, box | {"group": 3}), led).p_W) == 1


def test_an_leds_own_seat_does_not_hide_it_from_a_mirror() -> None:
    ball, led = _sphere(np.array([4.0, 0.0, 0.0]), 0.2), np.array([3.0, 1.5, 0.0])
    seat = {"type": _G.mjGEOM_SPHERE, "pos": list(led), "size": [0.02, 0.0, 0.0], "name": "hose_seat"}
    assert len(_find(scene_of(ball, seat), led).p_W) == 0
    assert len(_find(scene_of(ball, seat), led, replace(IDEAL, led_seat_m=0.03)).p_W) == 1


def _scene(make_world, ahead_m: float, surfaces: SurfaceParameters) -> LedReflections:
    world = make_world(p_PD_B=(ahead_m, 0.0, 0.0))
    p_WC = world.truth.p_WB + world.truth.R_WB @ world.parameters.mounting.p_BC
    leds = np.array([world.data.site(f"led_{k}").xpos for k in range(8)])
    mirrors, axis = Mirrors.of(world.model), -world.truth.R_WD[:, 0]
    return find_led_reflections(
        world.model, world.data, mirrors, p_WC, leds, axis, 0.015 * (1.0 + 0.3 * np.arange(8)), 2.6, surfaces
    )


def test_the_bound_that_spares_faint_pairs_drops_none_that_counts(make_world, monkeypatch) -> None:
    surfaces = replace(SHEET, metal_share=1.0, led_side_light=0.05, faintest_reflection=3e-5)
    for ahead_m in (0.0, 0.4, 3.0):
        spared = _scene(make_world, ahead_m, surfaces)
        with monkeypatch.context() as patch:
            patch.setattr(led_reflections, "_wanted", lambda *_: np.ones((8, 116), dtype=np.bool_))
            every = _scene(make_world, ahead_m, surfaces)
        assert len(every.p_W) > 5
        assert np.array_equal(spared.p_W, every.p_W)
        assert np.array_equal(spared.led, every.led)
        assert np.array_equal(spared.intensity_w_sr, every.intensity_w_sr)


def test_the_bound_is_above_every_reflection_and_not_far_above_the_best() -> None:
    """Of balls and tubes about an LED that shines at them, all ways; 0.01 of that when it turns its back."""
    rng, side = np.random.default_rng(9), replace(IDEAL, led_side_light=0.01)
    best = {"ball": 0.0, "tube": 0.0}
    for _ in range(150):
        centre, R = np.array([3.0, 0.2, -0.1]), exp(rng.normal(size=3))
        led = centre + unit(*rng.normal(size=3)) * rng.uniform(0.15, 1.0)
        for kind, geom in (("ball", _sphere(centre, 0.04)), ("tube", _tube(centre, 0.04, 2.0, R))):
            world = scene_of(geom)
            toward, sight = unit(*(centre - led)), EYE - centre
            edge = unit(*(sight - (sight @ toward) * toward)) - 0.02 / np.linalg.norm(centre - led) * toward
            for axis in (toward, -toward, unit(*edge)):  # a part of the ball lies ahead, not its middle
                found = _find(world, led, side, axis=axis, exponent=1e-6)
                bound = _bound(world, led, axis, side)
                for intensity in found.intensity_w_sr:
                    assert intensity / 2.0 <= bound
                    best[kind] = max(best[kind], intensity / 2.0 / bound)
    assert min(best.values()) > 0.3, best


def test_the_bound_of_a_tube_holds_where_its_side_alone_lies_ahead_of_the_led() -> None:
    """Its axis 2 cm behind the LED and across its beam; the LED's back would send a hundredth."""
    centre, led, axis = np.array([3.0, 0.3, 0.0]), np.array([3.0, 0.0, 0.0]), unit(-1.0, -0.02 / 0.3, 0.0)
    world, side = scene_of(_tube(centre, 0.04, 2.0, np.eye(3))), replace(IDEAL, led_side_light=0.01)
    found = _find(world, led, side, axis=axis, exponent=1e-6)
    assert len(found.p_W) == 1 and (centre - led) @ axis < 0.0 < (found.p_W[0] - led) @ axis
    assert found.intensity_w_sr[0] / 2.0 <= _bound(world, led, axis, side)


def test_a_reflection_is_too_faint_by_the_brightest_leds_light() -> None:
    """A tenth of what the bright one's reflection is, of which the other's is a hundredth."""
    world, leds = scene_of(_sphere(np.array([4.0, 0.0, 0.0]), 0.2)), np.array([[3.0, 1.5, 0.0], [3.0, -1.5, 0.0]])
    light = np.array([0.02, 2.0])
    args = *world, Mirrors.of(world[0]), EYE, leds, AFT, light, 2.6
    both = find_led_reflections(*args, IDEAL)
    assert both.led.tolist() == [0, 1]
    faintest = 0.1 * both.intensity_w_sr[1] / light[1]
    assert find_led_reflections(*args, replace(IDEAL, faintest_reflection=faintest)).led.tolist() == [1]


def test_polished_rim_and_coupling_show_the_leds_and_dull_ones_do_not(make_world) -> None:
    """Ahead of the ring, the coupling's mouth within 0.1 m of the drogue's axis, the rim beyond 0.2 m.

    By the sheets only the probe mirrors them, under 0.2 % of an LED.
    """
    polished = _scene(make_world, 4.0, replace(SHEET, metal_share=1.0, led_side_light=0.1, faintest_reflection=1e-6))
    world = make_world(p_PD_B=(4.0, 0.0, 0.0))
    x, y, z = ((polished.p_W - world.truth.p_WD) @ world.truth.R_WD).T
    beside = np.hypot(y, z)
    assert set(polished.led[(x > 0.0) & (beside > 0.2) & (beside < 0.3)]) == set(range(8))
    assert ((x > 0.0) & (beside < 0.1)).sum() > 4
    for ahead_m in (6.0, 1.0, 0.3):
        dull = _scene(make_world, ahead_m, SHEET)
        assert np.all(dull.intensity_w_sr < 0.002 * 0.015 * 3.1)
    assert len(dull.p_W) > 0


def test_a_dark_led_reflects_nothing() -> None:
    world = scene_of(_sphere(np.array([4.0, 0.0, 0.0]), 0.2))
    led = np.array([[3.0, 1.5, 0.0]])
    found = find_led_reflections(*world, Mirrors.of(world[0]), EYE, led, AFT, np.zeros(1), 2.6, IDEAL)
    assert found.p_W.shape == (0, 3) and found.led.shape == (0,)


def test_where_there_is_no_led_nothing_is_reflected() -> None:
    world = scene_of(_sphere(np.array([4.0, 0.0, 0.0]), 0.2))
    found = find_led_reflections(*world, Mirrors.of(world[0]), EYE, np.empty((0, 3)), AFT, np.empty(0), 2.6, IDEAL)
    assert found.p_W.shape == (0, 3) and found.led.shape == (0,)
