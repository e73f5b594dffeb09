"""The source's experiment on pose: a ring straight ahead of its own axis, seen by a camera of random attitude.

    o = (-R, 0, 0),   C = C_x(roll) C_y(pitch) C_z(yaw),  each angle uniform within 20 degrees       [Yoon 2018, IV.1]

o is the camera in drogue axes, C turns drogue to camera axes. LEDs are seen with Gaussian pixel noise and the pose is
solved by Levenberg-Marquardt with its isotropic weight (eqs 52, 65), from the truth: what is measured is the noise of
the minimum, not the search for it. Steps are taken in local coordinates; in the source's own (p, o) the same minimum is
reached through a curved valley, in more than 200 steps where the two minima of a small far ring nearly merge. Errors
are those of o and of the three angles.
There is no field of view: over half of the trials at 20 degrees have an LED beyond the real sensor's edge.

The pixel noise is not printed, and "drogue size 50 cm" may be a diameter or a radius. Two readings fit the table's y,
z and angles: diameter 0.50 m with 0.00135 px, and radius 0.50 m with 0.0052 px, which fits x too. Both are far below
what a sensor gives, so each ring stands beside itself at 0.1 px.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from dockair.calibration import Camera, LedRing
from dockair.nav.pose.descent import DescentSettings, descend
from dockair.nav.pose.descent_kernels import DIAGONAL
from dockair.nav.pose.measurement import LinesOfSight, isotropic_weights
from dockair.nav.pose.model import LOCAL
from dockair.rotations import Array

TO_THE_MINIMUM = DescentSettings(
    coordinates=LOCAL, damping=DIAGONAL, first_damping=1e-4, tolerance_sigma=1e-6, max_iterations=2000
)
LARGEST_ANGLE_RAD = np.deg2rad(20.0)
COLUMNS = ("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """A way to read the source's set-up."""

    name: str
    diameter_per_size: float  #: 1 when the printed size is a diameter, 2 when it is a radius
    sigma_px: float


DIAMETER = Reading(name="size is the diameter, 0.00135 px", diameter_per_size=1.0, sigma_px=0.00135)
RADIUS = Reading(name="size is the radius, 0.0052 px", diameter_per_size=2.0, sigma_px=0.0052)
DIAMETER_SENSOR = Reading(name="size is the diameter, 0.1 px", diameter_per_size=1.0, sigma_px=0.1)
RADIUS_SENSOR = Reading(name="size is the radius, 0.1 px", diameter_per_size=2.0, sigma_px=0.1)
READINGS = (RADIUS, DIAMETER, RADIUS_SENSOR, DIAMETER_SENSOR)


def errors(reading: Reading, size_m: float, range_m: float, trials: int, rng: np.random.Generator) -> tuple[Array, int]:
    """Return (trials, 6) errors in the order of COLUMNS [m, deg], and how many descents were still on the way.

    These count as they stand: they started on the ridge between the two minima of a flat ring and creep along it.

    Args:
        reading: of size and noise.
        size_m: the printed size of the drogue [m].
        range_m: R [m].
        trials: how many.
        rng: of attitudes and pixel noise.
    """
    camera = Camera()
    points_D = LedRing(diameter_m=reading.diameter_per_size * size_m).positions_D
    weights = isotropic_weights(len(points_D), reading.sigma_px / camera.focal_length_px)
    o = np.array([-range_m, 0.0, 0.0])
    found, on_the_way = np.empty((trials, 6)), 0
    for k in range(trials):
        angles = rng.uniform(-LARGEST_ANGLE_RAD, LARGEST_ANGLE_RAD, 3)
        C = attitude(angles)
        pixels = camera.pixels_from_points((points_D - o) @ C.T)
        pixels += reading.sigma_px * rng.standard_normal(pixels.shape)
        sight = LinesOfSight(
            rays=camera.rays_from_pixels(pixels),
            weights=weights,
            points_D=points_D,
            sigma_px=np.full(len(points_D), reading.sigma_px),
        )
        end = descend(sight, C, -C @ o, TO_THE_MINIMUM)
        found[k, :3] = -end.R_CD.T @ end.p_CD - o
        found[k, 3:] = np.rad2deg(_angles(end.R_CD) - angles)
        on_the_way += not end.converged
    return found, on_the_way


def attitude(roll_pitch_yaw_rad: Array) -> Array:
    """(3, 3) C from z-y-x Euler angles (3,), passive: drogue axes to camera axes."""
    return np.asarray(Rotation.from_euler("ZYX", roll_pitch_yaw_rad[::-1]).as_matrix().T)


def _angles(C: Array) -> Array:
    return np.asarray(Rotation.from_matrix(C.T).as_euler("ZYX"))[::-1]


def rmse(found: Array) -> Array:
    """(6,) root mean square over the trials."""
    return np.asarray(np.sqrt(np.mean(found**2, axis=0)))
