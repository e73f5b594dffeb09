"""Axes carried by the gyros."""

import numpy as np

from dockair.nav.guidance.stabilised_axes import StabilisedAxes
from dockair.rotations import exp, log

STEP_S = 0.01


def test_without_levelling_they_stay_where_they_were_whatever_the_body_does():
    """Against the product of exact rotations."""
    axes, R_WB = StabilisedAxes(1e12, STEP_S), np.eye(3)
    for k in range(500):
        w_B = np.array([0.9 * np.cos(0.03 * k), 0.3, 0.5 * np.sin(0.02 * k)])
        R_WB = R_WB @ exp(w_B * STEP_S)
        axes.step(w_B, 0.0)
    np.testing.assert_allclose(axes.R_NB, R_WB, atol=1e-8)


def test_a_drogue_at_rest_stays_at_rest_for_a_body_that_banks_and_yaws():
    """The drogue stands still 4 m ahead; its place in body axes moves by 0.35 m."""
    axes, p_W, R_WB, seen, rates = StabilisedAxes(10.0, STEP_S), np.array([4.0, 0.0, 0.0]), np.eye(3), [], []
    for k in range(600):
        w_B = np.array([0.5, 0.05, 0.2]) * np.cos(2.2 * k * STEP_S)
        R_WB = R_WB @ exp(w_B * STEP_S)
        axes.step(w_B, 0.0)
        p_B = R_WB.T @ p_W
        p, rate = axes.moved(p_B, -np.cross(w_B, p_B))
        seen.append((np.hypot(*p_B[1:]), np.hypot(*p[1:])))
        rates.append(np.linalg.norm(rate))
    body, ours = np.max(seen, axis=0)
    assert body > 0.35 and ours < 0.05
    assert max(rates) < 0.05


def test_an_announced_turn_takes_them_along_and_another_rate_leans_them_by_its_time_constant():
    as_announced, otherwise = StabilisedAxes(10.0, STEP_S), StabilisedAxes(10.0, STEP_S)
    for _ in range(10_000):
        as_announced.step(np.array([0.0, 0.0, 0.025]), 0.025)
        otherwise.step(np.array([0.0, 0.0, 0.002]), 0.0)
    np.testing.assert_allclose(as_announced.R_NB, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(log(otherwise.R_NB), [0.0, 0.0, 0.02], rtol=1e-3, atol=1e-12)


def test_the_rate_is_the_derivative_of_the_place():
    axes, p_B, rate_B, w_B = (
        StabilisedAxes(5.0, 1e-4),
        np.array([4.0, 1.0, -0.5]),
        np.array([-1.0, 0.2, 0.3]),
        np.array([1.0, -0.7, 0.4]),
    )
    places = []
    for k in range(3):
        axes.step(w_B, 0.02)
        places.append(axes.moved(p_B + k * 1e-4 * rate_B, rate_B))
    # the rotation of a step comes before the place is taken: differences are centred between two of them
    between = 0.5 * (places[1][1] + places[2][1])
    np.testing.assert_allclose((places[2][0] - places[1][0]) / 1e-4, between, rtol=1e-3)


def test_an_announced_turn_takes_them_along_into_its_bank_and_a_place_abeam_of_it_is_turned():
    """A body that rolls into a turn and flies it, coordinated: its attitude is R_z(heading) R_x(bank), exactly."""
    axes, R_before, heading, turn = StabilisedAxes(10.0, STEP_S), np.eye(3), 0.0, 0.025
    for k in range(3000):
        bank = -0.43 * min(k / 1000.0, 1.0)
        heading += turn * STEP_S
        R_WB = exp(np.array([0.0, 0.0, heading])) @ exp(np.array([bank, 0.0, 0.0]))
        axes.step(log(R_before.T @ R_WB) / STEP_S, turn, bank)
        R_before = R_WB
    np.testing.assert_allclose(axes.R_NB, np.eye(3), atol=2e-4)
    np.testing.assert_allclose(R_WB @ axes.left_N, [-np.sin(heading), np.cos(heading), 0.0], atol=1e-12)
    p_W = np.cross([0.0, 0.0, turn], R_WB @ [4.0, 1.0, 0.5])
    np.testing.assert_allclose(R_WB @ axes.turned(np.array([4.0, 1.0, 0.5])), p_W, atol=1e-12)
