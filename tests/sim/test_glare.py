"""Glints at true mirror points, the Sun's disc and its veil. No OpenGL is needed here."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.parameters import load_parameters
from dockair.sim.camera.glare import add_disc, find_glints, is_clear, rim_of, veil_electrons
from dockair.sim.camera.radiometry import CameraParameters, LedParameters, LightParameters, responses

CAMERA = load_parameters("camera", CameraParameters)
LIGHT = load_parameters("light", LightParameters)
RESPONSE = responses(CAMERA, load_parameters("leds", LedParameters), LIGHT, Camera())
EYE = np.zeros(3)


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


def _sphere(at: list[float], radius: float, **more: object) -> dict:
    return {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "pos": at, "size": [radius, 0.0, 0.0], **more}


def _mirror_error_rad(p: np.ndarray, n: np.ndarray, sun: np.ndarray) -> float:
    """Angle between the Sun and the mirror image of the line of sight: the law of reflection, independently."""
    sight = _unit(*(p - EYE))
    reflected = sight - 2.0 * (sight @ n) * n
    return float(np.arccos(np.clip(reflected @ sun, -1.0, 1.0)))


@pytest.mark.parametrize("sun", [_unit(-1, 0, 1), _unit(-0.8, 0.5, 0.2), _unit(0.3, -1, 0.4)])
def test_a_spheres_glint_obeys_the_law_of_reflection(sun: np.ndarray) -> None:
    centre, radius = np.array([8.0, 1.0, -0.5]), 0.6
    model, data = _world(_sphere(list(centre), radius))
    glints = find_glints(model, data, None, EYE, sun, LIGHT)
    assert glints.p_W.shape == (1, 3)
    n = (glints.p_W[0] - centre) / radius
    assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-9)
    assert _mirror_error_rad(glints.p_W[0], n, sun) < 1e-5
    assert glints.r1_r2_m2[0] == pytest.approx(radius**2, rel=1e-12)


def test_an_ellipsoids_glint_obeys_the_law_of_reflection_and_has_its_gaussian_curvature() -> None:
    axes, centre, sun = np.array([2.0, 0.5, 0.8]), np.array([9.0, -1.0, 0.7]), _unit(-0.6, 0.3, 0.7)
    model, data = _world({"type": mujoco.mjtGeom.mjGEOM_ELLIPSOID, "pos": list(centre), "size": list(axes)})
    glints = find_glints(model, data, None, EYE, sun, LIGHT)
    local = glints.p_W[0] - centre
    assert ((local / axes) ** 2).sum() == pytest.approx(1.0, abs=1e-9)
    n = _unit(*(local / axes**2))
    assert _mirror_error_rad(glints.p_W[0], n, sun) < 1e-4
    # Gaussian curvature of a surface z(x, y) from second differences of the distance to the tangent plane
    e1 = np.cross(n, [0.0, 0.0, 1.0])
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(n, e1)
    h = 1e-3

    def depth(a: float, b: float) -> float:
        q = local + a * e1 + b * e2  # drop along n onto the ellipsoid
        A, B, C = ((n / axes) ** 2).sum(), (n * q / axes**2).sum(), ((q / axes) ** 2).sum() - 1.0
        return float((-B + np.sqrt(B * B - A * C)) / A)

    Lxx = (depth(h, 0) - 2 * depth(0, 0) + depth(-h, 0)) / h**2
    Lyy = (depth(0, h) - 2 * depth(0, 0) + depth(0, -h)) / h**2
    Lxy = (depth(h, h) - depth(h, -h) - depth(-h, h) + depth(-h, -h)) / (4 * h**2)
    assert glints.r1_r2_m2[0] == pytest.approx(1.0 / (Lxx * Lyy - Lxy**2), rel=1e-4)


def test_the_reflected_light_of_a_sphere_is_the_light_it_catches() -> None:
    """I = E R r^2/4 into every direction: over the whole sphere 4 pi that is E R pi r^2, the light on its disc."""
    r = 0.3
    intensity_over_e = 0.25 * r**2
    assert 4.0 * np.pi * intensity_over_e == pytest.approx(np.pi * r**2, rel=1e-12)
    sun_per_s = RESPONSE.glint_e / LIGHT.glint_reflectance
    assert sun_per_s == pytest.approx(RESPONSE.sun_flux_e, rel=1e-12)


def test_something_in_the_way_of_the_sun_or_of_the_camera_puts_a_glint_out() -> None:
    sun = _unit(-0.2, 0.0, 1.0)
    ball = _sphere([8.0, 0.0, 0.0], 0.5)
    assert len(find_glints(*_world(ball), None, EYE, sun, LIGHT).p_W) == 1
    for at in ([7.0, 0.0, 4.0], [4.0, 0.0, 0.2]):
        box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "pos": at, "size": [0.5, 1.0, 0.3]}
        assert len(find_glints(*_world(ball, box), None, EYE, sun, LIGHT).p_W) == 0
        assert len(find_glints(*_world(ball, box | {"group": 3}), None, EYE, sun, LIGHT).p_W) == 1


def test_the_sun_behind_a_body_makes_no_glint() -> None:
    model, data = _world(_sphere([8.0, 0.0, 0.0], 0.5))
    assert len(find_glints(model, data, None, EYE, _unit(1.0, 0.0, 0.01), LIGHT).p_W) == 0


def _rim_world() -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="drogue", pos=[6.0, 0.3, 0.2])
    angle = 2.0 * np.pi * np.arange(24) / 24
    at = 0.25 * np.column_stack([np.zeros(24), np.cos(angle), np.sin(angle)]) + [0.01, 0.0, 0.0]
    for k in range(24):
        ends = [*at[k], *at[(k + 1) % 24]]
        body.add_geom(name=f"basket_rim_{k}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=ends, size=[0.008, 0.0, 0.0])
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
    assert rim_of(_world(_sphere([1.0, 0.0, 0.0], 0.1))[0]) is None


def test_the_rims_two_glints_obey_the_law_of_reflection_on_a_torus() -> None:
    model, data = _rim_world()
    rim, sun = rim_of(model), _unit(-0.8, 0.1, 0.6)
    glints = find_glints(model, data, rim, EYE, sun, LIGHT)
    assert len(glints.p_W) == 2
    centre = np.array([6.01, 0.3, 0.2])
    sides = set()
    for p, area in zip(glints.p_W, glints.r1_r2_m2, strict=True):
        q = p - centre
        ring = 0.25 * q * [0, 1, 1] / np.hypot(q[1], q[2])
        n = (q - ring) / 0.008
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-6)
        assert _mirror_error_rad(p, n, sun) < 1e-4
        cos_phi = float(n @ ring / 0.25)
        sides.add(np.sign(cos_phi))
        # a torus has curvature cos phi/(r (R + r cos phi)); do Carmo, section 3-3, example 6
        assert area == pytest.approx(0.008 * (0.25 + 0.008 * cos_phi) / abs(cos_phi), rel=1e-6)
    assert sides == {1.0, -1.0}


def test_a_ray_is_clear_up_to_what_it_meets() -> None:
    model, data = _world(_sphere([5.0, 0.0, 0.0], 1.0))
    ahead = np.array([1.0, 0.0, 0.0])
    assert is_clear(model, data, EYE, ahead, 3.99)
    assert not is_clear(model, data, EYE, ahead, 4.01)
    assert is_clear(model, data, EYE, -ahead, np.inf)


def _disc(centre: tuple[float, float], start: tuple[int, int], shape: tuple[int, int]) -> np.ndarray:
    image = np.zeros(shape, dtype=np.float32)
    visible = np.ones((30, 30), dtype=np.bool_)
    add_disc(image, start, centre, 13.5, 0.6, 1.0, visible, (35, 35), 2)
    return image


def test_the_suns_disc_has_its_area_and_its_centre() -> None:
    image = _disc((100.3, 98.8), (0, 0), (200, 200))
    rows, columns = np.indices(image.shape)
    # a radially blurred edge keeps area pi (R^2 + sigma^2)
    assert image.sum() == pytest.approx(np.pi * (13.5**2 + 0.6**2), rel=2e-3)
    assert (image * columns).sum() / image.sum() == pytest.approx(100.3, abs=0.02)
    assert (image * rows).sum() / image.sum() == pytest.approx(98.8, abs=0.02)


def test_the_suns_disc_in_a_window_is_the_full_frames() -> None:
    assert np.array_equal(
        _disc((100.3, 98.8), (90, 95), (40, 50)), _disc((100.3, 98.8), (0, 0), (200, 200))[90:130, 95:145]
    )


def test_the_disc_is_27_pixels_wide() -> None:
    assert 2.0 * Camera().focal_length_px * LIGHT.sun_angular_radius_rad == pytest.approx(27.0, abs=0.1)


def test_blocks_that_do_not_see_the_sun_stay_dark() -> None:
    image = np.zeros((200, 200), dtype=np.float32)
    visible = np.ones((30, 30), dtype=np.bool_)
    visible[:, :15] = False  # columns 70 to 99
    add_disc(image, (0, 0), (100.0, 100.0), 13.5, 0.6, 1.0, visible, (35, 35), 2)
    assert not image[:, :100].any()
    assert image[:, 100:].sum() == pytest.approx(0.5 * np.pi * 13.5**2, rel=0.05)


def test_two_percent_of_the_suns_light_spread_over_the_array_is_85_electrons_a_pixel() -> None:
    parameters = replace(CAMERA, veiling_glare=0.02)
    veil = veil_electrons(parameters, Camera(), np.array([1.0, 0.0, 0.0]), RESPONSE.sun_flux_e, 1.0)
    assert veil / LIGHT.air_transmittance == pytest.approx(85.0, rel=0.01)


def test_the_veil_falls_to_1_over_e_at_the_hoods_angle_outside_the_field_and_vanishes_behind() -> None:
    camera = Camera()
    edge = np.arctan(1024.0 / camera.focal_length_px)

    def veil(angle: float, visible: float = 1.0) -> float:
        sun_C = np.array([np.cos(angle), np.sin(angle), 0.0])
        return veil_electrons(CAMERA, camera, sun_C, RESPONSE.sun_flux_e, visible)

    outside = edge + CAMERA.veiling_decay_rad
    foreshortening = np.cos(outside) / np.cos(edge - 1e-3)
    assert veil(outside) / veil(edge - 1e-3) == pytest.approx(np.exp(-1.0) * foreshortening, rel=5e-3)
    assert veil(np.pi) == 0.0
    assert veil(0.1, 0.25) == pytest.approx(0.25 * veil(0.1), rel=1e-12)


def test_the_ring_is_the_scenes_own_scale() -> None:
    """A rim glint at the default reflectance is dimmer than an LED but of its order, as the sheets claim."""
    model, data = _rim_world()
    glints = find_glints(model, data, rim_of(model), EYE, _unit(-0.8, 0.1, 0.6), LIGHT)
    led = RESPONSE.led_e_m2_sr_w * load_parameters("leds", LedParameters).intensity_w_sr
    ratio = RESPONSE.glint_e * 0.25 * glints.r1_r2_m2 / led
    assert np.all((ratio > 0.05) & (ratio < 1.0)), ratio
    assert LedRing().diameter_m == 0.5
