"""The path that follows a commanded turn rate and slope."""

from collections.abc import Callable

import numpy as np
import pytest

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


def test_roll_rate_and_bank_keep_their_limits() -> None:
    """A turn rate no aircraft flies: bank at its limit, reached at no more than the limit of the roll rate."""
    log = flown(lambda t: (1.0, 0.0), 12.0)
    bank = np.arctan(log[:, 0] * 180.0 / STANDARD_GRAVITY_M_S2)
    assert np.diff(bank).max() / STEP_S <= PARAMETERS.roll_rate_limit_rad_s * 1.01
    assert np.diff(bank).max() / STEP_S > 0.9 * PARAMETERS.roll_rate_limit_rad_s
    assert bank[-1] < PARAMETERS.bank_limit_rad * 1.3


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
