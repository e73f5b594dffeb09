"""The reference that the receiver flies: smooth, limited, consistent in its derivatives."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.rotations import exp
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.reference import Reference

PARAMETERS = load_parameters("flight_control", FlightControlParameters)


def fly_reference(command: Any, seconds: float, step_s: float = 1e-3) -> np.ndarray:
    """(n, 4, 3) of the chain under a command that is a function of time."""
    reference = Reference(PARAMETERS.reference_limits, step_s)
    reference.start(np.zeros(3), np.eye(3), command(0.0))
    return np.array([reference.step(np.eye(3), command(k * step_s)).copy() for k in range(round(seconds / step_s))])


def test_reference_with_feed_forward_is_the_command_through_the_low_pass_alone() -> None:
    w, size = 1.0, 0.5
    chain = fly_reference(
        lambda t: ReceiverCommand(
            velocity_m_s=np.full(3, size * np.sin(w * t)), acceleration_m_s2=np.full(3, size * w * np.cos(w * t))
        ),
        20.0,
    )
    t = np.arange(1, len(chain) + 1) * 1e-3
    tail = t > 12.0
    b, zeta = PARAMETERS.smoothing_bandwidth_rad_s, PARAMETERS.smoothing_damping
    F = b**2 / (b**2 - w**2 + 2j * zeta * b * w)
    expected = size * np.imag(F * np.exp(1j * w * t[tail]))
    np.testing.assert_allclose(chain[tail, 0], np.tile(expected[:, None], 3), atol=2e-3)  # a tick of delay


def test_reference_without_feed_forward_follows_by_the_gain_within_the_low_pass() -> None:
    """Eq. (1) inside its limits, s r = F k (F u - r): k F^2 / (s + k F) of a swing of the command."""
    w, size = 1.0, 0.05
    chain = fly_reference(lambda t: ReceiverCommand(velocity_m_s=np.full(3, size * np.sin(w * t))), 9.0)
    t = np.arange(1, len(chain) + 1) * 1e-3
    tail = t > 7.5
    b, zeta = PARAMETERS.smoothing_bandwidth_rad_s, PARAMETERS.smoothing_damping
    F, k = b**2 / (b**2 - w**2 + 2j * zeta * b * w), PARAMETERS.reference_limits.gain_1_s
    expected = size * np.imag(k * F**2 / (1j * w + k * F) * np.exp(1j * w * t[tail, np.newaxis]))
    np.testing.assert_allclose(chain[tail, 0], expected, atol=0.006 * size)  # some ticks of delay


def test_reference_keeps_its_limits_and_its_derivatives_belong_together() -> None:
    rng, limits = np.random.default_rng(2), PARAMETERS.reference_limits
    commands = rng.normal(size=(40, 2, 3)) * 6.0
    chain = fly_reference(
        lambda t: ReceiverCommand(velocity_m_s=commands[int(4 * t), 0], acceleration_m_s2=commands[int(4 * t), 1]), 10.0
    )
    assert np.all(np.abs(chain[:, 1]) <= limits.acceleration_m_s2 * 1.2)  # the low pass after the limit overshoots
    assert np.all(np.abs(chain[:, 2]) <= limits.jerk_m_s3 * (1.0 + 1e-12))
    assert np.any(np.abs(chain[:, 2]) == limits.jerk_m_s3)
    for order in range(3):
        np.testing.assert_allclose(np.diff(chain[:, order], axis=0), 1e-3 * chain[1:, order + 1], atol=1e-12)


def test_reference_shortens_a_command_beyond_the_velocity_limit() -> None:
    command = ReceiverCommand(velocity_m_s=np.array([0.0, 40.0, 0.0]))
    chain = fly_reference(lambda t: command, 10.0)
    assert chain[-1, 0, 1] == pytest.approx(PARAMETERS.velocity_limit_m_s, rel=1e-3)
    assert chain[:, 0, 1].max() < 1.02 * PARAMETERS.velocity_limit_m_s


def test_a_command_in_turned_axes_is_the_one_that_points_the_same_way() -> None:
    R, rng = exp(np.array([0.2, -0.3, 0.9])), np.random.default_rng(3)
    u, a = rng.normal(size=(2, 3))
    turned, straight = (Reference(PARAMETERS.reference_limits, 1e-3) for _ in range(2))
    body, level = (ReceiverCommand(velocity_m_s=Q @ u, acceleration_m_s2=Q @ a) for Q in (np.eye(3), R))
    turned.start(np.zeros(3), R, body)
    straight.start(np.zeros(3), np.eye(3), level)
    for _ in range(500):
        np.testing.assert_allclose(turned.step(R, body), straight.step(np.eye(3), level), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("longer", [0.5, 3.0])
def test_a_reference_that_starts_at_its_command_stays_there(longer: float) -> None:
    """Turned to the command's axes, and shortened to the velocity limit if it is longer."""
    R, toward, limit = exp(np.array([0.2, -0.3, 0.9])), np.array([0.6, -0.64, 0.48]), PARAMETERS.velocity_limit_m_s
    command, reference = (
        ReceiverCommand(velocity_m_s=longer * limit * toward),
        Reference(PARAMETERS.reference_limits, 1e-3),
    )
    start = min(longer, 1.0) * limit * R @ toward
    reference.start(start, R, command)
    for _ in range(300):
        chain = reference.step(R, command)
    np.testing.assert_allclose(chain, [start, np.zeros(3), np.zeros(3), np.zeros(3)], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(("share", "left"), [(0.5, 1.0), (1.5, 0.5), (2.5, 0.0)])
def test_reference_takes_back_the_acceleration_to_the_side_as_the_bank_grows(share: float, left: float) -> None:
    """All of it up to the first bank of the sheet, half of it midway to the second, none beyond; up it stays."""
    limits = PARAMETERS.reference_limits
    first, last = limits.bank_rad
    bank = first * share if share < 1.0 else first + (share - 1.0) * (last - first)
    asked = np.array([0.0, 20.0, 20.0])  # m/s^2, beyond every limit
    reference, command = Reference(limits, 1e-3), ReceiverCommand(acceleration_m_s2=asked)
    reference.start(np.zeros(3), np.eye(3), command)
    for _ in range(700):
        chain = reference.step(np.eye(3), command, -bank)
    np.testing.assert_allclose(chain[1, 1:], limits.acceleration_m_s2[1:] * [left, 1.0], rtol=0.02, atol=1e-12)


def test_shares_take_back_the_acceleration_axis_by_axis() -> None:
    limits, shares = PARAMETERS.reference_limits, np.array([1.0, 0.25, 0.5])
    reference, command = Reference(limits, 1e-3), ReceiverCommand(acceleration_m_s2=np.array([20.0, 20.0, 20.0]))
    reference.start(np.zeros(3), np.eye(3), command)
    for _ in range(1500):
        chain = reference.step(np.eye(3), command, 0.0, shares)
    np.testing.assert_allclose(chain[1], shares * limits.acceleration_m_s2, rtol=0.02)


def test_shares_take_back_the_acceleration_alone() -> None:
    """As limits of acceleration that are smaller from the outset, to the bit; the limits of jerk stay."""
    rng, limits, shares = np.random.default_rng(5), PARAMETERS.reference_limits, np.array([0.5, 0.25, 0.75])
    smaller = replace(limits, acceleration_m_s2=shares * limits.acceleration_m_s2)
    shared, alone = Reference(limits, 1e-3), Reference(smaller, 1e-3)
    for reference in (shared, alone):
        reference.start(np.zeros(3), np.eye(3), ReceiverCommand())
    for u in rng.normal(0.0, 6.0, (10, 3)):
        command = ReceiverCommand(velocity_m_s=u, acceleration_m_s2=9.0 * u)
        for _ in range(150):
            expected = alone.step(np.eye(3), command)
            np.testing.assert_array_equal(shared.step(np.eye(3), command, 0.0, shares), expected)


@pytest.mark.parametrize("banks_rad", [(0.4, 0.4), (0.7, 0.4)])
def test_banks_between_which_nothing_could_be_taken_back_are_refused(banks_rad: tuple[float, float]) -> None:
    with pytest.raises(DockairError, match=r"increment_bank_rad: expected two banks, the second larger"):
        replace(PARAMETERS, increment_bank_rad=np.array(banks_rad))
