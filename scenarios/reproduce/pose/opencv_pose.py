"""OpenCV's solvers of the pose, in this project's frames: the competitors of the pose reproductions.

OpenCV's camera is x right, y down, z forward, and its planar solver wants the LEDs in the x-y plane:

    p_opencv = T p_C,   q_opencv = F q_D,   R_opencv = T R_CD F'                                          (1)

Each is taken as its manual says, without a start; `refined` adds solvePnPRefineLM until nothing changes any more. IPPE
gives both poses of a plane; the one with the smaller reprojection error is taken, after refinement. None of them has a
covariance, takes a sigma for each LED, or says when there may be another pose (IPPE's user may compare the two errors).
"""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from dockair.calibration import Camera
from dockair.rotations import Array

_TO_OPENCV = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
_FLAT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
_TO_THE_END = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-12)

_solve_pnp: Any = cv2.solvePnP  # its types know neither starts that are None nor float arrays

Pose = tuple[Array, Array]
Solver = Callable[[Array], Pose | None]


class OpenCvSolvers:
    """The solvers for one camera and one flat set of LEDs."""

    def __init__(self, camera: Camera, points_D: Array) -> None:
        f, (u, v) = camera.focal_length_px, camera.principal_point_px
        self._matrix = np.array([[f, 0.0, u], [0.0, f, v], [0.0, 0.0, 1.0]])
        self._distortion = None if camera.distortion is None else np.array(camera.distortion)
        self._points = np.ascontiguousarray(points_D @ _FLAT.T)

    def iterative(self, pixels: Array, start: Pose | None = None) -> Pose | None:
        """SOLVEPNP_ITERATIVE: a homography, or a start, refined by OpenCV's own Levenberg-Marquardt."""
        guess: list[Any] = [None, None] if start is None else list(self.to_opencv(start))
        found, rotation, translation = _solve_pnp(
            self._points,
            pixels,
            self._matrix,
            self._distortion,
            guess[0],
            guess[1],
            start is not None,
            cv2.SOLVEPNP_ITERATIVE,
        )
        return self._pose(rotation, translation) if found else None

    def ippe_refined(self, pixels: Array) -> Pose | None:
        """SOLVEPNP_IPPE, both poses refined, the better one."""
        count, rotations, translations, _ = cv2.solvePnPGeneric(
            self._points, pixels, self._matrix, self._distortion, flags=cv2.SOLVEPNP_IPPE
        )
        if not count:
            return None
        ends = [
            self._refined(pixels, np.asarray(r), np.asarray(t)) for r, t in zip(rotations, translations, strict=True)
        ]
        return self._pose(*min(ends, key=lambda end: self._squares(pixels, *end)))

    def sqpnp(self, pixels: Array) -> Pose | None:
        """SOLVEPNP_SQPNP: the global minimum of an object-space cost."""
        return self._solved(pixels, cv2.SOLVEPNP_SQPNP, refine=False)

    def sqpnp_refined(self, pixels: Array) -> Pose | None:
        """The same, refined."""
        return self._solved(pixels, cv2.SOLVEPNP_SQPNP, refine=True)

    def iterative_refined(self, pixels: Array) -> Pose | None:
        """SOLVEPNP_ITERATIVE, refined further."""
        return self._solved(pixels, cv2.SOLVEPNP_ITERATIVE, refine=True)

    def to_opencv(self, pose: Pose) -> tuple[Array, Array]:
        """Rotation vector (3, 1) and translation (3, 1) of R_CD, p_CD, Eq. (1)."""
        R, p = pose
        return cv2.Rodrigues(_TO_OPENCV @ R @ _FLAT.T)[0], (_TO_OPENCV @ p).reshape(3, 1)

    def start_in_place(self, pixels: Array, pose: Pose) -> Callable[[], object]:
        """SOLVEPNP_ITERATIVE from a start as a call without conversions: what is timed."""
        rotation, translation = self.to_opencv(pose)
        points, matrix, distortion = self._points, self._matrix, self._distortion
        flag = cv2.SOLVEPNP_ITERATIVE
        return lambda: cv2.solvePnP(points, pixels, matrix, distortion, rotation.copy(), translation.copy(), True, flag)

    def _solved(self, pixels: Array, flag: int, *, refine: bool) -> Pose | None:
        found, rotation, translation = _solve_pnp(self._points, pixels, self._matrix, self._distortion, flags=flag)
        if not found:
            return None
        return self._pose(*(self._refined(pixels, rotation, translation) if refine else (rotation, translation)))

    def _refined(self, pixels: Array, rotation: Any, translation: Any) -> tuple[Array, Array]:
        end = cv2.solvePnPRefineLM(
            self._points, pixels, self._matrix, self._distortion, rotation.copy(), translation.copy(), _TO_THE_END
        )
        return np.asarray(end[0]), np.asarray(end[1])

    def _squares(self, pixels: Array, rotation: Any, translation: Any) -> float:
        seen = cv2.projectPoints(self._points, rotation, translation, self._matrix, self._distortion)[0]
        return float(np.sum((seen[:, 0] - pixels) ** 2))

    @staticmethod
    def _pose(rotation: Any, translation: Any) -> Pose:
        return _TO_OPENCV.T @ cv2.Rodrigues(rotation)[0] @ _FLAT, _TO_OPENCV.T @ translation.ravel()
