"""Pose of the drogue from named LEDs in one frame, with its covariance and its mirror image.

A flat ring has two poses that fit its image nearly alike (`planar`). Both are refined; without a start the one with the
lower cost comes first, with a start the one that the start leads to. The other stays in `alternative`: one frame alone
cannot rule it out when the ring is far away or nearly frontal; whoever has a prior can (`prior`, `nav.fusion`).

Not modelled: wrong matches, errors common to all LEDs (calibration). The covariance is that of the linearised problem:
close to frontal, where the two minima lie within each other's sigma, it is neither Gaussian nor free of bias in range.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.nav.pose import model
from dockair.nav.pose.descent import Descent, PosePrior
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.glsdc import glsdc
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.measurement import LinesOfSight, lines_of_sight_from_pixels
from dockair.nav.pose.planar import mirrored, position_for_attitude, two_poses
from dockair.rotations import Array

_METHODS: dict[str, Callable[..., Descent]] = {"lm": levenberg_marquardt, "glsdc": glsdc}
_SAME_MINIMUM_CHI2 = 1e-3  # squared distance, in sigmas, below which two ends of a descent are one minimum


class PoseStatus(Enum):
    """How the solution ended; everything but CONVERGED carries NaN covariance."""

    CONVERGED = "converged"
    TOO_FEW_LEDS = "too few LEDs"
    NOT_CONVERGED = "not converged"
    BEHIND_CAMERA = "behind the camera"
    DEGENERATE = "degenerate"


_STATUS = {
    model.CONVERGED: PoseStatus.CONVERGED,
    model.NOT_CONVERGED: PoseStatus.NOT_CONVERGED,
    model.BEHIND: PoseStatus.BEHIND_CAMERA,
    model.SINGULAR: PoseStatus.DEGENERATE,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseEstimate:
    """Drogue relative to camera. Pose arrays are NaN when there is none."""

    status: PoseStatus
    R_CD: Array  #: (3, 3) drogue axes in camera axes
    p_CD: Array  #: (3,) drogue origin (ring centre) in camera axes [m]
    covariance: Array  #: (6, 6) of (phi, delta) in camera axes: R_CD <- exp(phi) R_CD, p_CD <- p_CD + delta [rad, m]
    iterations: int  #: of the descent that led here
    rms_px: float  #: root mean square of the 2 n pixel residuals
    chi2: float  #: weighted sum of squared residuals, of 2 n - 6 degrees of freedom; a prior's share not included
    led_chi2: Array  #: (n,) its parts, NaN where an LED was not seen
    measurement: LinesOfSight | None = None  #: what was solved; lets a filter take the frame with its own prior
    alternative: "PoseEstimate | None" = None  #: the other minimum, if there is one

    @property
    def p_DC(self) -> Array:
        """(3,) camera in drogue axes [m]: the source's o, nearly unobservable sideways."""
        return np.asarray(-self.R_CD.T @ self.p_CD)


def solve_pose(
    pixels: Array,
    points_D: Array,
    camera: Camera,
    *,
    sigma_px: float | Array = 0.1,
    method: str = "lm",
    initial: tuple[Array, Array] | None = None,
    prior: PosePrior | None = None,
) -> PoseEstimate:
    """Return the pose that best explains the LEDs' pixels.

    Args:
        pixels: (n, 2) pixels (u, v); a row with NaN is an LED that was not seen.
        points_D: (n, 3) the same LEDs in drogue axes [m], in a plane or nearly so.
        camera: calibration, distortion included.
        sigma_px: standard deviation of a pixel coordinate, one for all or (n,).
        method: "lm" (Levenberg-Marquardt) or "glsdc" (the source's Gauss-Newton).
        initial: start (R_CD, p_CD); without one at least four LEDs must be seen, with one three.
        prior: belief about the pose, used as a measurement (and as start); for "lm".

    Raises:
        DockairError: wrong shapes, unknown method, sigma not positive.
    """
    pixels, points_D, sigma = _checked(pixels, points_D, sigma_px, method, prior)
    seen = np.asarray(np.isfinite(pixels).all(axis=1))
    start = (prior.R_CD, prior.p_CD) if initial is None and prior is not None else initial
    if seen.sum() < (4 if start is None else 3):
        return _no_pose(PoseStatus.TOO_FEW_LEDS, len(pixels))
    whole = bool(seen.all())
    sight = lines_of_sight_from_pixels(
        pixels if whole else pixels[seen],
        points_D if whole else points_D[seen],
        camera,
        sigma if whole else sigma[seen],
    )
    refine = _METHODS[method]
    if start is None:
        attitudes, positions = two_poses(sight.rays, sight.points_D)
        if not np.isfinite(positions).all():
            return _no_pose(PoseStatus.DEGENERATE, len(pixels))
        ends = [_estimate(refine(sight, attitudes[k], positions[k]), sight, seen) for k in range(2)]
        ends.sort(key=lambda end: end.chi2 if end.status is PoseStatus.CONVERGED else np.inf)
        return _paired(ends[0], ends[1])
    if prior is not None:
        return _estimate(levenberg_marquardt(sight, *start, prior=prior), sight, seen)
    first = _estimate(refine(sight, *start), sight, seen)
    if first.status is PoseStatus.NOT_CONVERGED:  # a range far off leads astray; the attitude alone gives a better one
        again = refine(sight, start[0], position_for_attitude(sight.rays, sight.points_D, start[0]))
        first = _estimate(again, sight, seen)
    if first.status is not PoseStatus.CONVERGED:
        return first
    return _paired(first, _estimate(refine(sight, *mirrored(first.R_CD, first.p_CD, sight.points_D)), sight, seen))


def _checked(
    pixels: Array, points_D: Array, sigma_px: float | Array, method: str, prior: PosePrior | None
) -> tuple[Array, Array, Array]:
    pixels, points_D = np.asarray(pixels, dtype=float), np.asarray(points_D, dtype=float)
    if pixels.ndim != 2 or pixels.shape[1] != 2:
        raise DockairError("pixels", expected="an array (n, 2)", got=pixels.shape)
    if points_D.shape != (len(pixels), 3) or not np.isfinite(points_D).all():
        raise DockairError("points_D", expected=f"an array ({len(pixels)}, 3) of finite numbers", got=points_D.shape)
    sigma = np.full(len(pixels), float(sigma_px)) if np.ndim(sigma_px) == 0 else np.array(sigma_px, dtype=float)
    if sigma.shape != (len(pixels),) or not (sigma > 0.0).all():
        raise DockairError("sigma_px", expected=f"one number > 0, or {len(pixels)} of them", got=sigma_px)
    if method not in _METHODS or (prior is not None and method != "lm"):
        raise DockairError(
            "method", expected="a solver" if prior is None else "lm with a prior", got=method, exists=_METHODS
        )
    return np.ascontiguousarray(pixels), np.ascontiguousarray(points_D), sigma


def _no_pose(status: PoseStatus, count: int) -> PoseEstimate:
    nan = np.full((6, 6), np.nan)
    return PoseEstimate(
        status=status,
        R_CD=nan[:3, :3],
        p_CD=nan[0, :3],
        covariance=nan,
        iterations=0,
        rms_px=np.nan,
        chi2=np.nan,
        led_chi2=np.full(count, np.nan),
    )


def _estimate(end: Descent, sight: LinesOfSight, seen: NDArray[np.bool_]) -> PoseEstimate:
    status = _STATUS[end.outcome]
    led_chi2 = np.full(len(seen), np.nan)
    led_chi2[seen] = end.led_chi2
    return PoseEstimate(
        status=status,
        R_CD=end.R_CD,
        p_CD=end.p_CD,
        covariance=end.covariance,
        iterations=end.iterations,
        rms_px=float(np.sqrt(end.led_chi2 @ sight.sigma_px**2 / (2 * len(sight.rays)))),
        chi2=float(end.led_chi2.sum()),
        led_chi2=led_chi2,
        measurement=sight,
    )


def _paired(first: PoseEstimate, second: PoseEstimate) -> PoseEstimate:
    """Return the first with the second as its alternative, if that is a minimum and another one."""
    if first.status is not PoseStatus.CONVERGED or second.status is not PoseStatus.CONVERGED:
        return first
    step = pose_difference(second.R_CD, second.p_CD, first.R_CD, first.p_CD)
    if step @ np.linalg.solve(first.covariance, step) < _SAME_MINIMUM_CHI2:
        return first
    return replace(first, alternative=second)
