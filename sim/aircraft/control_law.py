"""The arithmetic of a tick of the flight control and its parts, in one file because a tick is then two calls.

The equations are those of `flight_control`, `rate_relief`, `reference` and `model_flight`.

Loops where slices would do: numba makes twenty times as much code of a slice, which then has to be fetched every tick.

Each part hands over one record, its `memory`, of state and constants by name: to receive an array takes numba 0.1 us.
`own` is that of `flight_control`, `row` that of `gain_schedule.Row`.

Layouts: a trim of now is attitude, rates, surfaces, thrust per mass, slope of the path; motions and wrenches are those
of `airframe.Aerodynamics`, the aircraft's and the model's; the state x is that of `linear_model`.
"""

import numpy as np

from dockair.kernels import njit
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.aircraft.gain_schedule import THRUST_0
from dockair.sim.aircraft.linear_model import ATTITUDE

SLOPE, TRIM = 10, 11
_BANK = ATTITUDE.start


@njit(cache=True)
def write_states(  # type: ignore[no-untyped-def]
    R_WB, velocity_W, w, surfaces, thrust, slope, R_WF, row, model, own, motions
):  # fmt: skip
    """Write attitude of now and against the path, trim, both states, and both motions in still air."""
    k, m, R_FM = own[()], model[()], np.empty((3, 3))
    _ahead(R_WB, w, k.lag_s, k.R_now)
    R_trim = _write_trim(slope, row[()].trim, k.trim)
    _beyond(R_WF, k.R_now, velocity_W, w, surfaces, thrust / k.mass_kg, k, R_trim, k.R_FB, motions[0], k.x)
    _beyond(R_WF, m.R_WB, m.velocity_W, m.w_WB_B, m.actuators, m.actuators[3], k, R_trim, R_FM, motions[1], k.x_m)
    for i in range(3):
        motions[0, 3 + i], motions[0, 6 + i] = w[i], surfaces[i]
        motions[1, 3 + i], motions[1, 6 + i] = m.w_WB_B[i], m.actuators[i]


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
def write_state(R_WF, R_WB, velocity_W, w, surfaces, thrust, slope, row, own, v_B):  # type: ignore[no-untyped-def]
    """Write attitude against the path, velocity along the body, the path's trim, and x beyond it."""
    k = own[()]
    R_trim = _write_trim(slope, row[()].trim, k.trim)
    _beyond(R_WF, R_WB, velocity_W, w, surfaces, thrust, k, R_trim, k.R_FB, v_B, k.x)


@njit(cache=True)
def _write_trim(slope, level, trim):  # type: ignore[no-untyped-def]
    """Write the path's trim; return its attitude, row by row."""
    for i in range(SLOPE):
        trim[i] = level[i]
    trim[SLOPE] = slope
    trim[THRUST_0] += STANDARD_GRAVITY_M_S2 * np.sin(slope)
    return rotation_rows(trim)


@njit(cache=True)
def _beyond(R_WF, R_WB, velocity_W, w, surfaces, thrust, k, R_trim, R_FB, v_B, x):  # type: ignore[no-untyped-def]
    """Write attitude against the path, velocity along the body, and x beyond trim.

    The velocity in x is the one with which C x is that of the tip however much the body is turned from trim.
    """
    p, trim = k.probe_B, k.trim
    of_tip = (w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0])
    for i in range(3):
        v_B[i] = R_WB[0, i] * velocity_W[0] + R_WB[1, i] * velocity_W[1] + R_WB[2, i] * velocity_W[2]
        x[i] = R_WF[0, i] * velocity_W[0] + R_WF[1, i] * velocity_W[1] + R_WF[2, i] * velocity_W[2]
        for j in range(3):
            R_FB[i, j] = R_WF[0, i] * R_WB[0, j] + R_WF[1, i] * R_WB[1, j] + R_WF[2, i] * R_WB[2, j]
            x[i] += (R_FB[i, j] - R_trim[3 * i + j]) * of_tip[j]
    x[0] -= k.airspeed_m_s
    _rotation_between(R_FB, R_trim, x[3:6])
    for i in range(3):
        x[6 + i], x[9 + i] = w[i] - trim[3 + i], surfaces[i] - trim[6 + i]
    x[12] = thrust - trim[THRUST_0]


@njit(cache=True)
def _estimate(v_B, force, felt, airspeed, gust_from_residual, engaged, k):  # type: ignore[no-untyped-def]
    """Advance the gust g."""
    gust, force_m = k.gust, k.force_B
    residual = np.empty(3)  # airspeed and specific forces across the body beyond those of still air
    for i in range(3):
        if not engaged:
            force_m[i] = force[i] / k.mass_kg
        force_m[i] += k.lag_share * (force[i] / k.mass_kg - force_m[i])  # as late as the accelerometers
        residual[i] = felt[i] - force_m[i]
    residual[0] = np.sqrt(v_B[0] * v_B[0] + v_B[1] * v_B[1] + v_B[2] * v_B[2]) - airspeed
    for i in range(3):
        now = 0.0
        for j in range(3):
            now += gust_from_residual[i, j] * residual[j]
        gust[i] = gust[i] + k.gust_share * (now - gust[i]) if engaged else now


@njit(cache=True)
def write_commands(  # type: ignore[no-untyped-def]
    felt, airspeed, u_B, a_B, engaged, motions, wrenches, surfaces, row, own, reference, relief, model
):  # fmt: skip
    """Eqs. (1) and (2): write commands to surfaces and model, return thrust [N]; advance gust and integrals.

    All that these need goes a tick further with them: relief and reference before, the model's flight after.
    """
    gains, k = row[()], own[()]
    x, x_m, w_m, z, trim, limits, chain = k.x, k.x_m, k.w_m, k.z, k.trim, k.limits, reference[()].chain
    n, step, haste, shares = len(x), k.step_s, 0.0, (1.0, 1.0, 1.0)
    if engaged:
        shares = relieve(surfaces, motions[0, 6:9], model[()].actuators, relief)
        haste = relief[()].haste
    advance_reference(reference, k.R_FB, u_B, a_B, x_m[_BANK], shares)
    _estimate(motions[0], wrenches[0], felt, airspeed, gains.gust_from_residual, engaged, k)
    error, u, off = np.empty(n + 6), np.zeros(4), np.zeros(3)
    for i in range(n):
        error[i] = x[i] - x_m[i]
    for i in range(3):
        error[n + i], error[n + 3 + i] = z[i], k.gust[i]
        w_m[i] += k.lag_share * (x_m[6 + i] - w_m[i])
        error[6 + i] = x[6 + i] - w_m[i]
    _add(-1.0, gains.K_followed, x_m, u)
    _add(-1.0, gains.K_command, chain.ravel(), u)
    free_m = free = True
    for i in range(4):
        wanted = trim[6 + i] + u[i]
        k.commands_m[i] = min(max(wanted, limits[0, i]), limits[1, i])
        free_m = free_m and k.commands_m[i] == wanted
    if haste == 0.0:
        _add(-1.0, gains.K, error, u)
    else:
        _add(-1.0, (1.0 - haste) * gains.K + haste * gains.K_busy, error, u)
    for i in range(4):
        wanted = trim[6 + i] + u[i]
        u[i] = min(max(wanted, limits[0, i]), limits[1, i])
        free = free and u[i] == wanted
    for i in range(3):
        surfaces[i] = u[i]
    if free:
        _add(step, gains.C, error, z)
    if free_m:
        _add(1.0, gains.C, x_m, off)
        for i in range(3):
            x_m[n + i] += step * (off[i] - chain[0, i])
    advance_model(wrenches[1], k.commands_m, model)
    return u[3] * k.mass_kg


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


@njit(cache=True)
def relieve(commands, surfaces, modelled, relief):  # type: ignore[no-untyped-def]
    """Eqs. (1) to (3) of `rate_relief` over one tick: both b and the larger h in place; return the shares."""
    k = relief[()]
    keep, least = k.keep, k.least
    up, left = keep * k.busy[0], keep * k.busy[1]
    if _is_busy(commands, surfaces, modelled, k, 0):
        up += 1.0 - keep
    if _is_busy(commands, surfaces, modelled, k, 1) or _is_busy(commands, surfaces, modelled, k, 2):
        left += 1.0 - keep
    haste_up = min(up / k.busy_share, 1.0)
    haste = max(min(left / k.busy_share, 1.0), haste_up)
    k.busy[0], k.busy[1], k.haste = up, left, haste
    share_up = 1.0 - (1.0 - least) * haste_up
    return share_up, 1.0 - (1.0 - least) * haste, share_up


@njit(cache=True)
def _is_busy(commands, surfaces, modelled, k, i):  # type: ignore[no-untyped-def]
    """Eq. (1)'s condition."""
    near_stop = max(abs(commands[i]), abs(modelled[i])) > k.stops_rad[i]
    return near_stop or abs(commands[i] - surfaces[i]) > k.misses_rad[i]


@njit(cache=True)
def shortening(u, longest):  # type: ignore[no-untyped-def]
    """What a command is multiplied by, so that it is no longer than allowed."""
    size = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    return 1.0 if size <= longest else longest / size


@njit(cache=True)
def advance_reference(reference, R, u_B, a_B, bank, left):  # type: ignore[no-untyped-def]
    """Eqs. (1) and (2) of `reference` over one tick, in place."""
    m = reference[()]
    chain, smooth, step, phi = m.chain, m.smooth, m.step_s, m.bank_rad
    w, zeta, share = m.bandwidth_rad_s, m.damping, shortening(u_B, m.velocity_m_s)
    for i in range(3):
        k, a_max, jerk_max = m.gain_1_s[i], left[i] * m.acceleration_m_s2[i], m.jerk_m_s3[i]
        if i == 1:
            a_max *= min(max((phi[1] - abs(bank)) / (phi[1] - phi[0]), 0.0), 1.0)
        u = share * (R[i, 0] * u_B[0] + R[i, 1] * u_B[1] + R[i, 2] * u_B[2])
        a = R[i, 0] * a_B[0] + R[i, 1] * a_B[1] + R[i, 2] * a_B[2]
        smooth[1, i] += step * (w * w * (u - smooth[0, i]) - 2.0 * zeta * w * smooth[1, i])
        smooth[0, i] += step * smooth[1, i]
        d = min(max(a + k * (smooth[0, i] - chain[0, i]), -a_max), a_max)
        snap = w * w * (d - chain[1, i]) - 2.0 * zeta * w * chain[2, i]
        jerk = min(max(chain[2, i] + step * snap, -jerk_max), jerk_max)
        chain[3, i] = (jerk - chain[2, i]) / step
        chain[2, i] = jerk
        chain[1, i] += step * jerk
        chain[0, i] += step * chain[1, i]


@njit(cache=True)
def advance_model(wrench, commands, model):  # type: ignore[no-untyped-def]
    """Eqs. (1) and (2) of `model_flight` over one tick, in place."""
    m = model[()]
    R, v, w, actuators, J, J_inverse = m.R_WB, m.velocity_W, m.w_WB_B, m.actuators, m.inertia, m.inverse_inertia
    step, mass, h, force, moment = m.step_s, m.mass_kg, m.rotor_momentum, wrench[:3], wrench[3:]
    L = (
        J[0, 0] * w[0] + J[0, 1] * w[1] + J[0, 2] * w[2],
        J[1, 0] * w[0] + J[1, 1] * w[1] + J[1, 2] * w[2],
        J[2, 0] * w[0] + J[2, 1] * w[1] + J[2, 2] * w[2],
    )
    torque = (
        moment[0] - w[1] * L[2] + w[2] * L[1],
        moment[1] - w[2] * L[0] + w[0] * L[2] - h * w[2],
        moment[2] - w[0] * L[1] + w[1] * L[0] + h * w[1],
    )
    push = (force[0] / mass + actuators[3], force[1] / mass, force[2] / mass)
    for i in range(3):
        v[i] += step * (R[i, 0] * push[0] + R[i, 1] * push[1] + R[i, 2] * push[2])
        w[i] += step * (J_inverse[i, 0] * torque[0] + J_inverse[i, 1] * torque[1] + J_inverse[i, 2] * torque[2])
    v[2] -= step * STANDARD_GRAVITY_M_S2
    _turn(R, step * w[0], step * w[1], step * w[2])
    for i in range(4):
        actuators[i] += step * m.lags_1_s[i] * (commands[i] - actuators[i])


@njit(cache=True)
def _turn(R, x, y, z):  # type: ignore[no-untyped-def]
    """R <- R exp(rotation vector), in place (Rodrigues)."""
    t2 = x * x + y * y + z * z
    t = np.sqrt(t2)
    a, b = (1.0, 0.5) if t < 1e-8 else (np.sin(t) / t, (1.0 - np.cos(t)) / t2)
    c = 1.0 - b * t2
    for i in range(3):
        p, q, r = R[i, 0], R[i, 1], R[i, 2]
        R[i, 0] = p * (c + b * x * x) + q * (b * x * y + a * z) + r * (b * x * z - a * y)
        R[i, 1] = p * (b * x * y - a * z) + q * (c + b * y * y) + r * (b * y * z + a * x)
        R[i, 2] = p * (b * x * z + a * y) + q * (b * y * z - a * x) + r * (c + b * z * z)
