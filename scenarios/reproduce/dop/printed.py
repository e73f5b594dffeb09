"""The linearisation that [Kim & Hwang 2014, eqs 4-24] print, slips included: what their figures 5-8 were drawn with.

    A_i dm_i = B_i dx (18),   A_i as printed in (19), B_i as printed in (20)
    dm_i = C(alpha)^-1 A_i^-1 B_i dx + roll column                                          (24)

psi and theta are azimuth and elevation of the line of sight after the roll is taken out as in (4)-(5), R its length.
Against the exact derivative of (1)-(3), which `nav.dop` has:

    (10)        arctan((u + du)/f) is taken as psi + du/f; right is psi + cos^2(psi) du/f
    (15)-(19)   the first term's sign is -, and in (19) cos(beta + theta) should be cos(theta)
    (20)        row 2: dy has + sin(beta + theta) sin(gamma + psi)/R
    (20)        the beta column holds for a landmark on the axis alone: pitch turns azimuth, too
    (4), (5)    roll and pitch turn the other way than in (3); the dilution does not feel a column's sign
    (24)        row 1 of the roll column has - f tan(psi) sin(alpha)

`mended` takes the first three out, all of (9)-(20) that is not geometry; it is still not exact.
"""

import numpy as np

from dockair.rotations import Array, matrix_from_yaw_pitch_roll


def printed_jacobian(
    landmarks_N: Array, position_N: Array, roll_pitch_yaw_rad: Array, focal_length_m: float, *, mended: bool = False
) -> Array:
    """(2n, 6) H of eq (25) by the printed (19), (20) and (24).

    Args:
        landmarks_N: (n, 3) landmarks [m], in front of the camera.
        position_N: (3,) body [m]; camera axes are its axes.
        roll_pitch_yaw_rad: (3,) attitude.
        focal_length_m: focal length [m].
        mended: whether (9)-(20) are mended term by term.
    """
    alpha, beta, gamma = roll_pitch_yaw_rad
    f = focal_length_m
    lines = (landmarks_N - position_N) @ matrix_from_yaw_pitch_roll(gamma, beta, alpha)
    C = np.array([[np.cos(alpha), np.sin(alpha)], [-np.sin(alpha), np.cos(alpha)]])  # (22)
    rows = []
    for line in lines:
        x, (y, z) = line[0], C @ line[1:]  # (4)-(5)
        psi, R = np.arctan2(y, x), np.sqrt(x * x + y * y + z * z)
        theta = np.arctan2(z, np.hypot(x, y))
        A = _mended_A(psi, theta, f) if mended else _printed_A(psi, theta, beta, f)
        H = np.linalg.solve(A @ C, _printed_B(gamma + psi, beta + theta, R, mended))
        tan, secant = f * np.tan(psi), f * np.tan(theta) / np.cos(psi)
        H[0, 3] += tan * np.sin(alpha) - secant * np.cos(alpha)  # (24), the line below
        H[1, 3] += tan * np.cos(alpha) - secant * np.sin(alpha)
        rows.append(H)
    return np.vstack(rows)


def dop_of(jacobian: Array) -> tuple[float, float]:
    """PDOP and ADOP of a Jacobian, eqs (27), (30), (31)."""
    variance = np.diag(np.linalg.inv(jacobian.T @ jacobian))
    return float(np.sqrt(variance[:3].sum())), float(np.sqrt(variance[3:].sum()))


def _printed_A(psi: float, theta: float, beta: float, f: float) -> Array:
    elevation = np.cos(beta + theta)  # (19)
    by_u = np.cos(theta) ** 2 * np.sin(theta) * np.cos(psi) * np.sin(psi) / elevation
    return np.array([[1.0, 0.0], [by_u, np.cos(theta) * np.cos(psi) * elevation]]) / f


def _mended_A(psi: float, theta: float, f: float) -> Array:
    by_u = -np.cos(theta) * np.sin(theta) * np.cos(psi) * np.sin(psi)
    return np.array([[np.cos(psi) ** 2, 0.0], [by_u, np.cos(theta) ** 2 * np.cos(psi)]]) / f


def _printed_B(azimuth: float, elevation: float, R: float, mended: bool) -> Array:
    sin_a, cos_a, sin_e, cos_e = np.sin(azimuth), np.cos(azimuth), np.sin(elevation), np.cos(elevation)
    sign = 1.0 if mended else -1.0
    return np.array(  # (20)
        [
            [sin_a / (R * cos_e), -cos_a / (R * cos_e), 0.0, 0.0, 0.0, -1.0],
            [sin_e * cos_a / R, sign * sin_e * sin_a / R, -cos_e / R, 0.0, -1.0, 0.0],
        ]
    )
