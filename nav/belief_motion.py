"""How the belief about the drogue moves between frames: its state, its errors, and the noise they gather.

Held in body axes B, from the place I of the accelerometers; u' is the rate of change seen from axes that do not turn:

    R = R_BD,  s = p_ID_B,  v = s',  n = swing of the drogue about its place of rest,  m = n',
    b = bias of the gyro,   c = gravity less the steady acceleration of the formation
    u = turn from the drogue's attitude to that of rest, R_rest = exp(u) R
    g = what gusts and the receiver's bow wave drive it with, which lasts for a while [Singer 1970]
    a = -W^2 n - 2 z W m + g + white drive,   g' = -g / T_g + white                                   (1)
    s' = v,   v' = a - (f + c),   n' = m,   m' = a,   w = w_gyro - b                                  (2)
    phi' = u / T + white turning,   u' = -phi'                                                        (3)

W = diag(0, W_left, W_up): along the hose nothing pulls the drogue back, and n, m stay 0 there. f is the accelerometers'
specific force, so that f + c is the receiver's acceleration beyond the formation's, which the belief need not guess;
their bias is part of c, from which it cannot be told. The drogue turns about an attitude of rest that hose and air give
it, which stays and walks a little, as the LEDs' places do for what is not modelled of them. In body axes every vector
turns with E = exp(-[w x] dt). Errors

    e = (phi, ds, dv, dn, dm, db, dc, du, dg, calibration, ring),   R_true = exp(phi) R,   dw = -db - noise     (4)

so that a turn that the gyro did not measure enters phi with +1 and each vector u with -[u x]. One step is Eq. (2) to
second order in dt (Eq. (3) to first), then E; the steps are at most `longest_step_s`.

Between the IMU's samples, and after the last, rate and specific force are as `imu_samples` says; where no two samples
of the force stand near, the receiver's acceleration is taken for white.

Not modelled: overtones of the hose, which take back half a second later what a gust gave, the size of the IMU, the
swing's axes turning with the tanker, a formation that speeds up (walk of c).
"""

from typing import NamedTuple

import numpy as np

from dockair.kernels import njit
from dockair.nav.imu_samples import sampled
from dockair.rotations import Array

PHI, PLACE, VELOCITY = slice(0, 3), slice(3, 6), slice(6, 9)
SWING, SWING_RATE, BIAS, FORMATION = slice(9, 12), slice(12, 15), slice(15, 18), slice(18, 21)
REST, GUST = slice(21, 24), slice(24, 27)
CALIBRATION, RING, HARDWARE = slice(27, 34), slice(34, 50), slice(27, 50)
ERRORS = 50  #: how many errors a belief has
S, V, B = 0, 1, 4  #: rows of the state (8, 3), which are s v n m b c u g
_MOVING = 27  # errors that move; those of calibration and ring do not


class Motion(NamedTuple):
    """Belief about motion, in the order of its `flat` numbers; densities are squared."""

    stiffness: Array  #: (3,) W^2 [1/s^2]
    friction: Array  #: (3,) 2 z W [1/s]
    gust_1_s: float  #: 1/T_g of Eq. (1)
    gust2: Array  #: (3,) of g' [m^2/s^5]
    attitude2: float  #: drogue's turning [rad^2/s]
    return_1_s: float  #: 1/T of Eq. (3)
    rest2: float  #: walk of the attitude of rest [rad^2/s]
    ring2: float  #: walk of the LEDs' places [m^2/s]
    drive2: float  #: the white one of Eq. (1) [m^2/s^3]
    receiver2: float  #: receiver's acceleration where it is not measured [m^2/s^3]
    accelerometer2: float  #: [m^2/s^3]
    gyro2: float  #: [rad^2/s]
    bias2: float  #: walk of the gyro's bias [rad^2/s^3]
    formation2: float  #: walk of c [m^2/s^5]
    scale2: float  #: the gyro's noise by its scale factor, per squared rate [s]
    held_turn2: float  #: sigma_A^2 of [imu_samples, eq 1] [rad^2/s^4]
    held_most2: float  #: noise density of a rate that is not known [rad^2/s]
    longest_gap_s: float  #: between two samples of acceleration that are used
    longest_step_s: float

    def flat(self) -> Array:
        """(25,) the same, as the kernel takes it: one array is handed over sooner than these many numbers."""
        return np.hstack(self)


@njit(cache=True, error_model="numpy")
def _unpacked(flat: Array) -> Motion:
    return Motion(
        flat[0:3], flat[3:6], flat[6], flat[7:10], flat[10], flat[11], flat[12], flat[13], flat[14], flat[15],
        flat[16], flat[17], flat[18], flat[19], flat[20], flat[21], flat[22], flat[23], flat[24],
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _turn(E: Array, w0: float, w1: float, w2: float, dt: float) -> None:
    """E (3, 3) = exp(-[w x] dt)."""
    angle = np.sqrt(w0**2 + w1**2 + w2**2) * dt
    p = 1.0 - angle**2 / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    q = 0.5 - angle**2 / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    x, y, z = -w0 * dt, -w1 * dt, -w2 * dt
    E[0, 0], E[0, 1], E[0, 2] = 1.0 - q * (y * y + z * z), -p * z + q * x * y, p * y + q * x * z
    E[1, 0], E[1, 1], E[1, 2] = p * z + q * x * y, 1.0 - q * (x * x + z * z), -p * x + q * y * z
    E[2, 0], E[2, 1], E[2, 2] = -p * y + q * x * z, p * x + q * y * z, 1.0 - q * (x * x + y * y)


@njit(cache=True, error_model="numpy")
def _state_turned(x: Array, E: Array) -> None:
    """The state (8, 3) in place, but for the gyro's bias, which stays in the body."""
    for row in (0, 1, 2, 3, 5, 6, 7):
        u0, u1, u2 = x[row, 0], x[row, 1], x[row, 2]
        for i in range(3):
            x[row, i] = E[i, 0] * u0 + E[i, 1] * u1 + E[i, 2] * u2


@njit(cache=True, error_model="numpy")
def _state_driven(x: Array, f: Array, w: Array, dt: float, felt: bool, motion: Motion) -> None:
    """Eqs (1), (2) of the state (8, 3) in place, in axes that do not turn."""
    fading_1_s = motion.gust_1_s * (1.0 - 0.5 * dt * motion.gust_1_s)
    for i in range(3):
        fades = fading_1_s * x[7, i]
        a = -motion.stiffness[i] * x[2, i] - motion.friction[i] * x[3, i] + x[7, i]
        a = a - 0.5 * dt * (motion.stiffness[i] * x[3, i] + motion.friction[i] * a + fades)  # half-way
        j, m = (i + 1) % 3, (i + 2) % 3
        before = f[i] + 0.5 * dt * (w[j] * f[m] - w[m] * f[j])  # f in the axes at the step's begin
        relative = a - before - x[5, i] if felt else a
        x[0, i] += dt * x[1, i] + 0.5 * dt * dt * relative
        x[1, i] += dt * relative
        x[7, i] -= dt * fades
        if i > 0:
            x[2, i] += dt * x[3, i] + 0.5 * dt * dt * a
            x[3, i] += dt * a


@njit(cache=True, error_model="numpy")
def _driven(P: Array, columns: int, dt: float, felt: bool, motion: Motion) -> None:
    """Eqs (1) to (3) for the rows that move, row after row (27 * 50,), in the first columns.

    That rows are 50 long is known to the compiler, which then goes in fours.
    """
    fading_1_s = motion.gust_1_s * (1.0 - 0.5 * dt * motion.gust_1_s)
    for i in range(3):
        W2, zW2 = motion.stiffness[i], motion.friction[i]
        s, v, n, m, c = (3 + i) * ERRORS, (6 + i) * ERRORS, (9 + i) * ERRORS, (12 + i) * ERRORS, (18 + i) * ERRORS
        g = (24 + i) * ERRORS
        for j in range(columns):
            fades = fading_1_s * P[g + j]
            a = -W2 * P[n + j] - zW2 * P[m + j] + P[g + j]
            a = a - 0.5 * dt * (W2 * P[m + j] + zW2 * a + fades)  # half-way
            relative = a - P[c + j] if felt else a
            P[s + j] += dt * P[v + j] + 0.5 * dt * dt * relative
            P[v + j] += dt * relative
            P[g + j] -= dt * fades
            if i > 0:  # along the hose there is no swing
                P[n + j] += dt * P[m + j] + 0.5 * dt * dt * a
                P[m + j] += dt * a
        phi, u = i * ERRORS, (21 + i) * ERRORS
        for j in range(columns):
            back = dt * motion.return_1_s * P[u + j]
            P[phi + j] += back
            P[u + j] -= back


@njit(cache=True, error_model="numpy")
def _errors_moved(P: Array, columns: int, E: Array, x: Array, dt: float, felt: bool, motion: Motion) -> None:
    """P <- F P in place in the first columns, P row after row (27 * 50,); x (8, 3) is the state after the step."""
    _driven(P, columns, dt, felt, motion)
    e00, e01, e02, e10, e11, e12 = E[0, 0], E[0, 1], E[0, 2], E[1, 0], E[1, 1], E[1, 2]
    e20, e21, e22 = E[2, 0], E[2, 1], E[2, 2]
    bias = P[15 * ERRORS : 18 * ERRORS]  # the gyro's stays in the body
    for block in (0, 1, 2, 3, 4, 6, 7, 8):
        rows = P[3 * block * ERRORS : 3 * (block + 1) * ERRORS]
        state = max(block - 1, 0)
        u0, u1, u2 = x[state, 0], x[state, 1], x[state, 2]
        for j in range(columns):
            p0, p1, p2 = rows[j], rows[ERRORS + j], rows[2 * ERRORS + j]
            b0, b1, b2 = dt * bias[j], dt * bias[ERRORS + j], dt * bias[2 * ERRORS + j]
            q0 = e00 * p0 + e01 * p1 + e02 * p2
            q1 = e10 * p0 + e11 * p1 + e12 * p2
            q2 = e20 * p0 + e21 * p1 + e22 * p2
            if block == 0:
                rows[j], rows[ERRORS + j], rows[2 * ERRORS + j] = q0 + b0, q1 + b1, q2 + b2
            else:
                rows[j] = q0 - (u1 * b2 - u2 * b1)
                rows[ERRORS + j] = q1 - (u2 * b0 - u0 * b2)
                rows[2 * ERRORS + j] = q2 - (u0 * b1 - u1 * b0)


@njit(cache=True, error_model="numpy")
def _noise_added(P: Array, G: Array, x: Array, dt: float, gyro2: float, other2: float, motion: Motion) -> None:
    """P <- P + Q in place, of what moves; `other2` drives the velocity alone.

    G (3, 27), how the errors take up the gyro's noise, is written anew where it depends on the state; the rest of it is
    a unit matrix and zeros.
    """
    for i in range(3):
        P[i, i] += motion.attitude2 * dt
        P[15 + i, 15 + i] += motion.bias2 * dt
        P[18 + i, 18 + i] += motion.formation2 * dt
        P[21 + i, 21 + i] += (motion.attitude2 + motion.rest2) * dt
        P[i, 21 + i] -= motion.attitude2 * dt
        P[21 + i, i] -= motion.attitude2 * dt
        swings = i > 0
        for row, powers in ((3, 1), (6, 0), (9, 1), (12, 0)):
            for column, more in ((3, 1), (6, 0), (9, 1), (12, 0)):
                if (row > 6 or column > 6) and not swings:
                    continue
                q = motion.drive2 + other2 if row <= 6 and column <= 6 else motion.drive2
                order = powers + more
                share = 1.0 if order == 0 else (0.5 * dt if order == 1 else dt * dt / 3.0)
                P[row + i, column + i] += q * dt * share
    for block in range(1, 9):
        if block != 5:
            u0, u1, u2, r = x[block - 1, 0], x[block - 1, 1], x[block - 1, 2], 3 * block
            G[1, r], G[2, r], G[2, r + 1] = u2, -u1, u0
            G[0, r + 1], G[0, r + 2], G[1, r + 2] = -u2, u1, -u0
    for i in range(_MOVING):
        g0, g1, g2 = G[0, i], G[1, i], G[2, i]
        for j in range(_MOVING):
            P[i, j] += gyro2 * dt * (g0 * G[0, j] + g1 * G[1, j] + g2 * G[2, j])


@njit(cache=True, error_model="numpy")
def _gust_noise_added(P: Array, dt: float, gust2: Array) -> None:
    """Add to P, symmetric, what drives g' of Eq. (1) in a step dt: of g to first order in dt, and its share of v and m.

    Shares of third order are left out. What is added is by itself a covariance, with the white drive, in steps shorter
    than the ratio of that drive's density to this one's (8 ms as flown).
    """
    for i in range(3):
        g, half = 24 + i, 0.5 * gust2[i] * dt * dt
        P[g, g] += gust2[i] * dt
        for row in (6, 12):
            if row == 6 or i > 0:
                P[g, row + i] += half
                P[row + i, g] += half


@njit(cache=True, error_model="numpy")
def _covariance_moved(
    P: Array,
    moving: Array,
    turned: Array,
    G: Array,
    E: Array,
    x: Array,
    dt: float,
    gyro2: float,
    felt: bool,
    motion: Motion,
) -> None:
    """P <- F P F' + Q over a piece of time: its rows that move, its ring; `turned` is what moves on both sides, too."""
    _errors_moved(moving.ravel(), ERRORS, E, x, dt, felt, motion)
    for i in range(_MOVING):
        for j in range(_MOVING):
            turned[j, i] = moving[i, j]
    _errors_moved(turned.ravel(), _MOVING, E, x, dt, felt, motion)
    _noise_added(turned, G, x, dt, gyro2, motion.accelerometer2 if felt else motion.receiver2, motion)
    _gust_noise_added(turned, dt, motion.gust2)
    moving[:, :_MOVING] = turned[:, :_MOVING]
    for i in range(RING.start, RING.stop):
        P[i, i] += motion.ring2 * dt


@njit(cache=True, error_model="numpy")
def propagated(
    R: Array,
    x: Array,
    P: Array,
    t0: float,
    t1: float,
    times: Array,
    rates: Array,
    forces: Array,
    flat: Array,
    errors: bool = True,
) -> tuple[Array, Array, Array]:
    """Return R (3, 3), x (8, 3), P at t1 [s], from those at t0 <= t1 and the samples about.

    Only the rows of P that move are carried along, and of them the block that moves on both sides by itself: what it
    has in common with calibration and ring is in them once, as P is symmetric.

    Args:
        R: (3, 3) R_BD.
        x: (8, 3) s, v, n, m, b, c, u, g.
        P: (50, 50) covariance of the errors, symmetric; with calibration and ring it is read where these are columns.
        t0: time of the belief.
        t1: time wanted.
        times: (k,) stamps of the samples, increasing.
        rates: (k, 3) of the gyro, body axes [rad/s].
        forces: (k, 3) of the accelerometers, body axes [m/s^2]; NaN where there is none.
        flat: (25,) belief about motion, `Motion.flat`.
        errors: whether P is moved, too; it is nearly all of the work.
    """
    motion = _unpacked(flat)
    R, x, P = R.copy(), x.copy(), P.copy()
    E, E_rest, R_rest, w, f = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    moving, turned, G = P[:_MOVING].copy(), np.empty((_MOVING, ERRORS)), np.zeros((3, _MOVING))
    G[0, 0] = G[1, 1] = G[2, 2] = 1.0
    held = motion.held_turn2, motion.held_most2, motion.longest_gap_s
    n, t = len(times), t0
    k = int(np.searchsorted(times, t0, side="right")) - 1
    while t < t1:
        knot = min(times[k + 1], t1) if k + 1 < n else t1
        pieces = max(int(np.ceil((knot - t) / motion.longest_step_s - 1e-9)), 1)
        dt, begin = (knot - t) / pieces, t
        for piece in range(pieces):
            ta, tb = begin + piece * dt, begin + (piece + 1) * dt
            held2, felt = sampled(w, f, k, ta, tb, times, rates, forces, *held)
            gyro2 = motion.gyro2 + held2 + motion.scale2 * (w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
            for i in range(3):
                w[i] -= x[4, i]
            _state_driven(x, f, w, dt, felt, motion)
            _turn(E, w[0], w[1], w[2], dt)
            back = -motion.return_1_s
            _turn(E_rest, back * x[6, 0], back * x[6, 1], back * x[6, 2], dt)
            np.dot(E_rest, R, R_rest)
            np.dot(E, R_rest, R)
            for i in range(3):
                x[6, i] *= 1.0 - dt * motion.return_1_s
            _state_turned(x, E)
            if errors:
                _covariance_moved(P, moving, turned, G, E, x, dt, gyro2, felt, motion)
        # at every sample, so that the way there does not matter to the last bit
        for i in range(_MOVING if errors else 0):
            for j in range(i):
                moving[i, j] = moving[j, i] = 0.5 * (turned[i, j] + turned[j, i])
        t, k = knot, k + (1 if k + 1 < n and knot == times[k + 1] else 0)
    for i in range(_MOVING):
        for j in range(ERRORS):
            P[i, j] = P[j, i] = moving[i, j]
    return R, x, P
