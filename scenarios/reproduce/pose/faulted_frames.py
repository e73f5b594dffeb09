"""Frames of a ring at random poses, and what can be wrong with one of its LEDs; for the reproductions of integrity."""

from dataclasses import dataclass

import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.nav.pose.estimate import PoseEstimate, solve_pose
from dockair.rotations import Array, exp

CAMERA, RING = Camera(), LedRing().positions_D
SIGMA_PX = 0.1
NEAREST_M, FARTHEST_M = 2.0, 30.0
_TILT_DEG = 20.0
_ASIDE = (0.15, 0.05)  # of the range: the ring stays in the frame from 2 m on


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """One frame before it is tested."""

    R_CD: Array
    p_CD: Array
    points_D: Array  #: (n, 3) LEDs seen [m]
    exact_pixels: Array  #: (n, 2) without noise
    pixels: Array  #: (n, 2) with it, without fault


def draw_frame(rng: np.random.Generator, range_m: float | None = None, count: int = 8) -> Frame:
    """Return a good frame at a range [m], or at any, with so many of the eight LEDs seen."""
    turn = np.deg2rad(rng.uniform(0.0, _TILT_DEG))
    axis, roll = rng.uniform(-np.pi, np.pi, 2)
    R = exp(turn * np.array([0.0, np.cos(axis), np.sin(axis)])) @ exp(np.array([roll, 0.0, 0.0]))
    distance = rng.uniform(NEAREST_M, FARTHEST_M) if range_m is None else range_m
    p = distance * np.array([1.0, rng.uniform(-1.0, 1.0) * _ASIDE[0], rng.uniform(-1.0, 1.0) * _ASIDE[1]])
    points = RING[np.sort(rng.permutation(len(RING))[:count])]
    exact = CAMERA.pixels_from_points(points @ R.T + p)
    noise = SIGMA_PX * rng.standard_normal((count, 2))
    return Frame(R_CD=R, p_CD=p, points_D=points, exact_pixels=exact, pixels=exact + noise)


def solved(frame: Frame, pixels: Array) -> PoseEstimate:
    """Return the pose from pixels (n, 2) of a frame's LEDs."""
    return solve_pose(pixels, frame.points_D, CAMERA, sigma_px=SIGMA_PX)


def random_fault(rng: np.random.Generator, frame: Frame, low_px: float, high_px: float) -> tuple[int, Array]:
    """Return an LED and a fault (2,) [px], both at random."""
    size, direction = rng.uniform(low_px, high_px), rng.uniform(-np.pi, np.pi)
    return int(rng.integers(len(frame.points_D))), size * np.array([np.cos(direction), np.sin(direction)])


def worst_fault(frame: Frame, rows: list[int]) -> tuple[int, Array]:
    """Return LED and fault (2,) [px] of unit length in the residuals that move some rows of (phi, delta) most."""
    step, n = 1e-6, len(frame.points_D)
    A = np.empty((n, 2, 6))
    for j, d in enumerate(step * np.eye(6)):
        ends = [
            CAMERA.pixels_from_points(frame.points_D @ (exp(s * d[:3]) @ frame.R_CD).T + frame.p_CD + s * d[3:])
            for s in (1.0, -1.0)
        ]
        A[:, :, j] = (ends[0] - ends[1]) / (2.0 * step * SIGMA_PX)
    P = np.linalg.inv(np.einsum("nij,nik->jk", A, A))
    effects, faults = [], []
    for A_i in A:
        root = np.linalg.inv(np.linalg.cholesky(np.eye(2) - A_i @ P @ A_i.T)).T
        _, values, axes = np.linalg.svd((P @ A_i.T)[rows] @ root)
        effects.append(values[0])
        faults.append(SIGMA_PX * root @ axes[0])
    led = int(np.argmax(effects))
    return led, faults[led]
