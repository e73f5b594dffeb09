"""A landscape for a walker's camera: textured upright panels, near, middle and far, seen through a pinhole.

Axes: x, y level [m], z up; the camera stands at eye height, looks level along its heading (0 along x, to the left
positive) and turns about the vertical. Panels are drawn from the farthest to the nearest, over a sky that grows
lighter downwards and a ground without texture. Every panel has a texture of its own: random grains of several sizes.
Not modelled: lens, noise, light and shade, people; a walker's camera that nods.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dockair.rotations import Array

_EYE_M = 1.6
_NEAREST_M = 0.3
_TEXTURE_PX = 192
_GRAINS = (2, 5, 12, 32)  # of the textures [texture pixels]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panel:
    """An upright rectangle."""

    left: Array  #: (3,) its lower left corner, seen from its front
    right: Array  #: (3,) its lower right one
    height_m: float
    texture: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Landscape:
    """Panels and the camera that looks at them.

    Args:
        panels: in any order.
        focal_length_px: of the pinhole.
        width_px: of the picture.
        height_px: of the picture.
    """

    panels: tuple[Panel, ...]
    focal_length_px: float = 900.0
    width_px: int = 1280
    height_px: int = 480

    def image(self, x_m: float, y_m: float, heading_rad: float) -> NDArray[np.uint8]:
        """(h, w) picture from a place toward a heading."""
        rows = np.linspace(200.0, 235.0, self.height_px // 2)
        picture = np.full((self.height_px, self.width_px), 90, np.uint8)
        picture[: len(rows)] = rows.astype(np.uint8)[:, None]
        eye = np.array([x_m, y_m, _EYE_M])
        c, s = np.cos(heading_rad), np.sin(heading_rad)
        R = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # level axes along the heading, from the world's
        corners = [(panel, (_corners(panel) - eye) @ R.T) for panel in self.panels]
        for panel, points in sorted(corners, key=lambda each: -float(np.median(each[1][:, 0]))):
            self._draw(picture, panel, points)
        return picture

    def _draw(self, picture: NDArray[np.uint8], panel: Panel, points: Array) -> None:
        if points[:, 0].min() < _NEAREST_M:
            return
        f, u_0, v_0 = self.focal_length_px, 0.5 * (self.width_px - 1), 0.5 * (self.height_px - 1)
        pixels = np.column_stack([u_0 - f * points[:, 1] / points[:, 0], v_0 - f * points[:, 2] / points[:, 0]])
        low, high = np.floor(pixels.min(axis=0)), np.ceil(pixels.max(axis=0))
        u1, v1 = (int(max(c, 0)) for c in low)
        u2, v2 = int(min(high[0], self.width_px - 1)), int(min(high[1], self.height_px - 1))
        if u2 <= u1 or v2 <= v1:
            return
        n = _TEXTURE_PX - 1.0
        texture_corners = np.array([[0.0, n], [n, n], [n, 0.0], [0.0, 0.0]], np.float32)
        H = cv2.getPerspectiveTransform(texture_corners, (pixels - [u1, v1]).astype(np.float32))
        size = (u2 - u1 + 1, v2 - v1 + 1)
        drawn = cv2.warpPerspective(panel.texture, H, size, flags=cv2.INTER_LINEAR)
        inside = np.zeros(drawn.shape, np.uint8)
        cv2.fillConvexPoly(inside, np.round(pixels - [u1, v1]).astype(np.int32), 1)
        cv2.copyTo(drawn, inside, picture[v1 : v2 + 1, u1 : u2 + 1])


def random_landscape(
    seed: int, *, panels: int, distances_m: tuple[float, float], around: Array | None = None
) -> Landscape:
    """Panels about a track, each at a distance from its nearest point that is log-uniform between two.

    Args:
        seed: of places and textures.
        panels: how many.
        distances_m: least and greatest.
        around: (n, 2) the track; by default the origin.
    """
    rng = np.random.default_rng(seed)
    track = np.zeros((1, 2)) if around is None else np.asarray(around)
    made: list[Panel] = []
    while len(made) < panels:
        distance = float(np.exp(rng.uniform(*np.log(distances_m))))
        centre = track[rng.integers(len(track))] + distance * _towards(rng.uniform(-np.pi, np.pi))
        if np.hypot(*(track - centre).T).min() < 0.9 * distance:
            continue
        nearest = track[np.hypot(*(track - centre).T).argmin()] - centre
        facing = np.arctan2(nearest[1], nearest[0]) + rng.uniform(-0.6, 0.6)
        half = 0.5 * distance * rng.uniform(0.06, 0.25) * _towards(facing + 0.5 * np.pi)
        base, height = rng.uniform(-0.3, 0.3) * distance * 0.3, distance * rng.uniform(0.08, 0.3)
        bottom = max(0.0, _EYE_M + base)
        # seen from its front, the right end is clockwise of the left one
        made.append(
            Panel(
                left=np.array([*(centre - half), bottom]),
                right=np.array([*(centre + half), bottom]),
                height_m=height,
                texture=_texture(rng),
            )
        )
    return Landscape(panels=tuple(made))


def _towards(angle_rad: float) -> Array:
    return np.array([np.cos(angle_rad), np.sin(angle_rad)])


def _texture(rng: np.random.Generator) -> NDArray[np.uint8]:
    total = np.zeros((_TEXTURE_PX, _TEXTURE_PX))
    for grain in _GRAINS:
        coarse = rng.uniform(-1.0, 1.0, (_TEXTURE_PX // grain + 1,) * 2)
        total += cv2.resize(coarse, (_TEXTURE_PX, _TEXTURE_PX), interpolation=cv2.INTER_CUBIC)
    total += rng.uniform(-1.0, 1.0)
    return np.clip(128.0 + 45.0 * total, 0.0, 255.0).astype(np.uint8)


def _corners(panel: Panel) -> Array:
    """(4, 3) lower left, lower right, upper right, upper left."""
    up = np.array([0.0, 0.0, panel.height_m])
    return np.array([panel.left, panel.right, panel.right + up, panel.left + up])
