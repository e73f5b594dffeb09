"""Sunlight through cloud and haze, over the Sun's disc: what all of the disc does is by the mean of its rays.

    mean of beam(d) over rays that each stand for the same solid angle                                           (1)

with beam(d) the transmittance along the ray d. Edges of cloud cross the disc; one ray to its centre would be all or
nothing.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dockair.rotations import Array

_RINGS = 4  # with 6, 12, 18, 24 rays, as their areas are: 60 rays resolve 2 % of the disc


class Beam(Protocol):
    """What is asked of the sky: `dockair.sim.camera.sky.Sky`."""

    def beam(self, directions_W: Array) -> Array:
        """(n,) transmittance of sunlight from directions (n, 3)."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SunBeam:
    """The rays to the Sun's disc, and what comes along each."""

    directions_W: Array  #: (n, 3) unit vectors, each standing for the same solid angle
    beams: Array  #: (n,) transmittance along each

    @classmethod
    def of(cls, sky: Beam, sun_W: Array, radius_rad: float) -> "SunBeam":
        """Of a disc of so many radians about (3,) the unit vector toward its centre."""
        directions = _disc_directions(sun_W, radius_rad)
        return cls(directions_W=directions, beams=sky.beam(directions))

    @property
    def mean(self) -> float:
        """Part of the sunlight that comes through, Eq. (1)."""
        return float(self.beams.mean())


def _disc_directions(axis: Array, radius_rad: float) -> Array:
    """(n, 3) unit vectors over a cone of half-angle radius_rad, each standing for the same solid angle."""
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= np.linalg.norm(across)
    basis = np.column_stack([across, np.cross(axis, across)])
    per_ring = 6 * np.arange(1, _RINGS + 1)
    edges = np.sqrt(np.concatenate([[0], np.cumsum(per_ring)]) / per_ring.sum())
    radius = radius_rad * np.repeat(np.sqrt(0.5 * (edges[:-1] ** 2 + edges[1:] ** 2)), per_ring)
    angle = np.concatenate([2.0 * np.pi * (np.arange(n) + 0.5) / n for n in per_ring])
    offsets = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]) @ basis.T
    directions = axis + offsets
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))
