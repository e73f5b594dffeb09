"""The tanker's state on its path at one moment: the arithmetic behind `tanker`, whose equations these are.

With L = V r cos gamma and N = V gamma' + g cos gamma, the roll of Eq. (3) and its rate are

    roll = -atan2(L, N),     roll' = -(L' N - L N')/(L^2 + N^2)                                           (1)

and the angular velocity follows from the rates of heading, pitch and roll.
A segment is a row: when it begins, how long it is, r and gamma at both ends, heading and place at the beginning.
"""

import math

import numpy as np

from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2

#: Layout of a state.
P, V, A, R, OMEGA, ALPHA, TURN, CLIMB = (
    slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 18), slice(18, 21), slice(21, 24), 24, 25
)  # fmt: skip
STATE = 26
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)  # exact to rounding for turns of a radian


@njit(cache=True)
def _profile(u: float, duration: float, r0: float, r1: float, heading: float) -> float:
    """Heading at the part u of a segment, Eq. (1)."""
    return heading + duration * (r0 * u + (r1 - r0) * u**4 * (2.5 - 3.0 * u + u * u))


@njit(cache=True)
def _step(u: float) -> tuple[float, float, float, float]:
    """S of Eq. (1) and its first three derivatives."""
    return (
        u**3 * (10.0 - 15.0 * u + 6.0 * u * u),
        30.0 * u * u * (1.0 - u) ** 2,
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
        60.0 * (1.0 - 6.0 * u + 6.0 * u * u),
    )


@njit(cache=True)
def _way(s: Array, t: float, speed: float, nodes: Array, weights: Array) -> tuple[float, float, float]:
    """Way through the air since the segment's beginning, t before now."""
    duration, r0, r1, g0, g1, heading = s[1], s[2], s[3], s[4], s[5], s[6]
    if r0 == r1 and g0 == g1:
        along = speed * math.cos(g0) * t
        half = 0.5 * r0 * t
        if half != 0.0:
            along *= math.sin(half) / half
        return along * math.cos(heading + half), along * math.sin(heading + half), speed * math.sin(g0) * t
    x, y, z = 0.0, 0.0, 0.0
    for k in range(nodes.shape[0]):
        u = 0.5 * (nodes[k] + 1.0) * t / duration
        share = 0.5 * t * speed * weights[k]
        psi = _profile(u, duration, r0, r1, heading)
        gamma = g0 + (g1 - g0) * _step(u)[0]
        x += share * math.cos(gamma) * math.cos(psi)
        y += share * math.cos(gamma) * math.sin(psi)
        z += share * math.sin(gamma)
    return x, y, z


@njit(cache=True)
def _bank(
    speed: float, g: tuple[float, float, float, float], r: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Roll of Eq. (3), right wing down positive, and its first two derivatives; of gamma and r with theirs."""
    c, s, earth = math.cos(g[0]), math.sin(g[0]), STANDARD_GRAVITY_M_S2
    side = speed * c * r[0]
    side1 = speed * (c * r[1] - s * g[1] * r[0])
    side2 = speed * (c * r[2] - 2.0 * s * g[1] * r[1] - (c * g[1] ** 2 + s * g[2]) * r[0])
    up = speed * g[1] + earth * c
    up1 = speed * g[2] - earth * s * g[1]
    up2 = speed * g[3] - earth * (c * g[1] ** 2 + s * g[2])
    square = side * side + up * up
    square1 = 2.0 * (side * side1 + up * up1)
    first = (side1 * up - side * up1) / square
    second = (side2 * up - side * up2) / square - first * square1 / square
    return -math.atan2(side, up), -first, -second


@njit(cache=True)
def _turn(out: Array, angles: tuple[float, float, float], first: Array, second: Array) -> None:
    """Rotation matrix, angular velocity and acceleration of yaw, pitch, roll and their derivatives."""
    (psi, theta, phi), (psi1, theta1, phi1), (psi2, theta2, phi2) = angles, first, second
    cy, sy, ct, st = math.cos(psi), math.sin(psi), math.cos(theta), math.sin(theta)
    c, s = math.cos(phi), math.sin(phi)
    out[9], out[10], out[11] = cy * ct, cy * st * s - sy * c, cy * st * c + sy * s
    out[12], out[13], out[14] = sy * ct, sy * st * s + cy * c, sy * st * c - cy * s
    out[15], out[16], out[17] = -st, ct * s, ct * c
    out[18] = phi1 - psi1 * st
    out[19] = theta1 * c + psi1 * ct * s
    out[20] = -theta1 * s + psi1 * ct * c
    out[21] = phi2 - psi2 * st - psi1 * ct * theta1
    out[22] = theta2 * c - theta1 * s * phi1 + psi2 * ct * s - psi1 * st * theta1 * s + psi1 * ct * c * phi1
    out[23] = -theta2 * s - theta1 * c * phi1 + psi2 * ct * c - psi1 * st * theta1 * c - psi1 * ct * s * phi1


@njit(cache=True)
def state_at(segments: Array, time: float, speed: float, nodes: Array, weights: Array) -> Array:
    """(26,) state at a time; before the first segment it goes on as at its beginning."""
    n = 0
    while n + 1 < segments.shape[0] and time >= segments[n + 1, 0]:
        n += 1
    s = segments[n]
    t, duration, r0, r1, g0, g1 = max(time - s[0], 0.0), s[1], s[2], s[3], s[4], s[5]
    out = np.zeros(STATE)
    r, g = (r0, 0.0, 0.0), (g0, 0.0, 0.0, 0.0)
    psi = s[6] + r0 * t
    if r0 != r1 or g0 != g1:
        u = t / duration
        f, f1, f2, f3 = _step(u)
        f1, f2, f3 = f1 / duration, f2 / duration**2, f3 / duration**3
        r = (r0 + (r1 - r0) * f, (r1 - r0) * f1, (r1 - r0) * f2)
        g = (g0 + (g1 - g0) * f, (g1 - g0) * f1, (g1 - g0) * f2, (g1 - g0) * f3)
        psi = _profile(u, duration, r0, r1, s[6])
    x, y, z = _way(s, t, speed, nodes, weights)
    out[0], out[1], out[2] = s[7] + x - speed * t, s[8] + y, s[9] + z
    cg, sg, cy, sy = math.cos(g[0]), math.sin(g[0]), math.cos(psi), math.sin(psi)
    out[3], out[4], out[5] = speed * (cg * cy - 1.0), speed * cg * sy, speed * sg
    out[6] = speed * (-sg * g[1] * cy - cg * sy * r[0])
    out[7] = speed * (-sg * g[1] * sy + cg * cy * r[0])
    out[8] = speed * cg * g[1]
    roll = _bank(speed, g, r)
    first, second = np.array([r[0], -g[1], roll[1]]), np.array([r[1], -g[2], roll[2]])
    _turn(out, (psi, -g[0], roll[0]), first, second)
    out[24], out[25] = r[0], g[0]
    return out
