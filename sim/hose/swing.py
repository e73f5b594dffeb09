"""Small swings of hose and drogue about their rest: periods and damping of the linearised chain.

A link's direction turns in a fixed plane by its own coordinate q_i: in the vertical plane, or sideways,

    t_i(q_i) = t_i0 cos q_i + n_i sin q_i,    w_i = q_i' (t_i0 x n_i)                                       (1)

n_i being the normal of t_i0 in the vertical plane, or y of W. With the bodies' places p_b(q) = - sum_i c_bi t_i (c: a
link's length, half of it, the drogue's arm) Lagrange's equations about rest are linear,

    M q'' + C q' + K q = 0,    M = sum_b m_b (dp_b/dq)'(dp_b/dq) + I_b,                                     (2)
    Q_i = sum_b dp_b/dq_i . F_b + (t_i0 x n_i) . M_i,    K = -dQ/dq,  C = -dQ/dq'                           (3)

with K and C by central differences of the loads on the displaced, moving chain, and the hinges' springs and dampers
added. A mode is q = Re(a exp(lambda t)): period 2 pi / Im lambda, damping ratio - Re lambda / |lambda|.

This is a second formulation of the chain, in absolute angles and without MuJoCo, whose relative hinges it checks.

Not modelled: the reel (held), the bend of a hose whose stiffness keeps it from the rest shape, contact.
Frame: W.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig

from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.loads import load_coefficients, tow_loads
from dockair.sim.hose.rest import rest_shape

Plane = Literal["vertical", "lateral"]

_ANGLE_RAD, _RATE_RAD_S = 1e-5, 1e-4  # of the central differences; loads are smooth over far more


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mode:
    """One damped swing."""

    eigenvalue_1_s: complex
    shape: NDArray[
        np.complex128
    ]  #: (links + 1,) angles of links and drogue, the hose's end moving by 1 m up or sideways

    @property
    def period_s(self) -> float:
        """Time of one swing, damped [s]."""
        return float(2.0 * np.pi / self.eigenvalue_1_s.imag)

    @property
    def damping_ratio(self) -> float:
        """Fraction of critical damping."""
        return float(-self.eigenvalue_1_s.real / abs(self.eigenvalue_1_s))


class LinearSwing:
    """The linearised chain in one plane.

    Args:
        hose: sheet.
        drogue: sheet.
        wind_W: (3,) velocity of the undisturbed air [m/s], in the x-z plane.
        air: density and viscosity.
        plane: of the swing.
    """

    def __init__(self, hose: HoseParameters, drogue: DrogueParameters, wind_W: Array, air: Air, plane: Plane) -> None:
        rho, nu = air.density_kg_m3, air.kinematic_viscosity_m2_s
        rest = rest_shape(hose, drogue, wind_W, rho, nu)
        self._hose, self._drogue, self._wind_W = hose, drogue, np.asarray(wind_W, dtype=float)
        self._loads = load_coefficients(hose, drogue, rho, nu)
        self._t0 = np.vstack([rest.t_W, rest.t_D_W])
        upward = np.column_stack([-self._t0[:, 2], np.zeros(len(self._t0)), self._t0[:, 0]])
        self._way = np.array([0.0, 0.0, 1.0] if plane == "vertical" else [0.0, 1.0, 0.0])
        self._n = upward if plane == "vertical" else np.tile(self._way, (len(self._t0), 1))
        self._axis = np.cross(self._t0, self._n)
        self._arms = _arms(hose, drogue)
        self._mass = np.append(np.full(hose.links, hose.link_mass_kg), drogue.mass_kg)
        self.M, self.C, self.K = self._mass_matrix(), *self._damping_and_stiffness()

    def modes(self) -> list[Mode]:
        """Oscillating modes, the slowest first."""
        n, zero, eye = len(self.M), np.zeros_like(self.M), np.eye(len(self.M))
        A = np.block([[zero, eye], [-np.linalg.solve(self.M, self.K), -np.linalg.solve(self.M, self.C)]])
        values, vectors = eig(A)
        swinging = np.flatnonzero(values.imag > 1e-9 * np.abs(values))
        order = swinging[np.argsort(np.abs(values[swinging]))]
        return [Mode(eigenvalue_1_s=complex(values[k]), shape=self._scaled(vectors[:n, k])) for k in order]

    def directions(self, mode: Mode, hose_end_m: float, time_s: float) -> Array:
        """(links + 1, 3) directions of links and drogue in a swing of one mode alone, its hose's end at most so far."""
        return self._directions(np.real(hose_end_m * mode.shape * np.exp(mode.eigenvalue_1_s * time_s)))

    def _scaled(self, q: NDArray[np.complex128]) -> NDArray[np.complex128]:
        at_end = -self._hose.link_length_m * ((self._n[:-1] @ self._way) @ q[:-1])
        return np.asarray(q / at_end)

    def _directions(self, q: Array) -> Array:
        return np.asarray(np.cos(q)[:, None] * self._t0 + np.sin(q)[:, None] * self._n)

    def _mass_matrix(self) -> Array:
        """M of Eq. (2) at rest, where dt_i/dq_i = n_i."""
        inertia = _inertia_across(self._hose, self._drogue)
        weighted = (self._arms.T * self._mass) @ self._arms
        return np.asarray(weighted * (self._n @ self._n.T) + np.diag(inertia))

    def _damping_and_stiffness(self) -> tuple[Array, Array]:
        n = len(self._t0)
        C, K = np.empty((n, n)), np.empty((n, n))
        for i in range(n):
            e = np.eye(n)[i]
            for matrix, q, rate in (
                (K, _ANGLE_RAD * e, np.zeros(n)),
                (C, np.zeros(n), _RATE_RAD_S * e),
            ):
                size = _ANGLE_RAD if matrix is K else _RATE_RAD_S
                matrix[:, i] = -(self._forces(q, rate) - self._forces(-q, -rate)) / (2.0 * size)
        spring, damper = _hinges(self._hose, self._drogue)
        return C + damper, K + spring

    def _forces(self, q: Array, rate: Array) -> Array:
        """(n,) generalised forces of air and weight, Eq. (3)."""
        t = self._directions(q)
        slope = np.cos(q)[:, None] * self._n - np.sin(q)[:, None] * self._t0
        v, w = -self._arms @ (rate[:, None] * slope), rate[:, None] * self._axis
        R = np.zeros((len(t), 3, 3))
        R[:, :, 0] = t
        air = np.tile(self._wind_W, (len(t), 1))
        wrench = tow_loads(R, v, w, air, 0.0, self._loads)
        wrench[:, 2] -= self._mass * STANDARD_GRAVITY_M_S2
        by_place = np.einsum("bi,ij,bj->i", -self._arms, slope, wrench[:, :3])
        return np.asarray(by_place + np.einsum("ij,ij->i", self._axis, wrench[:, 3:]))


def _arms(hose: HoseParameters, drogue: DrogueParameters) -> Array:
    """(n, n) c_bi [m]: how far body b's centre of mass lies aft along link i's direction."""
    n = hose.links + 1
    arms = hose.link_length_m * np.tril(np.ones((n, n)), -1)
    np.fill_diagonal(arms, 0.5 * hose.link_length_m)
    arms[-1, -1] = drogue.hose_joint_x_m - drogue.centre_of_mass_x_m
    return arms


def _inertia_across(hose: HoseParameters, drogue: DrogueParameters) -> Array:
    link = hose.link_mass_kg * (hose.link_length_m**2 / 12.0 + hose.radius_m**2 / 4.0)
    return np.append(np.full(hose.links, link), drogue.inertia_kg_m2[1])


def _hinges(hose: HoseParameters, drogue: DrogueParameters) -> tuple[Array, Array]:
    """(n, n) stiffness and (n, n) damping of the hinges, in absolute angles; the exit and the drogue have no spring."""
    n = hose.links + 1
    relative = np.eye(n) - np.eye(n, k=-1)
    springs = np.full(n, hose.bending_stiffness_n_m2 / hose.link_length_m)
    springs[[0, -1]] = 0.0
    dampers = np.full(n, hose.bending_damping_n_m2_s / hose.link_length_m)
    dampers[-1] = drogue.hinge_damping_n_m_s
    return relative.T @ np.diag(springs) @ relative, relative.T @ np.diag(dampers) @ relative
