"""Gains of the receiver's flight control: linear-quadratic feedback, and a model of the flight that is to be flown.

Both minimise the integral of y'Q y + z'Q_z z + x'Q_x x + u'R u of the linear model, y the velocity of the probe's tip
beyond the path's, z its integral; Q and R are diagonal, one over the square of what is tolerated [Bryson & Ho, 5.2].
Tip at p from the centre of gravity, w the angular velocity beyond trim, R_trim the trim's attitude:

    y = C x = v + R_trim (w x p)                                                                            (1)

Surfaces at their limits answer late, and a feedback that asks for more drives an airframe that is not stable by itself
apart: K_busy tolerates more of everything but the surfaces, and asks for about half.

Feedback knows the gust as the flight control thinks of it, dg/dt = -(V/L) g + noise:

    u = -K x - K_z z - K_g g,     K = R^-1 B' P,     P of the algebraic Riccati equation                   (2)

Following has its own tolerances. The command is a velocity c with its rate a and its jerk j, as of something that
swings about a velocity of its own: dc/dt = a, da/dt = j, dj/dt = -w^2 a - 2 zeta w j + noise. Minimised is y - c:

    u = -K_m (x, z) - K_c (c, a, j),     A_m' P_c + P_c S + P E = C' Q (1, 0, 0),     A_m = A - B K_m       (3)

with S the equation of (c, a, j), E the way of c into z. What nose, wing and tail each do for the tip is left to
Eq. (3): slowly the aircraft translates by bank and angle of attack, fast it points its nose.
Source: Anderson & Moore, Optimal Control: Linear Quadratic Methods, chapter 4 (tracking a reference with a model).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_continuous_are, solve_sylvester

from dockair.rotations import Array, skew
from dockair.sim.aircraft.linear_model import ATTITUDE, INPUTS, RATE, STATES, VELOCITY, LinearModel

FOLLOWED = STATES + 3  #: states of the model that is followed: the aircraft's and z
_Z, _G = slice(STATES, STATES + 3), slice(STATES + 3, STATES + 6)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tolerances:
    """What is tolerated: the weights of Q, Q_z, Q_x and R."""

    velocity_m_s: Array  #: (3,) of the probe's tip: forward, left, up
    integral_m: Array  #: (3,)
    attitude_rad: Array  #: (3,) roll, pitch, yaw
    rate_rad_s: Array  #: (3,)
    surfaces_rad: Array  #: (3,) elevator, aileron, rudder
    thrust_m_s2: float

    def relaxed(self, factors: Array) -> "Tolerances":
        """The same for the actuators; (4,) times as much of velocity, integral, attitude and rate."""
        return replace(
            self,
            velocity_m_s=factors[0] * self.velocity_m_s,
            integral_m=factors[1] * self.integral_m,
            attitude_rad=factors[2] * self.attitude_rad,
            rate_rad_s=factors[3] * self.rate_rad_s,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Swing:
    """How a command is expected to go on, Eq. (3)."""

    frequency_rad_s: Array  #: (3,) w: forward, left, up
    damping: Array  #: (3,) zeta


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gains:
    """Eqs. (1) to (3)."""

    C: Array  #: (3, 13)
    K: Array  #: (4, 19) on x, z, g
    K_busy: Array  #: (4, 19) likewise, for surfaces at their limits
    K_followed: Array  #: (4, 16) on x, z of the model that is followed
    K_command: Array  #: (4, 9) on c, a, j


def tip_velocity(R_trim: Array, point_B: Array) -> Array:
    """(3, 13) C of Eq. (1) for a point (3,) from the centre of gravity, body axes [m]."""
    C = np.zeros((3, STATES))
    C[:, VELOCITY], C[:, RATE] = np.eye(3), -R_trim @ skew(point_B)
    return C


def design(
    model: LinearModel,
    C: Array,
    feedback: Tolerances,
    busy: Tolerances,
    following: Tolerances,
    gust_1_s: float,
    swing: Swing,
) -> Gains:
    """Gains for a linear model.

    Args:
        model: the aircraft about trim.
        C: (3, 13) the velocity that is held.
        feedback: weights against gusts and errors of the model.
        busy: likewise, where surfaces are at their limits.
        following: weights of the flight to be flown.
        gust_1_s: V/L of the gusts expected [1/s].
        swing: how commands are expected to go on.
    """
    A, B = _with_integral(model, C)
    A_gust = np.zeros((STATES + 6, STATES + 6))
    A_gust[:FOLLOWED, :FOLLOWED], A_gust[:STATES, _G], A_gust[_G, _G] = A, model.B_gust, -gust_1_s * np.eye(3)
    B_gust = np.vstack([B, np.zeros((3, INPUTS))])
    K, K_busy = (_riccati(A_gust, B_gust, C, tolerances)[0] for tolerances in (feedback, busy))
    K_followed, P = _riccati(A, B, C, following)
    K_command = _feed_forward(A - B @ K_followed, B, C, P, following, swing)
    return Gains(C=C, K=K, K_busy=K_busy, K_followed=K_followed, K_command=K_command)


def _with_integral(model: LinearModel, C: Array) -> tuple[Array, Array]:
    A, B = np.zeros((FOLLOWED, FOLLOWED)), np.zeros((FOLLOWED, INPUTS))
    A[:STATES, :STATES], A[_Z, :STATES], B[:STATES] = model.A, C, model.B
    return A, B


def _riccati(A: Array, B: Array, C: Array, t: Tolerances) -> tuple[Array, Array]:
    """K and P of Eq. (2)."""
    Q = np.zeros_like(A)
    Q[:STATES, :STATES] = C.T @ np.diag(t.velocity_m_s**-2.0) @ C
    Q[ATTITUDE, ATTITUDE] += np.diag(t.attitude_rad**-2.0)
    Q[RATE, RATE] += np.diag(t.rate_rad_s**-2.0)
    Q[_Z, _Z] = np.diag(t.integral_m**-2.0)
    R = _input_weights(t)
    P = solve_continuous_are(A, B, Q, R)
    return np.linalg.solve(R, B.T @ P), P


def _input_weights(t: Tolerances) -> Array:
    return np.diag(np.append(t.surfaces_rad, t.thrust_m_s2) ** -2.0)


def _feed_forward(A_m: Array, B: Array, C: Array, P: Array, t: Tolerances, swing: Swing) -> Array:
    """(4, 9) K_c of Eq. (3)."""
    S, E, right = np.zeros((9, 9)), np.zeros((FOLLOWED, 9)), np.zeros((FOLLOWED, 9))
    w = swing.frequency_rad_s
    S[:6, 3:], S[6:, 3:6], S[6:, 6:] = np.eye(6), -np.diag(w * w), -np.diag(2.0 * swing.damping * w)
    E[_Z, :3] = -np.eye(3)
    right[:STATES, :3] = C.T @ np.diag(t.velocity_m_s**-2.0)
    P_c = solve_sylvester(A_m.T, S, right - P @ E)
    return np.linalg.solve(_input_weights(t), B.T @ P_c)
