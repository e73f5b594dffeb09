"""The belief and a frame: what a camera that is off shows, the update against closed forms; mixtures and their fate."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2 as chi2_law

from dockair.calibration import Camera, LedRing, Mounting
from dockair.nav.belief import Taking, _gained, _kept, begun_again, corrected, felt_first, mixture, rolled, widened
from dockair.nav.belief_motion import (
    BIAS,
    CALIBRATION,
    ERRORS,
    FORMATION,
    GUST,
    HARDWARE,
    PHI,
    PLACE,
    REST,
    RING,
    SWING,
    SWING_RATE,
    VELOCITY,
)
from dockair.nav.belief_sight import Belief, Sight, ring_sensitivity
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import solve_pose
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.nav.pose.planar import mirrored
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll

LEDS, CAMERA = LedRing().positions_D, Camera()
MOUNTING = Mounting(
    R_BC=matrix_from_yaw_pitch_roll(-0.05, 0.02, 0.1),
    p_BC=np.array([3.3, -0.45, 0.75]),
    p_BP=np.array([6.0, -0.9, 0.6]),
    p_BI=np.array([1.0, 0.2, -0.1]),
)
SIGHT = Sight(mounting=MOUNTING, points_D=LEDS)
OPEN = [np.inf] * 17


def chi2_band(freedom: int, missed: float) -> tuple[float, float]:
    low, high = chi2_law.ppf([0.5 * missed, 1.0 - 0.5 * missed], freedom)
    return float(low), float(high)


def covariance(blocks: dict[int, float]) -> Array:
    """Diagonal, variance by the first error of each three."""
    P = np.zeros((ERRORS, ERRORS))
    for first, variance in blocks.items():
        P[range(first, first + 3), range(first, first + 3)] = variance
    return P


def belief(P: Array, R: Array | None = None, log_weight: float = 0.0) -> Belief:
    x = np.zeros((8, 3))
    x[0], x[1] = [12.0, -0.5, 0.8], [0.4, -0.3, 0.2]
    return Belief(exp(np.array([0.1, -0.2, 0.3])) if R is None else R, x, P, log_weight)


def pixels_of(R_CD: Array, p_CD: Array, points_D: Array = LEDS) -> Array:
    return CAMERA.pixels_from_points(points_D @ R_CD.T + p_CD)


def pixels_off(b: Belief, e: Array) -> Array:
    """(8, 2) of the LEDs, seen where the belief has these errors (50,)."""
    axes, place, scale = np.split(e[CALIBRATION], [3, 6])
    ring = LEDS.copy()
    ring[:, 1:] += e[RING].reshape(-1, 2)
    R_BC, p_BC = exp(axes) @ MOUNTING.R_BC, MOUNTING.p_BC + place
    p_CD = R_BC.T @ (b.p_ID + e[3:6] + MOUNTING.p_BI - p_BC)
    return pixels_of(R_BC.T @ exp(e[:3]) @ b.R_BD, p_CD - scale * p_CD, ring)


def pixels_per_error(b: Belief, step: float = 1e-6) -> Array:
    """(8, 2, 50) their derivatives, by differences."""
    u = step * np.eye(ERRORS)
    return np.stack([(pixels_off(b, e) - pixels_off(b, -e)) / (2.0 * step) for e in u], axis=-1)


@pytest.mark.parametrize("k", range(ERRORS))
def test_a_camera_and_ring_that_are_off_show_what_the_model_says(k):
    """Each error by itself: true LEDs seen by the true camera, solved with the nominal ones, against Eqs (1), (2)."""
    b = belief(np.eye(ERRORS), MOUNTING.R_BC @ matrix_from_yaw_pitch_roll(0.1, 0.25, 0.2))
    b.x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ [6.0, 0.3, -0.2]
    e = np.zeros(ERRORS)
    e[k] = 1e-4
    axes, place, scale = np.split(e[CALIBRATION], [3, 6])
    ring = LEDS.copy()
    ring[:, 1:] += e[RING].reshape(-1, 2)
    R_BC, p_BC = exp(axes) @ MOUNTING.R_BC, MOUNTING.p_BC + place
    R_BD, p_BD = exp(e[:3]) @ b.R_BD, b.p_ID + e[3:6] + MOUNTING.p_BI
    p_CD = R_BC.T @ (p_BD - p_BC)
    seen = pixels_of(R_BC.T @ R_BD, p_CD - scale * p_CD, ring)
    told = SIGHT.apparent(b, solved=True)
    pose = solve_pose(seen, LEDS, CAMERA, initial=(told.R_CD, told.p_CD))
    shown = pose_difference(pose.R_CD, pose.p_CD, told.R_CD, told.p_CD)
    np.testing.assert_allclose(shown, told.M @ e, atol=4e-6)


def test_strain_of_a_frontal_ring_moves_no_pose():
    """Its image is an ellipse that no pose explains to first order, since a tilt enters by its square."""
    J = ring_sensitivity(np.eye(3), np.array([6.0, 0.0, 0.0]), LEDS)
    y, z = LEDS[:, 1], LEDS[:, 2]
    strain, keystone = np.column_stack([y, -z]).ravel(), np.column_stack([y * y, y * z]).ravel()
    np.testing.assert_allclose(J @ strain, 0.0, atol=1e-9)
    assert np.abs((J @ keystone)[:3]).max() > 1.0  # but keystone does


@pytest.mark.parametrize("range_m", [3.0, 30.0, 100.0])
def test_leds_that_are_off_as_a_tilt_would_show_them_are_taken_for_that_tilt(range_m):
    """Frontal: by a turn u about y an LED goes farther by u z, and is seen as one at (y, z) (1 - u z / range) is."""
    y, z = LEDS[:, 1], LEDS[:, 2]
    J = ring_sensitivity(np.eye(3), np.array([range_m, 0.0, 0.0]), LEDS)
    np.testing.assert_allclose(J @ (-np.column_stack([y, z]) * z[:, None] / range_m).ravel(), np.eye(6)[1], atol=1e-6)


def test_predicted_pose_is_uncertain_by_the_calibration_too():
    P = np.zeros((ERRORS, ERRORS))
    P[CALIBRATION.start + 1, CALIBRATION.start + 1] = 1e-6  # the camera turned by 1 mrad about the body's y
    seen = SIGHT.apparent(belief(P))
    c = belief(P).p_ID + MOUNTING.p_BI - MOUNTING.p_BC
    across = np.array([c[2], 0.0, -c[0]])
    T = MOUNTING.R_BC.T
    np.testing.assert_allclose(seen.covariance[3:, 3:], 1e-6 * np.outer(T @ across, T @ across), atol=1e-15)


def start(sigma_tilt_rad: float, tilt_deg: float, range_m: float) -> tuple[Belief, Array]:
    """A frontal belief and a true attitude tilted against it, seen from the camera."""
    R_CD, p_CD = matrix_from_yaw_pitch_roll(0.0, np.deg2rad(tilt_deg), 0.0), np.array([range_m, 0.0, 0.0])
    P = covariance({0: sigma_tilt_rad**2, 3: 0.04, 6: 0.1, 15: 1e-5})
    P[3:6, 6:9] = P[6:9, 3:6] = 0.03 * np.eye(3)
    x = np.zeros((8, 3))
    x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ p_CD
    return Belief(MOUNTING.R_BC, x, P), R_CD


@pytest.mark.parametrize("tight", [True, False], ids=["tight", "loose"])
def test_two_floors_far_apart_stay_two_until_one_dies(tight):
    """20 m, 6 degrees, a prior that does not know the side: two hypotheses, and after some frames the true one."""
    rng = np.random.default_rng(5)
    b, R_CD = start(np.deg2rad(8.0), 6.0, 20.0)
    p_CD, counts = SIGHT.apparent(b).p_CD, []
    beliefs = [b]
    for _ in range(60):
        pixels = pixels_of(R_CD, p_CD) + 0.1 * rng.normal(size=(8, 2))
        beliefs = corrected(beliefs, solve_pose(pixels, LEDS, CAMERA), SIGHT, OPEN, Taking(tight=tight)).beliefs
        counts.append(len(beliefs))
        assert beliefs[0].log_weight == 0.0
        assert all(np.linalg.eigvalsh(h.P[:9, :9]).min() > 0.0 for h in beliefs)
    assert counts[0] == 2 and counts[-1] == 1
    assert np.linalg.norm(log(MOUNTING.R_BC.T @ beliefs[0].R_BD @ R_CD.T)) < np.deg2rad(1.0)


def test_hypotheses_are_two_at_most_and_mirror_images():
    b, R_CD = start(np.deg2rad(8.0), 6.0, 20.0)
    p_CD = SIGHT.apparent(b).p_CD
    pose = solve_pose(pixels_of(R_CD, p_CD), LEDS, CAMERA)
    first, second = corrected([b], pose, SIGHT, OPEN, Taking()).beliefs
    other, _ = mirrored(MOUNTING.R_BC.T @ first.R_BD, p_CD, LEDS)
    assert np.rad2deg(np.linalg.norm(log(MOUNTING.R_BC.T @ second.R_BD @ other.T))) < 2.0


def test_velocity_follows_the_pose_by_regression():
    """A shift of the drogue seen where P_sv / P_ss = 0.75 /s raises the velocity by that much of what was taken."""
    b, _ = start(np.deg2rad(2.0), 0.0, 6.0)
    seen = SIGHT.apparent(b)
    pose = solve_pose(
        pixels_of(seen.R_CD, seen.p_CD + np.array([0.02, 0.05, -0.03])), LEDS, CAMERA, sigma_px=0.02
    )  # fmt: skip
    (after,) = corrected([b], pose, SIGHT, OPEN, Taking()).beliefs
    np.testing.assert_allclose(after.v_ID, 0.75 * (after.p_ID - b.p_ID), rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(np.diag(after.P)[6:9], 0.1 - 0.75**2 * (0.04 - np.diag(after.P)[3:6]), rtol=1e-3)


def test_an_update_is_the_kalman_filter_s_where_the_problem_is_linear():
    """Loose, near, tilted: gain, covariance and chi-square of the textbook, with M and the covariance of the pose."""
    rng = np.random.default_rng(7)
    root = 1e-3 * rng.normal(size=(ERRORS, ERRORS))
    b = belief(root @ root.T, MOUNTING.R_BC @ matrix_from_yaw_pitch_roll(0.1, 0.3, 0.0))
    b.x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ [4.0, 0.1, 0.1]
    seen = SIGHT.apparent(b, solved=True)
    pose = solve_pose(pixels_of(exp(np.full(3, 1e-4)) @ seen.R_CD, seen.p_CD + 1e-3), LEDS, CAMERA, sigma_px=0.1)
    found = corrected([b], pose, SIGHT, OPEN, Taking(tight=False))
    S = seen.covariance + pose.covariance
    y = pose_difference(pose.R_CD, pose.p_CD, seen.R_CD, seen.p_CD)
    K = b.P @ seen.M.T @ np.linalg.inv(S)
    K[HARDWARE] = 0.0  # considered
    A = np.eye(ERRORS) - K @ seen.M
    after = found.beliefs[0]
    np.testing.assert_allclose(after.P, A @ b.P @ A.T + K @ pose.covariance @ K.T, atol=1e-9)
    moved = np.concatenate([log(after.R_BD @ b.R_BD.T), (after.x - b.x).ravel()])
    np.testing.assert_allclose(moved, (K @ y)[: CALIBRATION.start], atol=1e-6)
    np.testing.assert_array_equal(after.ring, b.ring)
    assert found.chi2 == pytest.approx(float(y @ np.linalg.solve(S, y)), rel=1e-3)


def test_what_is_considered_is_neither_estimated_nor_made_smaller():
    P = covariance({0: 1e-4, 3: 1e-2, CALIBRATION.start: 1e-6, CALIBRATION.start + 3: 4e-6})
    b = belief(P, MOUNTING.R_BC @ matrix_from_yaw_pitch_roll(0.1, 0.3, 0.0))
    b.x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ [6.0, 0.1, 0.1]
    seen = SIGHT.apparent(b)
    beliefs = [b]
    for _ in range(200):
        pose = solve_pose(pixels_of(seen.R_CD, seen.p_CD), LEDS, CAMERA, sigma_px=0.1)
        beliefs = corrected(beliefs, pose, SIGHT, OPEN, Taking()).beliefs
    after = beliefs[0]
    np.testing.assert_array_equal(after.P[CALIBRATION, CALIBRATION], P[CALIBRATION, CALIBRATION])
    floor = 4e-6 + 1e-6 * 6.0**2  # the camera's place, and its turn at 6 m; 200 frames do not get below
    assert np.diag(after.P)[4] == pytest.approx(floor, rel=0.05)
    assert np.linalg.eigvalsh(after.P).min() > -1e-15


def test_a_tight_update_is_the_textbook_s_on_pixels_where_the_problem_is_linear():
    """Near, tilted, three LEDs of a belief in which everything correlates: H by differences, of pixels per error."""
    rng = np.random.default_rng(8)
    root = 1e-3 * rng.normal(size=(ERRORS, ERRORS))
    root[RING] *= 0.1
    b = belief(root @ root.T, MOUNTING.R_BC @ matrix_from_yaw_pitch_roll(0.1, 0.3, 0.0))
    b.x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ [4.0, 0.1, 0.1]
    chosen, sigma_px = np.array([1, 4, 6]), 0.1
    H = pixels_per_error(b)[chosen].reshape(-1, ERRORS)
    y = 1e-5 * rng.normal(size=6)  # small, so that the fit ends where it began
    sight = lines_of_sight_from_pixels(
        pixels_off(b, np.zeros(ERRORS))[chosen] + y.reshape(-1, 2), LEDS[chosen], CAMERA, np.full(3, sigma_px)
    )
    (after,) = (found := corrected([b], sight, SIGHT, OPEN, Taking())).beliefs
    S = H @ b.P @ H.T + sigma_px**2 * np.eye(6)
    K = b.P @ H.T @ np.linalg.inv(S)
    K[HARDWARE] = 0.0
    A = np.eye(ERRORS) - K @ H
    np.testing.assert_allclose(after.P, A @ b.P @ A.T + sigma_px**2 * K @ K.T, atol=1e-10)
    moved = np.concatenate([log(after.R_BD @ b.R_BD.T), (after.x - b.x).ravel()])
    np.testing.assert_allclose(moved, (K @ y)[: HARDWARE.start], atol=1e-8)
    assert found.chi2 == pytest.approx(float(y @ np.linalg.solve(S, y)), rel=1e-3)


def test_leds_out_of_place_are_no_news_the_second_time():
    """Chi-square of the same frame again and again, each LED 0.3 mm off, 8 degrees of tilt, 5 m: near that of noise.

    Taken for news in every frame, the LEDs' 0.17 px would make of it several times the sixteen that noise alone is.
    """
    rng, chi2 = np.random.default_rng(9), []
    for _ in range(40):
        P = covariance({0: 0.05**2, 3: 0.04})
        P[range(RING.start, RING.stop), range(RING.start, RING.stop)] = 9e-8
        b = belief(P, MOUNTING.R_BC @ matrix_from_yaw_pitch_roll(0.0, np.deg2rad(8.0), 0.0))
        b.x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ [5.0, 0.1, 0.1]
        seen = SIGHT.apparent(b)
        R_CD, p_CD = exp(0.05 * rng.normal(size=3)) @ seen.R_CD, seen.p_CD + 0.2 * rng.normal(size=3)
        ring = LEDS.copy()
        ring[:, 1:] += 3e-4 * rng.normal(size=(8, 2))
        beliefs = [b]
        for k in range(6):
            pixels = pixels_of(R_CD, p_CD, ring) + 0.1 * rng.normal(size=(8, 2))
            pose = solve_pose(pixels, LEDS, CAMERA, sigma_px=0.1, initial=(R_CD, p_CD))
            found = corrected(beliefs, pose, SIGHT, OPEN, Taking(share=0.1, memory=0.98))
            beliefs = found.beliefs
            chi2.append((k, found.chi2))
    later = np.array([value for k, value in chi2 if k > 0])
    low, high = chi2_band(16 * len(later), 1e-4)
    assert low < later.sum() < high


def test_places_of_the_leds_are_told_from_tilt_once_the_ring_turns():
    """Tilts of 3 to 12 degrees known to 0.1 degrees show which LEDs are off; what is learnt is true, and its sigma."""
    rng, off, says = np.random.default_rng(10), [], []
    for _ in range(10):
        d = 3e-4 * rng.normal(size=(8, 2))
        P = covariance({0: np.deg2rad(0.1) ** 2, 3: 1e-4})
        P[range(RING.start, RING.stop), range(RING.start, RING.stop)] = 9e-8
        b = belief(P)
        b.x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ [4.0, 0.1, 0.1]
        ring = LEDS.copy()
        ring[:, 1:] += d
        for tilt_deg in np.linspace(3.0, 12.0, 30):
            fresh = b.P.copy()
            fresh[:6], fresh[:, :6], fresh[:6, :6] = 0.0, 0.0, P[:6, :6]
            R_CD = matrix_from_yaw_pitch_roll(0.0, np.deg2rad(tilt_deg), 0.0)
            at = b.x.copy()
            at[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ [4.0, 0.1, 0.1]
            b = replace(b, R_BD=MOUNTING.R_BC @ exp(np.deg2rad(0.1) * rng.normal(size=3)) @ R_CD, x=at, P=fresh)
            pixels = pixels_of(R_CD, np.array([4.0, 0.1, 0.1]), ring) + 0.05 * rng.normal(size=(8, 2))
            pose = solve_pose(pixels, LEDS, CAMERA, sigma_px=0.05, initial=(R_CD, np.array([4.0, 0.1, 0.1])))
            b = corrected([b], pose, SIGHT, OPEN, Taking(ring=0.3)).beliefs[0]
        error = b.ring - d.ravel()
        off.append(error)
        says.append(error @ np.linalg.solve(b.P[RING, RING], error))
    strain = np.column_stack([LEDS[:, 1], -LEDS[:, 2]]).ravel() / np.linalg.norm(LEDS[:, 1:])
    assert np.std(np.array(off) @ strain) < 0.3 * 3e-4
    low, high = chi2_band(16 * len(says), 1e-4)
    assert 0.5 * low < np.sum(says) < high


def test_a_larger_ring_is_considered_and_not_learnt():
    """Frames that show a ring 1 % larger, with the range known: places are learnt, their common scale is not."""
    d = 2e-4 * np.random.default_rng(11).normal(size=(8, 2)) + 0.01 * LEDS[:, 1:]
    P = covariance({0: np.deg2rad(0.1) ** 2, 3: 1e-10})
    P[range(RING.start, RING.stop), range(RING.start, RING.stop)] = 9e-8
    p_CD, R_CD = np.array([4.0, 0.1, 0.1]), matrix_from_yaw_pitch_roll(0.0, 0.2, 0.0)
    b = replace(belief(P), R_BD=MOUNTING.R_BC @ R_CD)
    b.x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ p_CD
    pose = solve_pose(pixels_of(R_CD, p_CD, LEDS + np.c_[np.zeros(8), d]), LEDS, CAMERA, sigma_px=0.05)
    for _ in range(50):
        b = corrected([b], pose, SIGHT, OPEN, Taking(ring=0.3)).beliefs[0]
    assert abs(b.ring @ SIGHT.larger) < 1e-12
    assert np.linalg.norm(b.ring) > 1e-4
    assert SIGHT.larger @ b.P[RING, RING] @ SIGHT.larger == pytest.approx(9e-8, rel=1e-6)


def test_leds_are_expected_where_they_are_believed_to_be_on_the_ring():
    b = replace(belief(np.zeros((ERRORS, ERRORS)), MOUNTING.R_BC), ring=1e-3 * np.arange(16.0))
    ring = LEDS.copy()
    ring[:, 1:] += b.ring.reshape(-1, 2)
    seen = SIGHT.apparent(b)
    pixels, sigma_px = SIGHT.led_pixels(b, SIGHT.apparent(b), CAMERA)
    np.testing.assert_allclose(pixels, pixels_of(seen.R_CD, seen.p_CD, ring), atol=1e-9)
    np.testing.assert_allclose(sigma_px, 0.0, atol=1e-9)


def test_leds_are_expected_as_uncertainly_as_all_that_is_believed_makes_them():
    """Near, tilted, with a belief in which everything correlates: the larger root of each pixel's covariance."""
    root = 1e-3 * np.random.default_rng(12).normal(size=(ERRORS, ERRORS))
    b = belief(root @ root.T, MOUNTING.R_BC @ matrix_from_yaw_pitch_roll(0.1, 0.3, 0.0))
    b.x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ [3.0, 0.4, -0.3]
    H = pixels_per_error(b)
    worst = np.linalg.eigvalsh(H @ b.P @ H.transpose(0, 2, 1))[:, -1]
    np.testing.assert_allclose(SIGHT.led_pixels(b, SIGHT.apparent(b), CAMERA)[1], np.sqrt(worst), rtol=1e-6)


def test_leds_behind_the_camera_are_expected_nowhere():
    """The ring stands across the camera, 0.1 m ahead of its lens."""
    p_CD = np.array([0.1, 0.0, 0.0])
    b = belief(1e-6 * np.eye(ERRORS), MOUNTING.R_BC @ matrix_from_yaw_pitch_roll(0.5 * np.pi, 0.0, 0.0))
    b.x[0] = MOUNTING.p_BC - MOUNTING.p_BI + MOUNTING.R_BC @ p_CD
    seen = SIGHT.apparent(b)
    ahead = (LEDS @ seen.R_CD.T + seen.p_CD)[:, 0] > 0.0
    assert 0 < ahead.sum() < 8
    pixels, sigma_px = SIGHT.led_pixels(b, seen, CAMERA)
    np.testing.assert_array_equal(np.isfinite(pixels), np.column_stack([ahead, ahead]))
    np.testing.assert_array_equal(np.isfinite(sigma_px), ahead)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_leds_correct_what_they_see(count):
    """Their own places agree with the truth within 3 sigma of a pixel afterwards; chi2 has two degrees each."""
    rng = np.random.default_rng(count)
    b, _ = start(np.deg2rad(2.0), 0.0, 6.0)
    seen = SIGHT.apparent(b)
    moved = seen.p_CD + np.array([0.1, 0.05, -0.04])
    pixels = pixels_of(seen.R_CD, moved, LEDS[:count]) + 0.1 * rng.normal(size=(count, 2))
    sight = lines_of_sight_from_pixels(pixels, LEDS[:count], CAMERA, np.full(count, 0.1))
    found = corrected([b], sight, SIGHT, OPEN, Taking())
    assert found.degrees_of_freedom == 2 * count
    after = SIGHT.apparent(found.beliefs[0])
    np.testing.assert_allclose(pixels_of(after.R_CD, after.p_CD, LEDS[:count]), pixels, atol=0.3)
    P = found.beliefs[0].P
    assert np.diag(P)[4] < 0.01 * 0.04  # across
    if count == 1:
        assert np.diag(P)[3] > 0.5 * 0.04  # along


def test_a_frame_without_numbers_is_no_news_and_no_error():
    H = np.zeros((16, ERRORS))
    for P in (np.full((ERRORS, ERRORS), np.nan), np.full((ERRORS, ERRORS), np.inf)):
        gained, after = _gained(P, H, np.zeros(16), np.eye(16), CALIBRATION.start, RING.start)
        assert np.isnan(gained).all() and np.isnan(after).all()


def test_gate_refuses_and_leaves_nothing():
    b, _ = start(np.deg2rad(2.0), 0.0, 6.0)
    seen = SIGHT.apparent(b)
    pose = solve_pose(pixels_of(seen.R_CD, seen.p_CD + [0.0, 2.0, 0.0]), LEDS, CAMERA)
    refused = corrected([b], pose, SIGHT, [0.0] * 16 + [44.3], Taking())
    assert refused.beliefs == [] and refused.chi2 > 44.3
    assert len(corrected([b], pose, SIGHT, OPEN, Taking()).beliefs) == 1


@pytest.mark.parametrize(("tight", "freedom"), [(True, 16), (False, 6)], ids=["tight", "loose"])
def test_the_gate_is_that_of_the_frame_s_degrees_of_freedom(tight, freedom):
    b, _ = start(np.deg2rad(2.0), 0.0, 6.0)
    seen = SIGHT.apparent(b)
    pose = solve_pose(pixels_of(seen.R_CD, seen.p_CD + [0.0, 0.5, 0.0]), LEDS, CAMERA)
    found = corrected([b], pose, SIGHT, OPEN, Taking(tight=tight))
    assert found.degrees_of_freedom == freedom
    narrow, wide = [np.inf] * 17, [0.0] * 17
    narrow[freedom], wide[freedom] = 0.999 * found.chi2, 1.001 * found.chi2
    assert corrected([b], pose, SIGHT, narrow, Taking(tight=tight)).beliefs == []
    assert len(corrected([b], pose, SIGHT, wide, Taking(tight=tight)).beliefs) == 1


def test_a_frame_that_all_hypotheses_refuse_is_said_to_disagree_by_the_least_of_them():
    near, _ = start(np.deg2rad(2.0), 0.0, 6.0)
    far = replace(near, x=near.x + 0.3 * np.eye(8, 3, k=1))
    seen = SIGHT.apparent(near)
    pose = solve_pose(pixels_of(seen.R_CD, seen.p_CD + [0.0, -0.4, 0.0]), LEDS, CAMERA)
    alone = [corrected([b], pose, SIGHT, [0.0] * 17, Taking()).chi2 for b in (near, far)]
    assert min(alone) < 0.9 * max(alone)
    for both in ([near, far], [far, near]):
        assert corrected(both, pose, SIGHT, [0.0] * 17, Taking()).chi2 == min(alone)


def apart(sigmas: float, log_weight: float = 0.0) -> Belief:
    """A belief so many of its sigmas off from another one to the left."""
    b = belief(0.01 * np.eye(ERRORS), log_weight=log_weight)
    b.x[0, 1] += 0.1 * sigmas
    return b


def test_two_hypotheses_within_three_sigma_are_told_as_one():
    (one,) = _kept([apart(0.0), apart(2.9)])
    assert one.p_ID[1] == pytest.approx(mixture([apart(0.0), apart(2.9)]).p_ID[1], abs=1e-12)
    assert [b.p_ID[1] for b in _kept([apart(0.0), apart(3.1)])] == [b.p_ID[1] for b in (apart(0.0), apart(3.1))]


def test_a_hypothesis_dies_at_a_millionth_of_the_most_likely_one_s_weight():
    for relative, left in ((-13.9, 2), (-14.1, 1)):
        kept = _kept([apart(9.0, 5.0 + relative), apart(0.0, 5.0)])
        assert len(kept) == left and kept[0].log_weight == 0.0
        assert [b.log_weight for b in kept[1:]] == pytest.approx([relative] * (left - 1))


def test_of_three_hypotheses_the_two_most_likely_stay():
    kept = _kept([apart(9.0, -2.0), apart(0.0, -1.0), apart(-9.0, -3.0)])
    assert [b.p_ID[1] for b in kept] == [apart(0.0).p_ID[1], apart(9.0).p_ID[1]]


def test_two_that_are_told_as_one_may_be_the_most_likely_together():
    """Of weights 1, and twice 0.6 close together, that comes first whose weight is 1.2."""
    first, second = _kept([apart(0.0), apart(20.0, np.log(0.6)), apart(20.5, np.log(0.6))])
    assert first.p_ID[1] == pytest.approx(apart(20.25).p_ID[1]) and second.p_ID[1] == apart(0.0).p_ID[1]
    assert (first.log_weight, second.log_weight) == pytest.approx((0.0, -np.log(1.2)))


def test_mixture_has_the_mean_and_covariance_of_both():
    """3 : 1 of two Gaussians far apart, against the closed form on scalars along one axis."""
    first = belief(0.01 * np.eye(ERRORS))
    x = first.x.copy()
    x[0, 1] += 2.0
    ring = np.full(16, 4e-4)
    both = mixture([first, Belief(first.R_BD, x, 0.04 * np.eye(ERRORS), np.log(1.0 / 3.0), ring)])
    np.testing.assert_allclose(both.p_ID - first.p_ID, [0.0, 0.5, 0.0], atol=1e-12)
    expected = (0.75 * 0.01 + 0.25 * 0.04) * np.eye(ERRORS)
    apart = np.zeros(ERRORS)
    apart[4], apart[RING] = 2.0, ring
    expected += 0.75 * 0.25 * np.outer(apart, apart)
    np.testing.assert_allclose(both.ring, 1e-4)
    np.testing.assert_allclose(both.P, expected, atol=1e-12)
    assert both.log_weight == pytest.approx(np.log(4.0 / 3.0))


def test_a_rolled_belief_forgets_how_its_attitude_and_its_leds_went_with_the_rest():
    root = np.random.default_rng(2).normal(size=(ERRORS, ERRORS))
    before = replace(belief(root @ root.T), ring=np.full(16, 1e-3))
    after = rolled(before, 0.5, 9e-8)
    others = np.r_[3 : REST.start, CALIBRATION]
    np.testing.assert_allclose(before.R_BD.T @ after.R_BD, exp(np.array([0.5, 0.0, 0.0])), atol=1e-12)
    np.testing.assert_array_equal(after.ring, 0.0)
    np.testing.assert_array_equal(after.P[np.ix_(np.r_[:3, REST], others)], 0.0)
    np.testing.assert_array_equal(after.P[np.ix_(others, others)], before.P[np.ix_(others, others)])
    np.testing.assert_array_equal(after.P[:3, REST], before.P[:3, REST])
    assert np.diag(after.P)[:3].min() >= np.diag(before.P)[:3].max()
    np.testing.assert_array_equal(after.P[RING, : RING.start], 0.0)
    np.testing.assert_array_equal(after.P[: RING.start, RING], 0.0)
    np.testing.assert_array_equal(after.P[RING, RING], 9e-8 * np.eye(16))
    assert np.linalg.eigvalsh(after.P).min() > -1e-9


def test_what_moves_the_drogue_moves_it_from_its_place_and_attitude_of_rest_too():
    """Errors drawn from what a widened belief is less certain of: a blow leaves those of rest alone."""
    before = belief(np.eye(ERRORS))
    added = widened(before, (0.1, 0.2, 0.3), 0.4).P - before.P
    np.testing.assert_allclose(np.diag(added)[:9], np.repeat([0.01, 0.04, 0.09], 3))
    np.testing.assert_allclose(added[RING, RING], 0.16 * np.eye(16), atol=1e-12)
    drawn = np.random.default_rng(4).multivariate_normal(np.zeros(ERRORS), added, 100).T
    np.testing.assert_allclose(drawn[PHI], -drawn[REST], atol=1e-6)
    np.testing.assert_allclose(drawn[SWING][1:], drawn[PLACE][1:], atol=1e-6)
    np.testing.assert_allclose(drawn[SWING_RATE][1:], drawn[VELOCITY][1:], atol=1e-6)
    still = np.r_[SWING.start, SWING_RATE.start, BIAS, FORMATION, GUST, CALIBRATION]
    assert not added[still].any()


def test_the_first_force_is_that_of_the_formation():
    np.testing.assert_array_equal(felt_first(belief(np.eye(ERRORS)), np.array([0.5, 0.0, 9.8])).x[5], [-0.5, 0.0, -9.8])


def test_evidence_that_is_the_same_in_every_frame_does_not_add_up():
    """Frontal, 20 m: with memory m and share q the odds of the two minima stay below q/(1 - m) times a frame's own."""
    b, R_CD = start(np.deg2rad(8.0), 6.0, 20.0)
    pose = solve_pose(pixels_of(R_CD, SIGHT.apparent(b).p_CD), LEDS, CAMERA)
    (alone,) = [corrected([b], pose, SIGHT, OPEN, Taking()).beliefs[1].log_weight]
    (shared,) = [corrected([b], pose, SIGHT, OPEN, Taking(share=0.1)).beliefs[1].log_weight]
    assert shared == pytest.approx(0.1 * alone)
    first, second = corrected([b], pose, SIGHT, OPEN, Taking()).beliefs
    weighed = [first, replace(second, log_weight=-5.0)]
    ends = [corrected(weighed, pose, SIGHT, OPEN, Taking(memory=memory)).beliefs[1] for memory in (1.0, 0.5)]
    assert ends[1].log_weight - ends[0].log_weight == pytest.approx(2.5, abs=0.1)


def test_a_drogue_that_is_seen_again_moves_as_at_the_start_and_the_rest_is_kept():
    rng = np.random.default_rng(7)
    root = rng.normal(size=(ERRORS, ERRORS))
    lost = belief(root @ root.T)
    lost.x[:] = rng.normal(size=(8, 3))
    start = belief(np.diag(np.arange(1.0, ERRORS + 1.0)))
    start.x[:] = rng.normal(size=(8, 3))
    again = begun_again(lost, start, np.array([20.0, 1.0, -2.0]), 0.1)
    moving, kept = np.r_[3:15, GUST], np.r_[BIAS, FORMATION, REST, HARDWARE]
    assert np.array_equal(again.x, np.vstack([[20.0, 1.0, -2.0], start.x[1:4], lost.x[4:7], start.x[7:]]))
    assert np.array_equal(again.P[np.ix_(moving, moving)], start.P[np.ix_(moving, moving)])
    assert not again.P[np.ix_(moving, np.r_[PHI, kept])].any() and not again.P[np.ix_(np.r_[PHI, kept], moving)].any()
    turned = np.zeros((3, ERRORS))  # away from the attitude of rest, which stays
    turned[:, PHI], turned[:, REST] = np.eye(3), -np.eye(3)
    expected, others = lost.P + 0.01 * turned.T @ turned, np.r_[PHI, kept]
    assert again.P[np.ix_(others, others)] == pytest.approx(expected[np.ix_(others, others)])
    assert np.array_equal(again.R_BD, lost.R_BD)
