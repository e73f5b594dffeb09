"""What accelerometers and gyros tell of the tip's velocity."""

import numpy as np
import pytest

from dockair.nav.tip_motion import TipMotion
from dockair.rotations import exp

STEP_S, GRAVITY = 0.01, np.array([0.0, 0.0, -9.80665])
P_IP, CALIBRATED = np.array([6.0, 0.3, -0.5]), np.zeros(3)


class Body:
    """Rolls and pitches to and fro while its accelerometers move to and fro; everything in closed form."""

    def __init__(self, bias_rad_s=(0.0, 0.0, 0.0)):
        self.bias = np.array(bias_rad_s)

    def attitude(self, t):
        return exp(np.array([0.0, 0.0, 0.05 * np.sin(0.9 * t)])) @ exp(
            np.array([0.3 * np.sin(2.0 * t), 0.06 * np.sin(1.3 * t), 0.0])
        )

    def velocity(self, t):
        """(3,) of I, in axes that do not turn."""
        return np.array([0.2 * np.sin(1.5 * t), 0.5 * np.sin(2.0 * t), 0.4 * np.cos(2.6 * t)])

    def rate(self, t, h=1e-5):
        dR = (self.attitude(t + h) - self.attitude(t - h)) / (2.0 * h)
        W = self.attitude(t).T @ dR
        return np.array([W[2, 1], W[0, 2], W[1, 0]])

    def force(self, t, h=1e-4):
        a = (self.velocity(t + h) - self.velocity(t - h)) / (2.0 * h)
        return self.attitude(t).T @ (a - GRAVITY)

    def tip_velocity(self, t):
        return self.velocity(t) + self.attitude(t) @ np.cross(self.rate(t), P_IP)

    def flown(self, seconds, levelling_s):
        """Times, velocity of the tip as felt and as flown, from where the felt one begins, axes that do not turn."""
        motion, felt = TipMotion(P_IP, levelling_s), [np.zeros(3)]
        times = STEP_S * np.arange(round(seconds / STEP_S))
        for t in times:
            samples = [t - share * STEP_S for share in (0.0, 0.25, 0.5, 0.75)]
            force, rate = (np.mean([felt(s) for s in samples], axis=0) for felt in (self.force, self.rate))
            change = motion.change_m_s(force, rate + self.bias, CALIBRATED, STEP_S)
            felt.append(felt[-1] + self.attitude(t) @ np.nan_to_num(change))
        return times, np.array(felt[1:]), np.array([self.tip_velocity(t) for t in times])


def test_the_tip_s_velocity_is_felt_through_roll_pitch_and_yaw():
    """Within a second the error changes by 0.03 m/s at most, where the tip's velocity changes by over 1 m/s."""
    _, felt, true = Body().flown(90.0, 60.0)
    n = round(1.0 / STEP_S)
    error = (felt - true)[6000:]
    assert np.abs((true[n:] - true[:-n])[6000:]).max() > 1.0
    assert np.abs(error[n:] - error[:-n]).max() < 0.03


def test_a_gyro_s_bias_turns_gravity_by_no_more_than_it_times_the_levelling():
    """0.001 rad/s over 60 s: 0.06 rad, 0.6 m/s^2 at most and steady."""
    _, felt, true = Body(bias_rad_s=(0.001, 0.0, 0.0)).flown(200.0, 60.0)
    n = round(1.0 / STEP_S)
    drift = ((felt - true)[n:] - (felt - true)[:-n])[-3000:]
    assert 0.3 < np.abs(drift.mean(axis=0)).max() < 0.62
    assert drift.std(axis=0).max() < 0.03


def test_a_bias_that_is_learnt_late_is_taken_off_what_it_has_done_already():
    """After 20 s in which it turned gravity by 0.5 m/s^2, as one known all the time, to a hundredth of that."""
    bias, body = np.array([0.003, -0.002, 0.001]), Body()
    late, known, apart = TipMotion(P_IP, 60.0), TipMotion(P_IP, 60.0), []
    for k in range(4000):
        force, rate = body.force(k * STEP_S), body.rate(k * STEP_S)
        believed = bias * min(max(k - 1500, 0) / 500.0, 1.0)
        learnt = late.change_m_s(force, rate + bias - believed, believed, STEP_S)
        apart.append((learnt - known.change_m_s(force, rate, bias, STEP_S)) / STEP_S)
    apart = np.abs(np.nan_to_num(apart))
    assert apart[1400:1500].max() > 0.2
    assert apart[2002:].max() < 0.005


def _told(motion, body, first, stop):
    return [
        motion.change_m_s(body.force(k * STEP_S), body.rate(k * STEP_S), CALIBRATED, STEP_S) for k in range(first, stop)
    ]


def test_nothing_is_said_before_gravity_is_told_from_gusts():
    body, motion, nothing = Body(), TipMotion(P_IP, 60.0), np.full(3, np.nan)
    assert np.isnan(motion.change_m_s(nothing, body.rate(0.0), CALIBRATED, STEP_S)).all()
    said = _told(motion, body, 0, 1200)
    assert np.isnan(said[:1000]).all()
    assert np.isfinite(said[1002:]).all()


@pytest.mark.parametrize(("gap_ticks", "again_s"), [(5, 0.02), (100, 10.0)])
def test_after_a_gap_in_the_samples_nothing_false_is_said(gap_ticks, again_s):
    """Rates are held through it, as the navigation holds them; after a long one gravity is found anew."""
    body, motion, nothing = Body(), TipMotion(P_IP, 60.0), np.full(3, np.nan)
    _told(motion, body, 0, 4000)
    for _ in range(gap_ticks):
        assert np.isnan(motion.change_m_s(nothing, body.rate(39.99), CALIBRATED, STEP_S)).all()
    begun = 4000 + gap_ticks
    said = np.array(_told(motion, body, begun, begun + 1200))
    assert (
        np.isnan(said[: round(again_s / STEP_S) - 1]).all() and np.isfinite(said[round(again_s / STEP_S) + 2 :]).all()
    )
    times = STEP_S * np.arange(begun - 1, begun + 1200)
    flown = np.diff([body.tip_velocity(t) for t in times], axis=0)
    felt = np.array([body.attitude(t) @ dv for t, dv in zip(times[1:], said, strict=True)])
    error = (felt - flown)[np.isfinite(said).all(axis=1)]
    second = error[: len(error) // 100 * 100].reshape(-1, 100, 3).sum(axis=1)
    assert np.abs(second).max() < 0.25  # m/s within a second; a jump of gravity by 1.4 degrees


def test_a_bias_that_is_learnt_at_once_is_no_jerk_of_the_lever():
    """Standing still for 12 s, then the gyro's 0.001 rad/s are known: times 6 m they would be 6 mm/s within a tick."""
    bias, motion = np.array([0.0, 0.001, 0.0]), TipMotion(P_IP, 60.0)
    for _ in range(1200):
        motion.change_m_s(-GRAVITY, bias, CALIBRATED, STEP_S)
    np.testing.assert_allclose(motion.change_m_s(-GRAVITY, CALIBRATED, bias, STEP_S), 0.0, atol=2e-5)


def test_through_a_short_gap_gravity_is_carried_for_all_of_its_time():
    """Turning steadily about an accelerometer that falls no way: of the tip's velocity there is the whirl alone."""
    w, motion, nothing = np.array([0.1, -0.3, 0.2]), TipMotion(P_IP, 60.0), np.full(3, np.nan)
    for k in range(1210):
        force = nothing if 1200 <= k < 1206 else -exp(-w * k * STEP_S) @ GRAVITY
        change = motion.change_m_s(force, w, CALIBRATED, STEP_S)
    np.testing.assert_allclose(change, np.cross(w, np.cross(w, P_IP)) * STEP_S, atol=1e-9)
