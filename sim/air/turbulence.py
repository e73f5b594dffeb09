"""Dryden gusts: one frozen field that all bodies ride.

The field is a function of one air-fixed coordinate, s = x + V t: what is at x now was ahead before. Along s the gust is
white noise n (unit intensity) through the Dryden forming filters, D = d/ds:

    u:     sigma sqrt(2 L) / (1 + L D) n                                                        (1)
    v, w:  sigma sqrt(L) (1 + sqrt(3) L D) / (1 + L D)^2 n                                      (2)
    p:     sigma_p sqrt(2 l) / (1 + l D) n,    l = 4 b / pi                                     (3)
    sigma_p^2 = 0.1 pi^2 (pi L / (4 b))^(1/3) sigma^2 / (L b),    so 0.954 sigma / (L b^2)^(1/3)
    R_u(d) = sigma^2 exp(-d/L),    R_v(d) = R_w(d) = sigma^2 exp(-d/L) (1 - d/(2 L))            (4)

x, u are along the tanker's heading, v, y to the left, w, z up; p is the air's rolling about x over a span b, positive
with the left side going up. The four are independent of each other. Above 2000 ft one sigma, one L.

The filters advance without approximation from knot to knot, a distance h = L d apart. In units of L the two states of
(2) are (a, a'), and with I_n = integral_0^d s^n exp(-2 s) ds = n!/2^(n+1) P(n+1, 2 d), P the incomplete gamma function,

    Phi = exp(-d) [[1 + d, d], [-d, 1 - d]],    G G' = [[I_2, I_1 - I_2], [I_1 - I_2, I_0 - 2 I_1 + I_2]]   (5)

They start from their stationary covariance, so that the field is stationary from t = 0. The knots are fixed in the air,
and between them the gust is linear: the same seed makes the same gusts at any physics rate and any airspeed. Over a
cell the straight line loses (1 - R(h)/R(0))/3 of the variance, h/(2 L) of v and w, h/(3 L) of u, h/(3 l) of p.

Not modelled: below 2000 ft (another length, anisotropic); change across the path but for the rolling gust; pitching and
yawing gusts but for what the field's change along x makes of them; decay of the field on its way. Ahead of the front
the front's gust is taken, beyond the field's end that of its end.
Source: MIL-F-8785C (1980), section 3.7; the table is its figure 7, in feet and ft/s as printed in public tabulations
(the curves at 500, 1750, ... ft; probabilities 1e-2, 1e-3, 1e-5).
"""

from dataclasses import dataclass
from math import exp, expm1, floor, pi, sqrt

import numpy as np
from scipy.special import gammainc

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.rotations import Array

_METRES_PER_FOOT = 0.3048
_LOWEST_ALTITUDE_FT = 2000.0  # the specification's border of the low-altitude model
_ALTITUDES_FT = (500.0, 1750.0, 3750.0, 7500.0, 15000.0, 25000.0, 35000.0, 45000.0, 55000.0, 65000.0, 75000.0, 80000.0)
_SIGMAS_FT_S = {
    "light": (6.6, 6.9, 7.4, 6.7, 4.6, 2.7, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0),
    "moderate": (8.6, 9.6, 10.6, 10.1, 8.0, 6.6, 5.0, 4.2, 2.7, 0.0, 0.0, 0.0),
    "severe": (15.6, 17.6, 23.0, 23.6, 22.1, 20.0, 16.0, 15.1, 12.1, 7.9, 6.2, 5.1),
}

_NOISES = 6  # of a knot: u, v and v', w and w', p; drawn whether or not there is a span, so that u, v, w are the same
_BLOCK = 256  # knots drawn at a time, so that the call costs little per knot
# Layout of the coefficient vector the kernel takes
_U_KEEP, _U_NOISE, _P_KEEP, _P_NOISE, _V_11, _V_12, _V_21, _V_22, _G_11, _G_21, _G_22, _SIGMA, _SIGMA_P = range(13)


@dataclass(frozen=True, slots=True, kw_only=True)
class TurbulenceParameters:
    """Sheet `turbulence`."""

    sigma_m_s: float  #: of each component
    length_scale_m: float  #: L, of each component
    knot_spacing_m: float  #: h
    front_m: float  #: x of the front
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


def rolling_sigma(sigma_m_s: float, length_scale_m: float, span_m: float) -> float:
    """Standard deviation of the rolling gust over a span [rad/s], Eq. (3)."""
    b, L = span_m, length_scale_m
    return float(sigma_m_s * sqrt(0.1 * pi**2 / (L * b)) * (pi * L / (4.0 * b)) ** (1.0 / 6.0))


class DrydenField:
    """The gust at any place along x, one tick at a time.

    Args:
        parameters: strength and size of the field.
        airspeed_m_s: V, with which the field passes.
        step_s: length of a tick [s].
        rng: the stream "gust".
        span_m: b, of the aircraft that the rolling gust is for; None for no rolling gust.
    """

    def __init__(
        self,
        parameters: TurbulenceParameters,
        airspeed_m_s: float,
        step_s: float,
        rng: np.random.Generator,
        span_m: float | None = None,
    ) -> None:
        if not airspeed_m_s > 0.0:
            raise DockairError("airspeed_m_s", expected="a speed > 0", got=airspeed_m_s)
        if span_m is not None and not span_m > 0.0:
            raise DockairError("span_m", expected="a span > 0", got=span_m)
        h = parameters.knot_spacing_m
        self._airspeed_m_s, self._step_s, self._ticks, self._passed_m = airspeed_m_s, step_s, 0, 0.0
        self._spacing_m, self._rng = h, rng
        self._back_m, self._front_m = parameters.front_m - parameters.extent_m, parameters.front_m
        self._k = _knot_coefficients(parameters, span_m)
        self._knots = np.zeros((int(np.ceil(parameters.extent_m / h)) + _BLOCK + 3, 4))  # a ring: u, v, w, p
        self._state = rng.standard_normal(_NOISES)
        self._state[1:5] *= 0.5  # stationary: var a = var a' = 1/4, and a, a' independent
        self._end = floor(self._back_m / h)  # number of the next knot to be drawn
        self._draw_to_front()

    def step(self) -> None:
        """Advance by one tick."""
        self._ticks += 1
        self._passed_m = self._airspeed_m_s * (self._ticks * self._step_s)
        self._draw_to_front()

    def velocity(self, x: Array) -> Array:
        """(n, 3) gust velocity [m/s] at the places x (n,) [m]."""
        gusts: Array = np.empty((len(x), 3))
        self.write_gusts(x, 0.0, gusts)
        return gusts

    def rolling(self, x: float) -> float:
        """Rolling gust [rad/s] at the place x [m]; 0 without a span."""
        return self.write_gusts(np.empty(0), x, np.empty((0, 3)))

    def write_gusts(self, x: Array, rolling_x: float, gusts: Array) -> float:
        """Write `velocity` into an array that is there already (n, 3); return `rolling`: both at the price of one."""
        rolling: float = _gusts_at(
            self._knots, self._passed_m, self._back_m, self._front_m, self._spacing_m, x, rolling_x, gusts
        )
        return rolling

    def _draw_to_front(self) -> None:
        """Draw knots until the front lies between two."""
        while (self._end - 1) * self._spacing_m <= self._front_m + self._passed_m:
            _draw_knots(self._knots, self._end, self._state, self._rng.standard_normal((_BLOCK, _NOISES)), self._k)
            self._end += _BLOCK


def _knot_coefficients(parameters: TurbulenceParameters, span_m: float | None) -> Array:
    """(13,) what the filters need from knot to knot, Eqs. (1)-(3) and (5)."""
    L, h, sigma = parameters.length_scale_m, parameters.knot_spacing_m, parameters.sigma_m_s
    d = h / L
    I_0, I_1, I_2 = gammainc(1, 2.0 * d) / 2.0, gammainc(2, 2.0 * d) / 4.0, gammainc(3, 2.0 * d) / 4.0
    k, keep = np.zeros(13), exp(-d)
    k[_U_KEEP], k[_U_NOISE] = keep, sqrt(-expm1(-2.0 * d))
    k[_V_11], k[_V_12], k[_V_21], k[_V_22] = keep * (1.0 + d), keep * d, -keep * d, keep * (1.0 - d)
    k[_G_11] = sqrt(I_2)
    k[_G_21] = (I_1 - I_2) / k[_G_11]
    k[_G_22] = sqrt(I_0 - 2.0 * I_1 + I_2 - k[_G_21] ** 2)
    k[_SIGMA] = sigma
    if span_m is not None:
        d_p = h * pi / (4.0 * span_m)
        k[_P_KEEP], k[_P_NOISE] = exp(-d_p), sqrt(-expm1(-2.0 * d_p))
        k[_SIGMA_P] = rolling_sigma(sigma, L, span_m)
    return k


@njit(cache=True)
def _draw_knots(knots, first, state, noise, k):  # type: ignore[no-untyped-def]
    """Write knots `first`, `first` + 1, ... and leave the state of the one after."""
    u, a_v, b_v, a_w, b_w, p = state
    root3 = np.sqrt(3.0)
    for i in range(noise.shape[0]):
        row = (first + i) % knots.shape[0]
        knots[row, 0] = k[_SIGMA] * u
        knots[row, 1] = k[_SIGMA] * (a_v + root3 * b_v)
        knots[row, 2] = k[_SIGMA] * (a_w + root3 * b_w)
        knots[row, 3] = k[_SIGMA_P] * p
        n = noise[i]
        u = k[_U_KEEP] * u + k[_U_NOISE] * n[0]
        a_v, b_v = (
            k[_V_11] * a_v + k[_V_12] * b_v + k[_G_11] * n[1],
            k[_V_21] * a_v + k[_V_22] * b_v + k[_G_21] * n[1] + k[_G_22] * n[2],
        )
        a_w, b_w = (
            k[_V_11] * a_w + k[_V_12] * b_w + k[_G_11] * n[3],
            k[_V_21] * a_w + k[_V_22] * b_w + k[_G_21] * n[3] + k[_G_22] * n[4],
        )
        p = k[_P_KEEP] * p + k[_P_NOISE] * n[5]
    state[0], state[1], state[2], state[3], state[4], state[5] = u, a_v, b_v, a_w, b_w, p


@njit(cache=True)
def _between(x, passed_m, back_m, front_m, spacing_m):  # type: ignore[no-untyped-def]
    """Knot before a place, and how far the place is toward the next one, 0 to 1."""
    s = (min(max(x, back_m), front_m) + passed_m) / spacing_m
    knot = int(np.floor(s))
    return knot, s - knot


@njit(cache=True)
def _gusts_at(knots, passed_m, back_m, front_m, spacing_m, x, rolling_x, out):  # type: ignore[no-untyped-def]
    """Write the gusts at the places x; return the rolling one."""
    for i in range(x.shape[0]):
        knot, part = _between(x[i], passed_m, back_m, front_m, spacing_m)
        a, b = knot % knots.shape[0], (knot + 1) % knots.shape[0]
        for axis in range(3):
            out[i, axis] = (1.0 - part) * knots[a, axis] + part * knots[b, axis]
    knot, part = _between(rolling_x, passed_m, back_m, front_m, spacing_m)
    return (1.0 - part) * knots[knot % knots.shape[0], 3] + part * knots[(knot + 1) % knots.shape[0], 3]
