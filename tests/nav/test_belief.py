"""Motion of the belief: its Jacobian against differences, its noise against samples; mixtures and their fate."""

import numpy as np
import pytest
from scipy.linalg import expm

from dockair.calibration import Camera, LedRing, Mounting
from dockair.nav.belief import Belief, MotionNoise, corrected, mixture, moved, pose_prior
from dockair.nav.pose.estimate import solve_pose
from dockair.nav.pose.planar import mirrored
from dockair.rotations import Array, exp, log, matrix_from_yaw_pitch_roll, skew

RING, CAMERA = LedRing().positions_D, Camera()
MOUNTING = Mounting(
    R_BC=matrix_from_yaw_pitch_roll(-0.05, 0.02, 0.1),
    p_BC=np.array([3.3, -0.45, 0.75]),
    p_BP=np.array([6.0, -0.9, 0.6]),
)
SILENT = MotionNoise(attitude2=0.0, acceleration2=0.0, gyro2=0.0)


def belief(P: Array, R: Array | None = None, log_weight: float = 0.0) -> Belief:
    R = exp(np.array([0.1, -0.2, 0.3])) if R is None else R
    return Belief(R, np.array([12.0, -0.5, 0.8]), np.array([0.4, -0.3, 0.2]), P, log_weight)


def off(b: Belief, e: Array) -> Belief:
    return Belief(exp(e[:3]) @ b.R_BD, b.p_BD + e[3:6], b.v_BD + e[6:], b.P)


def difference(a: Belief, b: Belief) -> Array:
    return np.concatenate([log(a.R_BD @ b.R_BD.T), a.p_BD - b.p_BD, a.v_BD - b.v_BD])


@pytest.mark.parametrize("w", [np.zeros(3), np.array([0.3, -0.2, 0.5]), np.array([3.0, 2.0, -2.0])])
def test_state_moves_as_seen_from_axes_that_turn(w):
    """ds/dt = v - w x s, dv/dt = -w x v, dR/dt = -[w x] R, integrated by the matrix exponential."""
    b, dt = belief(np.eye(9)), 0.7
    after = moved(b, w, dt, SILENT)
    A = np.block([[-skew(w), np.eye(3)], [np.zeros((3, 3)), -skew(w)]])
    s_v = expm(A * dt) @ np.concatenate([b.p_BD, b.v_BD])
    np.testing.assert_allclose(np.concatenate([after.p_BD, after.v_BD]), s_v, atol=1e-12)
    np.testing.assert_allclose(after.R_BD, expm(-skew(w) * dt) @ b.R_BD, atol=1e-13)


def test_covariance_moves_by_the_jacobian_of_the_motion():
    w, dt, step, b = np.array([0.3, -0.2, 0.5]), 0.4, 1e-6, belief(np.eye(9))
    after = moved(b, w, dt, SILENT)
    F = np.empty((9, 9))
    for k, e in enumerate(np.eye(9) * step):
        plus, minus = (moved(off(b, s * e), w, dt, SILENT) for s in (1.0, -1.0))
        F[:, k] = (difference(plus, after) - difference(minus, after)) / (2.0 * step)
    root = np.random.default_rng(1).normal(size=(9, 9))
    P = root @ root.T
    np.testing.assert_allclose(moved(belief(P), w, dt, SILENT).P, F @ P @ F.T, atol=1e-7)


def test_gyro_noise_enters_as_turning_the_rate_would():
    """G of the module's head is the derivative of the moved state by the rate, taken with the opposite sign."""
    w, dt, step, b = np.array([0.3, -0.2, 0.5]), 1e-3, 1e-4, belief(np.zeros((9, 9)))
    G = np.empty((9, 3))
    for k, e in enumerate(np.eye(3) * step):
        plus, minus = (moved(b, w + s * e, dt, SILENT) for s in (1.0, -1.0))
        G[:, k] = -difference(plus, minus) / (2.0 * step * dt)
    P = moved(b, w, dt, MotionNoise(attitude2=0.0, acceleration2=0.0, gyro2=1e-6)).P
    np.testing.assert_allclose(P, 1e-6 * dt * G @ G.T, atol=2e-3 * P.max())


def test_noise_of_many_short_steps_is_that_of_one_long_step():
    noise, b = MotionNoise(attitude2=1e-3, acceleration2=0.5, gyro2=0.0), belief(np.eye(9))
    short = b
    for _ in range(100):
        short = moved(short, np.zeros(3), 0.01, noise)
    np.testing.assert_allclose(short.P, moved(b, np.zeros(3), 1.0, noise).P, rtol=1e-9, atol=1e-12)


def test_mixture_has_the_mean_and_covariance_of_samples():
    """3 : 1 of two Gaussians far apart, against the closed form on scalars along one axis."""
    d = np.zeros(9)
    d[4] = 2.0
    first = belief(0.01 * np.eye(9))
    second = Belief(first.R_BD, first.p_BD + d[3:6], first.v_BD, 0.04 * np.eye(9), log_weight=np.log(1.0 / 3.0))
    both = mixture([first, second])
    np.testing.assert_allclose(both.p_BD - first.p_BD, [0.0, 0.5, 0.0], atol=1e-12)
    expected = (0.75 * 0.01 + 0.25 * 0.04) * np.eye(9)
    expected[4, 4] += 0.75 * 0.25 * 4.0
    np.testing.assert_allclose(both.P, expected, atol=1e-12)
    assert both.log_weight == pytest.approx(np.log(4.0 / 3.0))


def start(sigma_tilt_rad: float, tilt_deg: float, range_m: float) -> tuple[Belief, Array]:
    """A frontal belief and a true attitude tilted against it, seen from the camera."""
    R_CD, p_CD = matrix_from_yaw_pitch_roll(0.0, np.deg2rad(tilt_deg), 0.0), np.array([range_m, 0.0, 0.0])
    P = np.diag([sigma_tilt_rad**2] * 3 + [0.04] * 3 + [0.1] * 3)
    P[3:6, 6:] = P[6:, 3:6] = 0.03 * np.eye(3)
    return Belief(MOUNTING.R_BC, MOUNTING.p_BC + MOUNTING.R_BC @ p_CD, np.zeros(3), P), R_CD


def test_two_floors_far_apart_stay_two_until_one_dies():
    """20 m, 6 degrees, a prior that does not know the side: two hypotheses, and after some frames the true one."""
    rng = np.random.default_rng(5)
    b, R_CD = start(np.deg2rad(8.0), 6.0, 20.0)
    p_CD, counts = pose_prior(b, MOUNTING).p_CD, []
    beliefs = [b]
    for _ in range(60):
        pixels = CAMERA.pixels_from_points(RING @ R_CD.T + p_CD) + 0.1 * rng.normal(size=(8, 2))
        beliefs = corrected(beliefs, solve_pose(pixels, RING, CAMERA), MOUNTING, np.inf)
        counts.append(len(beliefs))
        assert beliefs[0].log_weight == 0.0
        assert all(np.linalg.eigvalsh(h.P).min() > 0.0 for h in beliefs)
    assert counts[0] == 2 and counts[-1] == 1
    assert np.linalg.norm(log(MOUNTING.R_BC.T @ beliefs[0].R_BD @ R_CD.T)) < np.deg2rad(1.0)


def test_hypotheses_are_two_at_most_and_mirror_images():
    b, R_CD = start(np.deg2rad(8.0), 6.0, 20.0)
    p_CD = pose_prior(b, MOUNTING).p_CD
    pose = solve_pose(CAMERA.pixels_from_points(RING @ R_CD.T + p_CD), RING, CAMERA)
    first, second = corrected([b], pose, MOUNTING, np.inf)
    other, _ = mirrored(MOUNTING.R_BC.T @ first.R_BD, p_CD, RING)
    assert np.rad2deg(np.linalg.norm(log(MOUNTING.R_BC.T @ second.R_BD @ other.T))) < 2.0


def test_velocity_follows_the_pose_by_regression():
    """A shift of the drogue seen where P_sv / P_ss = 0.75 /s raises the velocity by that much of what was taken."""
    b, _ = start(np.deg2rad(2.0), 0.0, 6.0)
    prior = pose_prior(b, MOUNTING)
    shifted = prior.p_CD + np.array([0.02, 0.05, -0.03])
    pose = solve_pose(CAMERA.pixels_from_points(RING @ prior.R_CD.T + shifted), RING, CAMERA, sigma_px=0.02)
    (after,) = corrected([b], pose, MOUNTING, np.inf)
    np.testing.assert_allclose(after.v_BD, 0.75 * (after.p_BD - b.p_BD), rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(np.diag(after.P)[6:], 0.1 - 0.75**2 * (0.04 - np.diag(after.P)[3:6]), rtol=1e-3)


def test_gate_refuses_and_leaves_nothing():
    b, _ = start(np.deg2rad(2.0), 0.0, 6.0)
    prior = pose_prior(b, MOUNTING)
    pose = solve_pose(CAMERA.pixels_from_points(RING @ prior.R_CD.T + prior.p_CD + [0.0, 2.0, 0.0]), RING, CAMERA)
    assert corrected([b], pose, MOUNTING, 27.9) == []
    assert len(corrected([b], pose, MOUNTING, np.inf)) == 1
