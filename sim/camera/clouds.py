"""A layer of broken cloud: how thick it is where a ray crosses it, and the sunlight that comes through it.

Optical depth, a field with the roughness of real clouds. n is a sum of octaves of gradient noise, unit variance,

    n(r) = sum_k a^k w_k G(r 2^k/cell) / sqrt(sum_k a^2k var G),    a = 2^(-(beta - 1)/2)                        (1)
    tau(r) = tau_mean max(n - t, 0)/E[n - t | n > t],    P(n > t) = cover,    n taken as normal                   (2)

so that power falls as k^-beta; w_k fades octaves out that are finer than the footprint of what samples them. Where a
random number comes from a hash of (key, octave, lattice point).

Light. Half of what droplets take out of a beam is diffracted, into a lobe a few degrees wide, and half is refracted.
Both lobes are Henyey-Greenstein's, P(c; g) = (1 - g^2)/(1 + g^2 - 2 g c)^(3/2), of which n in a row make P(c; g^n):

    g_d = 1 - z/(sqrt(3) x),  J_0(z)^2 + J_1(z)^2 = 1/2,  x = 2 pi r/lambda,     g_r = 2 g - g_d                    (3)
    beam      exp(-tau/mu_0)                                                                                    (4)
    aureole   P(c; g_d^m)/4 (exp(-t) - exp(-tau/mu)),     t = tau/2mu,  m = t/(1 - exp(-t))                       (5)
    lobe      P(c; g_r)/4 t (exp(-t_0) - exp(-t))/(t - t_0),    t_0 = tau/2mu_0     (scattered once)              (6)
    diffuse   mu_0 (T - exp(-t_0)(1 + F t_0)),  not below 0,    T = 1/(1 + 3/4 (1 - g) tau)                       (7)

with c the cosine of the angle from the Sun, mu and mu_0 the cosines of incidence of sight and Sun, F the forward half
of the refracted lobe and T the two-stream transmittance of a layer that absorbs nothing. Half of the diffracted light
is within the same angle as in the Airy pattern, 1.7/x. Radiances are relative: 1 is a white Lambertian surface in
normal sunlight. Beam, aureole, lobe and diffuse light together bring T mu_0 to a level surface, to an eighth.

Not modelled: ice (halos, mock suns), rainbow and corona's rings, absorption, light that wanders sideways from one part
of the layer to another (each ray meets a layer that is as thick everywhere as where it crosses), cloud sides, drift.
The sum of octaves is normal to a percent of cover.
Sources: Perlin 2002 (gradient noise); Cahalan & Snider 1989 (exponent 5/3 of cloud liquid water); van de Hulst, Light
Scattering by Small Particles, sections 8.2 and 12.3 (half is diffracted, Airy); Kattawar 1975 (sums of
Henyey-Greenstein lobes); Bohren 1987 (two-stream transmittance); Steele, Lea & Flood 2014 (hash).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from dockair.kernels import njit
from dockair.rotations import Array

_OCTAVES = 12  # 2048:1; the footprint ends the sum earlier
_FINEST = 2.0  # lattice over footprint at which an octave has faded out, from twice that on
_THICKEST = 4.0  # standard deviations that the threshold keeps away from an endless one (cover 0 or 1)
_AIRY_HALF = 1.6802  # z of Eq. (3)
_DIFFRACTED = 0.5  # share of the extinction: geometric optics' paradox
_TURN = math.cos(0.65), math.sin(0.65)  # octave against octave, so that their lattices do not line up


@dataclass(frozen=True, slots=True, kw_only=True)
class Texture:
    """A random field over the plane, Eq. (1)."""

    key: int
    cell_m: float  #: lattice of the coarsest octave
    spectral_exponent: float  #: beta

    def at(self, x_m: Array, y_m: Array, footprint_m: Array) -> Array:
        """Return (n,) values, mean 0 and variance 1 but for the octaves finer than the footprint.

        Args:
            x_m: (n,) place in the plane.
            y_m: (n,).
            footprint_m: (n,) distance in the plane between samples.
        """
        out = np.empty(len(x_m))
        gain = 2.0 ** (-0.5 * (self.spectral_exponent - 1.0))
        scale = math.sqrt((1.0 - gain**2) / _NOISE_VARIANCE)
        _fractal(x_m / self.cell_m, y_m / self.cell_m, self.cell_m / footprint_m, gain, np.uint64(self.key), out)
        return scale * out


def optical_depth(noise: Array, cover: float, mean_depth: float) -> Array:
    """Return (n,) optical depths, Eq. (2), from the values of a `Texture`.

    Args:
        noise: (n,).
        cover: share of the layer where the depth is positive, 0 to 1.
        mean_depth: mean over that share.
    """
    if cover <= 0.0:
        return np.zeros_like(noise)
    threshold = float(np.clip(ndtri(1.0 - min(cover, 1.0)), -_THICKEST, _THICKEST))
    mean_excess = math.exp(-0.5 * threshold**2) / math.sqrt(2.0 * math.pi) / float(ndtr(-threshold)) - threshold
    return np.asarray(mean_depth / mean_excess * np.maximum(noise - threshold, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Droplets:
    """What a cloud is made of."""

    asymmetry: float  #: g, mean cosine of the scattering angle, diffraction included
    size_parameter: float  #: x, circumference over wavelength

    @property
    def lobes(self) -> tuple[float, float]:
        """g_d and g_r, Eq. (3)."""
        diffracted = 1.0 - _AIRY_HALF / (math.sqrt(3.0) * self.size_parameter)
        return diffracted, (self.asymmetry - _DIFFRACTED * diffracted) / (1.0 - _DIFFRACTED)

    def transmittance(self, depth: Array) -> Array:
        """Return the flux, beam and all, that comes through: T of Eq. (7)."""
        return np.asarray(1.0 / (1.0 + 0.75 * (1.0 - self.asymmetry) * depth))

    def aureole(self, depth: Array, mu: Array, cosine: Array) -> Array:
        """Return (n,) relative radiance of the diffracted light, Eq. (5).

        Args:
            depth: (n,) optical depth of the layer.
            mu: (n,) cosine of the incidence of the line of sight.
            cosine: (n,) of the angle from the Sun.
        """
        t = _DIFFRACTED * depth / mu
        orders = np.where(t > 1e-6, t / -np.expm1(-np.maximum(t, 1e-6)), 1.0)
        return np.asarray(0.25 * lobe(cosine, self.lobes[0] ** orders) * -np.exp(-t) * np.expm1(-t))

    def diffuse(self, depth: Array, mu: Array, mu_0: float, cosine: Array) -> Array:
        """Return (n,) relative radiance of all other scattered light, Eqs. (6) and (7); arguments as `aureole`."""
        g = self.lobes[1]
        t, t_0 = (1.0 - _DIFFRACTED) * depth / mu, (1.0 - _DIFFRACTED) * depth / mu_0
        apart = np.where(np.abs(t - t_0) > 1e-6, t - t_0, 1e-6)
        once = 0.25 * lobe(cosine, np.asarray(g)) * t * (np.exp(apart - t) - np.exp(-t)) / apart
        rest = self.transmittance(depth) - np.exp(-t_0) * (1.0 + forward_half(g) * t_0)
        return np.asarray(once + mu_0 * np.maximum(rest, 0.0))


def lobe(cosine: Array, g: Array) -> Array:
    """Return Henyey-Greenstein's P(c; g), whose mean over the sphere is 1."""
    q = 1.0 + g * g - 2.0 * g * cosine
    return np.asarray((1.0 - g * g) / (q * np.sqrt(q)))


def forward_half(g: float) -> float:
    """Return the share of the lobe within 90 degrees, 0 < g < 1."""
    return (1.0 + g) / (2.0 * g) * (1.0 - (1.0 - g) / math.sqrt(1.0 + g * g))


def _noise_variance() -> float:
    """Mean square of the gradient noise: 4 corners, gradients' components uniform in [-1, 1]."""
    x, weight = np.polynomial.legendre.leggauss(12)
    x = 0.5 * (x + 1.0)
    fade = 1.0 - x * x * x * (x * (6.0 * x - 15.0) + 10.0)
    flat, sloped = 0.5 * float(weight @ fade**2), 0.5 * float(weight @ (fade * x) ** 2)
    return 8.0 / 3.0 * flat * sloped


_NOISE_VARIANCE = _noise_variance()


@njit(cache=True)
def _gradient(i: int, j: int, seed: np.uint64, x: float, y: float) -> float:
    """Product of the lattice point's random gradient with the way (x, y) from it."""
    h = seed ^ (np.uint64(i) * np.uint64(0x9E3779B97F4A7C15)) ^ (np.uint64(j) * np.uint64(0xC2B2AE3D27D4EB4F))
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    h = h ^ (h >> np.uint64(31))
    g_x = float(h & np.uint64(0xFFFFFFFF)) * 2.0**-31 - 1.0
    g_y = float(h >> np.uint64(32)) * 2.0**-31 - 1.0
    return g_x * x + g_y * y


@njit(cache=True)
def _noise(u: float, v: float, seed: np.uint64) -> float:
    i, j = math.floor(u), math.floor(v)
    x, y = u - i, v - j
    i, j = int(i), int(j)
    p = x * x * x * (x * (6.0 * x - 15.0) + 10.0)
    q = y * y * y * (y * (6.0 * y - 15.0) + 10.0)
    a, b = _gradient(i, j, seed, x, y), _gradient(i + 1, j, seed, x - 1.0, y)
    c, d = _gradient(i, j + 1, seed, x, y - 1.0), _gradient(i + 1, j + 1, seed, x - 1.0, y - 1.0)
    return (1.0 - q) * (a + p * (b - a)) + q * (c + p * (d - c))


@njit(cache=True)
def _fractal(u: Array, v: Array, size: Array, gain: float, key: np.uint64, out: Array) -> None:
    """Sum of Eq. (1), not normalised; (u, v) and the inverse of the footprint in coarsest cells."""
    cos, sin = _TURN
    for n in range(len(out)):
        total, amplitude, x, y, cells = 0.0, 1.0, u[n], v[n], size[n]
        for octave in range(_OCTAVES):
            if cells <= _FINEST:
                break
            seed = (key + np.uint64(octave)) * np.uint64(0xD1342543DE82EF95)
            total += amplitude * min(cells / _FINEST - 1.0, 1.0) * _noise(x, y, seed)
            x, y = 2.0 * (cos * x - sin * y) + 0.37, 2.0 * (sin * x + cos * y) + 0.71
            amplitude, cells = gain * amplitude, 0.5 * cells
        out[n] = total
