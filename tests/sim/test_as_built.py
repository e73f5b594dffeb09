"""What is drawn scatters around the nominal sheets by the sheet's standard deviations.

Bounds are 4.5 standard errors over 3000 draws (a false alarm in 1.5e5 each); the seed is fixed.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dockair.assets
from dockair.calibration import Camera, LedRing, Mounting
from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import exp, log
from dockair.sim.as_built import AsBuilt, AsBuiltParameters, draw_as_built
from dockair.sim.camera.radiometry import led_intensity_w_sr
from dockair.sim.camera.sheets import LedParameters

SHEET = load_parameters("as_built", AsBuiltParameters)
LEDS = load_parameters("leds", LedParameters)
MOUNTING = Mounting(
    R_BC=exp(np.array([0.0, 0.0, -0.05])),
    p_BC=np.array([3.3, -0.4, 0.7]),
    p_BP=np.array([6.0, -0.9, 0.6]),
    p_BI=np.array([0.5, 0.1, -0.2]),
    R_BI=exp(np.array([0.3, -0.2, 0.1])),
)
N = 3000
DISTORTION_SIGMAS = (
    SHEET.distortion_k1_sigma,
    SHEET.distortion_k2_sigma,
    SHEET.distortion_p_sigma,
    SHEET.distortion_p_sigma,
)


@pytest.fixture(scope="module")
def drawn() -> list[AsBuilt]:
    rng = np.random.default_rng(0)
    return [draw_as_built(Camera(), LedRing(), MOUNTING, SHEET, LEDS, rng) for _ in range(N)]


def _assert_normal(values: np.ndarray, sigma: float) -> None:
    n = values.size
    assert abs(values.mean()) < 4.5 * sigma / np.sqrt(n)
    assert values.var() == pytest.approx(sigma**2, rel=4.5 * np.sqrt(2.0 / n))


def test_mounting_errors_have_their_standard_deviations_about_each_axis(drawn: list[AsBuilt]) -> None:
    camera = np.array([log(d.mounting.R_BC @ MOUNTING.R_BC.T) for d in drawn])
    imu = np.array([log(d.mounting.R_BI @ MOUNTING.R_BI.T) for d in drawn])
    for axis in range(3):
        _assert_normal(camera[:, axis], SHEET.mounting_angle_sigma_rad)
        _assert_normal(imu[:, axis], SHEET.mounting_angle_sigma_rad)
    _assert_normal(np.array([d.mounting.p_BC - MOUNTING.p_BC for d in drawn]), SHEET.mounting_position_sigma_m)
    assert abs(np.corrcoef(camera[:, 0], imu[:, 0])[0, 1]) < 4.5 / np.sqrt(N)


def test_the_probes_tip_and_the_imu_are_where_the_sheets_have_them(drawn: list[AsBuilt]) -> None:
    assert all(np.array_equal(d.mounting.p_BP, MOUNTING.p_BP) for d in drawn)
    assert all(np.array_equal(d.mounting.p_BI, MOUNTING.p_BI) for d in drawn)


def test_intrinsics_have_their_standard_deviations(drawn: list[AsBuilt]) -> None:
    _assert_normal(np.array([d.camera.focal_length_m / 0.016 - 1.0 for d in drawn]), SHEET.focal_length_sigma)
    centre = np.array([d.camera.principal_point_px for d in drawn]) - [1023.5, 543.5]
    _assert_normal(centre, SHEET.principal_point_sigma_px)


def test_distortion_scatters_around_the_sheets_and_leaves_k3(drawn: list[AsBuilt]) -> None:
    rng = np.random.default_rng(1)
    lens = Camera(distortion=(-0.1, 0.02, 1e-3, -2e-3, 0.3))
    distorted = [draw_as_built(lens, LedRing(), MOUNTING, SHEET, LEDS, rng) for _ in range(N)]
    for built, nominal in ((drawn, (0.0,) * 5), (distorted, lens.distortion)):
        error = np.array([d.camera.distortion for d in built]) - np.array(nominal)
        for column, sigma in enumerate(DISTORTION_SIGMAS):
            _assert_normal(error[:, column], sigma)
        assert np.all(error[:, 4] == 0.0)


def test_distortion_moves_the_corner_by_a_fifth_of_a_pixel_rms(drawn: list[AsBuilt]) -> None:
    corner_C = Camera().rays_from_pixels(np.array([[0.0, 0.0]]))
    straight = replace(Camera(), distortion=None).pixels_from_points(corner_C)
    moved = [replace(Camera(), distortion=d.camera.distortion).pixels_from_points(corner_C) for d in drawn]
    assert np.sqrt(np.mean(np.sum((np.array(moved) - straight) ** 2, axis=-1))) == pytest.approx(0.2, abs=0.02)


def test_no_drawn_distortion_keeps_the_sheets_pinhole_and_the_sheets_distortion() -> None:
    straight = replace(SHEET, distortion_k1_sigma=0.0, distortion_k2_sigma=0.0, distortion_p_sigma=0.0)
    for nominal in (Camera(), Camera(distortion=(-0.1, 0.02, 0.0, 0.0, 0.0))):
        built = draw_as_built(nominal, LedRing(), MOUNTING, straight, LEDS, np.random.default_rng(0))
        assert built.camera.distortion == nominal.distortion


def test_leds_scatter_each_by_itself_and_all_with_the_diameter(drawn: list[AsBuilt]) -> None:
    """Along x only the LED's own error; radially that and half the diameter's, which all LEDs of a ring share."""
    error = np.array([d.ring_positions_D - LedRing().positions_D for d in drawn])
    _assert_normal(error[:, :, 0], SHEET.led_position_sigma_m)
    radial = np.einsum("nij,ij->ni", error, LedRing().positions_D / 0.25)
    shared = 0.25 * SHEET.ring_diameter_sigma_m**2
    variance = SHEET.led_position_sigma_m**2 + shared
    assert radial[:, 0].var() == pytest.approx(variance, rel=4.5 * np.sqrt(2.0 / N))
    assert np.mean(radial[:, 0] * radial[:, 4]) == pytest.approx(shared, abs=4.5 * variance / np.sqrt(N))


def test_brightness_lies_evenly_in_one_bin_of_two_to_one_around_the_sheets_value(drawn: list[AsBuilt]) -> None:
    brightness = np.array([d.led_intensity_w_sr for d in drawn]) / led_intensity_w_sr(LEDS)
    assert brightness.min() >= 2.0 / 3.0 and brightness.max() <= 4.0 / 3.0
    assert brightness.max() / brightness.min() == pytest.approx(2.0, rel=2e-3)
    assert brightness.mean() == pytest.approx(1.0, abs=4.5 * (2.0 / 3.0) / np.sqrt(12.0 * 8 * N))


def test_a_coded_rings_leds_scatter_around_its_own_angles_and_brightnesses() -> None:
    """Same draws as for the plain ring: the tolerances come on top."""
    coded = LedRing(angles_deg=(0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 327.0), brightness=(4.0, *6 * (1.0,), 0.5))
    built, plain = (
        draw_as_built(Camera(), ring, MOUNTING, SHEET, LEDS, np.random.default_rng(6)) for ring in (coded, LedRing())
    )
    tolerances = plain.ring_positions_D - LedRing().positions_D
    diameter_share = (plain.ring_positions_D - built.ring_positions_D)[:7]
    assert np.abs(diameter_share).max() < 1e-12
    angle = np.degrees(np.arctan2(built.ring_positions_D[7, 2], built.ring_positions_D[7, 1]))
    assert angle == pytest.approx(327.0 - 360.0, abs=np.degrees(5.0 * SHEET.led_position_sigma_m / 0.25))
    assert np.linalg.norm(built.ring_positions_D[7] - coded.positions_D[7]) == pytest.approx(
        np.linalg.norm(tolerances[7]), abs=5.0 * SHEET.ring_diameter_sigma_m
    )
    assert np.allclose(built.led_intensity_w_sr / plain.led_intensity_w_sr, coded.brightness, rtol=1e-12)
    record = np.array(built.record()["led_intensity_w_sr"])
    assert np.allclose(record, built.led_intensity_w_sr - led_intensity_w_sr(LEDS) * np.array(coded.brightness))


def test_an_led_brighter_than_its_current_allows_is_refused() -> None:
    """1.5 A is the most that the sheet knows of; the LEDs run at 16.7 mA."""
    allowed, refused = (LedRing(brightness=(ratio, *7 * (1.0,))) for ratio in (89.0, 91.0))
    draw_as_built(Camera(), allowed, MOUNTING, SHEET, LEDS, np.random.default_rng(0))
    with pytest.raises(DockairError, match=r"ring.brightness: expected at most 89.82 times .* 1.5 A, got 91"):
        draw_as_built(Camera(), refused, MOUNTING, SHEET, LEDS, np.random.default_rng(0))


def test_a_lens_too_short_for_the_distortion_that_is_drawn_is_refused_by_the_sheet_it_is_drawn_from() -> None:
    """The distortion was said to be that of the camera's sheet, which has none."""
    with pytest.raises(DockairError, match=r"^parameters.as_built: .* through a lens of 0.002 m is found .*, got \("):
        draw_as_built(Camera(focal_length_m=0.002), LedRing(), MOUNTING, SHEET, LEDS, np.random.default_rng(0))


def test_without_errors_the_hardware_is_the_sheets() -> None:
    exact = AsBuiltParameters(**{name: 0.0 for name in AsBuiltParameters.__slots__})
    built = draw_as_built(Camera(), LedRing(), MOUNTING, exact, replace(LEDS, bin_ratio=1.0), np.random.default_rng(0))
    assert built.camera == Camera()
    assert np.allclose(built.ring_positions_D, LedRing().positions_D)
    assert np.allclose(built.led_intensity_w_sr, led_intensity_w_sr(LEDS))
    assert np.allclose(built.mounting.R_BC, MOUNTING.R_BC) and np.allclose(built.mounting.R_BI, MOUNTING.R_BI)
    assert np.allclose(built.mounting.p_BC, MOUNTING.p_BC)


def test_one_error_switched_off_leaves_the_others_as_they_were() -> None:
    a = draw_as_built(Camera(), LedRing(), MOUNTING, SHEET, LEDS, np.random.default_rng(4))
    no_lens = replace(SHEET, focal_length_sigma=0.0, mounting_angle_sigma_rad=0.0, distortion_k1_sigma=0.0)
    b = draw_as_built(Camera(), LedRing(), MOUNTING, no_lens, LEDS, np.random.default_rng(4))
    assert np.array_equal(a.ring_positions_D, b.ring_positions_D)
    assert np.array_equal(a.led_intensity_w_sr, b.led_intensity_w_sr)
    assert np.array_equal(a.mounting.p_BC, b.mounting.p_BC)
    assert a.camera.focal_length_m != b.camera.focal_length_m
    assert a.camera.distortion is not None and b.camera.distortion is not None
    assert a.camera.distortion[1:] == b.camera.distortion[1:] and b.camera.distortion[0] == 0.0


def test_distortion_is_drawn_after_all_else() -> None:
    """A draw that is added must come last, so that one seed keeps its brightness bins."""
    built = draw_as_built(Camera(), LedRing(), MOUNTING, SHEET, LEDS, np.random.default_rng(4))
    rng = np.random.default_rng(4)
    rng.standard_normal((3, 3)), rng.standard_normal(3), rng.standard_normal(), rng.standard_normal((8, 3))
    brightness = 2.0 / 3.0 * (1.0 + rng.uniform(size=8))
    assert np.allclose(built.led_intensity_w_sr, led_intensity_w_sr(LEDS) * brightness, rtol=1e-12)


def test_the_record_turns_the_sheets_into_the_hardware() -> None:
    camera = Camera(distortion=(-0.1, 0.02, 1e-3, -2e-3, 0.3))
    built = draw_as_built(camera, LedRing(), MOUNTING, SHEET, LEDS, np.random.default_rng(5))
    record = json.loads(json.dumps(built.record()))
    assert np.allclose(exp(np.array(record["camera_turn_B_rad"])) @ MOUNTING.R_BC, built.mounting.R_BC, atol=1e-14)
    assert np.allclose(exp(np.array(record["imu_turn_B_rad"])) @ MOUNTING.R_BI, built.mounting.R_BI, atol=1e-14)
    assert np.allclose(record["camera_shift_B_m"] + MOUNTING.p_BC, built.mounting.p_BC, rtol=1e-12)
    assert record["focal_length_m"] + 0.016 == pytest.approx(built.camera.focal_length_m, rel=1e-15)
    assert np.allclose(np.add(record["principal_point_px"], [1023.5, 543.5]), built.camera.principal_point_px)
    assert np.allclose(np.add(record["distortion_k1_k2_p1_p2_k3"], camera.distortion), built.camera.distortion)
    shifts = np.column_stack([record[f"led_shift_{axis}_D_m"] for axis in "xyz"])
    assert np.allclose(LedRing().positions_D + shifts, built.ring_positions_D, atol=1e-15)
    intensity = led_intensity_w_sr(LEDS) + np.array(record["led_intensity_w_sr"])
    assert np.allclose(intensity, built.led_intensity_w_sr, rtol=1e-12)


def test_the_record_of_exact_hardware_is_zero_and_nobody_can_write_into_it() -> None:
    exact = AsBuiltParameters(**{name: 0.0 for name in AsBuiltParameters.__slots__})
    built = draw_as_built(Camera(), LedRing(), MOUNTING, exact, replace(LEDS, bin_ratio=1.0), np.random.default_rng(0))
    assert max(np.abs(value).max() for value in built.record().values()) < 1e-15
    built.record()["focal_length_m"] = 1.0
    assert built.record()["focal_length_m"] == 0.0


def test_the_nominal_sheets_in_the_assets_are_the_defaults_of_their_classes() -> None:
    folder = Path(next(iter(dockair.assets.__path__))) / "calibration"
    assert Camera.from_toml(folder / "camera.toml") == Camera()
    assert LedRing.from_toml(folder / "ring.toml") == LedRing()
