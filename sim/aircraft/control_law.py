"""The arithmetic of a tick of the flight control, whose equations these are (`flight_control`).

Loops where slices would do: numba makes twenty times as much code of a slice, which then has to be fetched every tick.

Layouts: a trim of now is attitude, rates, surfaces, thrust per mass, slope of the path; the constants k are the step,
then as named here, from `PROBE` on the place of the probe's tip; motions and wrenches are those of
`airframe.Aerodynamics`, the aircraft's and the model's; the state x is that of `linear_model`.
"""

import numpy as np
from numba import njit

from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.aircraft.gain_schedule import THRUST_0

SLOPE, TRIM = 10, 11
AIRSPEED, MASS, GUST_SHARE, LAG_SHARE, LAG, PROBE = 1, 2, 3, 4, 5, 6


@njit(cache=True)
def write_states(  # type: ignore[no-untyped-def]
    R_WB, velocity_W, w, surfaces, thrust, slope, level, R_WF, R_WM, velocity_m, w_m, actuators_m, k,
    R_now, R_FB, trim, x, x_m, motions,
):  # fmt: skip
    """Write attitude of now and against the path, trim, both states, and both motions in still air."""
    R_FM = np.empty((3, 3))
    _ahead(R_WB, w, k[LAG], R_now)
    R_trim = _write_trim(slope, level, trim)
    _beyond(R_WF, R_now, velocity_W, w, surfaces, thrust / k[MASS], trim, R_trim, k, R_FB, motions[0], x)
    _beyond(R_WF, R_WM, velocity_m, w_m, actuators_m, actuators_m[3], trim, R_trim, k, R_FM, motions[1], x_m)
    for i in range(3):
        motions[0, 3 + i], motions[0, 6 + i] = w[i], surfaces[i]
        motions[1, 3 + i], motions[1, 6 + i] = w_m[i], actuators_m[i]


@njit(cache=True)
def _ahead(R, w, late, now):  # type: ignore[no-untyped-def]
    """Write R exp(w late), to the second order: the attitude of now."""
    x, y, z = late * w[0], late * w[1], late * w[2]
    half = 0.5 * (x * x + y * y + z * z)
    for i in range(3):
        along = 0.5 * (R[i, 0] * x + R[i, 1] * y + R[i, 2] * z)
        now[i, 0] = R[i, 0] * (1.0 - half) + R[i, 1] * z - R[i, 2] * y + along * x
        now[i, 1] = R[i, 1] * (1.0 - half) + R[i, 2] * x - R[i, 0] * z + along * y
        now[i, 2] = R[i, 2] * (1.0 - half) + R[i, 0] * y - R[i, 1] * x + along * z


@njit(cache=True)
def write_state(  # type: ignore[no-untyped-def]
    R_WF, R_WB, velocity_W, w, surfaces, thrust, slope, level, k, R_FB, v_B, trim, x
):  # fmt: skip
    """Write attitude against the path, velocity along the body, the path's trim, and x beyond it."""
    R_trim = _write_trim(slope, level, trim)
    _beyond(R_WF, R_WB, velocity_W, w, surfaces, thrust, trim, R_trim, k, R_FB, v_B, x)


@njit(cache=True)
def _write_trim(slope, level, trim):  # type: ignore[no-untyped-def]
    """Write the path's trim; return its attitude, row by row."""
    for i in range(SLOPE):
        trim[i] = level[i]
    trim[SLOPE] = slope
    trim[THRUST_0] += STANDARD_GRAVITY_M_S2 * np.sin(slope)
    return rotation_rows(trim)


@njit(cache=True)
def _beyond(R_WF, R_WB, velocity_W, w, surfaces, thrust, trim, R_trim, k, R_FB, v_B, x):  # type: ignore[no-untyped-def]
    """Write attitude against the path, velocity along the body, and x beyond trim.

    The velocity in x is the one with which C x is that of the tip however much the body is turned from trim.
    """
    p = k[PROBE:]
    of_tip = (w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0])
    for i in range(3):
        v_B[i] = R_WB[0, i] * velocity_W[0] + R_WB[1, i] * velocity_W[1] + R_WB[2, i] * velocity_W[2]
        x[i] = R_WF[0, i] * velocity_W[0] + R_WF[1, i] * velocity_W[1] + R_WF[2, i] * velocity_W[2]
        for j in range(3):
            R_FB[i, j] = R_WF[0, i] * R_WB[0, j] + R_WF[1, i] * R_WB[1, j] + R_WF[2, i] * R_WB[2, j]
            x[i] += (R_FB[i, j] - R_trim[3 * i + j]) * of_tip[j]
    x[0] -= k[AIRSPEED]
    _rotation_between(R_FB, R_trim, x[3:6])
    for i in range(3):
        x[6 + i], x[9 + i] = w[i] - trim[3 + i], surfaces[i] - trim[6 + i]
    x[12] = thrust - trim[THRUST_0]


@njit(cache=True)
def _estimate(v_B, force, felt, airspeed, gust_from_residual, gust, force_m, engaged, k):  # type: ignore[no-untyped-def]
    """Advance the gust g."""
    residual = np.empty(3)  # airspeed and specific forces across the body beyond those of still air
    for i in range(3):
        if not engaged:
            force_m[i] = force[i] / k[MASS]
        force_m[i] += k[LAG_SHARE] * (force[i] / k[MASS] - force_m[i])  # as late as the accelerometers
        residual[i] = felt[i] - force_m[i]
    residual[0] = np.sqrt(v_B[0] * v_B[0] + v_B[1] * v_B[1] + v_B[2] * v_B[2]) - airspeed
    for i in range(3):
        now = 0.0
        for j in range(3):
            now += gust_from_residual[i, j] * residual[j]
        gust[i] = gust[i] + k[GUST_SHARE] * (now - gust[i]) if engaged else now


@njit(cache=True)
def write_commands(  # type: ignore[no-untyped-def]
    felt, airspeed, engaged, C, K, K_m, K_c, gust_from_residual, x, motions, wrenches, trim, chain,
    x_m, w_m, z, gust, force_m, limits, k, surfaces, commands_m,
):  # fmt: skip
    """Eqs. (1) and (2): write commands to surfaces and model, return thrust [N]; advance gust and integrals."""
    _estimate(motions[0], wrenches[0], felt, airspeed, gust_from_residual, gust, force_m, engaged, k)
    n, step = len(x), k[0]
    error, u, off = np.empty(n + 6), np.zeros(4), np.zeros(3)
    for i in range(n):
        error[i] = x[i] - x_m[i]
    for i in range(3):
        error[n + i], error[n + 3 + i] = z[i], gust[i]
        w_m[i] += k[LAG_SHARE] * (x_m[6 + i] - w_m[i])
        error[6 + i] = x[6 + i] - w_m[i]
    _add(-1.0, K_m, x_m, u)
    _add(-1.0, K_c, chain.ravel(), u)
    free_m = free = True
    for i in range(4):
        wanted = trim[6 + i] + u[i]
        commands_m[i] = min(max(wanted, limits[0, i]), limits[1, i])
        free_m = free_m and commands_m[i] == wanted
    _add(-1.0, K, error, u)
    for i in range(4):
        wanted = trim[6 + i] + u[i]
        u[i] = min(max(wanted, limits[0, i]), limits[1, i])
        free = free and u[i] == wanted
    for i in range(3):
        surfaces[i] = u[i]
    if free:
        _add(step, C, error, z)
    if free_m:
        _add(1.0, C, x_m, off)
        for i in range(3):
            x_m[n + i] += step * (off[i] - chain[0, i])
    return u[3] * k[MASS]


@njit(cache=True)
def _add(factor, M, x, out):  # type: ignore[no-untyped-def]
    """Add factor M x to out, as many of x as M has columns."""
    for i in range(M.shape[0]):
        total = 0.0
        for j in range(M.shape[1]):
            total += M[i, j] * x[j]
        out[i] += factor * total


@njit(cache=True)
def rotation_rows(angles):  # type: ignore[no-untyped-def]
    """R_z R_y R_x, row by row, of angles about x, y, z."""
    cx, sx, cy, sy = np.cos(angles[0]), np.sin(angles[0]), np.cos(angles[1]), np.sin(angles[1])
    cz, sz = np.cos(angles[2]), np.sin(angles[2])
    return (
        cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx,
        sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx,
        -sy, cy * sx, cy * cx,
    )  # fmt: skip


@njit(cache=True)
def _rotation_between(R, S, phi):  # type: ignore[no-untyped-def]
    """Write the rotation vector phi (3,) of R S' = exp(phi), for |phi| < pi; S row by row."""
    M = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            M[i, j] = R[i, 0] * S[3 * j] + R[i, 1] * S[3 * j + 1] + R[i, 2] * S[3 * j + 2]
    phi[0], phi[1], phi[2] = 0.5 * (M[2, 1] - M[1, 2]), 0.5 * (M[0, 2] - M[2, 0]), 0.5 * (M[1, 0] - M[0, 1])
    sine = np.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    if sine >= 1e-12:
        cosine = 0.5 * (M[0, 0] + M[1, 1] + M[2, 2] - 1.0)
        longer = np.arctan2(sine, cosine) / sine
        for i in range(3):
            phi[i] *= longer
