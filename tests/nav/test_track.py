import subprocess
import sys
from dataclasses import astuple, replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.stats import chi2

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.identify.prior import ring_from_leds
from dockair.nav.identify.ring import Identification, IdentificationStatus, identify
from dockair.nav.image.detect import detect
from dockair.nav.track import RingTracker, TrackSettings
from dockair.rotations import exp, matrix_from_yaw_pitch_roll

DT = 0.02
SOURCE = TrackSettings(acceleration_radii_s2=0.0)  # [Yoon 2018, III.3]: Q = 0.01 I, R = 4 I, 50 Hz
CAMERA = Camera()


def seen(centre, radius=100.0, status=IdentificationStatus.FOUND):
    angle = np.arange(8) * np.pi / 4
    ring = np.asarray(centre, float) - radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return Identification(
        status=status, members=np.arange(8), led_numbers=np.arange(8), centre_px=np.asarray(centre, float),
        radius_px=radius, roll_rad=0.0, led_pixels_px=ring, ellipse=None, rms_px=0.1,
    )  # fmt: skip


MISSING = replace(seen((0, 0)), status=IdentificationStatus.NOT_FOUND)


def test_the_steady_state_is_the_riccati_equation_s():
    """sigma of position 0.509 px for the source's set-up."""
    tracker = RingTracker(CAMERA, DT, SOURCE)
    for _ in range(1500):
        tracker.predict()
        tracker.update(seen((500, 400)))
    F = np.block([[np.eye(2), DT * np.eye(2)], [np.zeros((2, 2)), np.eye(2)]])
    H = np.hstack([np.eye(2), np.zeros((2, 2))])
    prior = solve_discrete_are(F.T, H.T, 0.01 * np.eye(4), 4.0 * np.eye(2))
    gain = prior @ H.T @ np.linalg.inv(H @ prior @ H.T + 4.0 * np.eye(2))
    np.testing.assert_allclose(tracker.covariance, (np.eye(4) - gain @ H) @ prior, rtol=1e-6, atol=1e-12)
    assert np.sqrt(tracker.covariance[0, 0]) == pytest.approx(0.509, abs=5e-4)


@pytest.mark.parametrize("end", [(0.0, 0.0), (60.0, 60.0)])
def test_errors_stay_inside_three_sigma_in_the_source_s_two_simulations(end):
    """60 s at rest, and moving from (0, 0) to (60, 60) px; at least 99 % inside after settling [Yoon 2018, Figs 18-19].

    The truth has no process noise, so the filter is conservative.
    """
    rng, n = np.random.default_rng(31), 3000
    tracker = RingTracker(CAMERA, DT, SOURCE)
    inside = []
    for k in range(n):
        true = np.array(end) * k / n
        tracker.predict()
        tracker.update(seen(true + 2.0 * rng.standard_normal(2), 100.0 + 2.0 * rng.standard_normal()))
        error = np.abs(tracker.centre_px - true)
        inside.append(error <= 3.0 * np.sqrt(np.diag(tracker.covariance)[:2]))
    assert np.mean(inside[200:]) >= 0.99


def test_innovations_are_honest_when_the_truth_has_the_filter_s_process_noise():
    """Mean NIS of n measurements is chi2(3n)/n; the bounds fail by luck once in 10^4.

    The gate at probability 0.9999 cuts the mean by 0.2 % of 3.
    """
    rng, n = np.random.default_rng(32), 3000
    tracker = RingTracker(CAMERA, DT, SOURCE)
    F = np.block([[np.eye(3), DT * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    x = np.array([1000.0, 500.0, 300.0, 0.0, 0.0, 0.0])
    nis = []
    for _ in range(n):
        x = F @ x + 0.1 * rng.standard_normal(6)
        tracker.predict()
        if tracker.update(seen(x[:2] + 2.0 * rng.standard_normal(2), x[2] + 2.0 * rng.standard_normal())):
            nis.append(tracker.normalised_innovation_squared)
    nis = np.array(nis[50:])  # the start's covariance is not that of this truth
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], 3 * len(nis)) / len(nis)
    assert len(nis) > 0.99 * n - 50
    assert low < nis.mean() < high


def test_white_acceleration_adds_what_equation_1_says():
    """One prediction from a known covariance: difference of the two filters' P is (a r)^2 [[dt^4/4, dt^3/2], ...]."""
    covariances = []
    for settings in (SOURCE, replace(SOURCE, acceleration_radii_s2=8.0)):
        tracker = RingTracker(CAMERA, DT, settings)
        tracker.update(seen((500, 400), 100.0))
        tracker.predict()
        covariances.append(tracker.covariance)
    walk = np.array([[DT**4 / 4, DT**3 / 2], [DT**3 / 2, DT**2]])
    np.testing.assert_allclose(covariances[1] - covariances[0], 800.0**2 * np.kron(walk, np.eye(2)), atol=1e-9)


@pytest.mark.parametrize("lever_C", [None, np.array([3.3, -0.4, 0.7])])
def test_the_camera_s_rotation_is_taken_out_of_the_drogue_s_motion(lever_C):
    """A ring at rest, a camera that turns to and fro by up to 45 deg/s about all axes and a point 3 m behind it.

    Predicted to 0.1 px at 40 px a frame, rolls and ranges with it: the ring gets no velocity of its own.
    """
    tracker = RingTracker(CAMERA, DT, SOURCE, lever_C=lever_C)
    lever = np.zeros(3) if lever_C is None else lever_C
    R_WC, points_W = np.eye(3), lever + np.array([8.0, 0.5, -0.2]) + np.vstack([np.zeros(3), LedRing().positions_D])
    moved_px = 0.0
    for k in range(200):
        turn = np.deg2rad(45.0) * DT * np.cos(0.1 * k) * np.array([0.6, 0.5, -0.6])
        R_WC = R_WC @ exp(turn)
        p_C = points_W @ R_WC - lever
        pixels = CAMERA.pixels_from_points(p_C)
        # after a turn about z the ring is not seen along its axis: its roll as `identify` has it
        _, _, roll = ring_from_leds(pixels[1:])
        radius = CAMERA.focal_length_px * 0.25 / p_C[0, 0]
        found = replace(seen(pixels[0], radius), led_pixels_px=pixels[1:], roll_rad=roll)
        before = tracker.centre_px
        tracker.predict(turn)
        if tracker.tracking:
            np.testing.assert_allclose(tracker.centre_px, pixels[0], atol=0.1)
            np.testing.assert_allclose(tracker.radius_px, radius, atol=0.05)
            np.testing.assert_allclose(tracker.expected_led_px, pixels[1:], atol=0.8)
            moved_px = max(moved_px, np.hypot(*(tracker.centre_px - before)))
        assert tracker.update(found)
    np.testing.assert_allclose(tracker.velocity_px_s, 0.0, atol=1.0)
    assert moved_px > 20.0


def test_a_prediction_over_two_intervals_is_two_predictions():
    one, two = (RingTracker(CAMERA, DT, replace(SOURCE, process_variance=0.0)) for _ in range(2))
    for tracker in (one, two):
        for k in range(50):
            tracker.predict()
            tracker.update(seen((500 + 2 * k, 400)))
    one.predict(interval_s=2.0 * DT)
    two.predict()
    window = two.window(interval_s=3.0 * DT)
    two.predict()
    np.testing.assert_allclose(one.centre_px, two.centre_px, atol=1e-9)
    two.predict(interval_s=2.0 * DT)
    assert two.window(interval_s=0.0) == window


def turning(k, radius=100.0):
    """A ring on its way round at 30 deg/s, as identified in frame k."""
    roll = float(np.angle(np.exp(1j * (3.0 + np.deg2rad(30.0) * DT * k))))
    angle = roll + np.arange(8) * np.pi / 4
    centre = np.array([900.0, 500.0])
    leds = centre - radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return replace(seen(centre, radius), led_pixels_px=leds, roll_rad=roll)


def test_each_led_of_a_turning_ring_is_expected_where_it_will_be():
    """30 deg/s: 1 px a frame at the rim, through the jump of the roll at 180 deg, and through four missed frames."""
    tracker = RingTracker(CAMERA, DT)
    for k in range(100):
        tracker.predict()
        if k > 50:
            np.testing.assert_allclose(tracker.expected_led_px, turning(k).led_pixels_px, atol=0.15)
        assert tracker.update(MISSING if k % 20 in (15, 16, 17, 18) else turning(k)) or k % 20 in (15, 16, 17, 18)


def test_a_lost_ring_s_roll_goes_on_turning_until_it_no_longer_tells_numbers_apart():
    tracker = RingTracker(CAMERA, DT)
    for k in range(100):
        tracker.predict()
        tracker.update(turning(k))
    lost = []
    for k in range(100, 200):
        tracker.predict()
        tracker.update(MISSING)
        off = np.angle(np.exp(1j * (tracker.roll_rad - turning(k).roll_rad)))
        assert np.isnan(off) or abs(np.rad2deg(off)) < 3.0
        lost.append(np.isnan(off))
    assert not tracker.tracking
    known_s = DT * lost.index(True)
    assert 0.4 < known_s < 0.6 and all(lost[lost.index(True) :])


def test_a_ring_given_up_is_lost_at_once_and_its_roll_is_kept():
    tracker = RingTracker(CAMERA, DT)
    for k in range(20):
        tracker.predict()
        tracker.update(turning(k))
    tracker.lose()
    assert not tracker.tracking and tracker.window() is None and tracker.expected_led_px is None
    assert tracker.roll_rad == pytest.approx(turning(19).roll_rad, abs=0.02)


def test_new_numbers_are_taken_over_without_turning_the_ring():
    """A code was read: the same LEDs with numbers three places on."""
    tracker = RingTracker(CAMERA, DT)
    for _ in range(30):
        tracker.predict()
        tracker.update(seen((500, 400)))
    old = tracker.expected_led_px
    renumbered = replace(seen((500, 400)), roll_rad=np.deg2rad(135.0), led_pixels_px=np.roll(old, -3, axis=0))
    tracker.predict()
    assert tracker.update(renumbered)
    for _ in range(3):
        tracker.predict()
        np.testing.assert_allclose(tracker.expected_led_px, np.roll(old, -3, axis=0), atol=0.2)
        tracker.update(MISSING)


def test_a_measurement_far_outside_its_covariance_is_a_miss_and_changes_nothing():
    tracker = RingTracker(CAMERA, DT)
    for _ in range(50):
        tracker.predict()
        tracker.update(seen((500, 400)))
    tracker.predict()
    before = tracker.centre_px
    assert not tracker.update(seen((560, 400)))
    assert not tracker.update(seen((500, 400), radius=160.0))
    np.testing.assert_array_equal(tracker.centre_px, before)
    assert tracker.misses == 2
    assert tracker.update(seen((500, 400)))
    assert tracker.misses == 0


def test_an_ambiguous_ring_neither_begins_nor_feeds_a_track():
    tracker = RingTracker(CAMERA, DT)
    assert not tracker.update(seen((500, 400), status=IdentificationStatus.AMBIGUOUS))
    assert not tracker.tracking
    assert tracker.update(seen((500, 400)))
    assert not tracker.update(seen((500, 400), status=IdentificationStatus.AMBIGUOUS))
    assert tracker.misses == 1


def test_the_window_holds_the_ring_grows_with_misses_and_opens_when_the_ring_is_lost():
    tracker = RingTracker(CAMERA, DT)
    assert tracker.window() is None
    for _ in range(20):
        tracker.predict()
        tracker.update(seen((900, 500)))
    sizes = []
    for _ in range(round(TrackSettings().lost_s / DT)):
        window = tracker.window()
        assert window is not None
        assert window.column_start <= 800 and window.column_stop > 1000
        assert window.row_start <= 400 and window.row_stop > 600
        sizes.append(window.shape[0] * window.shape[1])
        tracker.predict()
        tracker.update(MISSING)
    assert (np.diff(sizes) > 0).all()
    assert sizes[0] < 0.1 * 2048 * 1088
    assert tracker.window() is None
    assert not tracker.tracking and np.isnan(tracker.centre_px).all() and np.isnan(tracker.covariance).all()
    assert tracker.expected_led_px is None


def test_the_window_is_the_predicted_ring_three_sigma_and_the_margin_half_as_wide_again_with_every_miss():
    """Closed form from the covariance; without acceleration the radius has the centre's."""
    settings = TrackSettings()
    tracker = RingTracker(CAMERA, DT, SOURCE)
    for _ in range(50):
        tracker.predict()
        tracker.update(seen((1000, 550), 60.0))
    F, Q = np.eye(4) + DT * np.eye(4, k=2), settings.process_variance * np.eye(4)
    for misses in range(4):
        sigma = np.sqrt((F @ tracker.covariance @ F.T + Q)[0, 0])
        half = (60.0 + 3.0 * sigma) * (1.0 + settings.window_margin_radii) + settings.window_margin_px + 3.0 * sigma
        half *= settings.growth**misses
        window = tracker.window()
        assert 1000 - half == pytest.approx(window.column_start, abs=1.0)
        assert 550 + half == pytest.approx(window.row_stop - 1, abs=1.0)
        tracker.predict()
        tracker.update(MISSING)


@pytest.mark.parametrize("rate_hz", [30.0, 50.0, 180.0])
def test_a_ring_is_lost_after_the_same_time_at_every_frame_rate_and_its_window_grows_as_quickly(rate_hz):
    tracker, settings = RingTracker(CAMERA, 1.0 / rate_hz, SOURCE), TrackSettings()
    tracker.update(seen((1000, 550), 60.0))
    first, misses, grown = tracker.window(interval_s=0.0), 0, 1.0
    while tracker.tracking:
        window = tracker.window(interval_s=0.0)
        grown, misses = window.shape[1] / first.shape[1], misses + 1
        assert grown == pytest.approx(settings.growth ** ((misses - 1) / rate_hz / settings.growth_s), rel=0.02)
        tracker.update(MISSING)
    assert misses / rate_hz == pytest.approx(settings.lost_s, abs=0.5 / rate_hz)
    assert grown > 2.0


def test_the_window_moves_with_the_rotation_to_come_and_stays_on_the_sensor():
    tracker = RingTracker(CAMERA, DT)
    tracker.update(seen((900, 500)))
    # a turn to the right and up moves what stands ahead to the left and down
    turn = np.array([0.0, -20.0, -50.0]) / CAMERA.focal_length_px
    still, moved = (np.array(astuple(tracker.window(w))) for w in (None, turn))
    np.testing.assert_allclose(moved - still, [20, 20, -50, -50], atol=1)
    edge = RingTracker(CAMERA, DT)
    edge.update(seen((10, 1080)))
    window = edge.window()
    assert window.column_start == 0 and window.row_stop == CAMERA.height_px
    gone = RingTracker(CAMERA, DT)
    gone.update(seen((-500, 400)))
    assert gone.window() is None


def test_hidden_leds_do_not_rename_the_others():
    """A ring that rolls 1 deg a frame through a whole turn, LEDs hidden at random: the numbers go with it."""
    rng = np.random.default_rng(33)
    tracker = RingTracker(CAMERA, DT)
    for k in range(360):
        angle = np.deg2rad(k) + np.arange(8) * np.pi / 4
        centre = np.array([900.0, 500.0]) + 0.3 * k
        ring = centre - 90.0 * np.column_stack([np.cos(angle), np.sin(angle)])
        visible = rng.permutation(8)[: rng.integers(5, 9)]
        tracker.predict()
        expected = {}
        if tracker.tracking:
            expected = {
                "expected_led_px": tracker.expected_led_px,
                "expected_sigma_px": tracker.expected_sigma_px,
            }
        result = identify(ring[visible] + 0.1 * rng.standard_normal((len(visible), 2)), **expected)
        assert tracker.update(result)
        np.testing.assert_array_equal(result.led_numbers, visible[result.members])


def test_a_rendered_approach_is_followed_with_every_name_right(render):
    """Pixels to names, 12 m to 3 m in 60 frames, windows as the tracker asks: full frame once, glints about, a roll."""
    rng = np.random.default_rng(34)
    tracker = RingTracker(CAMERA, DT)
    window, sizes, named = CAMERA.full_window, [], 0
    for k in range(60):
        range_m = 12.0 - 0.15 * k
        R_CD = matrix_from_yaw_pitch_roll(0.15, -0.1 + 0.002 * k, 0.01 * k)
        p_CD = np.array([range_m, 0.4 * np.cos(0.05 * k), 0.2 + 0.1 * np.sin(0.05 * k)])
        leds = CAMERA.pixels_from_points(p_CD + LedRing().positions_D @ R_CD.T)
        visible = rng.permutation(8)[: rng.integers(6, 9)]
        glints = rng.uniform([0, 0], [2047, 1087], (4, 2))
        spots = [(u, v, 6e4 * (10.0 / range_m) ** 2) for u, v in leds[visible]] + [(u, v, 3e4) for u, v in glints]
        origin = np.array([window.column_start, window.row_start])
        inside = [(u - origin[0], v - origin[1], e) for u, v, e in spots]
        inside = [s for s in inside if -5 < s[0] < window.shape[1] + 5 and -5 < s[1] < window.shape[0] + 5]
        blobs = detect(render(window.shape, inside, rng), None, window)
        tracker.predict()
        result = identify(
            blobs.centroids_px,
            expected_led_px=tracker.expected_led_px,
            expected_sigma_px=tracker.expected_sigma_px if tracker.tracking else None,
            expected_roll_rad=None if tracker.tracking else 0.0,
        )
        assert tracker.update(result), f"frame {k}: {result.status}"
        errors = np.hypot(*(blobs.centroids_px[result.members] - leds[result.led_numbers]).T)
        assert errors.max() < 0.3, f"frame {k}"
        named += len(errors) - len(visible)
        sizes.append(window.shape[0] * window.shape[1])
        window = tracker.window() or CAMERA.full_window
    assert abs(named) <= 2
    assert max(sizes[1:]) < 0.3 * sizes[0]


def test_the_first_frame_says_where_the_ring_is_and_hardly_how_it_moves():
    """4 radii/s of the centre; 0.5 rad/s of the roll, so that numbers are told apart for a quarter of a second."""
    tracker = RingTracker(CAMERA, DT)
    tracker.update(seen((500, 400), 100.0))
    np.testing.assert_allclose(tracker.covariance, np.diag([4.0, 4.0, 400.0**2, 400.0**2]))
    assert tracker.expected_sigma_px == pytest.approx(2.0)
    known = 0
    while not np.isnan(tracker.roll_rad):
        tracker.predict()
        known += 1
    assert 0.2 < known * DT < 0.3


def test_the_next_ring_found_after_a_loss_starts_the_filter_afresh():
    tracker = RingTracker(CAMERA, DT)
    for k in range(20):
        tracker.predict()
        tracker.update(seen((500 + 10 * k, 400)))
    while tracker.tracking:
        tracker.predict()
        tracker.update(MISSING)
    assert np.isnan(tracker.expected_sigma_px)
    assert tracker.update(seen((1200, 700)))
    assert tracker.tracking and tracker.misses == 0
    np.testing.assert_array_equal([*tracker.centre_px, *tracker.velocity_px_s], [1200, 700, 0, 0])
    assert np.isnan(tracker.normalised_innovation_squared)  # there was nothing to hold it against


def test_a_ring_is_followed_by_the_slowest_camera_until_it_is_missed_once():
    """At 1 Hz a frame lasts ten times as long as a ring that is not seen is followed."""
    tracker = RingTracker(CAMERA, 1.0)
    assert tracker.update(seen((500, 400)))
    assert tracker.tracking
    tracker.predict()
    tracker.update(MISSING)
    assert not tracker.tracking


def test_a_ring_as_large_as_the_frame_needs_no_window():
    tracker = RingTracker(CAMERA, DT)
    tracker.update(seen((1024, 544), radius=1500.0))
    assert tracker.tracking and tracker.window() is None


def test_of_a_lost_ring_nothing_is_followed_but_the_roll():
    """It was last seen on the axis, moving: a turn that would roll it elsewhere in the image does not there."""
    tracker, (u, v) = RingTracker(CAMERA, DT), CAMERA.principal_point_px
    for k in range(20):
        tracker.predict()
        tracker.update(seen((u + 20.0 * (k - 19), v)))
    assert tracker.velocity_px_s[0] > 800.0
    tracker.lose()
    before_rad = tracker.roll_rad
    for _ in range(15):
        tracker.predict(np.array([0.0, 0.02, 0.0]))
    assert tracker.roll_rad == pytest.approx(before_rad, abs=1e-3)


def test_a_roll_is_filtered_through_the_jump_at_half_a_turn_as_elsewhere():
    ends = []
    for roll in (0.0, np.pi):
        tracker, rng = RingTracker(CAMERA, DT), np.random.default_rng(35)
        for _ in range(30):
            tracker.predict()
            off = roll + 0.02 * rng.standard_normal()
            tracker.update(replace(seen((500, 400)), roll_rad=float(np.angle(np.exp(1j * off)))))
            ends.append(tracker.roll_rad - roll)
    turns = (np.array(ends[:30]) - ends[30:]) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)


def test_a_roll_with_new_numbers_is_known_as_well_as_it_was_measured():
    """0.5 px at 100 px; what the next frame says of it counts for about half."""
    tracker = RingTracker(CAMERA, DT)
    for _ in range(30):
        tracker.predict()
        tracker.update(seen((500, 400)))
    for roll_rad in (np.deg2rad(135.0), np.deg2rad(137.0)):
        tracker.predict()
        assert tracker.update(replace(seen((500, 400)), roll_rad=roll_rad))
    assert np.rad2deg(tracker.roll_rad) > 135.8


def test_the_gate_is_chi_square_s_of_three_degrees_of_freedom():
    limit, squares = chi2.ppf(TrackSettings().gate_probability, 3), []
    for off_px in np.linspace(30.0, 60.0, 31):
        tracker = RingTracker(CAMERA, DT)
        tracker.update(seen((500, 400)))
        tracker.predict()
        taken = tracker.update(seen((500 + off_px, 400)))
        squares.append(tracker.normalised_innovation_squared)
        assert taken == (squares[-1] <= limit)
    assert min(squares) < chi2.ppf(TrackSettings().gate_probability, 2) < limit < max(squares)
    assert ((np.array(squares) > 0.9 * limit) & (np.array(squares) < limit)).any()


def test_a_frame_interval_that_is_not_positive_is_refused():
    with pytest.raises(DockairError, match="frame_interval_s"):
        RingTracker(CAMERA, 0.0)


def test_importing_the_tracker_does_not_import_filterpy():
    code = "import sys, dockair.nav.track; sys.exit('filterpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
