"""The one loop of all pose solvers: a descent on the cost of [normal_equations], damped as the source's family is."""

import numpy as np

from dockair.kernels import njit
from dockair.nav.pose.model import LOCAL
from dockair.nav.pose.mrp import matrix_from_mrp, mrp_from_matrix, mrp_product
from dockair.nav.pose.normal_equations import Problem, Room, factor, invert, new_room, normal_equations, substitute
from dockair.rotations import Array

UNDAMPED, IDENTITY, DIAGONAL, GRADIENT = 0, 1, 2, 3  #: eqs (62), (64), (65), (63) of the source
CONVERGED, NOT_CONVERGED, BEHIND, SINGULAR = 0, 1, 2, 3  #: how a descent ended
_CREEPING = 1e-2  # sigmas; a floor so flat that steps are still this short after half of the iterations is reached
_ROUNDING = 1e-10  # of the cost: its own rounding is about 1e-12, a smaller promise cannot be told from it


@njit(cache=True, error_model="numpy")
def descend(
    measured: Array, weights: Array, points: Array, lens: Array, R_CD: Array, p_CD: Array, prior_R: Array,
    prior_t: Array, information: Array, axis_D: Array, axis_C: Array, axis_information: float, huber: float,
    hold_attitude: bool, coordinates: int, damping: int, mu: float, tolerance: float, max_iterations: int,
) -> tuple[int, int, Array, Array, Array, float, float, Array, Array]:  # fmt: skip
    """Minimise the cost from a start; no error is raised, the outcome is in the first result.

    Equation numbers are those of [normal_equations].

    Args:
        measured: (n, 3) unit vectors b_i in camera axes, or (n, 2) pixels.
        weights: (n, 3, 3) W_i, of pixels with a third row and column of zeros.
        points: (n, 3) LEDs in drogue axes [m].
        lens: (8,) focal length, centre u, v [px], k1, k2, p1, p2, k3; used with pixels.
        R_CD: (3, 3) start.
        p_CD: (3,) start [m].
        prior_R: (3, 3) attitude of Eq. (1).
        prior_t: (3,) position of Eq. (1) [m].
        information: (6, 6) Lambda of Eq. (1), of any rank, with LOCAL coordinates; (0, 0) for none.
        axis_D: (3,) unit vector a of Eq. (2), with LOCAL coordinates.
        axis_C: (3,) unit vector c.
        axis_information: 1/sigma^2, or 0 for none.
        huber: k of Eq. (3), or inf.
        hold_attitude: whether the position alone is solved for, with LOCAL coordinates.
        coordinates: SOURCE or LOCAL.
        damping: UNDAMPED, IDENTITY, DIAGONAL or GRADIENT.
        mu: first damping. It multiplies the largest diagonal met so far (DIAGONAL), its largest entry (IDENTITY), or
            stands for the step's length, 2 lambda = 1/(mu tr H'WH) (GRADIENT). With LOCAL coordinates all three angles
            have the entry of the one seen best: a frontal ring hardly shows its tilt to first order, and the damping
            that holds the other axes would let that one run. With g the share of the decrease promised by the quadratic
            model that a step brings, mu falls by max(0.1, 1 - (2 g - 1)^3); a step that does not lower the cost is not
            taken and mu rises tenfold.
        tolerance: converged when the undamped step is shorter than this many of its own standard deviations; a damped
            step as short gives way to it (but GRADIENT's).
        max_iterations: of solved steps.

    Returns:
        outcome, iterations, R_CD (3, 3), p_CD (3,), r^2 of each LED (n,), their sum, whole cost,
        covariance (6, 6) of (phi, delta), the inverse of N, and N, weighed by Eq. (3); NaN unless CONVERGED.
    """
    start, prior_p, room = np.empty(3), np.empty(3), new_room()
    mrp_from_matrix(R_CD, start)
    mrp_from_matrix(prior_R, prior_p)
    problem = Problem(
        measured, weights, points, lens, prior_p, prior_t, information, axis_D, axis_C, axis_information, huber,
        hold_attitude, coordinates,
    )  # fmt: skip
    outcome, iterations, p, t, N, led, cost = _minimise(
        problem, start, p_CD.copy(), room, damping, mu, tolerance, max_iterations
    )
    covariance, C, g = np.full((6, 6), np.nan), np.empty((3, 3)), np.empty(6)
    if coordinates != LOCAL or hold_attitude:
        local = Problem(
            measured, weights, points, lens, prior_p, prior_t, information, axis_D, axis_C, axis_information, huber,
            False, LOCAL,
        )  # fmt: skip
        normal_equations(local, p, t, room, N, g, led)
    if outcome != CONVERGED:
        N[:] = np.nan
    elif not invert(N, covariance, room):
        covariance[:] = np.nan
        outcome = outcome if hold_attitude else SINGULAR
    matrix_from_mrp(p, C)
    return outcome, iterations, C, t, led, led.sum(), cost, covariance, N


@njit(cache=True, error_model="numpy")
def _minimise(
    problem: Problem, p: Array, t: Array, room: Room, damping: int, mu: float, tolerance: float, max_iterations: int
) -> tuple[int, int, Array, Array, Array, Array, float]:
    """Run the loop; return outcome, iterations, p, t, N, each LED's r^2, cost."""
    p_new, t_new, N, N_new, g, g_new = p.copy(), t.copy(), np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    x, undamped, D, led = np.empty(6), np.empty(6), np.zeros(6), np.zeros(len(problem.points))
    led_new = led.copy()
    cost = normal_equations(problem, p, t, room, N, g, led)
    outcome, iterations = (NOT_CONVERGED, 0) if cost < np.inf else (BEHIND, 0)
    while outcome == NOT_CONVERGED and iterations < max_iterations:
        iterations += 1
        _set_damping(N, problem.coordinates, damping, D)
        if not _step(N, g, D, damping, mu, x, room):
            if damping == UNDAMPED or mu > 1e6:
                outcome = SINGULAR
            mu = max(10.0 * mu, 1e-6)
            continue
        least = tolerance if 2 * iterations < max_iterations else max(tolerance, _CREEPING)
        end = _check_end(N, g, D, damping, least, cost, x, undamped, room)
        if end == SINGULAR:
            outcome = SINGULAR
            break
        _moved(p, t, x, problem.coordinates, p_new, t_new, room)
        new = normal_equations(problem, p_new, t_new, room, N_new, g_new, led_new)
        if end == CONVERGED and new < np.inf:
            outcome = CONVERGED
        elif damping != UNDAMPED:
            promised = 2.0 * _dot(g, x) - _square(N, x)
            if not new < cost:
                mu = max(10.0 * mu, 1e-6)
                continue
            if promised > 0.0:
                mu *= max(0.1, 1.0 - (2.0 * (cost - new) / promised - 1.0) ** 3)
        elif not new < np.inf:
            break
        cost, p, p_new, t, t_new = new, p_new, p, t_new, t
        N, N_new, g, g_new, led, led_new = N_new, N, g_new, g, led_new, led
    return outcome, iterations, p, t, N, led, cost


@njit(cache=True, error_model="numpy")
def _step(N: Array, g: Array, D: Array, damping: int, mu: float, x: Array, room: Room) -> bool:
    """Fill the step x of a member of the family; False when its matrix is singular."""
    if damping == GRADIENT:
        for i in range(6):
            x[i] = g[i] / (mu * D[i])
        return True
    if not factor(N, D, mu, room.L, room.scale):
        return False
    substitute(room.L, room.scale, g, x)
    return True


@njit(cache=True, error_model="numpy")
def _set_damping(N: Array, coordinates: int, damping: int, D: Array) -> None:
    """Fill D: the largest diagonal of N met so far, or its largest entry, or its trace now; see `descend`."""
    largest, trace = 0.0, 0.0
    for i in range(6):
        D[i] = max(D[i], N[i, i])
        largest, trace = max(largest, D[i]), trace + N[i, i]
    if damping == DIAGONAL and coordinates == LOCAL:
        D[:3] = max(D[0], D[1], D[2])
    elif damping == IDENTITY:
        D[:] = largest
    elif damping == GRADIENT:
        D[:] = trace


@njit(cache=True, error_model="numpy")
def _moved(p: Array, t: Array, x: Array, coordinates: int, p_new: Array, t_new: Array, room: Room) -> None:
    """Fill the state after a step x."""
    C, step = room.C, room.s
    if coordinates == LOCAL:
        angle = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
        k = 0.25 if angle < 1e-4 else np.tan(0.25 * min(angle, np.pi)) / angle
        for i in range(3):
            step[i], t_new[i] = -k * x[i], t[i] + x[3 + i]
        mrp_product(step, p, 1.0, p_new)
        return
    matrix_from_mrp(p, C)
    for i in range(3):  # o + its step, by columns of C
        step[i] = x[3 + i] - (C[0, i] * t[0] + C[1, i] * t[1] + C[2, i] * t[2])
        p_new[i] = p[i] + x[i]
    s = p_new[0] ** 2 + p_new[1] ** 2 + p_new[2] ** 2
    if s > 1.0:  # shadow set
        for i in range(3):
            p_new[i] = -p_new[i] / s
    matrix_from_mrp(p_new, C)
    for i in range(3):
        t_new[i] = -(C[i, 0] * step[0] + C[i, 1] * step[1] + C[i, 2] * step[2])


@njit(cache=True, error_model="numpy")
def _check_end(
    N: Array, g: Array, D: Array, damping: int, least: float, cost: float, x: Array, undamped: Array, room: Room
) -> int:
    """Say whether step x is the last one: CONVERGED, NOT_CONVERGED or SINGULAR; a damped step may become undamped."""
    length, promised = _square(N, x), 2.0 * _dot(g, x) - _square(N, x)
    if not (length < least**2 or promised < _ROUNDING * cost):
        return NOT_CONVERGED
    if damping == UNDAMPED:
        return CONVERGED
    if not _step(N, g, D, UNDAMPED, 0.0, undamped, room):
        return SINGULAR
    decrement = _dot(g, undamped)
    last = decrement < least**2 or decrement < _ROUNDING * cost
    if last or damping != GRADIENT:
        x[:] = undamped
    return CONVERGED if last else NOT_CONVERGED


@njit(cache=True, error_model="numpy")
def _square(N: Array, x: Array) -> float:
    total = 0.0
    for i in range(6):
        for j in range(6):
            total += x[i] * N[i, j] * x[j]
    return total


@njit(cache=True, error_model="numpy")
def _dot(a: Array, b: Array) -> float:
    total = 0.0
    for i in range(6):
        total += a[i] * b[i]
    return total
