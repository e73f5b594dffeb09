"""Which ends of the fit of a frame and a belief become hypotheses: floors, and shoulders of floors that are none."""

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.nav.belief_fit import distance2, fitted, image_of
from dockair.nav.belief_frame import Explanation, Seen, explanations
from dockair.nav.pose.measurement import LinesOfSight, lines_of_sight_from_pixels
from dockair.nav.pose.planar import mirrored
from dockair.rotations import Array, exp, matrix_from_yaw_pitch_roll

LEDS, CAMERA = LedRing().positions_D, Camera()
Pose = tuple[Array, Array]


def tilted(tilt_deg: float, range_m: float) -> Pose:
    return matrix_from_yaw_pitch_roll(0.0, np.deg2rad(tilt_deg), 0.0), np.array([range_m, 0.0, 0.0])


def frame(true: Pose, sigma_px: float = 0.1) -> LinesOfSight:
    R, p = true
    return lines_of_sight_from_pixels(CAMERA.pixels_from_points(LEDS @ R.T + p), LEDS, CAMERA, np.full(8, sigma_px))


def believed(pose: Pose, tilt_sigma_deg: float) -> Seen:
    """A belief that knows the place to 0.2 m and each LED's to 0.3 mm."""
    C = np.diag(np.repeat([np.deg2rad(tilt_sigma_deg), 0.2, 3e-4], [3, 3, 16]) ** 2)
    return Seen(R_CD=pose[0], p_CD=pose[1], points_D=LEDS, C=C)


def residuals(end: Explanation, seen: Seen, sight: LinesOfSight) -> Array:
    """(16,) whitened, written out, of what an explanation says."""
    ab, whiten = image_of(sight.rays, sight.weights)
    points = LEDS.copy()
    points[:, 1:] += end.y[6:].reshape(-1, 2)
    at = points @ (exp(end.y[:3]) @ seen.R_CD).T + seen.p_CD + end.y[3:6]
    return np.einsum("kij,kj->ki", whiten, ab + at[:, 1:] / at[:, :1]).ravel()


def test_near_by_and_tilted_all_starts_on_one_side_are_one_explanation():
    true = tilted(20.0, 4.0)
    starts = [true, tilted(17.0, 4.1), tilted(22.0, 3.9)]
    assert len(explanations(believed(tilted(18.0, 4.0), 2.0), frame(true), starts)) == 1


def test_far_away_a_frontal_belief_has_two_floors_with_their_evidence():
    """Eqs. (2) and (4) at both: no step goes anywhere, and the evidence is that of the cost there."""
    true = tilted(6.0, 20.0)
    seen, sight = believed(tilted(0.0, 20.0), 8.0), frame(true)
    ends = explanations(seen, sight, [true, mirrored(*true, LEDS)])
    assert len(ends) == 2
    assert ends[0].y[1] > np.deg2rad(5.0) and ends[1].y[1] < -np.deg2rad(5.0)
    for end in ends:
        S = end.H @ seen.C @ end.H.T + np.eye(16)
        sigma = np.sqrt(np.diag(seen.C))
        np.testing.assert_allclose(end.y / sigma, seen.C @ end.H.T @ np.linalg.solve(S, end.nu) / sigma, atol=1e-3)
        r = residuals(end, seen, sight)
        np.testing.assert_allclose(end.nu, r + end.H @ end.y, atol=1e-9)
        cost = r @ r + end.y @ np.linalg.solve(seen.C, end.y)
        assert end.chi2 == pytest.approx(cost, rel=1e-4)
        assert end.log_evidence == pytest.approx(-0.5 * (end.chi2 + np.linalg.slogdet(S)[1]), rel=1e-9)


def test_of_a_floor_that_the_belief_has_filled_one_step_from_there_is_left():
    """The average of two Gaussians: by the mirror image's own linearisation, off what the LEDs are seen to say."""
    true = tilted(6.0, 20.0)
    seen, sight = believed(true, 2.0), frame(true)
    floor, shoulder = explanations(seen, sight, [true, mirrored(*true, LEDS)])
    S = shoulder.H @ seen.C @ shoulder.H.T + np.eye(16)
    by_S, sigma = np.linalg.solve(S, shoulder.nu), np.sqrt(np.diag(seen.C))
    np.testing.assert_allclose(shoulder.y / sigma, seen.C @ shoulder.H.T @ by_S / sigma, atol=1e-6)
    assert shoulder.chi2 == pytest.approx(shoulder.nu @ by_S, rel=1e-9)
    assert np.abs(residuals(shoulder, seen, sight) - shoulder.nu + shoulder.H @ shoulder.y).max() > 0.1
    np.testing.assert_allclose(residuals(floor, seen, sight), floor.nu - floor.H @ floor.y, atol=1e-9)


def test_a_shoulder_within_three_sigma_of_the_floor_is_none():
    true = tilted(6.0, 20.0)
    mirror, seen = mirrored(*true, LEDS), believed(true, 1.0)
    for sigma_px, count, chi2 in ((0.31, 2, 9.2), (0.32, 1, 8.7)):
        sight = frame(true, sigma_px)
        image = image_of(sight.rays, sight.weights)
        floor, step = (fitted(*true, LEDS, seen.C, *image, *begin) for begin in (true, mirror))
        assert distance2(step[9], floor[3], floor[6]) == pytest.approx(chi2, abs=0.1)
        assert len(explanations(seen, sight, [true, mirror])) == count


def test_a_belief_without_a_pose_of_the_frame_s_own_has_no_shoulder():
    """However far its own first step is from where the fit ends."""
    true = tilted(25.0, 3.0)
    (end,) = explanations(believed(tilted(2.0, 3.0), 20.0), frame(true), [])
    assert end.y[1] == pytest.approx(np.deg2rad(23.0), abs=0.01)


def test_a_fit_that_has_not_ended_explains_nothing():
    """Believed 6 m ahead, by 10 m, and seen at 2 cm: no step from there stays ahead of the camera."""
    seen = believed(tilted(0.0, 6.0), 3.0)
    seen.C[range(3, 6), range(3, 6)] = 100.0
    assert explanations(seen, frame(tilted(0.0, 0.02)), []) == []


def test_nothing_explains_leds_that_are_believed_behind_the_camera():
    true = tilted(6.0, 5.0)
    assert explanations(believed(tilted(6.0, -5.0), 2.0), frame(true), []) == []
