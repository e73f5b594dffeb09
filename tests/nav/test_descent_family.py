"""Equations (62)-(65) of the source: one step of each against the formula in NumPy, and what it promises."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.pose import descent_kernels, model
from dockair.nav.pose.descent import DescentSettings, PosePrior, descend
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.glsdc import GLSDC, glsdc
from dockair.nav.pose.gradient import GRADIENT, gradient
from dockair.nav.pose.levenberg import LEVENBERG, levenberg
from dockair.nav.pose.levenberg_marquardt import AS_PRINTED, LEVENBERG_MARQUARDT, levenberg_marquardt
from dockair.nav.pose.measurement import LinesOfSight, isotropic_weights, lines_of_sight_from_pixels
from dockair.rotations import Array, exp, log, matrix_from_mrp, mrp_from_matrix

RING, CAMERA = LedRing().positions_D, Camera()
R_TRUE, P_TRUE = exp(np.array([0.1, 0.3, -0.2])), np.array([6.0, 0.2, 0.1])


def sight(*, isotropic: bool) -> LinesOfSight:
    pixels = CAMERA.pixels_from_points(RING @ R_TRUE.T + P_TRUE) + 0.1 * np.random.default_rng(6).normal(size=(8, 2))
    seen = lines_of_sight_from_pixels(pixels, RING, CAMERA, np.full(8, 0.1))
    return replace(seen, weights=isotropic_weights(8, 0.1 / CAMERA.focal_length_px)) if isotropic else seen


def normal_equations(seen: LinesOfSight, R: Array, p: Array) -> tuple[Array, Array]:
    """H'WH and H'W(b - h) in (p, o), stacked as the source writes them, eqs (58)-(61)."""
    h, J = model.lines_of_sight(mrp_from_matrix(R), p, RING, model.SOURCE)
    H, W = J.reshape(-1, 6), np.zeros((24, 24))
    for i, w in enumerate(seen.weights):
        W[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = w
    return H.T @ W @ H, H.T @ W @ (seen.rays - h).ravel()


STEPS = {
    "(62)": (GLSDC, lambda N, g, mu: np.linalg.solve(N, g)),
    "(63)": (GRADIENT, lambda N, g, mu: g / (mu * np.trace(N))),
    "(64)": (LEVENBERG, lambda N, g, mu: np.linalg.solve(N + mu * np.diag(N).max() * np.eye(6), g)),
    "(65)": (AS_PRINTED, lambda N, g, mu: np.linalg.solve(N + mu * np.diag(np.diag(N)), g)),
}


@pytest.mark.parametrize("isotropic", [True, False])
@pytest.mark.parametrize("equation", STEPS)
def test_first_step_is_the_sources_formula(equation, isotropic):
    settings, formula = STEPS[equation]
    seen, R, p = sight(isotropic=isotropic), exp(np.array([0.02, -0.01, 0.015])) @ R_TRUE, 1.01 * P_TRUE
    x = formula(*normal_equations(seen, R, p), settings.first_damping)
    C = matrix_from_mrp(mrp_from_matrix(R) + x[:3])
    o = -R.T @ p + x[3:]
    end = descend(seen, R, p, replace(settings, max_iterations=1, tolerance_sigma=0.0))
    assert end.iterations == 1
    np.testing.assert_allclose(log(end.R_CD @ C.T), 0.0, atol=1e-10)
    np.testing.assert_allclose(end.p_CD, -C @ o, atol=1e-8)


@pytest.mark.parametrize("settings", [GRADIENT, LEVENBERG, AS_PRINTED, LEVENBERG_MARQUARDT])
def test_a_damped_descent_never_climbs(settings):
    rng = np.random.default_rng(7)
    for _ in range(20):
        axis = rng.normal(size=3)
        start = exp(0.9 * axis / np.linalg.norm(axis)) @ R_TRUE, rng.uniform(0.6, 1.5) * P_TRUE
        costs = [
            descend(sight(isotropic=False), *start, replace(settings, max_iterations=n)).cost
            for n in (0, 1, 2, 3, 5, 8, 12, 20)
        ]
        assert costs[0] > costs[-1]
        assert all(after <= before * (1.0 + 1e-9) for before, after in zip(costs, costs[1:], strict=False))


@pytest.mark.parametrize("solver", [glsdc, levenberg, levenberg_marquardt], ids=lambda solver: solver.__name__)
def test_each_arrives_at_the_same_minimum_from_near(solver):
    seen = sight(isotropic=True)
    reference = levenberg_marquardt(seen, R_TRUE, P_TRUE, settings=replace(LEVENBERG_MARQUARDT, tolerance_sigma=1e-7))
    end = solver(seen, exp(np.array([0.01, -0.01, 0.01])) @ R_TRUE, 1.002 * P_TRUE)
    assert end.converged
    sigma = np.sqrt(np.diag(reference.covariance))
    np.testing.assert_array_less(np.abs(log(end.R_CD @ reference.R_CD.T)), 1e-2 * sigma[:3])
    np.testing.assert_array_less(np.abs(end.p_CD - reference.p_CD), 1e-2 * sigma[3:])


def test_gradient_creeps_and_says_that_it_has_not_arrived():
    """From 1 degree and 0.2 % off the cost falls to an eighth in 2000 steps, and is still far above the minimum."""
    seen, start = sight(isotropic=True), (exp(np.array([0.01, -0.01, 0.01])) @ R_TRUE, 1.002 * P_TRUE)
    least = levenberg_marquardt(seen, *start).cost
    first = gradient(seen, *start, settings=replace(GRADIENT, max_iterations=0)).cost
    end = gradient(seen, *start)
    assert end.outcome == descent_kernels.NOT_CONVERGED and end.iterations == GRADIENT.max_iterations
    assert np.isnan(end.covariance).all() and np.isnan(end.information).all()
    assert 5.0 * least < end.cost < first / 5.0


def test_a_third_of_a_sigma_from_the_minimum_is_not_arrived_though_steps_are_as_short():
    """Along the axis that is seen worst 2000 steps go a hundredth of the way: a short step is no proof."""
    seen = sight(isotropic=True)
    least = levenberg_marquardt(seen, R_TRUE, P_TRUE)
    values, vectors = np.linalg.eigh(least.information)
    x = 0.3 * vectors[:, 0] / np.sqrt(values[0])
    end = gradient(seen, exp(x[:3]) @ least.R_CD, least.p_CD + x[3:])
    d = pose_difference(end.R_CD, end.p_CD, least.R_CD, least.p_CD)
    assert 0.25 < np.sqrt(d @ least.information @ d) < 0.3
    assert end.outcome == descent_kernels.NOT_CONVERGED and end.iterations == GRADIENT.max_iterations


def test_the_tilt_of_a_frontal_start_does_not_run_away():
    """300 starts within 3 degrees of frontal, range 20 to 50 % too far: all within 20 steps.

    With an entry of diag(H'WH) for each angle a tenth of them takes more than 25, zigzagging about frontal.
    """
    rng = np.random.default_rng(8)
    for _ in range(300):
        R, p = exp(rng.uniform(-0.35, 0.35, 3)), np.array([rng.uniform(15.0, 30.0), 0.0, 0.0])
        seen = lines_of_sight_from_pixels(CAMERA.pixels_from_points(RING @ R.T + p), RING, CAMERA, np.full(8, 0.1))
        start = exp(np.array([rng.uniform(-0.5, 0.5), *np.deg2rad(rng.uniform(-3.0, 3.0, 2))]))
        end = levenberg_marquardt(seen, start, rng.uniform(1.2, 1.5) * p)
        assert end.converged and end.iterations <= 20


@pytest.mark.parametrize("settings", [GLSDC, GRADIENT, LEVENBERG, AS_PRINTED])
def test_a_prior_or_a_held_attitude_in_the_sources_coordinates_is_refused(settings: DescentSettings):
    prior = PosePrior(R_CD=R_TRUE, p_CD=P_TRUE, covariance=np.eye(6))
    for options in ({"prior": prior}, {"hold_attitude": True}):
        with pytest.raises(DockairError, match=r"settings\.coordinates"):
            descend(sight(isotropic=True), R_TRUE, P_TRUE, settings, **options)
