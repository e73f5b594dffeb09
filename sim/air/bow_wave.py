"""The receiver's bow wave: a Rankine half-body about its nose.

A source in the stream V, so strong that the body it makes has the radius R far behind, sends out

    u = V R^2/4  r/|r|^3                                                                                 (1)

at r from the source. The stream comes to rest R/2 ahead of it, where the nose is; the body's surface lies at

    |r| = (R/2) / cos(theta/2),      theta from the direction of flight                                   (2)

Inside the sphere of radius R/2 about the source, which the body holds, u falls linearly to nothing at its middle: no
point of hose or drogue gets there but through the receiver, and none is blown away without bound.

Frame: B, body axes of the receiver; the source stands R/2 behind the nose along -x. V is the trim airspeed.
Not modelled: the nose's own shape (a real one is more slender: less push close to it), canopy, wings, incidence of the
fuselage, compressibility (at Mach 0.57 the push abeam is 1/sqrt(1 - M^2), 20 per cent, stronger), what the drogue's own
wake does to the receiver.
Source: potential flow, as [Dai, Wei & Quan 2016] with one source in place of their several.
"""

from dataclasses import dataclass

import numpy as np

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BowWaveParameters:
    """assets/parameters/bow_wave.toml."""

    radius_m: float  #: R
    nose_behind_tip_m: float  #: tip of the nose behind the probe's, along x of B
    nose_height_m: float  #: above the centre of gravity, along z of B


def bow_wave_coefficients(parameters: BowWaveParameters, p_BP: Array, airspeed_m_s: float) -> Array:
    """(5,) source's place in B, V R^2/4, R/2: what `bow_wave_velocity` needs.

    Args:
        parameters: sheet `bow_wave`.
        p_BP: (3,) the probe's tip in B [m].
        airspeed_m_s: V, true.

    Raises:
        DockairError: no airspeed.
    """
    if not airspeed_m_s > 0.0:
        raise DockairError("airspeed_m_s", expected="a speed > 0", got=airspeed_m_s)
    R = parameters.radius_m
    x = p_BP[0] - parameters.nose_behind_tip_m - 0.5 * R
    k = np.array([x, 0.0, parameters.nose_height_m, 0.25 * airspeed_m_s * R * R, 0.5 * R])
    k.setflags(write=False)
    return k


@njit(cache=True)
def bow_wave_velocity(points_B: Array, k: Array) -> Array:
    """(n, 3) velocity of the air that the receiver's nose causes at points_B (n, 3) [m], axes B [m/s], Eq. (1)."""
    out = np.empty(points_B.shape)
    write_bow_wave_velocity(points_B, k, out)
    return out


@njit(cache=True)
def write_bow_wave_velocity(points_B: Array, k: Array, out: Array) -> None:
    """`bow_wave_velocity` into an array that is there already (n, 3)."""
    for i in range(points_B.shape[0]):
        x, y, z = points_B[i, 0] - k[0], points_B[i, 1] - k[1], points_B[i, 2] - k[2]
        r = max(np.sqrt(x * x + y * y + z * z), k[4])
        scale = k[3] / (r * r * r)
        out[i, 0], out[i, 1], out[i, 2] = scale * x, scale * y, scale * z
