"""Motion of the belief: closed forms, its Jacobian against differences, its noise against the Lyapunov equation."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from dockair.nav.belief_motion import BIAS, CALIBRATION, ERRORS, REST, RING, Motion, propagated
from dockair.rotations import Array, exp, log, skew

SWINGS = np.array([0.0, 1.0, 1.0])  # along the hose there is no swing
OMEGA = 2.0 * np.pi * np.array([0.0, 0.33, 0.40])
SILENT = Motion(
    stiffness=OMEGA**2,
    friction=0.3 * OMEGA,
    gust_1_s=1.4,
    gust2=np.zeros(3),
    attitude2=0.0,
    return_1_s=0.7,
    rest2=0.0,
    ring2=0.0,
    drive2=0.0,
    receiver2=0.0,
    accelerometer2=0.0,
    gyro2=0.0,
    bias2=0.0,
    formation2=0.0,
    scale2=0.0,
    held_turn2=0.0,
    held_most2=0.0,
    longest_gap_s=0.1,
    longest_step_s=0.01,
)
R0 = exp(np.array([0.1, -0.2, 0.3]))
X0 = np.array(
    [
        [9.0, -0.5, 0.8],
        [0.4, -0.3, 0.2],
        [0.0, 0.1, -0.2],
        [0.0, -0.3, 0.25],
        [0.01, -0.02, 0.03],
        [0.3, -0.1, -9.7],
        [0.02, -0.03, 0.01],
        [0.3, -0.2, 0.4],
    ]
)
ZERO = np.zeros((ERRORS, ERRORS))


def samples(w: Array, f: Array, until_s: float, rate_hz: float = 250.0) -> tuple[Array, Array, Array]:
    times = np.arange(round(until_s * rate_hz) + 1) / rate_hz
    return times, np.tile(w, (len(times), 1)), np.tile(f, (len(times), 1))


def off(x: Array, R: Array, e: Array) -> tuple[Array, Array]:
    return exp(e[:3]) @ R, x + e[3 : CALIBRATION.start].reshape(8, 3)


def difference(a: tuple[Array, Array], b: tuple[Array, Array]) -> Array:
    return np.concatenate([log(a[0] @ b[0].T), (a[1] - b[1]).ravel(), np.zeros(ERRORS - CALIBRATION.start)])


@pytest.mark.parametrize("w", [np.zeros(3), np.array([0.3, -0.2, 0.5])])
def test_state_follows_its_differential_equation(w):
    """Integrated by Runge-Kutta in axes that turn, u' = -w x u and the swing's own terms."""
    f = np.array([0.2, 0.4, 9.5])

    def rate(_: float, y: Array) -> Array:
        s, v, n, m, b, c, u, g = y.reshape(8, 3)
        a, turn = -SILENT.stiffness * n - SILENT.friction * m + g, w - b
        still = np.zeros(3)
        swing = SWINGS * m, SWINGS * a
        moved = np.array([v, a - f - c, *swing, still, still, -SILENT.return_1_s * u, -SILENT.gust_1_s * g])
        moved[[0, 1, 2, 3, 5, 6, 7]] -= np.cross(turn, np.array([s, v, n, m, c, u, g]))
        return moved.ravel()

    expected = solve_ivp(rate, (0.0, 0.8), X0.ravel(), rtol=1e-10, atol=1e-12).y[:, -1].reshape(8, 3)
    R, x, _ = propagated(R0, X0, ZERO, 0.0, 0.8, *samples(w, f, 0.8), SILENT.flat())
    np.testing.assert_allclose(x, expected, atol=2e-4)  # second order in 4 ms
    returned = exp(X0[6] * (1.0 - np.exp(-0.8 * SILENT.return_1_s)))  # towards the attitude of rest
    np.testing.assert_allclose(R, expm(-skew(w - X0[4]) * 0.8) @ returned @ R0, atol=3e-5)


def test_a_swing_without_damping_keeps_its_period():
    """After one period of 1/0.33 s it is where it was; side by side with a receiver that keeps its course."""
    x = np.zeros((8, 3))
    x[0, 0], x[2, 1] = 10.0, 0.2
    calm = SILENT._replace(friction=np.zeros(3))
    period_s = 1.0 / 0.33
    _, after, _ = propagated(R0, x, ZERO, 0.0, period_s, *samples(np.zeros(3), np.zeros(3), period_s), calm.flat())
    assert after[2, 1] == pytest.approx(0.2, abs=2e-4)
    assert after[0, 1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("fitted", [True, False], ids=["accelerometers", "no accelerometers"])
def test_covariance_moves_by_the_jacobian_of_the_motion(fitted):
    w, f, step = np.array([0.3, -0.2, 0.5]), np.array([0.2, 0.4, 9.5]) if fitted else np.full(3, np.nan), 1e-6
    given = samples(w, f, 0.1)
    after = propagated(R0, X0, ZERO, 0.0, 0.1, *given, SILENT.flat())[:2]
    F = np.eye(ERRORS)
    for k in range(CALIBRATION.start):
        e = step * np.eye(ERRORS)[k]
        plus, minus = (propagated(*off(X0, R0, s * e), ZERO, 0.0, 0.1, *given, SILENT.flat())[:2] for s in (1.0, -1.0))
        F[:, k] = (difference(plus, after) - difference(minus, after)) / (2.0 * step)
    root = np.random.default_rng(1).normal(size=(ERRORS, ERRORS))
    P = propagated(R0, X0, root @ root.T, 0.0, 0.1, *given, SILENT.flat())[2]
    np.testing.assert_allclose(P, F @ root @ root.T @ F.T, atol=4e-3 * ERRORS)  # but for a half step of db x f
    np.testing.assert_array_equal(P, P.T)


def test_gyro_noise_enters_as_turning_the_rate_would():
    step, still = 1e-4, SILENT._replace(stiffness=np.zeros(3), friction=np.zeros(3))
    G = np.zeros((ERRORS, 3))
    w, f = np.array([0.3, -0.2, 0.5]), np.full(3, np.nan)
    after = propagated(R0, X0, ZERO, 0.0, 1e-3, *samples(w, f, 1e-3, 1000.0), still.flat())[:2]
    for k, e in enumerate(np.eye(3) * step):
        turned = [samples(w + s * e, f, 1e-3, 1000.0) for s in (1, -1)]
        ends = [propagated(R0, X0, ZERO, 0.0, 1e-3, *given, still.flat())[:2] for given in turned]
        G[:, k] = -(difference(ends[0], after) - difference(ends[1], after)) / (2.0 * step * 1e-3)
    P = propagated(R0, X0, ZERO, 0.0, 1e-3, *samples(w, f, 1e-3, 1000.0), still._replace(gyro2=1e-6).flat())[2]
    np.testing.assert_allclose(P, 1e-9 * G @ G.T, atol=2e-3 * P.max())


def test_noise_of_the_swing_is_that_of_the_lyapunov_equation():
    """Not turning: P' = A P + P A' + Q by Van Loan's matrix exponential, an axis without and one with swing."""
    q2, other2, gust2, t = 0.05, 0.02, np.array([0.4, 0.6, 0.9]), 1.0
    P = propagated(
        R0,
        np.zeros((8, 3)),
        ZERO,
        0.0,
        t,
        *samples(np.zeros(3), np.zeros(3), t),
        SILENT._replace(drive2=q2, accelerometer2=other2, gust2=gust2).flat(),
    )[2]
    for axis in (0, 2):
        A = np.zeros((5, 5))
        swings = SWINGS[axis]
        A[0, 1], A[2, 3] = 1.0, swings
        A[1, 2:] = -SILENT.stiffness[axis], -SILENT.friction[axis], 1.0
        A[3, 2:] = swings * A[1, 2:]
        A[4, 4] = -SILENT.gust_1_s
        drive = np.array([0.0, 1.0, 0.0, swings, 0.0])
        Q = q2 * np.outer(drive, drive) + np.diag([0.0, other2, 0.0, 0.0, gust2[axis]])
        loan = expm(np.block([[-A, Q], [np.zeros((5, 5)), A.T]]) * t)
        expected = loan[5:, 5:].T @ loan[:5, 5:]
        rows = [3 + axis, 6 + axis, 9 + axis, 12 + axis, 24 + axis]
        np.testing.assert_allclose(P[np.ix_(rows, rows)], expected, rtol=0.02, atol=1e-5)


def test_walks_grow_with_time():
    given = samples(np.zeros(3), np.zeros(3), 0.5)
    moving = SILENT._replace(attitude2=1e-3, return_1_s=0.0, bias2=1e-8, formation2=0.04, ring2=1e-8)
    P = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, 0.5, *given, moving.flat())[2]
    np.testing.assert_allclose(np.diag(P)[:3], 0.5e-3 + 1e-8 * 0.5**3 / 3.0, rtol=1e-3)
    np.testing.assert_allclose(np.diag(P)[BIAS], 0.5e-8, rtol=1e-9)
    np.testing.assert_allclose(np.diag(P)[18:21], 0.02, rtol=1e-9)
    np.testing.assert_allclose(np.diag(P)[RING], 0.5e-8, rtol=1e-9)
    np.testing.assert_allclose(np.diag(P)[6:9], 0.04 * 0.5**3 / 3.0, rtol=0.02)


def test_a_drogue_that_turns_comes_back_to_an_attitude_of_rest_that_walks():
    """The way to rest has an Ornstein-Uhlenbeck process's variance, the attitude of rest that of its walk alone."""
    q2, walk2, k, t = 2e-4, 1e-5, SILENT.return_1_s, 2.0
    turning = SILENT._replace(attitude2=q2, rest2=walk2)
    P = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, t, *samples(np.zeros(3), np.zeros(3), t), turning.flat())[2]
    decay = 1.0 - np.exp(-2.0 * k * t)
    np.testing.assert_allclose(np.diag(P)[REST], (q2 + walk2) / (2.0 * k) * decay, rtol=0.01)
    M = np.zeros((3, ERRORS))
    M[:, :3] = M[:, REST] = np.eye(3)
    np.testing.assert_allclose(M @ P @ M.T, walk2 * t * np.eye(3), atol=1e-3 * walk2)


@pytest.mark.parametrize(("wait_s", "corner"), [(0.1, False), (1.0, True)])
def test_a_rate_that_is_held_is_as_uncertain_as_a_rate_that_is_missing(wait_s, corner):
    """After the last sample the angle's variance is A^2 t^4 / 4, and beyond the corner it grows by the ceiling."""
    turn2, most2 = 0.04, 1.25e-3
    held = SILENT._replace(held_turn2=turn2, held_most2=most2)
    given = samples(np.zeros(3), np.full(3, np.nan), 0.1)
    P = propagated(R0, np.zeros((8, 3)), ZERO, 0.1, 0.1 + wait_s, *given, held.flat())[2]
    knee = (most2 / turn2) ** (1.0 / 3.0)
    expected = turn2 * min(wait_s, knee) ** 4 / 4.0 + most2 * max(wait_s - knee, 0.0)
    assert (wait_s > knee) is corner
    np.testing.assert_allclose(np.diag(P)[:3], expected, rtol=1e-9)


def test_a_gap_between_samples_is_bridged_with_its_own_uncertainty():
    held = SILENT._replace(held_turn2=0.04, held_most2=1.25e-3)
    times = np.array([0.0, 0.2])
    P = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, 0.2, times, np.zeros((2, 3)), np.zeros((2, 3)), held.flat())[2]
    np.testing.assert_allclose(np.diag(P)[:3], 0.04 * 0.2**4 / 64.0, rtol=1e-9)


def test_in_a_gap_the_receiver_s_acceleration_is_not_taken_for_known():
    """Samples 0.2 s apart with 5 m/s^2 between them: not used, and the velocity's variance is that of a guess."""
    times, forces = np.array([0.0, 0.2]), np.tile([5.0, 0.0, 0.0], (2, 1))
    guess = SILENT._replace(receiver2=0.2, accelerometer2=1e-6)
    _, x, P = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, 0.2, times, np.zeros((2, 3)), forces, guess.flat())
    np.testing.assert_array_equal(x[1], 0.0)
    np.testing.assert_allclose(np.diag(P)[6:9], 0.04, rtol=1e-9)


def test_many_samples_at_once_are_the_same_one_by_one_to_the_last_bit():
    rng = np.random.default_rng(3)
    times = np.arange(41) / 250.0
    w, f = 0.2 * rng.normal(size=(41, 3)), rng.normal(size=(41, 3))
    noisy = SILENT._replace(drive2=0.1, gyro2=1e-7, accelerometer2=1e-5, attitude2=1e-4)
    at_once = propagated(R0, X0, np.eye(ERRORS), 0.0, times[-1], times, w, f, noisy.flat())
    step = R0, X0, np.eye(ERRORS)
    for k in range(40):
        step = propagated(*step, times[k], times[k + 1], times, w, f, noisy.flat())
    for a, b in zip(at_once, step, strict=True):
        np.testing.assert_array_equal(a, b)


def test_of_a_gap_no_rate_is_less_certain_than_one_that_is_not_known():
    """Samples 2 s apart: by [imu_samples, eq 1] 0.005 rad^2/s, four times the ceiling."""
    held = SILENT._replace(held_turn2=0.04, held_most2=1.25e-3)
    given = np.array([0.0, 2.0]), np.zeros((2, 3)), np.zeros((2, 3))
    P = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, 2.0, *given, held.flat())[2]
    np.testing.assert_allclose(np.diag(P)[:3], 2.0 * 1.25e-3, rtol=1e-9)


def test_without_samples_rate_and_acceleration_are_not_known_at_all():
    nothing = SILENT._replace(held_turn2=0.04, held_most2=1.25e-3, receiver2=0.2, accelerometer2=1e-6)
    given = np.empty(0), np.empty((0, 3)), np.empty((0, 3))
    R, x, P = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, 0.5, *given, nothing.flat())
    np.testing.assert_array_equal(x, 0.0)
    np.testing.assert_allclose(R, R0, atol=1e-15)
    np.testing.assert_allclose(np.diag(P)[:9], np.repeat([0.5 * 1.25e-3, 0.2 * 0.5**3 / 3.0, 0.5 * 0.2], 3), rtol=1e-3)


def test_before_the_first_sample_that_one_is_held():
    """The belief is older than the samples: as after the last, the angle's variance is A^2 t^4 / 4."""
    w, f = np.array([[0.3, -0.2, 0.5], [-0.4, 0.1, 0.2]]), np.array([[5.0, 0.0, 0.0], [0.0, 7.0, 0.0]])
    held = SILENT._replace(held_turn2=0.04, held_most2=1.25e-3)
    R, x, P = propagated(R0, np.zeros((8, 3)), ZERO, -0.08, 0.0, np.array([0.0, 0.004]), w, f, held.flat())
    np.testing.assert_allclose(R, expm(-skew(w[0]) * 0.08) @ R0, atol=1e-12)
    np.testing.assert_allclose(x[1], -0.08 * f[0], atol=0.03)  # but for the body's turn
    np.testing.assert_allclose(np.diag(P)[:3], 0.04 * 0.08**4 / 4.0, rtol=1e-9)


def test_an_acceleration_is_held_no_longer_than_samples_may_be_apart():
    """5 m/s^2 at the only sample: felt in the nine steps of 0.01 s that end within 0.095 s of it."""
    brief = SILENT._replace(longest_gap_s=0.095)
    given = np.zeros(1), np.zeros((1, 3)), np.array([[5.0, 0.0, 0.0]])
    x = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, 0.3, *given, brief.flat())[1]
    np.testing.assert_allclose(x[1], [-0.45, 0.0, 0.0], atol=1e-12)


def test_a_gyro_s_scale_factor_is_noise_by_the_squared_rate():
    w, turning = np.array([0.3, -0.2, 0.5]), SILENT._replace(scale2=1e-4)
    P = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, 0.5, *samples(w, np.zeros(3), 0.5), turning.flat())[2]
    np.testing.assert_allclose(P[:3, :3], 1e-4 * (w @ w) * 0.5 * np.eye(3), atol=1e-15)


def test_a_gust_s_noise_enters_velocity_and_swing_within_the_step():
    """To second order in dt, Lyapunov's equation for g' = white, v' = m' = g: half the square of it in common."""
    gust2, dt = np.array([0.4, 0.6, 0.9]), 0.01
    given = samples(np.zeros(3), np.zeros(3), dt, 100.0)
    P = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, dt, *given, SILENT._replace(gust2=gust2).flat())[2]
    expected = np.zeros((ERRORS, ERRORS))
    for axis in range(3):
        expected[24 + axis, 24 + axis] = gust2[axis] * dt
        for row in (6 + axis, 12 + axis)[: 1 + int(SWINGS[axis])]:
            expected[24 + axis, row] = expected[row, 24 + axis] = 0.5 * gust2[axis] * dt**2
    np.testing.assert_allclose(P, expected, atol=1e-15)


def test_a_white_drive_s_share_of_the_place_within_a_step_is_the_double_integral_s():
    """Of one step dt: q dt^3/3 of the place, q dt^2/2 with the rate, q dt of the rate, and so of the swing across."""
    q2, other2, dt = 0.05, 0.02, 0.01
    given = samples(np.zeros(3), np.zeros(3), dt, 100.0)
    driven = SILENT._replace(drive2=q2, accelerometer2=other2)
    P = propagated(R0, np.zeros((8, 3)), ZERO, 0.0, dt, *given, driven.flat())[2]
    once = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    for axis in range(3):
        moved, swung = np.array([3, 6]) + axis, np.array([9, 12]) + axis
        np.testing.assert_allclose(P[np.ix_(moved, moved)], (q2 + other2) * once, rtol=1e-9)
        np.testing.assert_allclose(P[np.ix_(moved, swung)], SWINGS[axis] * q2 * once, rtol=1e-9)
        np.testing.assert_allclose(P[np.ix_(swung, swung)], SWINGS[axis] * q2 * once, rtol=1e-9)


def test_errors_of_all_but_gyro_and_rest_move_to_the_last_digits_as_the_state_does():
    """Where the body does not turn Eq. (2) is linear in them: differences of the state, of any size, are the errors."""
    given, free = samples(X0[4], np.array([0.2, 0.4, 9.5]), 0.1), np.r_[3 : BIAS.start, BIAS.stop : REST.start, 24:27]
    x0 = X0 * np.array([1, 1, 1, 1, 1, 1, 0, 1])[:, np.newaxis]
    after = propagated(R0, x0, ZERO, 0.0, 0.1, *given, SILENT.flat())[:2]
    for k in free:
        e = np.eye(ERRORS)[k]
        moved = difference(propagated(*off(x0, R0, e), ZERO, 0.0, 0.1, *given, SILENT.flat())[:2], after)
        P = propagated(R0, x0, np.outer(e, e), 0.0, 0.1, *given, SILENT.flat())[2]
        np.testing.assert_allclose(P, np.outer(moved, moved), atol=1e-12)
