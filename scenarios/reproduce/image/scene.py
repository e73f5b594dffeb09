"""Candidates of an image that is never rendered: eight LEDs of a ring and noise blobs, as the source simulates them."""

from dataclasses import dataclass

import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.rotations import Array, matrix_from_yaw_pitch_roll

SIZE_PX = (512, 384)  # width, height of the part of a frame that is looked at
CENTRE_PX = np.array([250.3, 190.7])
CAMERA = Camera(width_px=SIZE_PX[0], height_px=SIZE_PX[1], principal_point_px=(0.5 * SIZE_PX[0], 0.5 * SIZE_PX[1]))
_RADIUS_PX = (45.0, 120.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """Candidates, the LEDs first."""

    points: Array  #: (8 + n, 2)
    centre_px: Array  #: (2,) of the ring
    radius_px: float  #: that a frontal ring would have there


def ring_points(radius_px: float, centre_px: Array = CENTRE_PX) -> Array:
    """(8, 2) a frontal ring."""
    angle = np.arange(8) * np.pi / 4.0
    return centre_px + radius_px * np.column_stack([np.cos(angle), np.sin(angle)])


def random_scene(
    rng: np.random.Generator,
    noise_blobs: int,
    *,
    radius_px: float | None = None,
    tilt_rad: float = 0.0,
    noise_px: float = 0.0,
) -> Scene:
    """A ring that lies wholly in the image, and blobs anywhere but on its LEDs.

    Args:
        rng: draws everything.
        noise_blobs: how many.
        radius_px: None for a random one.
        tilt_rad: largest pitch and yaw; roll is any.
        noise_px: of the LEDs.
    """
    radius = float(rng.uniform(*_RADIUS_PX)) if radius_px is None else radius_px
    range_m = CAMERA.focal_length_px * 0.5 * LedRing().diameter_m / radius
    yaw, pitch = rng.uniform(-tilt_rad, tilt_rad, 2)
    R_CD = matrix_from_yaw_pitch_roll(float(yaw), float(pitch), float(rng.uniform(-np.pi, np.pi)))
    margin = 1.15 * radius
    u, v = rng.uniform([margin, margin], [SIZE_PX[0] - margin, SIZE_PX[1] - margin])
    ray = CAMERA.rays_from_pixels(np.array([[u, v]]))[0]
    p_CD = range_m * ray / ray[0]
    leds = CAMERA.pixels_from_points(p_CD + LedRing().positions_D @ R_CD.T)
    leds = leds + noise_px * rng.standard_normal(leds.shape)
    noise = rng.uniform([0.0, 0.0], SIZE_PX, (4 * noise_blobs + 8, 2))
    noise = noise[(np.linalg.norm(noise[:, None] - leds, axis=2) > 6.0).all(axis=1)][:noise_blobs]
    return Scene(points=np.concatenate([leds, noise]), centre_px=np.array([u, v]), radius_px=radius)
