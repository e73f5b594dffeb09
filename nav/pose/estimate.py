"""Pose of the drogue from named LEDs in one frame, with its covariance and its mirror image.

A flat ring has two poses that fit its image nearly alike (`planar`). Both are refined. Without a start the one with the
lower cost comes first; with a start the one that the start leads to; with a prior the one with the lower cost, the
prior's share included. The other stays in `alternative`: one frame alone cannot rule it out when the ring is far away
or nearly frontal, and `reprojection_ratio` and `ambiguous` say so. A frontal ring needs no case of its own: the guesses
do not fail there, and when both end in one minimum there is no other (none was in 2000 such frames).

Not modelled: wrong matches, errors common to all LEDs (calibration). The covariance is that of the linearised problem:
close to frontal, where the two minima lie within each other's sigma, it is neither Gaussian nor free of bias in range;
a prior or `position.solve_position` is. With Huber's loss it is the inverse of the information that the loss leaves: an
LED beyond k sigma counts k/r of its own.
"""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.nav.pose import descent_kernels
from dockair.nav.pose.descent import Descent, DescentSettings, descend
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.glsdc import GLSDC
from dockair.nav.pose.gradient import GRADIENT
from dockair.nav.pose.levenberg import LEVENBERG
from dockair.nav.pose.levenberg_marquardt import LEVENBERG_MARQUARDT
from dockair.nav.pose.measurement import LinesOfSight, measure
from dockair.nav.pose.planar import mirrored, position_for_attitude, two_poses
from dockair.nav.pose.prior import AttitudePrior, DirectionPrior, Prior
from dockair.rotations import Array

_METHODS = {"lm": LEVENBERG_MARQUARDT, "glsdc": GLSDC, "levenberg": LEVENBERG, "gradient": GRADIENT}
_LEAST_LEDS, _LEAST_LEDS_WITH_START = 4, 3  # three allow up to four poses
_SAME_MINIMUM_CHI2 = 1e-3  # squared distance, in sigmas, below which two ends of a descent are one minimum
_AMBIGUOUS_CHI2 = 25.0  # between two costs; to be as far wrong takes 5 sigma of the noise


class PoseStatus(Enum):
    """How the solution ended; everything but CONVERGED carries NaN covariance."""

    CONVERGED = "converged"
    TOO_FEW_LEDS = "too few LEDs"
    NOT_CONVERGED = "not converged"
    BEHIND_CAMERA = "behind the camera"
    DEGENERATE = "degenerate"


STATUS = {
    descent_kernels.CONVERGED: PoseStatus.CONVERGED,
    descent_kernels.NOT_CONVERGED: PoseStatus.NOT_CONVERGED,
    descent_kernels.BEHIND: PoseStatus.BEHIND_CAMERA,
    descent_kernels.SINGULAR: PoseStatus.DEGENERATE,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseOptions:
    """How the frame is measured and judged.

    Raises:
        DockairError: an option that does not exist.
    """

    residuals: str = "lines_of_sight"  #: or "pixels": the same minimum within a thousandth of its sigma, a bit slower
    weight: str = "tangent"  #: or "isotropic", the source's, for lines of sight
    huber_sigma: float = np.inf  #: residual of an LED, u and v together, beyond which it counts linearly; 3 is usual
    #: Whether the other minimum is looked for when there is a start; False saves half of the time. For a tracker whose
    #: own prior decides, or who stays where `ambiguous` is never true.
    mirror: bool = True

    def __post_init__(self) -> None:
        for name, exists in (("residuals", ("lines_of_sight", "pixels")), ("weight", ("tangent", "isotropic"))):
            if getattr(self, name) not in exists:
                raise DockairError(
                    f"options.{name}", expected="one that exists", got=getattr(self, name), exists=exists
                )
        if not self.huber_sigma > 0.0:
            raise DockairError("options.huber_sigma", expected="a number > 0, or inf", got=self.huber_sigma)


_DEFAULT = PoseOptions()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseEstimate:
    """Drogue relative to camera. Pose arrays are NaN when there is none."""

    status: PoseStatus
    R_CD: Array  #: (3, 3) drogue axes in camera axes
    p_CD: Array  #: (3,) drogue origin (ring centre) in camera axes [m]
    covariance: Array  #: (6, 6) of (phi, delta) in camera axes: R_CD <- exp(phi) R_CD, p_CD <- p_CD + delta [rad, m]
    iterations: int  #: of the descent that led here
    chi2: float  #: weighted sum of squared residuals, of 2 n - 6 degrees of freedom; a prior's share not included
    cost: float  #: what was minimised: chi2 and the prior's share, less what Huber's loss spares
    led_chi2: Array  #: (n,) parts of chi2, NaN where an LED was not seen
    measurement: LinesOfSight | None = None  #: what was solved; lets a filter take the frame with its own prior
    alternative: "PoseEstimate | None" = None  #: the other minimum, if there is one
    mirror_tried: bool = False  #: whether the mirror image was descended from: no `alternative` means none then

    @property
    def p_DC(self) -> Array:
        """(3,) camera in drogue axes [m]: the source's o, nearly unobservable sideways."""
        return np.asarray(-self.R_CD.T @ self.p_CD)

    @property
    def rms_px(self) -> float:
        """Root mean square of the 2 n pixel residuals; NaN without a measurement."""
        if self.measurement is None:
            return float("nan")
        seen = np.isfinite(self.led_chi2)
        squares = self.led_chi2[seen] * self.measurement.sigma_px**2
        return float(np.sqrt(squares.mean() / 2.0)) if seen.any() else float("nan")

    @property
    def condition(self) -> float:
        """Condition number of the information, angles counted in metres at the ring: NaN unless converged.

        Its root is how many times longer than short the ellipsoid of the LEDs' errors is: about ten for a tilted ring
        near by, hundreds for one that is frontal and far, whose tilt is hardly seen.
        """
        if self.measurement is None or not np.isfinite(self.covariance).all():
            return float("nan")
        points = self.measurement.points_D
        radius = float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))
        scale = np.array([radius] * 3 + [1.0] * 3)
        values = np.linalg.eigvalsh(self.covariance * scale * scale[:, None])
        return float(values[-1] / values[0])

    @property
    def reprojection_ratio(self) -> float:
        """rms_px of the better minimum over that of the other: near 1 they look alike; 0 when there is one only."""
        if self.alternative is None:
            return 0.0
        low, high = sorted((self.rms_px, self.alternative.rms_px))
        return low / high if high > 0.0 else 1.0

    @property
    def ambiguous(self) -> bool:
        """True when the other minimum costs less than 25 more than this one: it may be the right one."""
        return self.alternative is not None and self.alternative.cost - self.cost < _AMBIGUOUS_CHI2


def solve_pose(
    pixels: Array,
    points_D: Array,
    camera: Camera,
    *,
    sigma_px: float | Array = 0.1,
    method: str = "lm",
    initial: tuple[Array, Array] | None = None,
    prior: Prior | None = None,
    options: PoseOptions = _DEFAULT,
) -> PoseEstimate:
    """Return the pose that best explains the LEDs' pixels.

    Args:
        pixels: (n, 2) pixels (u, v); a row with NaN is an LED that was not seen.
        points_D: (n, 3) the same LEDs in drogue axes [m], in a plane or nearly so.
        camera: calibration, distortion included.
        sigma_px: standard deviation of a pixel coordinate, one for all or (n,).
        method: "lm" (Levenberg-Marquardt), or for the reproductions the source's "glsdc", "levenberg" or "gradient".
        initial: start (R_CD (3, 3), p_CD (3,) [m]); without it and a prior at least four LEDs must be seen, with one of
            them three.
        prior: what is known beside, used as a measurement, and as start if there is no other; for "lm".
        options: residuals, weight, loss, and whether the mirror image is looked for.

    Returns:
        Pose of the drogue in camera axes with its covariance (6, 6) [rad, m]. `status` says whether there is one: LEDs
        that allow none raise nothing, and leave NaN.

    Raises:
        DockairError: wrong shapes, unknown method, sigma not positive, a start that is not finite.
    """
    sight, seen, apart = measure(pixels, points_D, camera, sigma_px, residuals=options.residuals, weight=options.weight)
    settings = _settings(method, prior, options)
    if apart < (_LEAST_LEDS if initial is None and prior is None else _LEAST_LEDS_WITH_START):
        return no_pose(PoseStatus.TOO_FEW_LEDS, len(seen))
    start = _start(initial, prior, sight)
    if start is None:
        ends = _from_nothing(sight, settings, prior)
    else:
        ends = _from_start(start, sight, settings, prior, options.mirror)
    if not ends:
        return no_pose(PoseStatus.DEGENERATE, len(seen))
    if prior is not None or start is None:
        ends.sort(key=lambda end: end.cost if end.converged else np.inf)
    two = len(ends) > 1 and _two_minima(*ends)
    other = estimate_of(ends[1], sight, seen) if two else None
    return estimate_of(ends[0], sight, seen, other, mirror_tried=start is not None and len(ends) > 1)


def _settings(method: str, prior: Prior | None, options: PoseOptions) -> DescentSettings:
    if method not in _METHODS or (prior is not None and method != "lm"):
        raise DockairError(
            "method", expected="a solver" if prior is None else "lm with a prior", got=method, exists=_METHODS
        )
    settings = _METHODS[method]
    return settings if options.huber_sigma == np.inf else replace(settings, huber_sigma=options.huber_sigma)


def _start(initial: tuple[Array, Array] | None, prior: Prior | None, sight: LinesOfSight) -> tuple[Array, Array] | None:
    if initial is not None:
        R, p = np.asarray(initial[0], dtype=float), np.asarray(initial[1], dtype=float)
        if R.shape != (3, 3) or p.shape != (3,):
            raise DockairError("initial", expected="R_CD (3, 3) and p_CD (3,)", got=(R.shape, p.shape))
        return R, p
    if prior is None or isinstance(prior, DirectionPrior):
        return None
    if isinstance(prior, AttitudePrior):
        return prior.R_CD, position_for_attitude(sight.rays, sight.points_D, np.ascontiguousarray(prior.R_CD))
    return prior.R_CD, prior.p_CD


def _from_nothing(sight: LinesOfSight, settings: DescentSettings, prior: Prior | None) -> list[Descent]:
    """Both of the poses that scaled orthography allows, refined; none when the LEDs lie on a line."""
    attitudes, positions = two_poses(sight.rays, sight.points_D)
    if not np.isfinite(positions).all():
        return []
    return [descend(sight, attitudes[k], positions[k], settings, prior) for k in range(2)]


def _from_start(
    start: tuple[Array, Array], sight: LinesOfSight, settings: DescentSettings, prior: Prior | None, mirror: bool
) -> list[Descent]:
    """Where a start leads, and where the mirror image of that does."""
    first = descend(sight, *start, settings, prior)
    if first.outcome == descent_kernels.BEHIND and not (np.isfinite(start[0]).all() and np.isfinite(start[1]).all()):
        raise DockairError("initial", expected="finite numbers", got=start)
    if (
        first.outcome == descent_kernels.NOT_CONVERGED
    ):  # a range far off leads astray; the attitude alone gives a better one
        again = start[0], position_for_attitude(sight.rays, sight.points_D, np.ascontiguousarray(start[0]))
        first = descend(sight, *again, settings, prior)
    if not (first.converged and mirror):
        return [first]
    R_CD, p_CD = mirrored(first.R_CD, first.p_CD, sight.points_D)
    return [first, descend(sight, R_CD, p_CD, settings, prior)]


def no_pose(status: PoseStatus, count: int) -> PoseEstimate:
    """Return what there is to say when there is no pose, of `count` LEDs."""
    nan = np.full((6, 6), np.nan)
    return PoseEstimate(
        status=status,
        R_CD=nan[:3, :3],
        p_CD=nan[0, :3],
        covariance=nan,
        iterations=0,
        chi2=np.nan,
        cost=np.nan,
        led_chi2=np.full(count, np.nan),
    )


def estimate_of(
    end: Descent,
    sight: LinesOfSight,
    seen: NDArray[np.bool_],
    alternative: PoseEstimate | None = None,
    *,
    mirror_tried: bool = False,
) -> PoseEstimate:
    """Return the end of a descent as an estimate from LEDs of which (n,) were seen."""
    led_chi2 = end.led_chi2
    if len(seen) != len(led_chi2):
        led_chi2 = np.full(len(seen), np.nan)
        led_chi2[seen] = end.led_chi2
    return PoseEstimate(
        status=STATUS[end.outcome],
        R_CD=end.R_CD,
        p_CD=end.p_CD,
        covariance=end.covariance,
        iterations=end.iterations,
        chi2=end.chi2,
        cost=end.cost,
        led_chi2=led_chi2,
        measurement=sight,
        alternative=alternative,
        mirror_tried=mirror_tried,
    )


def _two_minima(first: Descent, second: Descent) -> bool:
    if not (first.converged and second.converged):
        return False
    step = pose_difference(second.R_CD, second.p_CD, first.R_CD, first.p_CD)
    return bool(step @ first.information @ step >= _SAME_MINIMUM_CHI2)
