"""What drives the swing of a drogue, and how it is spread at any moment."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from dockair.nav.guidance.swing_model import SwingSettings, any_moment, dynamics, step_noise

STEP_S, SWINGS = 0.05, slice(2, None)  # of the state: all but m and d
SETTINGS = replace(SwingSettings(), rattle_density=(0.1, 0.02, 0.126))  # forward, too, where no gust drives overtones
AXES = pytest.mark.parametrize("axis", [0, 1, 2])


@AXES
def test_the_drift_is_the_integral_of_white_noise(axis):
    """Of density q: variance q^2 dt of d, q^2 dt^3 / 3 of m and q^2 dt^2 / 2 of both."""
    Q, q, dt = step_noise(SETTINGS, axis, STEP_S), SETTINGS.drift_density, STEP_S
    np.testing.assert_allclose(Q[:2, :2], q**2 * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]]), rtol=1e-9)
    assert not Q[:2, SWINGS].any()


@AXES
def test_in_a_moment_all_that_is_driven_gains_by_its_own_density(axis):
    dt = 1e-6
    driven = np.diag(step_noise(SETTINGS, axis, dt))[1::2] / dt  # d, the rates of the modes
    rattle = SETTINGS.rattle_density[axis]
    np.testing.assert_allclose(driven, np.square([SETTINGS.drift_density, *[rattle] * 3]), rtol=1e-4)
    assert step_noise(SETTINGS, axis, dt)[-1, -1] / dt == pytest.approx(1.0, rel=1e-4)  # g'


@AXES
def test_a_step_later_the_swing_is_spread_as_at_any_moment(axis):
    """What dies away in a step is what is driven on: P = F P F' + Q."""
    P, F = any_moment(SETTINGS, axis, 0.4), expm(dynamics(SETTINGS, axis) * STEP_S)
    later = F @ P @ F.T + step_noise(SETTINGS, axis, STEP_S)
    scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))[SWINGS, SWINGS]
    np.testing.assert_allclose((later - P)[SWINGS, SWINGS] / scale, 0.0, atol=1e-9)


@AXES
def test_gusts_are_spread_by_their_noise_over_their_time(axis):
    """g' = -g/T + noise of density one: variance T/2."""
    assert any_moment(SETTINGS, axis, 0.4)[-1, -1] == pytest.approx(0.5 * SETTINGS.gust_time_s[axis], rel=1e-9)


@pytest.mark.parametrize("mode", [1, 2])
def test_an_overtone_that_only_rattles_is_spread_as_an_oscillator_in_white_noise(mode):
    """Of density r: r^2 / (4 zeta omega^3) of its place, r^2 / (4 zeta omega) of its rate."""
    r, zeta = SETTINGS.rattle_density[0], SETTINGS.modes[mode].damping[0]
    omega, s = 2.0 * np.pi * SETTINGS.modes[mode].frequency_hz[0], 2 + 2 * mode
    spread = np.diag(any_moment(SETTINGS, 0, 0.4))[s : s + 2]
    np.testing.assert_allclose(spread, r**2 / (4.0 * zeta * omega) * np.array([omega**-2.0, 1.0]), rtol=1e-9)


@AXES
def test_the_middle_is_known_no_better_than_the_swing_and_the_drift_as_well_as_is_said(axis):
    P = any_moment(SETTINGS, axis, 0.4)
    assert P[0, 0] == P[2, 2] and P[1, 1] == pytest.approx(0.16)
    assert not (P[:2] - np.diag(np.diag(P))[:2]).any()
