"""Gains of the receiver's flight control: linear-quadratic feedback and exact steering along a commanded path.

Feedback minimises the integral of x'Q x + z'Q_z z + u'R u of the linear model with two additions: z, the integral of
the velocity's error, and the gust g as the flight control thinks of it, dg/dt = -(V/L) g + noise:

    u = -K x - K_z z - K_g g,     K = R^-1 B' P,     P of the algebraic Riccati equation              (1)

Q and R are diagonal, one over the square of what is tolerated [Bryson & Ho, section 5.2].

Steering: to follow w, a reference velocity r and its first three derivatives (per axis a chain S of integrators),
state and input must be Pi w and Gamma w, the solution of the regulator equations

    Pi S = A Pi + B Gamma,     C Pi = (1, 0, 0, 0) for the three velocities, 0 for the heading        (2)

so that u = Gamma w - K (x - Pi w) tracks without error in the linear model what has no fourth derivative, and the
feedback's gains do not shape the answer to commands.
Source: Francis, The linear multivariable regulator problem, SIAM J. Control Optim. 15 (1977).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_are

from dockair.rotations import Array
from dockair.sim.aircraft.linear_model import ATTITUDE, INPUTS, RATE, STATES, VELOCITY, LinearModel

CHAIN = 4  #: the reference and three derivatives of it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tolerances:
    """What is tolerated: the weights of Q, Q_z and R."""

    velocity_m_s: Array  #: (3,) forward, left, up
    integral_m: Array  #: (3,)
    attitude_rad: Array  #: (3,) roll, pitch, yaw
    rate_rad_s: Array  #: (3,)
    surfaces_rad: Array  #: (3,) elevator, aileron, rudder
    thrust_m_s2: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gains:
    """Eqs. (1) and (2)."""

    K: Array  #: (4, 13)
    K_integral: Array  #: (4, 3)
    K_gust: Array  #: (4, 3)
    Pi: Array  #: (13, 12) on the chain: three axes of r, of its first, second, third derivative
    Gamma: Array  #: (4, 12)


def design(model: LinearModel, tolerances: Tolerances, gust_rate_1_s: float) -> Gains:
    """Gains for a linear model.

    Args:
        model: the aircraft about trim.
        tolerances: the weights.
        gust_rate_1_s: V/L of the gusts expected [1/s].
    """
    z, g = slice(STATES, STATES + 3), slice(STATES + 3, STATES + 6)
    A, B = np.zeros((STATES + 6, STATES + 6)), np.zeros((STATES + 6, INPUTS))
    A[:STATES, :STATES], A[:STATES, g], B[:STATES] = model.A, model.B_gust, model.B
    A[z, VELOCITY], A[g, g] = np.eye(3), -gust_rate_1_s * np.eye(3)
    weights = np.zeros(STATES + 6)
    weights[VELOCITY], weights[z] = tolerances.velocity_m_s**-2.0, tolerances.integral_m**-2.0
    weights[ATTITUDE], weights[RATE] = tolerances.attitude_rad**-2.0, tolerances.rate_rad_s**-2.0
    R = np.diag(np.append(tolerances.surfaces_rad, tolerances.thrust_m_s2) ** -2.0)
    K = np.linalg.solve(R, B.T @ solve_continuous_are(A, B, np.diag(weights), R))
    Pi, Gamma = _steering(model)
    return Gains(K=K[:, :STATES], K_integral=K[:, z], K_gust=K[:, g], Pi=Pi, Gamma=Gamma)


def _steering(model: LinearModel) -> tuple[Array, Array]:
    """Solve Eq. (2), M X - E X S = (0; outputs) with X = (Pi; Gamma), by stacking the columns of X."""
    C = np.zeros((4, STATES))
    C[:3, VELOCITY], C[3, ATTITUDE.stop - 1] = np.eye(3), 1.0
    S = np.kron(np.eye(CHAIN, k=1), np.eye(3))
    right = np.zeros((STATES + INPUTS, len(S)))
    right[STATES : STATES + 3, :3] = np.eye(3)
    M = np.block([[model.A, model.B], [C, np.zeros((4, INPUTS))]])
    E = np.zeros_like(M)
    E[:STATES, :STATES] = np.eye(STATES)
    stacked = np.kron(np.eye(len(S)), M) - np.kron(S.T, E)
    X = np.linalg.solve(stacked, right.T.reshape(-1)).reshape(len(S), -1).T
    return X[:STATES], X[STATES:]
