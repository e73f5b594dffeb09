"""Velocity, acceleration and jerk that are commanded."""

import numpy as np
import pytest

from dockair.nav.guidance.command_limits import CommandLimits
from dockair.nav.guidance.guidance_settings import GuidanceSettings

SETTINGS = GuidanceSettings(acceleration_limit_m_s2=(0.75, 1.9, 2.53), jerk_limit_m_s3=(3.8, 6.6, 10.1))
FASTEST_M_S = SETTINGS.velocity_limit_m_s
ACCELERATION, JERK = np.array(SETTINGS.acceleration_limit_m_s2), np.array(SETTINGS.jerk_limit_m_s3)


def commanded(asked, step_s, patient):
    """Velocities and accelerations (n + 1, 3), from rest, for accelerations (n, 3) that are asked for."""
    limits, us, u_dots = CommandLimits(SETTINGS, step_s), [np.zeros(3)], [np.zeros(3)]
    for a, share in zip(asked, patient, strict=True):
        u, u_dot = limits.step(us[-1], u_dots[-1], a, patient=share)
        us.append(u)
        u_dots.append(u_dot)
    return np.array(us), np.array(u_dots)


@pytest.mark.parametrize("step_s", [0.02, 0.01, 1.0 / 180.0])
@pytest.mark.parametrize("patient", [(False,), (True,), (True, False)])
def test_whatever_is_asked_for_velocity_and_acceleration_belong_together_inside_their_limits(step_s, patient):
    """Accelerations of any size and direction, for a second each: the velocity is often at its limit."""
    rng, ticks = np.random.default_rng(2), round(1.0 / step_s)
    asked = np.repeat(rng.normal(scale=5.0, size=(200, 3)), ticks, axis=0)
    patiently = np.repeat(rng.choice(patient, 200), ticks)
    u, u_dot = commanded(asked, step_s, patiently)
    share = np.where(patiently[:, np.newaxis], np.append(1.0, SETTINGS.patient_share), 1.0) * (1.0 + 1e-9)
    speed = np.linalg.norm(u, axis=1)
    assert np.mean(speed > 0.99 * FASTEST_M_S) > 0.1
    assert speed.max() < 1.04 * FASTEST_M_S
    np.testing.assert_allclose(np.diff(u, axis=0) / step_s, u_dot[1:], atol=1e-9)
    assert (np.abs(np.diff(u_dot, axis=0)) <= step_s * share * JERK).all()
    assert (np.abs(u_dot[1:]) <= ACCELERATION * (1.0 + 1e-9)).all()
    if len(patient) == 1:  # else it takes some ticks to come to the share
        assert (np.abs(u_dot[1:]) <= share * ACCELERATION).all()


def test_who_is_at_the_limit_comes_back_from_it_however_little_is_asked_for():
    asked = np.vstack([np.tile([5.0, 5.0, 5.0], (1000, 1)), np.tile([-0.01, -0.02, -0.005], (1000, 1))])
    u, _ = commanded(asked, 0.01, np.zeros(2000, bool))
    np.testing.assert_allclose(u[2000] - u[1000], 10.0 * asked[-1], atol=0.01)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_along_an_axis_the_limit_is_come_to_with_all_of_the_jerk_that_patience_leaves(axis):
    """Full acceleration until v = V - a^2/2j, then it is taken back at that jerk: closed form."""
    share = np.append(1.0, SETTINGS.patient_share)[axis]
    a, j, step_s = ACCELERATION[axis], share * JERK[axis], 0.001
    u, u_dot = commanded(np.tile(100.0 * np.eye(3)[axis], (8000, 1)), step_s, np.zeros(8000, bool))
    takes_back = np.flatnonzero(u_dot[1:, axis] < u_dot[:-1, axis])[0]
    assert u[takes_back, axis] == pytest.approx(FASTEST_M_S - a * a / (2.0 * j), abs=2.0 * a * step_s)
    assert u[-1, axis] == pytest.approx(FASTEST_M_S, abs=1e-3)
    lasts = takes_back + round(0.9 * a / j / step_s)
    np.testing.assert_allclose(u_dot[takes_back:lasts, axis], a - j * step_s * np.arange(lasts - takes_back), atol=0.1)


def test_far_from_the_limit_of_the_velocity_an_acceleration_is_what_was_asked_for():
    asked = 0.5 * np.sin(np.arange(500) / 50.0)[:, np.newaxis] * ACCELERATION
    _, u_dot = commanded(asked, 0.01, np.zeros(500, bool))
    np.testing.assert_array_equal(u_dot[1:], asked)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_however_coarse_the_ticks_the_limit_of_the_velocity_is_come_to_and_not_passed(axis):
    """But for what the jerk gives in a part of a tick; half a tick of the acceleration is 0.019 m/s or more."""
    u, _ = commanded(np.tile(100.0 * np.eye(3)[axis], (400, 1)), 0.05, np.zeros(400, bool))
    assert u[-1, axis] == pytest.approx(FASTEST_M_S, abs=2e-3)
    assert u.max() < FASTEST_M_S + 2e-3


@pytest.mark.parametrize("patient", [False, True])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_who_is_beyond_the_limit_of_the_velocity_may_brake_as_hard_as_inside_it(axis, patient):
    """As where the velocity has turned quickly."""
    along, braking = np.eye(3)[axis], []
    for speed_m_s in (0.5 * FASTEST_M_S, 1.03 * FASTEST_M_S):
        limits, u, u_dot = CommandLimits(SETTINGS, 0.01), speed_m_s * along, np.zeros(3)
        for _ in range(20):
            u, u_dot = limits.step(u, u_dot, -5.0 * along, patient=patient)
        braking.append(u_dot)
    assert braking[0][axis] < -0.3
    np.testing.assert_allclose(braking[1], braking[0], atol=1e-4)
