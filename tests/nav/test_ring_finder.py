"""From blobs to named LEDs, with a belief that is right."""

import numpy as np
import pytest

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.messages import CameraFrame, Window
from dockair.nav import ring_finder
from dockair.nav.identify.result import IdentificationStatus, nothing
from dockair.nav.image.detect import Blobs, DetectSettings
from dockair.nav.navigator import NavigatorSettings
from dockair.nav.ring_finder import FewSettings, RingFinder
from dockair.nav.track import TrackSettings
from dockair.rotations import exp

CAMERA, CENTROID_PX, BELIEF_PX = Camera(), 0.02, 1.0
MISPLACED_M = NavigatorSettings().led_position_sigma_m
NOTHING = np.zeros((2, 2), np.uint8)
R_BC, P_BC = exp(np.array([0.3, -0.2, 0.1])), np.array([3.0, -0.5, 0.7])
TURNED_RAD = 0.2
UNEVEN = LedRing(angles_deg=(0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 327.0))
AMBIGUOUS, NOT_FOUND = IdentificationStatus.AMBIGUOUS, IdentificationStatus.NOT_FOUND


def leds_px(roll_rad=0.0, shift_px=(0.0, 0.0), ring=None, range_m=6.0):
    """(8, 2) of a frontal ring in the middle of the frame, rolled from left toward up in the image, and shifted."""
    points = (ring or LedRing()).positions_D @ exp(np.array([roll_rad, 0.0, 0.0])).T
    return CAMERA.pixels_from_points(points + [range_m, 0.0, 0.0]) + np.array(shift_px)


LEDS_PX = leds_px()
MIDDLE_PX, RADIUS_PX = LEDS_PX.mean(axis=0), 0.5 * np.ptp(LEDS_PX[:, 0])
NO_BLOBS = np.empty((0, 2))


class Belief:
    """Knows where the LEDs of a sheet are, to a pixel, and keeps what it is asked and told."""

    def __init__(self, led_px=None, sigma_px=BELIEF_PX):
        self.led_px, self.sigma_px = np.full((8, 2), np.nan) if led_px is None else led_px, np.full(8, sigma_px)
        self.asked_s, self.turned_rad = [], []

    def predicted_led_pixels(self, time_s):
        self.asked_s.append(time_s)
        return self.led_px, self.sigma_px

    def rate_B(self, time_s):
        return np.array([0.1, 0.2, 0.3]) * time_s

    def turn_drogue(self, angle_rad, time_s):
        self.turned_rad.append(angle_rad)


def blobs_at(pixels, sigma_px=CENTROID_PX):
    n = len(pixels)
    ones, whole = np.ones(n), np.ones(n, np.int64)
    return Blobs(
        centroids_px=pixels, area_px=9 * whole, peak=100 * whole, sigma_px=sigma_px * ones, clipped=whole < 0,
        flux=1000.0 * ones, threshold_dn=10, thresholds_dn=10 * whole,
    )  # fmt: skip


def finder_of(belief, ring=None, few=None):
    mounting = Mounting(R_BC=R_BC, p_BC=P_BC, p_BP=np.zeros(3))
    start = StartGeometry(p_PD_B=np.zeros(3), sigma_p_m=np.ones(3), R_BD=np.eye(3), sigma_R_rad=np.ones(3))
    gyro = GyroSheet(rate_hz=500, noise_density_rad_s_rthz=1e-4, bias_sigma_rad_s=1e-3)
    sheets = NavigationSheets(
        camera=CAMERA, ring=ring or LedRing(), mounting=mounting, start=start, gyro=gyro, camera_rate_hz=50,
        control_rate_hz=100, coupling_depth_m=0.3,
    )  # fmt: skip
    return RingFinder(sheets, belief, DetectSettings(), TrackSettings(), TURNED_RAD, few, misplaced_m=MISPLACED_M)


def look(monkeypatch, finder, pixels, time_s=0.0, window=CAMERA.full_window, sigma_px=CENTROID_PX, **keys):
    """Let a finder see blobs (n, 2) in a frame."""
    monkeypatch.setattr(ring_finder, "detect", lambda *_, **__: blobs_at(pixels, sigma_px))
    frame = CameraFrame(time_stamp_s=time_s, pixels=NOTHING, window=window, exposure_s=1e-4, gain=1.0)
    return finder.find(frame, **keys)


@pytest.mark.parametrize("diameter_m", [0.2, 0.5, 0.8])
def test_leds_as_far_off_their_places_as_the_tolerance_lets_them_are_found_on_a_ring_of_any_size(
    diameter_m, monkeypatch
):
    """100 rings of one size in the image. Of 800 LEDs 0.27 are off by more than four sigma, over 3 once in 6000 sets.

    By the tolerance of a ring of 0.5 m half of the rings of 0.2 m would lose an LED or more.
    """
    rng, ring, belief = np.random.default_rng(1), LedRing(diameter_m=diameter_m), Belief()
    missing = 0
    for _ in range(100):
        finder = finder_of(belief, ring)
        R, p = exp(np.radians(rng.uniform(-8.0, 8.0, 3))), np.array([6.0 * diameter_m, *rng.uniform(-0.1, 0.1, 2)])
        off = np.zeros((8, 3))
        off[:, 1:] = MISPLACED_M * rng.standard_normal((8, 2))
        belief.led_px = CAMERA.pixels_from_points(ring.positions_D @ R.T + p) + BELIEF_PX * rng.standard_normal(2)
        seen_px = CAMERA.pixels_from_points((ring.positions_D + off) @ R.T + p)
        found = look(monkeypatch, finder, seen_px + CENTROID_PX * rng.standard_normal((8, 2)))
        missing += 8 - len(found.led_numbers)
    assert missing <= 3


def test_a_late_frame_says_nothing_of_the_window_of_the_next(monkeypatch):
    """Two LEDs of the newest frame are named singly, and none of one before it; then the other way round."""
    for newest, late in ((LEDS_PX[[1, 5]], NO_BLOBS), (NO_BLOBS, LEDS_PX[[1, 5]])):
        finder = finder_of(Belief(LEDS_PX))
        named = look(monkeypatch, finder, newest, time_s=1.0, followed=True)
        window = finder.window(1.0)
        assert (window is not None) == (len(named.led_numbers) == 2)
        assert len(look(monkeypatch, finder, late, time_s=0.98, followed=True).led_numbers) == len(late)
        assert finder.window(1.0) == window


def test_a_late_frame_moves_neither_the_track_nor_its_window(monkeypatch):
    belief = Belief(LEDS_PX)
    finder = finder_of(belief)
    look(monkeypatch, finder, LEDS_PX, time_s=1.0)
    window = finder.window(1.0)
    belief.led_px = leds_px(shift_px=(30.0, 0.0))
    assert len(look(monkeypatch, finder, belief.led_px, time_s=0.98).led_numbers) == 8
    assert finder.window(1.0) == window is not None
    look(monkeypatch, finder, NO_BLOBS, time_s=0.98, window=Window(0, 100, 0, 100))
    assert finder.window(1.0) == window


def test_the_track_gives_way_where_no_ring_is_found_and_the_window_does_not_show_where_the_belief_has_it(monkeypatch):
    """Of the ring only what lies on the sensor can be shown."""
    for shift_px, window, kept in (
        ((0.0, 0.0), CAMERA.full_window, True),
        ((0.0, 0.0), Window(400, 600, 800, 1300), False),
        ((-MIDDLE_PX[0], 0.0), Window(400, 700, 0, 200), True),
        ((-MIDDLE_PX[0], 0.0), Window(400, 700, 1, 200), False),
    ):
        belief = Belief(leds_px(shift_px=shift_px))
        finder = finder_of(belief)
        belief.led_px = LEDS_PX
        assert len(look(monkeypatch, finder, LEDS_PX, time_s=1.0).led_numbers) == 8
        belief.led_px = leds_px(shift_px=shift_px)
        look(monkeypatch, finder, NO_BLOBS, time_s=1.02, window=window)
        assert (finder.window(1.02) is not None) == kept


def test_a_window_holds_the_pixels_whose_centres_it_reads():
    """Rows 2 to 4 and columns 10 to 14: v from 1.5 to 4.5, u from 9.5 to 14.5."""
    inside = [[9.6, 1.6], [14.4, 4.4]]
    outside = [[9.4, 3.0], [14.6, 3.0], [12.0, 1.4], [12.0, 4.6], [np.nan, 3.0]]
    found = ring_finder._inside(np.array(inside + outside), Window(2, 5, 10, 15))
    np.testing.assert_array_equal(found, [True, True, False, False, False, False, False])


@pytest.mark.parametrize("off_rad", [-0.3, -0.1, 0.1, 0.3])
def test_a_belief_of_another_roll_is_turned_by_the_difference_where_its_gate_may_not_bridge_it(off_rad, monkeypatch):
    belief = Belief(leds_px(roll_rad=1.0 - off_rad))
    found = look(monkeypatch, finder_of(belief), leds_px(roll_rad=1.0))
    np.testing.assert_array_equal(found.led_numbers, np.arange(8))
    expected = [off_rad] if abs(off_rad) > TURNED_RAD else []
    np.testing.assert_allclose(belief.turned_rad, expected, atol=1e-3)


@pytest.mark.parametrize("off_rad", [-3.0, -1.3, 1.3, 3.0])
def test_a_code_turns_a_belief_by_more_than_half_a_place_and_not_the_long_way_round(off_rad, monkeypatch):
    belief = Belief(leds_px(roll_rad=2.5 - off_rad, ring=UNEVEN))
    found = look(monkeypatch, finder_of(belief, UNEVEN), leds_px(roll_rad=2.5, ring=UNEVEN))
    np.testing.assert_array_equal(found.led_numbers, np.arange(8))
    np.testing.assert_allclose(belief.turned_rad, [off_rad], atol=1e-3)


def test_the_roll_of_the_track_counts_before_the_beliefs_also_for_a_while_after_a_loss(monkeypatch):
    """A belief off by 30 degrees would take the next LED for each; only while nothing is tracked is it turned."""
    belief = Belief(LEDS_PX)
    finder = finder_of(belief)
    look(monkeypatch, finder, LEDS_PX, time_s=1.0)
    belief.led_px = leds_px(roll_rad=np.deg2rad(30.0))
    found = look(monkeypatch, finder, LEDS_PX, time_s=1.02)
    np.testing.assert_array_equal(found.led_numbers, np.arange(8))
    assert not belief.turned_rad
    look(monkeypatch, finder, NO_BLOBS, time_s=1.04, window=Window(0, 100, 0, 100))
    found = look(monkeypatch, finder, LEDS_PX, time_s=1.06)
    np.testing.assert_array_equal(found.led_numbers, np.arange(8))
    np.testing.assert_allclose(belief.turned_rad, [-np.deg2rad(30.0)], atol=1e-3)


def test_rolls_to_both_sides_of_half_a_turn_are_near_each_other(monkeypatch):
    """The track remembers 3.1 rad, the belief has -3.1 rad."""
    belief, seen_px = Belief(leds_px(roll_rad=3.1)), leds_px(roll_rad=3.1)
    finder = finder_of(belief)
    look(monkeypatch, finder, seen_px, time_s=1.0)
    look(monkeypatch, finder, NO_BLOBS, time_s=1.02, window=Window(0, 100, 0, 100))
    belief.led_px = leds_px(roll_rad=-3.1)
    found = look(monkeypatch, finder, seen_px, time_s=1.04)
    np.testing.assert_array_equal(found.led_numbers, np.arange(8))
    assert not belief.turned_rad


def test_a_ring_farther_off_than_the_beliefs_sigma_is_found_within_a_radius_and_beyond_it_only_where_it_is_lost(
    monkeypatch,
):
    for radii, lost, found in ((0.5, False, True), (3.0, False, False), (3.0, True, True)):
        seen_px = leds_px(shift_px=(radii * RADIUS_PX, 0.0))
        leds = look(monkeypatch, finder_of(Belief(LEDS_PX)), seen_px, lost=lost)
        assert len(leds.led_numbers) == (8 if found else 0)


def test_a_ring_where_the_belief_has_it_is_numbered_by_it_though_it_was_lost(monkeypatch):
    """Searched for without a belief LED 0 would be the leftmost one."""
    seen_px = leds_px(roll_rad=2.0)
    found = look(monkeypatch, finder_of(Belief(seen_px)), seen_px, lost=True)
    np.testing.assert_allclose(found.centroids_px, seen_px[found.led_numbers])


def test_a_ring_in_doubt_is_looked_for_once_more_with_twice_the_tolerance_of_its_leds_places(monkeypatch):
    for status, factors in ((AMBIGUOUS, [1.0, 2.0]), (NOT_FOUND, [1.0])):
        tried = []

        def says(*_, settings, status=status, tried=tried, **__):
            tried.append(settings.ring_sigma)
            return nothing(status)

        monkeypatch.setattr(ring_finder, "identify", says)
        finder_of(Belief(LEDS_PX))._identified(blobs_at(LEDS_PX))
        np.testing.assert_allclose(tried, np.array(factors) * MISPLACED_M / 0.25)


def test_the_identification_is_told_the_brightnesses_and_how_sure_the_belief_is(monkeypatch):
    told, belief = [], Belief(LEDS_PX)
    belief.sigma_px = np.array([0.5, 0.7, np.nan, 0.1, 0.1, 0.1, 0.1, 0.1])
    monkeypatch.setattr(ring_finder, "identify", lambda *_, **keys: told.append(keys) or nothing(NOT_FOUND))
    look(monkeypatch, finder_of(belief), LEDS_PX)
    # for the roll, the ring, within a radius
    assert [keys.get("expected_sigma_px") for keys in told] == [0.7, 0.7, None]
    assert all((keys["brightness"] == 1000.0).all() for keys in told)
    assert ring_finder._largest(np.full(8, np.nan)) is None


def test_the_detection_is_told_the_frames_gain_and_window(monkeypatch):
    told, window = [], Window(10, 12, 20, 22)

    def detects(pixels, settings, window, **keys):
        told.append((window, keys))
        return blobs_at(NO_BLOBS)

    monkeypatch.setattr(ring_finder, "detect", detects)
    frame = CameraFrame(time_stamp_s=0.0, pixels=NOTHING, window=window, exposure_s=1e-4, gain=0.02)
    finder_of(Belief()).find(frame)
    assert told == [(window, {"gain_dn_per_electron": 0.02})]


@pytest.mark.parametrize(("sigma_px", "centroid_px"), [(0.5, 0.02), (0.02, 0.3), (0.02, 0.02)])
def test_a_blob_gets_a_name_in_the_gate_of_belief_centroid_and_place(sigma_px, centroid_px, monkeypatch):
    """Four sigma; the sharpest centroid counts for all."""
    misplaced_px = MISPLACED_M * RADIUS_PX / 0.25
    gate_px = 4.0 * np.sqrt(sigma_px**2 + centroid_px**2 + misplaced_px**2)
    for share, named in ((0.97, 1), (1.03, 0)):
        blobs = np.vstack([LEDS_PX[2] + [0.0, share * gate_px], MIDDLE_PX + [5.0 * RADIUS_PX, 0.0]])
        finder, centroids_px = finder_of(Belief(LEDS_PX, sigma_px)), np.array([2.0 * centroid_px, centroid_px])
        found = look(monkeypatch, finder, blobs, followed=True, sigma_px=centroids_px)
        np.testing.assert_array_equal(found.led_numbers, [2] * named)


def test_a_belief_that_does_not_follow_the_drogue_names_no_led(monkeypatch):
    assert len(look(monkeypatch, finder_of(Belief(LEDS_PX)), LEDS_PX[:2], followed=True).led_numbers) == 2
    assert len(look(monkeypatch, finder_of(Belief(LEDS_PX)), LEDS_PX[:2], followed=False).led_numbers) == 0


@pytest.mark.parametrize(
    ("status", "ring", "named"), [(NOT_FOUND, UNEVEN, 2), (AMBIGUOUS, UNEVEN, 0), (AMBIGUOUS, LedRing(), 2)]
)
def test_leds_of_a_ring_whose_code_is_in_doubt_are_not_named_singly(status, ring, named, monkeypatch):
    monkeypatch.setattr(ring_finder, "identify", lambda *_, **__: nothing(status))
    seen_px = leds_px(ring=ring)
    found = look(monkeypatch, finder_of(Belief(seen_px), ring), seen_px[:2], followed=True)
    assert len(found.led_numbers) == named


def test_of_two_blobs_in_one_gate_and_of_one_in_two_none_gets_a_name(monkeypatch):
    few = FewSettings(false_names_max=1.0)
    twice = np.vstack([LEDS_PX[[0, 4]], LEDS_PX[4] + [2.0, 0.0]])
    found = look(monkeypatch, finder_of(Belief(LEDS_PX), few=few), twice, followed=True)
    np.testing.assert_array_equal(found.led_numbers, [0])
    wide_px = 0.11 * RADIUS_PX  # gates of 0.44 radii: the LEDs are 0.77 apart
    between = np.vstack([LEDS_PX[0], 0.5 * (LEDS_PX[3] + LEDS_PX[4])])
    found = look(monkeypatch, finder_of(Belief(LEDS_PX, wide_px), few=few), between, followed=True)
    np.testing.assert_array_equal(found.led_numbers, [0])


def test_nothing_is_named_where_clutter_may_get_names_too_often(monkeypatch):
    """Eq. (1): eight gates times (n + 0.2) blobs within 1.6 radii, those of LEDs not counted."""
    near_px, far_px = MIDDLE_PX + [0.0, 1.5 * RADIUS_PX], MIDDLE_PX + [0.0, 1.7 * RADIUS_PX]
    for clutter, count in (([], 0), ([near_px], 1), ([near_px, MIDDLE_PX], 2), ([far_px], 0)):
        # gate at which (n + 0.2) 8 pi gate^2 / (pi (1.6 r)^2) is what is allowed
        gate_px = 1.6 * RADIUS_PX * np.sqrt(FewSettings().false_names_max / (8.0 * (count + 0.2)))
        for share, named in ((0.97, 2), (1.03, 0)):
            noise_px = np.hypot(CENTROID_PX, MISPLACED_M * RADIUS_PX / 0.25)
            belief = Belief(LEDS_PX, np.sqrt((share * gate_px / 4.0) ** 2 - noise_px**2))
            found = look(monkeypatch, finder_of(belief), np.array([*LEDS_PX[[1, 5]], *clutter]), followed=True)
            assert len(found.led_numbers) == named


def test_a_window_about_the_belief_holds_its_leds_with_the_margins_of_a_track(monkeypatch):
    """12 px, 15 % of the radius and three sigma; of the sensor there is no more than it has."""
    for sigma_px, range_m in ((1.0, 6.0), (3.0, 6.0), (1.0, 12.0)):
        led_px = leds_px(range_m=range_m)
        finder = finder_of(Belief(led_px, sigma_px), few=FewSettings(false_names_max=1.0))
        look(monkeypatch, finder, led_px[[1, 5]], followed=True)
        margin_px = 12.0 + 0.15 * RADIUS_PX * 6.0 / range_m + 3.0 * sigma_px
        window = finder.window(0.0)
        first, last = led_px.min(axis=0) - margin_px, led_px.max(axis=0) + margin_px
        read = [window.column_start, window.row_start, window.column_stop - 1, window.row_stop - 1]
        np.testing.assert_array_equal(read, [*np.floor(first), *np.ceil(last)])


def test_a_window_about_a_belief_at_the_edge_ends_with_the_sensor_and_off_it_all_of_it_is_read():
    finder = finder_of(Belief())
    sigma_px, to_corner = np.ones(8), np.array([CAMERA.width_px, CAMERA.height_px]) - MIDDLE_PX
    before, beyond = (finder._window_about(leds_px(shift_px=s), sigma_px) for s in (-MIDDLE_PX, to_corner))
    assert (before.row_start, before.column_start) == (0, 0)
    assert (beyond.row_stop, beyond.column_stop) == (CAMERA.height_px, CAMERA.width_px)
    for axis in range(2):
        for way in (-2.0, 2.0):
            off_px = np.eye(2)[axis] * way * (MIDDLE_PX + RADIUS_PX)
            assert finder._window_about(leds_px(shift_px=off_px), sigma_px) is None
    assert finder._window_about(LEDS_PX, np.full(8, np.inf)) is None


def test_while_the_track_holds_single_leds_leave_the_window_to_it(monkeypatch):
    windows = []
    for few_px in (LEDS_PX[[1, 5]], NO_BLOBS):
        finder = finder_of(Belief(LEDS_PX))
        look(monkeypatch, finder, LEDS_PX, time_s=1.0, followed=True)
        look(monkeypatch, finder, few_px, time_s=1.02, followed=True)
        windows.append(finder.window(1.02))
    assert windows[0] == windows[1] is not None


@pytest.mark.parametrize(
    ("now_s", "next_s"), [(0.97, 1.02), (1.0, 1.02), (1.014, 1.02), (1.016, 1.04), (1.05, 1.06), (1.056, 1.08)]
)
def test_the_window_is_for_the_first_exposure_after_half_a_tick(now_s, next_s, monkeypatch):
    """A frame each 0.02 s since 1.00 s, a tick each 0.01 s."""
    belief = Belief(LEDS_PX)
    finder = finder_of(belief)
    look(monkeypatch, finder, LEDS_PX[[1, 5]], time_s=1.0, followed=True)
    finder.window(now_s)
    assert belief.asked_s[-1] == pytest.approx(next_s)


def test_the_camera_turns_as_the_gyro_says_in_the_middle_of_the_time_and_about_its_own_lever(monkeypatch):
    finder = finder_of(Belief())
    turn_C, interval_s = finder._turn_C(1.0, 1.2)
    np.testing.assert_allclose(turn_C, R_BC.T @ [0.1, 0.2, 0.3] * 1.1 * 0.2)
    assert interval_s == pytest.approx(0.2)
    told = {}
    monkeypatch.setattr(ring_finder, "RingTracker", lambda *_, **keys: told.update(keys))
    finder_of(Belief(), LedRing(diameter_m=0.8))
    np.testing.assert_allclose(told["lever_C"], R_BC.T @ P_BC)
    assert told["ring_radius_m"] == 0.4


def test_the_gate_misses_one_led_in_3000_and_clutter_gets_a_name_once_in_four_seconds():
    """A Gaussian of two axes is beyond g sigma with exp(-g^2 / 2)."""
    few = FewSettings()
    assert np.exp(-0.5 * few.gate_sigmas**2) == pytest.approx(1.0 / 3000.0, rel=0.02)
    assert 1.0 / (50.0 * few.false_names_max) == pytest.approx(4.0)
