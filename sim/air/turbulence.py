"""Dryden gusts: one frozen field that all bodies ride.

At the front of the field the gust is white noise n (unit intensity) through the Dryden forming filters, t = L / V:

    u:     H(s) = sigma sqrt(2 t) / (1 + t s)                                             (1)
    v, w:  H(s) = sigma sqrt(t) (1 + sqrt(3) t s) / (1 + t s)^2                           (2)
    R_u(d) = sigma^2 exp(-d/t),    R_v(d) = R_w(d) = sigma^2 exp(-d/t) (1 - d/(2 t))      (3)

u is along x of W, v along y, w along z, independent of each other. Above 2000 ft the turbulence is isotropic:
one sigma, one L. The filters' states x advance without approximation from tick to tick,

    x <- Phi x + G n,    Phi = exp(A h),    G G' = P - Phi P Phi',    A P + P A' + B B' = 0   (4)

and start from their stationary covariance P, so the field is stationary from t = 0. It is frozen in the air, which
passes W with the airspeed V: at x the gust is that of the front, (x_front - x) / V earlier.

Not modelled: below 2000 ft (another length, anisotropic), gradients across the span (no rotational gusts: below
span / L = 2 %), decay of the field on its way. Points ahead of the front take the front's gust, points beyond the
field's end that of its end.
Source: MIL-F-8785C (1980), section 3.7; the table is its figure 7, in feet and ft/s as printed in public tabulations
(the curves at 500, 1750, ... ft; probabilities 1e-2, 1e-3, 1e-5).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.linalg import cholesky, expm, solve_continuous_lyapunov

from dockair.errors import DockairError
from dockair.rotations import Array

_METRES_PER_FOOT = 0.3048
_LOWEST_ALTITUDE_FT = 2000.0  # the specification's border of the low-altitude model
_ALTITUDES_FT = (500.0, 1750.0, 3750.0, 7500.0, 15000.0, 25000.0, 35000.0, 45000.0, 55000.0, 65000.0, 75000.0, 80000.0)
_SIGMAS_FT_S = {
    "light": (6.6, 6.9, 7.4, 6.7, 4.6, 2.7, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0),
    "moderate": (8.6, 9.6, 10.6, 10.1, 8.0, 6.6, 5.0, 4.2, 2.7, 0.0, 0.0, 0.0),
    "severe": (15.6, 17.6, 23.0, 23.6, 22.1, 20.0, 16.0, 15.1, 12.1, 7.9, 6.2, 5.1),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TurbulenceParameters:
    """Sheet `turbulence`."""

    sigma_m_s: float  #: of each component
    length_scale_m: float  #: L, of each component
    front_m: float  #: x_front in W
    extent_m: float  #: from the front back to the field's end


def gust_sigma(intensity: str, altitude_m: float) -> float:
    """Standard deviation of each gust component [m/s], MIL-F-8785C, interpolated in altitude.

    Args:
        intensity: "light", "moderate" or "severe" (exceeded with probability 1e-2, 1e-3, 1e-5).
        altitude_m: altitude [m], from 2000 ft up.

    Raises:
        DockairError: unknown intensity, or an altitude outside the model.
    """
    if intensity not in _SIGMAS_FT_S:
        raise DockairError("turbulence.intensity", expected="an intensity", got=intensity, exists=_SIGMAS_FT_S)
    altitude_ft = altitude_m / _METRES_PER_FOOT
    if not _LOWEST_ALTITUDE_FT <= altitude_ft <= _ALTITUDES_FT[-1]:
        low, high = _LOWEST_ALTITUDE_FT * _METRES_PER_FOOT, _ALTITUDES_FT[-1] * _METRES_PER_FOOT
        raise DockairError("altitude_m", expected=f"an altitude from {low:.0f} to {high:.0f} m", got=altitude_m)
    return float(np.interp(altitude_ft, _ALTITUDES_FT, _SIGMAS_FT_S[intensity])) * _METRES_PER_FOOT


class DrydenField:
    """The gust at any place along x, one tick at a time.

    Args:
        parameters: strength and size of the field.
        airspeed_m_s: V, with which the field passes.
        step_s: length of a tick [s].
        rng: the stream "gust".
    """

    def __init__(
        self, parameters: TurbulenceParameters, airspeed_m_s: float, step_s: float, rng: np.random.Generator
    ) -> None:
        if not airspeed_m_s > 0.0:
            raise DockairError("airspeed_m_s", expected="a speed > 0", got=airspeed_m_s)
        A, B, self._C = _forming_filters(parameters, airspeed_m_s)
        P = solve_continuous_lyapunov(A, -B @ B.T)
        self._Phi = expm(A * step_s)
        self._G = cholesky(P - self._Phi @ P @ self._Phi.T, lower=True)  # Eq. (4)
        self._rng = rng
        self._state = cholesky(P, lower=True) @ rng.standard_normal(len(A))
        self._front_m = parameters.front_m
        self._metres_per_tick = airspeed_m_s * step_s
        self._gusts = np.zeros((int(np.ceil(parameters.extent_m / self._metres_per_tick)) + 2, 3))  # a ring of ticks
        self._newest = 0
        self._sigma = parameters.sigma_m_s
        self._gusts[0] = self._sigma * (self._C @ self._state)
        for _ in range(len(self._gusts) - 1):
            self.step()

    def step(self) -> None:
        """Advance by one tick."""
        self._state = self._Phi @ self._state + self._G @ self._rng.standard_normal(len(self._state))
        self._newest = (self._newest + 1) % len(self._gusts)
        self._gusts[self._newest] = self._sigma * (self._C @ self._state)

    def velocity(self, x_W: Array) -> Array:
        """(n, 3) gust velocity in W axes [m/s] at the places x_W (n,) [m] along x of W."""
        return _gusts_at(self._gusts, self._newest, self._front_m, self._metres_per_tick, np.asarray(x_W, dtype=float))


def _forming_filters(parameters: TurbulenceParameters, airspeed_m_s: float) -> tuple[Array, Array, Array]:
    """A (5, 5), B (5, 3), C (3, 5) of Eqs. (1) and (2) for a sigma of 1; states (u, v, v', w, w')."""
    t = parameters.length_scale_m / airspeed_m_s
    A, B, C = np.zeros((5, 5)), np.zeros((5, 3)), np.zeros((3, 5))
    A[0, 0], B[0, 0], C[0, 0] = -1.0 / t, np.sqrt(2.0 / t), 1.0
    for axis, i in ((1, 1), (2, 3)):
        A[i : i + 2, i : i + 2] = [[0.0, 1.0 / t], [-1.0 / t, -2.0 / t]]  # the second state in units of the first
        B[i + 1, axis] = 1.0 / np.sqrt(t)
        C[axis, i : i + 2] = [1.0, np.sqrt(3.0)]
    return A, B, C


@njit(cache=True)
def _gusts_at(gusts, newest, front_m, metres_per_tick, x_W):  # type: ignore[no-untyped-def]
    count = gusts.shape[0]
    out = np.empty((x_W.shape[0], 3))
    for i in range(x_W.shape[0]):
        ticks = min(max((front_m - x_W[i]) / metres_per_tick, 0.0), count - 2.0)
        whole = int(ticks)
        part = ticks - whole
        a, b = (newest - whole) % count, (newest - whole - 1) % count
        for axis in range(3):
            out[i, axis] = (1.0 - part) * gusts[a, axis] + part * gusts[b, axis]
    return out
