"""The path that follows a commanded turn rate and slope."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import expm

from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.flight_path import FlightPath

PARAMETERS = load_parameters("flight_control", FlightControlParameters).path
STEP_S = 2e-3


def flown(command: Callable[[float], tuple[float, float]], seconds: float) -> np.ndarray:
    """(n, 3) turn rate, slope, heading."""
    path, log = FlightPath(PARAMETERS, 180.0, STEP_S), np.empty((round(seconds / STEP_S), 3))
    for k in range(len(log)):
        path.step(*command(k * STEP_S))
        log[k] = path.turn_rate_rad_s, path.climb_rad, path.heading_rad
    return log


def test_what_was_turned_too_late_is_made_up() -> None:
    """A step of the turn rate for 10 s: afterwards the heading is 10 s of it, within 0.01 degrees."""
    log = flown(lambda t: (0.02 if t < 10.0 else 0.0, 0.0), 25.0)
    assert log[-1, 2] == pytest.approx(0.2, abs=np.radians(0.01))
    assert log[-1, 0] == pytest.approx(0.0, abs=1e-5)
    assert log[1000, 2] < 0.04 + 1e-3  # and not ahead of the command meanwhile


def test_height_of_a_descent_is_made_up_too() -> None:
    log = flown(lambda t: (0.0, -0.05 if 1.0 < t < 11.0 else 0.0), 26.0)
    assert np.sum(log[:, 1]) * STEP_S == pytest.approx(-0.5, abs=1e-3)


@pytest.mark.parametrize("axis", [0, 1], ids=["turn rate", "slope"])
@pytest.mark.parametrize("size", [1e-3, -1e-3])
def test_small_step_is_answered_as_the_equation_says(axis: int, size: float) -> None:
    """Far below every limit: d = r - r_c, its rate and e are linear, from (-r_c, 0, 0); a step is a fiftieth of 1/w."""
    w, zeta, kappa = PARAMETERS.bandwidth_rad_s, PARAMETERS.damping, PARAMETERS.catching_up
    A = np.array([[0.0, 1.0, 0.0], [-(w**2), -2.0 * zeta * w, kappa * w**3], [-1.0, 0.0, 0.0]])
    command = size * np.eye(2)[axis]
    log = flown(lambda t: (command[0], command[1]), 4.0)
    for seconds in (0.05, 0.1, 0.2, 0.5, 1.0, 4.0):
        off = expm(seconds * A)[0] @ [-size, 0.0, 0.0]
        assert log[round(seconds / STEP_S) - 1, axis] == pytest.approx(size + off, abs=0.015 * abs(size))
    np.testing.assert_array_equal(log[:, 1 - axis], 0.0)


def test_roll_rate_and_bank_keep_their_limits() -> None:
    """A turn rate no aircraft flies: bank at its limit, reached at no more than the limit of the roll rate."""
    log = flown(lambda t: (1.0, 0.0), 12.0)
    bank = np.arctan(log[:, 0] * 180.0 / STANDARD_GRAVITY_M_S2)
    assert np.diff(bank).max() / STEP_S <= PARAMETERS.roll_rate_limit_rad_s * 1.01
    assert np.diff(bank).max() / STEP_S > 0.9 * PARAMETERS.roll_rate_limit_rad_s
    assert bank[-1] < PARAMETERS.bank_limit_rad * 1.3


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_slope_keeps_its_own_limits_of_angle_and_rate_either_way(sense: float) -> None:
    """A climb, or a descent, no aircraft flies: the steepest slope in the end, reached at no more than its rate."""
    slope = flown(lambda t: (0.0, sense), 30.0)[:, 1]
    rate = np.abs(np.diff(slope, prepend=0.0)) / STEP_S
    assert rate.max() == pytest.approx(PARAMETERS.climb_rate_limit_rad_s, rel=1e-9)
    assert slope[-1] == pytest.approx(sense * PARAMETERS.climb_limit_rad, rel=1e-6)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_bank_ends_at_its_limit_either_way(sense: float) -> None:
    bank = np.arctan(flown(lambda t: (sense, 0.0), 20.0)[:, 0] * 180.0 / STANDARD_GRAVITY_M_S2)
    assert bank[-1] == pytest.approx(sense * PARAMETERS.bank_limit_rad, rel=1e-6)


def test_roll_rate_is_at_its_limit_banked_too() -> None:
    """As fast at half the largest bank, where the turn rate changes by 1/cos(bank)^2 more, as at none."""
    bank = np.arctan(flown(lambda t: (1.0, 0.0), 6.0)[:, 0] * 180.0 / STANDARD_GRAVITY_M_S2)
    halfway = int(np.searchsorted(bank, 0.5 * PARAMETERS.bank_limit_rad))
    assert (bank[halfway] - bank[halfway - 1]) / STEP_S == pytest.approx(PARAMETERS.roll_rate_limit_rad_s, rel=1e-3)


def test_path_that_is_told_nothing_stays_straight_to_the_bit() -> None:
    assert not flown(lambda t: (0.0, 0.0), 1.0).any()


def test_axes_of_the_path_are_along_it() -> None:
    """x along (cos g cos h, cos g sin h, sin g), y level, orthonormal."""
    path = FlightPath(PARAMETERS, 180.0, STEP_S)
    for _ in range(3000):
        path.step(0.03, 0.05)
    R, h, g = path.axes(), path.heading_rad, path.climb_rad
    np.testing.assert_allclose(R[:, 0], [np.cos(g) * np.cos(h), np.cos(g) * np.sin(h), np.sin(g)], atol=1e-12)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert R[2, 1] == 0.0 and np.linalg.det(R) > 0.0
