"""Which ring of LEDs shows the drogue's pose best over the approach: the bound, ring by ring, node by node.

A node is a range and a tilt of the drogue, seen in the middle of the image; of several directions of the tilt the worst
counts. For each ring and node: the Cramer-Rao bound (`nav.dop.bound`) of range, lateral and attitude of the drogue seen
from the camera and of the camera seen from the drogue, LEDs beyond the sensor's edge left out; and what the second
minimum of a flat or nearly flat ring costs in chi^2 (`nav.pose.planar`), which says how soon a frame alone is trusted.

    gain of a ring = exp mean over nodes and quantities ln(sigma of the default ring / its sigma)         (1)
    P(noise makes the second minimum the cheaper) = Phi(-chi/2)                                           (2)

(2) is of noise along the difference of the two images, which is chi long; that both minima move with it is left out.

Rings have `rim` LEDs on the rim, evenly spaced or with one displaced so that the image tells its numbering, and `inner`
ones ahead of or behind the rim's plane: ahead, on the ribs that narrow to the coupling's mouth; behind, on stalks.

Not modelled: the same pixel sigma for all LEDs and ranges; LEDs hidden by rim, ribs or probe; the LEDs' beam; errors of
calibration. Identification (`nav.identify`) knows flat rings of eight.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import product
from typing import Any

import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.dop.bound import PoseBound, pose_bound
from dockair.nav.dop.dilution import DopStatus
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.nav.pose.planar import mirrored
from dockair.parameters import read_sheet
from dockair.rotations import Array, exp

SPACINGS = ("equal", "coded")
_CODE_SHIFT = 4.0 / 15.0  # of the spacing, 12 deg of 45: far enough off its place to be told from it
_DIRECTIONS = 5  # of the tilt; no ring's symmetry but of five LEDs repeats itself in them
_SECOND_MINIMUM = 0.25  # of the tilt; a descent that ends nearer to the true attitude has found the same minimum
_SURE_CHI2 = 55.0  # a second minimum that costs so much is taken in error once in 10^4 frames, Eq. (2)
_MOST_RINGS = 400  # some ten seconds

#: What is bounded, in the order of the columns: name, property of the bound.
QUANTITIES = {
    "range_m": "range_sigma_m",
    "lateral_m": "lateral_sigma_m",
    "attitude_rad": "attitude_sigma_rad",
    "camera_range_m": "camera_range_sigma_m",
    "camera_lateral_m": "camera_lateral_sigma_m",
}
#: What a ranking can go by.
RANKINGS = {
    "all": ("range_m", "lateral_m", "attitude_rad"),
    "range": ("range_m",),
    "lateral": ("lateral_m",),
    "attitude": ("attitude_rad",),
    "camera": ("camera_lateral_m",),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RingDesign:
    """A ring as one would build it."""

    rim: int = 8  #: LEDs on the rim
    diameter_m: float = 0.5
    spacing: str = "equal"
    inner: int = 0  #: LEDs off the rim's plane
    depth_m: float = 0.0  #: of those, forward along the drogue's x; behind the rim when negative

    @property
    def points_D(self) -> Array:
        """(rim + inner, 3) LEDs in drogue axes [m]."""
        even = 360.0 / self.rim * np.arange(self.rim)
        if self.spacing == "coded":
            even[-1] -= _CODE_SHIFT * 360.0 / self.rim
        rim = LedRing(diameter_m=self.diameter_m, count=self.rim, angles_deg=tuple(even.tolist())).positions_D
        angle = 2.0 * np.pi * np.arange(self.inner) / max(self.inner, 1) + np.pi / self.rim
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        inner = np.column_stack([np.full(self.inner, self.depth_m), inner_radius(self) * circle])
        return np.vstack([rim, inner])

    @property
    def label(self) -> str:
        """Return it in words."""
        leds = f"{self.rim}" if self.inner == 0 else f"{self.rim} + {self.inner} at {self.depth_m:+g} m"
        return f"{leds}, {self.diameter_m:g} m, {self.spacing}"


def inner_radius(design: RingDesign) -> float:
    """Radius of the circle of inner LEDs: that of the ribs at their depth; behind the rim's plane the rim's [m]."""
    drogue, coupling = read_sheet("drogue"), read_sheet("coupling")
    rim_x, throat_x = drogue["rim_x_m"].value, drogue["throat_x_m"].value
    throat = coupling["socket_radius_m"].value + drogue["rib_radius_m"].value
    return float(np.interp(design.depth_m, [rim_x, throat_x], [0.5 * design.diameter_m, throat]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Corridor:
    """The nodes, and what looks."""

    ranges_m: Array  #: (r,)
    tilts_rad: Array  #: (t,) of the drogue's axis against the line of sight
    camera: Camera = field(default_factory=Camera)
    sigma_px: float = 0.1

    def attitudes(self, tilt_rad: float) -> list[Array]:
        """R_CD of one tilt in several directions."""
        angles = 2.0 * np.pi * np.arange(_DIRECTIONS if tilt_rad > 0.0 else 1) / _DIRECTIONS
        return [exp(tilt_rad * np.array([0.0, np.cos(angle), np.sin(angle)])) for angle in angles]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingMap:
    """A ring over the corridor."""

    design: RingDesign
    sigma: Mapping[str, Array]  #: by quantity, (r, t) [m] or [rad], the worst direction; inf where the pose is not seen
    mirror_chi2: Array  #: (r, t) what the second minimum costs, the worst direction; inf where there is none

    @property
    def blind(self) -> int:
        """Nodes at which it does not show the pose."""
        return int(np.isinf(self.sigma["range_m"]).sum())

    @property
    def ambiguous(self) -> float:
        """Share of the tilted nodes at which one frame may be taken for its mirror image."""
        return float((self.mirror_chi2 < _SURE_CHI2).mean()) if self.mirror_chi2.size else 0.0

    def gain(self, default: "RingMap", quantities: Iterable[str]) -> float:
        """Eq. (1) over the nodes that both show."""
        names = list(quantities)
        ours, theirs = (np.array([ring.sigma[name] for name in names]) for ring in (self, default))
        both = np.isfinite(ours) & np.isfinite(theirs)
        return float(np.exp(np.log(theirs[both] / ours[both]).mean())) if both.any() else 0.0


def designs(
    rims: Sequence[int],
    diameters_m: Sequence[float],
    spacings: Sequence[str],
    inners: Sequence[int],
    depths_m: Sequence[float],
) -> list[RingDesign]:
    """Return every combination, the default ring first; depths matter to rings with inner LEDs alone.

    Raises:
        DockairError: more than can be waited for.
    """
    found = [RingDesign()]
    for rim, diameter, spacing, inner in product(rims, diameters_m, spacings, inners):
        for depth in depths_m if inner else (0.0,):
            found.append(RingDesign(rim=rim, diameter_m=diameter, spacing=spacing, inner=inner, depth_m=depth))
    unique = list(dict.fromkeys(found))
    if len(unique) > _MOST_RINGS:
        raise DockairError("design-ring", expected=f"at most {_MOST_RINGS} rings", got=len(unique))
    return unique


def map_ring(design: RingDesign, corridor: Corridor) -> RingMap:
    """Return the bound of one ring over the corridor."""
    points, shape = design.points_D, (len(corridor.ranges_m), len(corridor.tilts_rad))
    sigma = {name: np.zeros(shape) for name in QUANTITIES}
    mirror = np.full(shape, np.inf)
    for i, range_m in enumerate(corridor.ranges_m):
        p_CD = np.array([range_m, 0.0, 0.0])
        for j, tilt in enumerate(corridor.tilts_rad):
            for R_CD in corridor.attitudes(tilt):
                bound = pose_bound(points, R_CD, p_CD, corridor.camera, corridor.sigma_px)
                for name, of in QUANTITIES.items():
                    value = getattr(bound, of) if bound.status is DopStatus.SOLVED else np.inf
                    sigma[name][i, j] = max(sigma[name][i, j], value)
                if tilt > 0.0 and bound.status is DopStatus.SOLVED:
                    mirror[i, j] = min(mirror[i, j], _mirror_chi2(points[bound.seen], R_CD, p_CD, corridor))
    return RingMap(design=design, sigma=sigma, mirror_chi2=mirror[:, corridor.tilts_rad > 0.0])


def _mirror_chi2(points: Array, R_CD: Array, p_CD: Array, corridor: Corridor) -> float:
    """Cost of the minimum that the mirrored attitude leads to, without noise; inf when that is the true one."""
    pixels = corridor.camera.pixels_from_points(points @ R_CD.T + p_CD)
    sight = lines_of_sight_from_pixels(pixels, points, corridor.camera, np.full(len(points), corridor.sigma_px))
    end = levenberg_marquardt(sight, *mirrored(R_CD, p_CD, points))
    tilt = float(np.arccos(np.clip(R_CD[0, 0], -1.0, 1.0)))
    turn = pose_difference(end.R_CD, end.p_CD, R_CD, p_CD)[:3]
    another = float(np.linalg.norm(turn)) > _SECOND_MINIMUM * tilt
    return float(end.cost) if end.converged and another else np.inf


def bound_at(design: RingDesign, corridor: Corridor, range_m: float, tilt_rad: float = 0.0) -> PoseBound:
    """Return the bound of one node, the tilt about the camera's y axis."""
    R_CD = exp(np.array([0.0, tilt_rad, 0.0]))
    return pose_bound(design.points_D, R_CD, np.array([range_m, 0.0, 0.0]), corridor.camera, corridor.sigma_px)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ranking:
    """Rings, the best first; of those that are blind somewhere the least blind first, and after all others."""

    by: str
    corridor: Corridor
    default: RingMap
    maps: list[RingMap]
    gains: list[float]  #: of each, Eq. (1)
    at_range_m: float  #: of the figures of single nodes

    def to_dict(self, top: int) -> dict[str, Any]:
        """Return the first `top` rings and the default ring as one JSON object."""
        shown = [k for k, ring in enumerate(self.maps) if k < top or ring is self.default]
        corridor = self.corridor
        return {
            "by": self.by,
            "sigma_px": corridor.sigma_px,
            "ranges_m": corridor.ranges_m.tolist(),
            "tilts_deg": np.rad2deg(corridor.tilts_rad).tolist(),
            "at_range_m": self.at_range_m,
            "compared": len(self.maps),
            "rings": [self._entry(k) for k in shown],
        }

    def _entry(self, k: int) -> dict[str, Any]:
        ring = self.maps[k]
        return {
            "rank": k + 1,
            "ring": ring.design.label,
            "default": ring is self.default,
            **asdict(ring.design),
            "points_D_m": ring.design.points_D.tolist(),
            "gain": self.gains[k],
            "gains": {name: ring.gain(self.default, quantities) for name, quantities in RANKINGS.items()},
            "blind_nodes": ring.blind,
            "ambiguous_share": ring.ambiguous,
            "frontal": self.frontal(ring),
            "sigma": {name: _finite_or_none(values) for name, values in ring.sigma.items()},
            "mirror_chi2": _finite_or_none(ring.mirror_chi2),
        }

    def frontal(self, ring: RingMap) -> dict[str, float | None]:
        """Bound of the frontal drogue at `at_range_m`; None where the pose is not seen."""
        bound = bound_at(ring.design, self.corridor, self.at_range_m)
        solved = bound.status is DopStatus.SOLVED
        return {name: getattr(bound, of) if solved else None for name, of in QUANTITIES.items()}


def rank(rings: Sequence[RingDesign], corridor: Corridor, by: str, at_range_m: float) -> Ranking:
    """Map every ring over the corridor and order them; the first ring is the default that gains are counted from."""
    maps = [map_ring(ring, corridor) for ring in rings]
    gains = {id(ring): ring.gain(maps[0], RANKINGS[by]) for ring in maps}
    ordered = sorted(maps, key=lambda ring: (ring.blind, -gains[id(ring)]))
    return Ranking(
        by=by,
        corridor=corridor,
        default=maps[0],
        maps=ordered,
        gains=[gains[id(ring)] for ring in ordered],
        at_range_m=at_range_m,
    )


def _finite_or_none(values: Array) -> list[list[float | None]]:
    return [[float(value) if np.isfinite(value) else None for value in row] for row in values]
