"""Candidates to identify a ring among: random drogues with clutter, and crowds of forty made to take long.

Drogues at 2 to 30 m anywhere in the field of view, axis up to 30 degrees off the camera's, any roll, 0.1 px of noise;
clutter uniform over the frame, or within some radii of the ring's centre. LEDs are as bright as 2:1 bins make them,
clutter is anything within a factor of 100 (rendered frames: 150); the two are independent of place.
"""

from collections.abc import Callable

import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.rotations import Array, exp

_RANGE_M, _TILT_RAD, _SIGMA_PX = (2.0, 30.0), np.deg2rad(30.0), 0.1
_BIN, _SPREAD = (2.0 / 3.0, 4.0 / 3.0), 0.1  # of an LED's flux: bin, and what the pattern and noise add
_CLUTTER_DECADES = (-1.0, 1.0)
_SHIFT_PX, _SIZE, _ROLL_RAD = 4.0, 0.01, np.deg2rad(1.0)  # standard deviations of a prediction
CROWD = 40


def _led_pixels(centre_px: Array, range_m: float, rng: np.random.Generator, roll: float | None = None) -> Array:
    """(8, 2) LEDs of a ring seen at a pixel, of any tilt allowed and of any roll if none is given."""
    camera = Camera()
    ray = camera.rays_from_pixels(centre_px[None])[0]
    axis, any_roll = rng.uniform(-np.pi, np.pi, 2)
    tilt = exp(rng.uniform(0.0, _TILT_RAD) * np.array([0.0, np.cos(axis), np.sin(axis)]))
    R_CD = tilt @ exp(np.array([any_roll if roll is None else roll, 0.0, 0.0]))
    return camera.pixels_from_points(range_m * ray / ray[0] + LedRing().positions_D @ R_CD.T)


class Scene:
    """One case: candidates in random order, and which LED each of them is (-1 for clutter)."""

    def __init__(
        self, rng: np.random.Generator, visible: int = 8, clutter: int = 0, near_radii: float | None = None
    ) -> None:
        camera, ring = Camera(), LedRing()
        frame = np.array([camera.width_px - 1.0, camera.height_px - 1.0])
        while True:
            range_m, self.centre_px = rng.uniform(*_RANGE_M), rng.uniform(0.0, frame)
            self.led_px: Array = _led_pixels(self.centre_px, range_m, rng)
            if ((self.led_px > 0.0) & (self.led_px < frame)).all():
                break
        self.radius_px: float = camera.focal_length_px * 0.5 * ring.diameter_m / range_m
        low, high = np.zeros(2), frame
        if near_radii is not None:
            low, high = (self.centre_px + side * near_radii * self.radius_px for side in (-1.0, 1.0))
        seen = rng.permutation(ring.count)[:visible]
        noise = _SIGMA_PX * rng.standard_normal((visible, 2))
        points = np.vstack([self.led_px[seen] + noise, rng.uniform(low, high, (clutter, 2))])
        order = rng.permutation(len(points))
        self.points, self.visible = points[order], visible
        self.numbers = np.concatenate([seen, np.full(clutter, -1)])[order]
        led = rng.uniform(*_BIN, len(points)) * np.exp(_SPREAD * rng.standard_normal(len(points)))
        other = 10.0 ** rng.uniform(*_CLUTTER_DECADES, len(points))
        self.flux: Array = np.where(self.numbers >= 0, led, other)
        self.predicted_px = self._prediction(rng)
        self.sigma_px = _SHIFT_PX

    def _prediction(self, rng: np.random.Generator) -> Array:
        """Where a track expects the LEDs: shifted, scaled and turned a little."""
        angle = _ROLL_RAD * rng.standard_normal()
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        size, shift = 1.0 + _SIZE * rng.standard_normal(), _SHIFT_PX * rng.standard_normal(2)
        return np.asarray(self.centre_px + size * (self.led_px - self.centre_px) @ turn.T + shift)


def _ring(centre_px: Array, radius_px: float, rng: np.random.Generator, roll: float | None = None) -> Array:
    """(8, 2) a ring of that size if it were frontal."""
    return _led_pixels(centre_px, Camera().focal_length_px * 0.5 * LedRing().diameter_m / radius_px, rng, roll)


def _place(rng: np.random.Generator, margin_px: float = 200.0) -> Array:
    camera = Camera()
    return np.asarray(rng.uniform(margin_px, np.array([camera.width_px, camera.height_px]) - margin_px))


def _size(rng: np.random.Generator, low_px: float, high_px: float) -> float:
    return float(np.exp(rng.uniform(np.log(low_px), np.log(high_px))))


def _frame(rng: np.random.Generator) -> Array:
    visible = int(rng.integers(4, 9))
    return Scene(rng, visible, CROWD - visible).points


def _near(rng: np.random.Generator) -> Array:
    visible = int(rng.integers(4, 9))
    return Scene(rng, visible, CROWD - visible, 1.5).points


def _disc(rng: np.random.Generator) -> Array:
    angle, radius = rng.uniform(0.0, 2.0 * np.pi, (CROWD, 1)), _size(rng, 15.0, 500.0)
    distance = radius * np.sqrt(rng.uniform(0.0, 1.0, (CROWD, 1)))
    return np.asarray(_place(rng) + distance * np.column_stack([np.cos(angle), np.sin(angle)]))


def _grid(rng: np.random.Generator) -> Array:
    columns, step = int(rng.integers(5, 9)), _size(rng, 5.0, 120.0)
    v, u = np.divmod(np.arange(CROWD), columns)
    return _place(rng, 100.0) + step * np.column_stack([u, v]) + _noise(rng)


def _noise(rng: np.random.Generator) -> Array:
    return float(rng.choice([0.0, _SIGMA_PX, 1.0])) * rng.standard_normal((CROWD, 2))


def _line(rng: np.random.Generator) -> Array:
    return _place(rng) + rng.uniform(-300.0, 300.0, CROWD)[:, None] * rng.standard_normal(2) + _noise(rng)


def _circle(rng: np.random.Generator) -> Array:
    angle = np.arange(CROWD) * 2.0 * np.pi / CROWD
    return _place(rng) + _size(rng, 12.0, 500.0) * np.column_stack([np.cos(angle), np.sin(angle)]) + _noise(rng)


def _concentric(rng: np.random.Generator) -> Array:
    centre, largest, ratio = _place(rng), _size(rng, 100.0, 300.0), rng.uniform(1.05, 1.6)
    roll = None if rng.random() < 0.5 else 0.1
    return np.vstack([_ring(centre, largest / ratio**k, rng, roll) for k in range(5)]) + _noise(rng)


def _rings(rng: np.random.Generator) -> Array:
    return np.vstack([_ring(_place(rng), _size(rng, 12.0, 200.0), rng) for _ in range(5)]) + _noise(rng)


def _overlapping(rng: np.random.Generator) -> Array:
    centre, radius = _place(rng), _size(rng, 12.0, 120.0)
    apart = radius * float(rng.choice([0.02, 0.2, 1.0]))
    return np.vstack([_ring(centre + rng.uniform(-apart, apart, 2), radius, rng) for _ in range(5)]) + _noise(rng)


def _rings_of_five(rng: np.random.Generator) -> Array:
    """Eight rings none of which is whole."""
    rings = [_ring(_place(rng), _size(rng, 12.0, 200.0), rng)[rng.permutation(8)[:5]] for _ in range(8)]
    return np.vstack(rings) + _noise(rng)


def _five_at_each_led(rng: np.random.Generator) -> Array:
    ring = _ring(_place(rng), _size(rng, 12.0, 400.0), rng)
    return np.vstack([ring] * 5) + float(rng.choice([0.0, 0.1, 1.0, 5.0])) * rng.standard_normal((CROWD, 2))


def _clusters(rng: np.random.Generator) -> Array:
    centres = np.array([_place(rng) for _ in range(int(rng.integers(3, 12)))])
    return centres[rng.integers(0, len(centres), CROWD)] + rng.uniform(2.0, 60.0) * rng.standard_normal((CROWD, 2))


#: crowds of forty candidates (40, 2) by name
CROWDS: dict[str, Callable[[np.random.Generator], Array]] = {
    "ring, clutter over the frame": _frame,
    "ring, clutter within 1.5 radii": _near,
    "disc": _disc,
    "grid": _grid,
    "line": _line,
    "forty on a circle": _circle,
    "five rings": _rings,
    "five concentric rings": _concentric,
    "five overlapping rings": _overlapping,
    "eight rings of five": _rings_of_five,
    "five blobs at each LED": _five_at_each_led,
    "clusters": _clusters,
}
