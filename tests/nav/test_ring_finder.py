"""From blobs to named LEDs, with a belief that is right."""

import numpy as np
import pytest

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.messages import CameraFrame
from dockair.nav import ring_finder
from dockair.nav.image.detect import Blobs, DetectSettings
from dockair.nav.navigator import NavigatorSettings
from dockair.nav.ring_finder import RingFinder
from dockair.nav.track import TrackSettings
from dockair.rotations import exp

CAMERA, CENTROID_PX, BELIEF_PX = Camera(), 0.02, 1.0
MISPLACED_M = NavigatorSettings().led_position_sigma_m
NOTHING = np.zeros((2, 2), np.uint8)
LEDS_PX = CAMERA.pixels_from_points(LedRing().positions_D + [6.0, 0.0, 0.0])


class Belief:
    """Knows where the LEDs of a sheet are, to a pixel."""

    led_px = np.full((8, 2), np.nan)

    def predicted_led_pixels(self, time_s):
        return self.led_px, np.full(8, BELIEF_PX)

    def rate_B(self, time_s):
        return np.zeros(3)


def blobs_at(pixels):
    n = len(pixels)
    ones, whole = np.ones(n), np.ones(n, np.int64)
    return Blobs(
        centroids_px=pixels, area_px=9 * whole, peak=100 * whole, sigma_px=CENTROID_PX * ones, clipped=whole < 0,
        flux=1000.0 * ones, threshold_dn=10, thresholds_dn=10 * whole,
    )  # fmt: skip


def finder_of(belief, ring=None):
    mounting = Mounting(R_BC=np.eye(3), p_BC=np.zeros(3), p_BP=np.zeros(3))
    start = StartGeometry(p_PD_B=np.zeros(3), sigma_p_m=np.ones(3), R_BD=np.eye(3), sigma_R_rad=np.ones(3))
    gyro = GyroSheet(rate_hz=500, noise_density_rad_s_rthz=1e-4, bias_sigma_rad_s=1e-3)
    sheets = NavigationSheets(
        camera=CAMERA, ring=ring or LedRing(), mounting=mounting, start=start, gyro=gyro, camera_rate_hz=50,
        control_rate_hz=100, coupling_depth_m=0.3,
    )  # fmt: skip
    return RingFinder(sheets, belief, DetectSettings(), TrackSettings(), 0.2, misplaced_m=MISPLACED_M)


def look(monkeypatch, finder, pixels, time_s=0.0, window=CAMERA.full_window, **keys):
    """Let a finder see blobs (n, 2) in a frame."""
    monkeypatch.setattr(ring_finder, "detect", lambda *_, **__: blobs_at(pixels))
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
    belief = Belief()
    belief.led_px = LEDS_PX
    for newest, late in ((LEDS_PX[[1, 5]], LEDS_PX[:0]), (LEDS_PX[:0], LEDS_PX[[1, 5]])):
        finder = finder_of(belief)
        named = look(monkeypatch, finder, newest, time_s=1.0, followed=True)
        window = finder.window(1.0)
        assert (window is not None) == (len(named.led_numbers) == 2)
        assert len(look(monkeypatch, finder, late, time_s=0.98, followed=True).led_numbers) == len(late)
        assert finder.window(1.0) == window
