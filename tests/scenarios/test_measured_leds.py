"""LEDs measured without a picture: places, errors, faults, and that nothing is drawn out of turn."""

from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from scipy.stats import chi2, norm

from dockair.calibration import Camera, LedRing, Mounting
from dockair.errors import DockairError
from dockair.messages import Window
from dockair.nav.navigator import NavigatorSettings
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.scenarios.assembly.measured import SHEET, measured_leds, refuse_unmodelled
from dockair.scenarios.measured_leds import MeasuredLeds, MeasurementParameters, TextureLight, View
from dockair.scenarios.schema import load_scenario
from dockair.sim.as_built import AsBuilt, AsBuiltParameters, draw_as_built
from dockair.sim.camera.electronics import output_black, output_gain
from dockair.sim.camera.point_spread import blur_px
from dockair.sim.camera.radiometry import responses
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.faults import CameraDropOut, DirtyWindow, ExposureStuck, Faults, LedDim, LedFlicker, LedOff, StuckFrame

SHEETS = CameraSheets.load()
PARAMETERS = load_parameters(SHEET, MeasurementParameters)
#: Everything that is drawn at random, switched off.
EXACT = replace(
    PARAMETERS, error_over_sigma=0.0, clipped_error_over_sigma=0.0, unnamed_share=0.0, stray_share=0.0,
    no_ring_share=0.0, faintest_spread=0.0,
)  # fmt: skip
ALL = tuple(range(8))
_XML = """<mujoco><worldbody>
<body name="receiver" mocap="true"><geom type="sphere" size="0.01" pos="-9 0 0"/></body>
<body name="drogue" mocap="true"><geom type="sphere" size="0.01" pos="9 0 0"/></body>
<body name="board" mocap="true" pos="0 0 99"><geom type="box" size="0.01 0.04 0.04"/></body>
</worldbody></mujoco>"""


class Stand:
    """A receiver at the origin, a drogue that can be put, a small board that can be put in the way."""

    def __init__(self, parameters: MeasurementParameters = EXACT, faults=(), seed: int = 0, **changes) -> None:
        self.model = mujoco.MjModel.from_xml_string(_XML)
        self.data = mujoco.MjData(self.model)
        mounting = Mounting(R_BC=exp(np.array([0.0, 0.0, 0.02])), p_BC=np.array([3.0, -0.4, 0.7]), p_BP=np.zeros(3))
        self.built = draw_as_built(
            Camera(), LedRing(), mounting, load_parameters("as_built", AsBuiltParameters), SHEETS.leds,
            np.random.default_rng(4),
        )  # fmt: skip
        response = responses(SHEETS.lens, SHEETS.filter, SHEETS.sensor, SHEETS.leds, SHEETS.light, self.built.camera)
        self.leds = MeasuredLeds(
            parameters, SHEETS, self.built, response, self.model,
            rng=np.random.default_rng(seed), transfer=np.random.default_rng(1),
            defects=SimpleNamespace(dirt=lambda cover: None), faults=Faults(faults, 8),
            followed_s=NavigatorSettings().usable_age_s, **changes,
        )  # fmt: skip
        self.put(7.0)

    def turn(self, rotvec) -> np.ndarray:
        """Turn the drogue; return R_WD."""
        angle = np.linalg.norm(rotvec)
        self.data.mocap_quat[1] = [np.cos(angle / 2), *(np.sin(angle / 2) * np.asarray(rotvec) / angle)]
        mujoco.mj_kinematics(self.model, self.data)
        return self.data.xmat[self.model.body("drogue").id].reshape(3, 3)

    def put(self, depth_m: float, board_before: int | None = None, side_m: float = 0.1) -> None:
        """Put the drogue ahead of the lens and so far to the left, the board half-way to an LED."""
        R_WC, p_WC = self.built.mounting.R_BC, self.built.mounting.p_BC
        self.data.mocap_pos[1] = p_WC + R_WC @ np.array([depth_m, side_m, -0.05])
        self.data.mocap_pos[2] = [0.0, 0.0, 99.0]
        if board_before is not None:
            led = self.data.mocap_pos[1] + self.built.ring_positions_D[board_before]
            self.data.mocap_pos[2] = 0.5 * (p_WC + led)
        mujoco.mj_kinematics(self.model, self.data)

    def look(self, time_s: float = 1.0):
        """One exposure."""
        return self.leds.expose(self.data, time_s, 0, None)

    def true_px(self) -> np.ndarray:
        """(8, 2) the as-built pinhole projection."""
        built = self.built
        leds_W = self.data.mocap_pos[1] + built.ring_positions_D
        return built.camera.pixels_from_points((leds_W - built.mounting.p_BC) @ built.mounting.R_BC)


def test_without_errors_each_led_is_where_the_as_built_camera_images_it():
    for depth_m in (3.0, 7.0, 20.0):
        stand = Stand()
        stand.put(depth_m)
        seen = stand.look()
        assert tuple(seen.led_numbers) == ALL
        np.testing.assert_allclose(seen.centroids_px, stand.true_px(), atol=1e-9)
        assert seen.time_stamp_s == 1.0


def test_a_turned_drogue_turns_its_ring_and_where_its_leds_shine():
    """cos^m of the angle between the LEDs' axis, aft, and the sight line; their place by the same rotation."""
    stand = Stand()
    straight = stand.leds.view(stand.data, 1.0, 20e-6)
    R_WD = stand.turn([0.2, -0.5, 0.3])
    turned, built = stand.leds.view(stand.data, 1.0, 20e-6), stand.built
    leds_W = stand.data.mocap_pos[1] + built.ring_positions_D @ R_WD.T
    p_C = (leds_W - built.mounting.p_BC) @ built.mounting.R_BC
    np.testing.assert_allclose(turned.pixels_px, built.camera.pixels_from_points(p_C), atol=1e-9)
    np.testing.assert_allclose(turned.depth_m, p_C[:, 0], rtol=1e-12)
    aft_C = -(built.mounting.R_BC.T @ R_WD[:, 0])
    straight_C = (stand.data.mocap_pos[1] + built.ring_positions_D - built.mounting.p_BC) @ built.mounting.R_BC
    ratio = np.ones(8)
    for p, axis_C, power in ((p_C, aft_C, 1.0), (straight_C, -built.mounting.R_BC[0], -1.0)):
        range_m = np.linalg.norm(p, axis=1)
        cosine = -(p @ axis_C) / range_m
        ratio *= (cosine**SHEETS.leds.pattern_exponent / range_m**2) ** power
    assert ratio.max() < 0.9  # so turned
    np.testing.assert_allclose(turned.electrons / straight.electrons, ratio, rtol=2e-3)  # the filter's blue shift, too


def test_air_between_takes_its_part_of_each_spot():
    """Beer and Lambert along each sight line."""
    clear, hazy = (Stand(extinction_1_m=extinction) for extinction in (0.0, 0.05))
    views = [stand.leds.view(stand.data, 1.0, 20e-6) for stand in (clear, hazy)]
    built = clear.built
    range_m = np.linalg.norm(clear.data.mocap_pos[1] + built.ring_positions_D - built.mounting.p_BC, axis=1)
    np.testing.assert_allclose(views[1].electrons / views[0].electrons, np.exp(-0.05 * range_m), rtol=1e-9)


def test_a_flicker_faster_than_the_exposure_leaves_its_mean_light():
    """Two whole periods in 200 us, bright for 0.3 of each."""
    plain, flicker = Stand(), Stand(faults=[LedFlicker(frequency_hz=1e4, duty=0.3)])
    views = [stand.leds.view(stand.data, 1.0, 200e-6) for stand in (plain, flicker)]
    np.testing.assert_allclose(views[1].electrons / views[0].electrons, 0.3, rtol=1e-9)


def test_dirt_dims_the_leds_behind_it_and_no_other():
    stand = Stand(faults=[DirtyWindow(cover=0.5)])
    middle = float(np.median(stand.true_px()[:, 0]))
    smudge = SimpleNamespace(at=lambda pixels: np.where(pixels[:, 0] > middle, 0.25, 1.0))
    stand.leds._defects = SimpleNamespace(dirt=lambda cover: smudge if cover == 0.5 else None)
    clean, fault = stand.leds.view(stand.data, 1.0, 20e-6), stand.leds._faults.camera(1.0)
    dirty = stand.leds.view(stand.data, 1.0, 20e-6, fault)
    factor = np.where(clean.pixels_px[:, 0] > middle, 0.25, 1.0)
    np.testing.assert_allclose(dirty.electrons, factor * clean.electrons, rtol=1e-12)


@pytest.mark.parametrize("depth_m", [0.7, 3.0, 20.0])
def test_a_spot_is_widened_by_the_disc_out_of_focus_and_the_dies_image(depth_m):
    """A disc of diameter b has the variance b^2/16 on each axis, a square of side s has s^2/12."""
    stand, p = Stand(), EXACT
    camera = stand.built.camera
    disc_px = blur_px(SHEETS.lens, camera, np.array([1.0 / depth_m]))[0]
    die_px = camera.focal_length_px * SHEETS.leds.die_size_m / depth_m
    view = View(pixels_px=np.array([[900.0, 500.0]]), depth_m=np.array([depth_m]), electrons=np.array([1e4]),
                clear=np.array([True]))  # fmt: skip
    levels, width_px = stand.leds.spots(view)
    expected_px2 = p.spot_sigma_px**2 + p.widening_share * (disc_px**2 / 16.0 + die_px**2 / 12.0)
    np.testing.assert_allclose(width_px**2, [expected_px2], rtol=1e-12)
    black, gain = output_black(SHEETS.sensor), output_gain(SHEETS.sensor)
    peak_e = min(1e4 / (2.0 * np.pi * expected_px2), SHEETS.sensor.full_well_e)
    assert levels[0, 12] == min(np.floor(black + gain * peak_e), 255.0)
    beside_e = 1e4 / (2.0 * np.pi * expected_px2) * np.exp(-0.5 / expected_px2)
    assert levels[0, 11] == levels[0, 7] == min(np.floor(black + gain * beside_e), 255.0)


def test_a_pixel_holds_no_more_than_its_full_well():
    """Of a well half as deep as full scale needs, whatever falls on it."""
    stand = Stand()
    half = replace(SHEETS.sensor, full_well_e=0.5 * 255.0 / output_gain(SHEETS.sensor))
    stand.leds._sheets = replace(SHEETS, sensor=half)
    levels, _ = stand.leds.spots(stand.leds.view(stand.data, 1.0, SHEETS.exposure.longest_s))
    assert levels.max() == np.floor(output_black(SHEETS.sensor) + 0.5 * 255.0)


def test_a_spots_variance_is_that_of_floor_photons_background_and_texture():
    p = replace(EXACT, sigma_floor_px=0.02, photon_factor=1.5, background_e=300.0)
    variance, texture = Stand(p).leds.variances(np.array([1000.0]), np.array([0.8]), np.array([0]), np.array([50.0]))
    assert texture[0] == pytest.approx((0.8 * 50.0 / 1000.0) ** 2, rel=1e-12)
    assert variance[0] == pytest.approx(0.02**2 + 1.2**2 * 1300.0 / 1000.0**2 + texture[0], rel=1e-12)


def test_a_board_before_an_led_hides_that_one_alone():
    stand = Stand()
    stand.put(7.0, board_before=3)
    assert tuple(stand.look().led_numbers) == (0, 1, 2, 4, 5, 6, 7)


def test_leds_beside_the_lens_are_not_on_the_sensor_though_its_polynomial_would_fold_them_into_the_frame():
    stand = Stand()
    k1, k2, p1, p2, k3 = stand.built.camera.distortion
    stand.built = replace(stand.built, camera=replace(stand.built.camera, distortion=(k1, -0.004, p1, p2, k3)))
    stand.leds._as_built = stand.built
    folded = 0
    for side_m in np.arange(0.7, 1.1, 0.01):
        stand.put(0.2, side_m=side_m)
        camera, view = stand.built.camera, stand.leds.view(stand.data, 1.0, SHEETS.exposure.exposure_s)
        size = camera.width_px - 1.0, camera.height_px - 1.0
        folded += int(((stand.true_px() > 0.0) & (stand.true_px() < size)).all(axis=1).any())
        assert not view.clear.any()
    assert folded > 0


def test_the_stated_sigma_is_that_of_photons_on_a_gaussian():
    """Without floor, background and texture, a = 1: w/sqrt(N), the classical bound."""
    plain = replace(EXACT, sigma_floor_px=0.0, background_e=0.0, texture_e=0.0, photon_factor=1.0)
    stand = Stand(plain)
    seen, view = stand.look(), stand.leds.view(stand.data, 1.0, SHEETS.exposure.exposure_s)
    _, width_px = stand.leds.spots(view)
    np.testing.assert_allclose(seen.sigma_px, width_px / np.sqrt(view.electrons), rtol=1e-12)


def test_a_clipped_spot_states_the_root_of_its_full_pixels_up_to_the_most():
    leds = Stand().leds
    variance, texture = leds.variances(np.full(4, 2e5), np.full(4, 0.8), np.array([1, 2, 4, 9]), np.full(4, 90.0))
    p = EXACT
    np.testing.assert_allclose(variance, p.clipped_sigma_px**2 * np.array([1.0, 2.0, p.clipped_most, p.clipped_most]))
    assert not texture.any()


def test_errors_have_the_stated_spread_times_the_ratio():
    """Chi-square of 16 x 400 normals: a false alarm in 1e4 seeds; the seed is fixed."""
    stand = Stand(replace(EXACT, error_over_sigma=0.9, texture_lasting_share=0.0))
    frames = [stand.look(0.02 * k) for k in range(400)]
    z = np.concatenate([(one.centroids_px - stand.true_px()) / (0.9 * one.sigma_px[:, None]) for one in frames])
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], z.size)
    assert low < (z**2).sum() < high
    assert abs(z.mean()) < norm.ppf(1.0 - 5e-5) / np.sqrt(z.size)


def test_errors_of_clipped_spots_have_a_ratio_of_their_own():
    """Chi-square of 16 x 200 normals: a false alarm in 1e4 seeds; the seed is fixed."""
    stand = Stand(replace(EXACT, clipped_error_over_sigma=0.7), [ExposureStuck(exposure_s=500e-6)])
    frames = [stand.look(0.02 * k) for k in range(200)]
    full = (stand.leds.spots(stand.leds.view(stand.data, 1.0, 500e-6))[0] == 255).any(axis=1)
    assert full.all()
    z = np.concatenate([(one.centroids_px - stand.true_px()) / (0.7 * one.sigma_px[:, None]) for one in frames])
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], z.size)
    assert low < (z**2).sum() < high


def test_a_share_of_the_leds_is_put_in_a_wrong_place_as_far_off_as_the_sheet_says():
    """Strays within five standard deviations of a binomial, their squares as chi-square has it; the seed is fixed."""
    stand, frames = Stand(replace(EXACT, stray_share=0.2, stray_px=3.0)), 200
    off = np.concatenate([stand.look(0.02 * k).centroids_px - stand.true_px() for k in range(frames)])
    stray = np.abs(off).max(axis=1) > 1e-6
    assert stray.mean() == pytest.approx(0.2, abs=5.0 * np.sqrt(0.2 * 0.8 / len(off)))
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], off[stray].size)
    assert low < ((off[stray] / 3.0) ** 2).sum() < high


def test_a_ring_is_lost_in_proportion_to_the_texture_where_it_is_and_not_where_one_led_is():
    """In dense haze there is texture before one LED at 3 m, which alone would lose it, and next to none at 7 m."""
    p = replace(EXACT, no_ring_share=100.0, texture_exponent=1.5, texture_exposure_s=SHEETS.exposure.exposure_s)
    stand = Stand(p, texture_light=TextureLight(extinction_1_m=1.0), automatic_exposure=False)
    view = stand.leds.view(stand.data, 1.0, SHEETS.exposure.exposure_s)
    one_near = replace(view, depth_m=np.array([3.0, *view.depth_m[1:]]))
    stand.leds.view = lambda *_: one_near
    assert len(stand.look().led_numbers) == 8


def test_the_lasting_part_of_the_textures_error_is_correlated_over_its_time():
    """All error is texture's and half of it lasts: correlation 0.5 exp(-lag/T); 3000 frames give it to 0.05."""
    p = replace(
        EXACT, error_over_sigma=1.0, sigma_floor_px=0.0, photon_factor=0.0, texture_e=500.0, texture_lasting_share=0.5,
        texture_time_s=0.2,
    )  # fmt: skip
    stand = Stand(p, automatic_exposure=False)
    z = np.array([(stand.look(0.02 * k).centroids_px - stand.true_px()).ravel() for k in range(3000)])[100:]
    z /= z.std()
    for lag in (1, 10):
        assert np.mean(z[lag:] * z[:-lag]) == pytest.approx(0.5 * np.exp(-0.02 * lag / 0.2), abs=0.05)


def test_the_exposure_brings_the_metered_pixel_to_its_target_within_the_dead_band():
    for depth_m in (6.0, 12.0, 25.0):
        stand = Stand()
        stand.put(depth_m)
        for k in range(12):
            stand.look(0.02 * k)
        levels, _ = stand.leds.spots(stand.leds.view(stand.data, 1.0, stand.leds.exposure_s))
        black = output_black(SHEETS.sensor)
        span = min(black + output_gain(SHEETS.sensor) * SHEETS.sensor.full_well_e, 255.0) - black
        metered = (np.sort(levels, axis=None)[-SHEETS.exposure.metered_pixel] - black) / span
        assert metered == pytest.approx(SHEETS.exposure.target_level, rel=SHEETS.exposure.dead_band + 0.02)


@pytest.mark.parametrize(("dark", "left"), [((0, 2, 5), (1, 3, 4, 6, 7)), ((0, 2, 5, 7), (1, 3, 4, 6)), (range(5), ())])
def test_dark_leds_are_not_named_and_too_few_are_no_ring(dark, left):
    assert tuple(Stand(faults=[LedOff(leds=tuple(dark))]).look().led_numbers) == left


@pytest.mark.parametrize("left", [1, 2, 3])
def test_leds_too_few_for_a_ring_are_named_while_one_is_followed_and_begin_none(left):
    """For 0.5 s after the last that were named, as the navigation's belief does; then four are needed again."""
    dark = tuple(range(left, 8))
    faults = [LedOff(leds=dark, start_s=1.0), LedOff(start_s=1.2, stop_s=1.6), LedOff(start_s=2.0, stop_s=2.6)]
    stand, counts = Stand(faults=faults), {}
    for k in range(160):
        counts[k] = len(stand.look(0.02 * k).led_numbers)
    assert {counts[k] for k in range(50)} == {8}
    assert {counts[k] for k in range(51, 60)} | {counts[k] for k in range(81, 100)} == {left}
    assert {counts[k] for k in range(61, 80)} | {counts[k] for k in range(101, 160)} == {0}
    assert len(Stand(faults=[LedOff(leds=dark)]).look().led_numbers) == 0


@pytest.mark.parametrize(("later_s", "count"), [(0.5, 2), (0.51, 0)])
def test_a_ring_is_followed_for_as_long_as_the_navigations_belief_may_be_used(later_s, count):
    assert NavigatorSettings().usable_age_s == 0.5
    stand = Stand(faults=[LedOff(leds=tuple(range(2, 8)), start_s=0.1)])
    assert len(stand.look(0.0).led_numbers) == 8
    assert len(stand.look(later_s).led_numbers) == count


def test_an_led_dimmed_below_the_faintest_level_is_not_seen_and_above_it_is():
    stand = Stand(automatic_exposure=False)
    view = stand.leds.view(stand.data, 1.0, SHEETS.exposure.exposure_s)
    levels, _ = stand.leds.spots(view)
    t = SHEETS.exposure.exposure_s
    faintest_dn = EXACT.faintest_dn + EXACT.faintest_dn_per_e * float(stand.leds.texture_e(t, view.depth_m)[2])
    factor = faintest_dn / (levels[2].max() - output_black(SHEETS.sensor))
    for times, seen in ((0.5, False), (2.5, True)):  # output levels are whole numbers
        dimmed = Stand(faults=[LedDim(leds=(2,), factor=min(times * factor, 1.0))], automatic_exposure=False)
        assert (2 in dimmed.look().led_numbers) is seen


@pytest.mark.parametrize("above_dark_dn", [1, 2, 4])
def test_an_led_is_seen_in_the_share_of_frames_that_its_levels_above_a_dark_pixel_have_over_the_faintest(above_dark_dn):
    """Within five standard deviations of a binomial: a false alarm in 1.7e6; the seed is fixed."""
    p, t, frames = replace(EXACT, faintest_spread=PARAMETERS.faintest_spread), SHEETS.exposure.exposure_s, 600
    stand = Stand(automatic_exposure=False)
    view, gain = stand.leds.view(stand.data, 1.0, t), output_gain(SHEETS.sensor)
    _, width_px = stand.leds.spots(view)
    off_px2 = ((view.pixels_px[2] - np.round(view.pixels_px[2])) ** 2).sum()
    peak_e = view.electrons[2] * np.exp(-0.5 * off_px2 / width_px[2] ** 2) / (2.0 * np.pi * width_px[2] ** 2)
    dimmed = Stand(p, [LedDim(leds=(2,), factor=above_dark_dn / (gain * peak_e))], automatic_exposure=False)
    seen = np.mean([2 in dimmed.look(0.02 * k).led_numbers for k in range(frames)])
    faintest_dn = p.faintest_dn + p.faintest_dn_per_e * stand.leds.texture_e(t, view.depth_m)[2]
    share = norm.cdf(np.log(above_dark_dn / faintest_dn) / p.faintest_spread)
    assert seen == pytest.approx(share, abs=5.0 * np.sqrt(share * (1.0 - share) / frames))


@pytest.mark.parametrize("black_dn", [8.0, 10.0, 11.0])
def test_a_dark_led_is_never_seen_whatever_the_black_level(black_dn):
    stand = Stand(replace(EXACT, faintest_spread=3.0), [LedOff(leds=(2,))])
    stand.leds._black = output_black(replace(SHEETS.sensor, black_level_dn=black_dn))
    assert not any(2 in stand.look(0.02 * k).led_numbers for k in range(200))


def test_a_camera_that_has_dropped_out_sends_nothing_and_a_stuck_one_the_same_again():
    faults = [StuckFrame(start_s=1.0, stop_s=2.0), CameraDropOut(start_s=2.0, stop_s=3.0)]
    stand = Stand(PARAMETERS, faults)
    before, stuck = stand.look(0.9), stand.look(1.1)
    np.testing.assert_array_equal(stuck.centroids_px, before.centroids_px)
    assert stuck.time_stamp_s == 1.1
    assert stand.look(2.5) is None
    assert stand.look(3.1) is not None


def test_a_camera_that_is_stuck_from_its_first_frame_on_sends_that_one():
    stand = Stand(PARAMETERS, [StuckFrame()])
    first, second = stand.look(0.0), stand.look(0.02)
    assert len(first.led_numbers) > 0
    np.testing.assert_array_equal(second.centroids_px, first.centroids_px)


def test_a_drop_out_leaves_the_numbers_of_later_frames_as_they_are():
    p = replace(PARAMETERS, texture_lasting_share=0.0)
    whole, broken = Stand(p, seed=3), Stand(p, [CameraDropOut(start_s=0.05, stop_s=0.07)], seed=3)
    series = [[stand.look(0.02 * k) for k in range(8)] for stand in (whole, broken)]
    assert series[1][3] is None
    np.testing.assert_array_equal(series[0][7].centroids_px, series[1][7].centroids_px)


def test_a_drop_out_leaves_the_transfers_of_later_frames_as_they_are():
    """Each frame takes a number of the stream, whether it arrives or not."""
    taken = []
    for faults in ((), [CameraDropOut(start_s=0.01, stop_s=0.03)]):
        stand = Stand(faults=faults, automatic_exposure=False)
        for k in range(3):
            if (frame := stand.look(0.02 * k)) is not None:
                latency_s = stand.leds.latency_s(frame)
        taken.append(latency_s)
    assert taken[0] == taken[1]


def test_a_stuck_exposure_is_the_one_in_use():
    stand = Stand(faults=[ExposureStuck(exposure_s=200e-6)])
    stand.look()
    assert stand.leds.exposure_s == 200e-6


def test_an_exposure_asked_for_is_made_within_the_limits_and_leaves_the_cameras_own_control_alone():
    asked, alone = Stand(), Stand()
    for k in range(6):
        alone.look(0.02 * k)
        asked.look(0.02 * k)
    for exposure_s, made_s in ((200e-6, 200e-6), (1.0, SHEETS.exposure.longest_s), (1e-9, SHEETS.exposure.shortest_s)):
        asked.leds.expose(asked.data, 1.0, 7, None, exposure_s)
        assert asked.leds.exposure_s == made_s
    asked.look(2.0)
    alone.look(2.0)
    assert asked.leds.exposure_s == alone.leds.exposure_s
    stuck = Stand(faults=[ExposureStuck(exposure_s=200e-6)])
    stuck.leds.expose(stuck.data, 0.0, 0, None, 50e-6)
    assert stuck.leds.exposure_s == 200e-6  # whatever is asked for


def test_shares_of_unnamed_leds_and_of_frames_without_a_ring_are_those_of_the_sheet():
    """Within five standard deviations of a binomial: a false alarm in 1.7e6; the seed is fixed."""
    p = replace(EXACT, unnamed_share=0.1, no_ring_share=0.2, texture_exposure_s=SHEETS.exposure.exposure_s)
    stand, frames = Stand(p, automatic_exposure=False), 600
    counts = np.array([len(stand.look(0.02 * k).led_numbers) for k in range(frames)])
    without = (counts == 0).mean()
    assert without == pytest.approx(0.2, abs=5.0 * np.sqrt(0.2 * 0.8 / frames))
    assert counts[counts > 0].mean() / 8.0 == pytest.approx(0.9, abs=5.0 * np.sqrt(0.09 / (8 * 0.8 * frames)))


@pytest.mark.parametrize("factor", [0.0, 0.25, 1.0])
def test_with_the_textures_light_go_its_part_of_the_sigma_and_the_faintest_level(factor):
    p, t = replace(EXACT, texture_e=3000.0, texture_exposure_s=SHEETS.exposure.exposure_s), SHEETS.exposure.exposure_s
    fixed = {"texture_light": TextureLight(factor=factor), "automatic_exposure": False}
    stand, bare = Stand(p, **fixed), Stand(replace(p, texture_e=0.0), automatic_exposure=False)
    view = stand.leds.view(stand.data, 1.0, t)
    levels, width_px = stand.leds.spots(view)
    own_px2 = (width_px * factor * 3000.0 / view.electrons) ** 2
    np.testing.assert_allclose(stand.look().sigma_px ** 2 - bare.look().sigma_px ** 2, own_px2, rtol=1e-9, atol=1e-15)
    faintest_dn = p.faintest_dn + p.faintest_dn_per_e * factor * 3000.0
    dim = faintest_dn / (levels[2].max() - output_black(SHEETS.sensor))
    for times, seen in ((0.5, False), (2.5, True)):  # output levels are whole numbers
        dimmed = Stand(p, [LedDim(leds=(2,), factor=min(times * dim, 1.0))], **fixed)
        assert (2 in dimmed.look().led_numbers) is seen


@pytest.mark.parametrize("factor", [0.0, 0.25, 1.0])
def test_with_the_textures_light_go_the_shares_without_a_name_and_without_a_ring(factor):
    """Within five standard deviations of a binomial, as above."""
    p = replace(EXACT, unnamed_share=0.2, no_ring_share=0.2, texture_exposure_s=SHEETS.exposure.exposure_s)
    stand, frames = Stand(p, texture_light=TextureLight(factor=factor), automatic_exposure=False), 400
    counts = np.array([len(stand.look(0.02 * k).led_numbers) for k in range(frames)])
    share = 0.2 * factor
    spread = np.sqrt(share * (1.0 - share) / frames)
    assert (counts == 0).mean() == pytest.approx(share, abs=5.0 * spread)
    assert counts[counts > 0].mean() / 8.0 == pytest.approx(1.0 - share, abs=5.0 * spread / np.sqrt(8.0 * 0.7))


def test_in_haze_the_texture_fades_with_the_depth_of_each_led():
    light, z = TextureLight(factor=0.5, extinction_1_m=0.02), np.array([5.0, 15.0, -3.0])
    hazy, clear = (Stand(texture_light=one).leds.texture_e(60e-6, z) for one in (light, TextureLight()))
    q = PARAMETERS.texture_exponent
    np.testing.assert_allclose(hazy / clear, 0.5 * np.exp(-q * 0.02 * np.array([5.0, 15.0, 0.0])), rtol=1e-12)
    np.testing.assert_array_equal(clear, PARAMETERS.texture_e * (60e-6 / PARAMETERS.texture_exposure_s) ** q)


def test_latency_follows_the_window_of_a_ring_that_is_tracked_and_the_full_frame_before():
    """Rows are read one after another: the difference of the two is theirs."""
    no_jitter = replace(SHEETS, sensor=replace(SHEETS.sensor, transfer_jitter_s=0.0))
    stand = Stand()
    stand.leds._sheets = no_jitter
    first = stand.leds.latency_s(stand.look(0.0)) - 0.5 * stand.leds.exposure_s
    later = stand.leds.latency_s(stand.look(0.02)) - 0.5 * stand.leds.exposure_s
    height_px = np.ptp(stand.true_px()[:, 1])
    rows = EXACT.window_heights * height_px + EXACT.window_margin_px
    row_s = SHEETS.sensor.row_clocks / SHEETS.sensor.clock_hz * 16 / SHEETS.sensor.outputs
    assert first - later == pytest.approx((1088 - rows) * row_s, abs=2.0 * row_s)


def test_latency_is_counted_from_the_middle_of_the_exposure_that_was_taken():
    """A frame of 500 us has its last row 200 us later after its stamp than one of 100 us."""
    no_jitter = replace(SHEETS, sensor=replace(SHEETS.sensor, transfer_jitter_s=0.0))
    latencies_s = []
    for exposure_s in (100e-6, 500e-6):
        stand = Stand(faults=[ExposureStuck(exposure_s=exposure_s)])
        stand.leds._sheets = no_jitter
        latencies_s.append(stand.leds.latency_s(stand.look()))
    assert latencies_s[1] - latencies_s[0] == pytest.approx(200e-6, rel=1e-9)


def test_the_window_is_as_high_above_the_rings_middle_as_below_it():
    """LEDs in rows 490 to 510 and a margin of 40 px, windows as high as the ring: rows 470 to 530, 61 of them."""
    stand = Stand(replace(EXACT, window_heights=1.0, window_margin_px=40.0))
    view = stand.leds.view(stand.data, 1.0, 20e-6)
    rows_px = np.linspace(490.0, 510.0, 8)
    window = stand.leds.window(replace(view, pixels_px=np.column_stack([view.pixels_px[:, 0], rows_px])))
    assert (window.row_start, window.row_stop) == (470, 531)


def test_where_no_led_is_on_the_sensor_the_window_is_all_of_it_and_else_it_ends_with_the_sensor():
    stand = Stand()
    view = stand.leds.view(stand.data, 1.0, 20e-6)
    height, width = stand.built.camera.height_px, stand.built.camera.width_px
    assert stand.leds.window(replace(view, clear=np.zeros(8, bool))) == Window(0, height, 0, width)
    for row_px in (0.0, height - 1.0):
        at_the_edge = replace(view, pixels_px=np.column_stack([view.pixels_px[:, 0], np.full(8, row_px)]))
        window = stand.leds.window(at_the_edge)
        assert window.row_start >= 0 and window.row_stop <= height
        half = 0.5 * EXACT.window_margin_px
        assert window.row_stop - window.row_start == pytest.approx(half, abs=2.0)


def test_a_ring_at_the_right_edge_of_the_wide_sensor_is_on_it():
    """Farther right than the sensor is high: its 2048 columns count, not its 1088 rows."""
    stand = Stand()
    stand.put(7.0, side_m=-1.2)
    assert stand.true_px()[:, 0].min() > stand.built.camera.height_px
    assert tuple(stand.look().led_numbers) == ALL


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"faults": [{"kind": "hot_pixels", "count": 9}]}, "hot pixels"),
        ({"weather.cloud_cover": 0.3}, "clouds"),
        ({"sun.azimuth_deg": 5.0, "sun.elevation_deg": 10.0}, "the Sun in the camera's field"),
    ],
)
def test_what_acts_through_the_picture_alone_is_refused(settings, reason):
    with pytest.raises(DockairError, match=reason):
        refuse_unmodelled(load_scenario("default", settings), Stand().built.camera, Stand().built.mounting)


@pytest.mark.parametrize(("azimuth_deg", "is_refused"), [(0.0, True), (24.5, True), (-22.5, True), (29.5, False)])
def test_the_sun_is_refused_as_far_beside_the_field_as_the_receivers_attitude_may_turn_it_in(azimuth_deg, is_refused):
    """Half of the field's diagonal is 21.7 degrees, the camera looks 1.1 to the left, and 5 are added."""
    scenario = load_scenario("default", {"sun.azimuth_deg": azimuth_deg, "sun.elevation_deg": 0.0})
    mounting = Mounting(R_BC=exp(np.array([0.0, 0.0, 0.02])), p_BC=np.zeros(3), p_BP=np.zeros(3))
    if is_refused:
        with pytest.raises(DockairError, match="the Sun in the camera's field"):
            refuse_unmodelled(scenario, Camera(), mounting)
    else:
        refuse_unmodelled(scenario, Camera(), mounting)


@pytest.mark.parametrize("exposure", ["auto", "fixed"])
def test_what_stands_in_place_of_the_camera_has_the_scenarios_air_and_exposure(exposure):
    scenario = load_scenario("still_air", {"weather.visibility_m": 2000.0, "camera.exposure": exposure})
    stand = Stand()
    made = measured_leds(scenario, 0, stand.built, Faults((), 8), SimpleNamespace(model=stand.model))
    electrons = [leds.view(stand.data, 1.0, 20e-6).electrons for leds in (made, stand.leds)]
    range_m = np.linalg.norm(stand.data.mocap_pos[1] + stand.built.ring_positions_D - stand.built.mounting.p_BC, axis=1)
    np.testing.assert_allclose(electrons[0] / electrons[1], np.exp(-3.912 / 2000.0 * range_m), rtol=1e-3)
    for k in range(4):
        made.expose(stand.data, 0.02 * k, k, None)
    assert (made.exposure_s == SHEETS.exposure.exposure_s) is (exposure == "fixed")
    assert made._followed_s == NavigatorSettings().usable_age_s


def test_one_fault_in_the_picture_is_refused_among_others():
    faults = [{"kind": "hot_pixels", "count": 9}, {"kind": "led_off", "leds": [1]}]
    with pytest.raises(DockairError, match="hot pixels"):
        refuse_unmodelled(load_scenario("default", {"faults": faults}), Stand().built.camera, Stand().built.mounting)


def test_the_default_scenario_and_a_night_with_the_sun_below_are_not_refused():
    built: AsBuilt = Stand().built
    for settings in ({}, {"sun.azimuth_deg": 5.0, "weather.night": True}):
        refuse_unmodelled(load_scenario("default", settings), built.camera, built.mounting)
