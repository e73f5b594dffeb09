"""The range of a frontal ring: biased by noise when one frame stands alone, and what a known attitude mends.

Noise makes a frontal ring look tilted, never less than not tilted; what looks tilted looks nearer by the square of it.
An attitude known from elsewhere (gyro, the hose's direction) ends that. Two ways to use it: as a prior, one more
measurement (`prior.AttitudePrior`, or the hose's direction alone, `prior.DirectionPrior`), and as the attitude itself,
solving for the position alone with the attitude's error in its covariance (`position.solve_position`).

Ring on the camera's axis, 0.1 px. In the first rows the ring is *believed* frontal: the truth is scattered about it by
the belief's sigma about both cross axes, which is what a covariance says. In the rows called "truly frontal" the truth
is fixed and the belief scattered. Then a belief is in the mean tilted, and whoever trusts it places the ring nearer: by
the square again, 20 mm at 20 m for 3 degrees, and twice as much with the position alone, whose correction for the mean
tilt of the truth is then one too many. No use of a prior escapes that; it takes a better one, or many frames.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import Camera, LedRing
from dockair.nav.pose.estimate import PoseEstimate, solve_pose
from dockair.nav.pose.position import solve_position
from dockair.nav.pose.prior import AttitudePrior, DirectionPrior
from dockair.rotations import Array, exp
from dockair.scenarios.reproduce.reference import picture_name

ID = "pose/frontal"
TITLE = "range of a frontal ring: bias of one frame, and with a known attitude"
_SOURCE = "closed form: Gaussian error of the range"
RANGES_M = (5.0, 10.0, 20.0, 30.0)
_SIGMA_PX = 0.1
_TRIALS = 2000  # standard error of the mean: 2.2 % of the rms
_SEED = 54
_SIZE_IN, _DPI = (9.0, 4.2), 110

Solver = Callable[[Array, Array, float], PoseEstimate]


def _free(pixels: Array, believed: Array, sigma_rad: float) -> PoseEstimate:
    return solve_pose(pixels, LedRing().positions_D, Camera(), sigma_px=_SIGMA_PX)


def _prior(pixels: Array, believed: Array, sigma_rad: float) -> PoseEstimate:
    prior = AttitudePrior.from_sigmas(believed, np.array([np.inf, sigma_rad, sigma_rad]))
    return solve_pose(pixels, LedRing().positions_D, Camera(), sigma_px=_SIGMA_PX, prior=prior)


def _direction(pixels: Array, believed: Array, sigma_rad: float) -> PoseEstimate:
    prior = DirectionPrior(axis_C=believed[:, 0], axis_D=np.array([1.0, 0.0, 0.0]), sigma_rad=sigma_rad)
    return solve_pose(pixels, LedRing().positions_D, Camera(), sigma_px=_SIGMA_PX, prior=prior)


def _position(pixels: Array, believed: Array, sigma_rad: float) -> PoseEstimate:
    P = sigma_rad**2 * (np.eye(3) - np.outer(believed[:, 0], believed[:, 0]))
    return solve_position(pixels, LedRing().positions_D, Camera(), believed, attitude_covariance=P, sigma_px=_SIGMA_PX)


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """A way to solve, with what is known of the attitude."""

    name: str
    solver: Solver
    sigma_deg: float


WAYS = (
    Way(name="one frame alone", solver=_free, sigma_deg=3.0),
    Way(name="prior of 3 deg", solver=_prior, sigma_deg=3.0),
    Way(name="hose's direction to 3 deg", solver=_direction, sigma_deg=3.0),
    Way(name="position alone, attitude to 3 deg", solver=_position, sigma_deg=3.0),
    Way(name="prior of 0.5 deg", solver=_prior, sigma_deg=0.5),
    Way(name="position alone, attitude to 0.5 deg", solver=_position, sigma_deg=0.5),
)


def errors(
    way: Way, range_m: float, trials: int, *, truly_frontal: bool, rng: np.random.Generator
) -> tuple[Array, Array]:
    """(trials,) error of the range [m] and its square over the covariance's."""
    points_D, camera, p = LedRing().positions_D, Camera(), np.array([range_m, 0.0, 0.0])
    sigma_rad, found, squares = np.deg2rad(way.sigma_deg), np.empty(trials), np.empty(trials)
    for k in range(trials):
        scattered = exp(np.array([0.0, *(sigma_rad * rng.standard_normal(2))]))
        R, believed = (np.eye(3), scattered) if truly_frontal else (scattered, np.eye(3))
        if way.solver is _free:
            R = np.eye(3)
        pixels = camera.pixels_from_points(points_D @ R.T + p)
        pixels += _SIGMA_PX * rng.standard_normal(pixels.shape)
        pose = way.solver(pixels, believed, sigma_rad)
        found[k] = pose.p_CD[0] - range_m
        squares[k] = found[k] ** 2 / pose.covariance[3, 3]
    return found, squares


def reproduce(out: Path | None, trials: int = _TRIALS) -> dict[str, Any]:
    """Run all ways at all ranges; bias and rms in `out`."""
    rows, drawn = [], {}
    for truly_frontal in (False, True):
        for i, way in enumerate(WAYS):
            for range_m in RANGES_M:
                rng = np.random.default_rng((_SEED, i, round(range_m), truly_frontal))
                found, squares = errors(way, range_m, trials, truly_frontal=truly_frontal, rng=rng)
                drawn[truly_frontal, way.name, range_m] = found
                case = f"{way.name}, {range_m:g} m" + (", truly frontal" if truly_frontal else "")
                rows.append(
                    {"case": case, "ours": _summary(found, squares), "reference": {"bias_mm": 0.0, "nees": 1.0}}
                )
    if out is not None:
        _draw(drawn, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _summary(found: Array, squares: Array) -> dict[str, float]:
    n = len(found)
    return {
        "bias_mm": float(1e3 * found.mean()),
        "bias_standard_error_mm": float(1e3 * found.std() / np.sqrt(n)),
        "rms_mm": float(1e3 * np.sqrt(np.mean(found**2))),
        "nees": float(squares.mean()),
        "nees_standard_error": float(squares.std() / np.sqrt(n)),
    }


def _draw(drawn: dict[tuple[bool, str, float], Array], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    for axes, truly_frontal in zip(figure.subplots(1, 2, sharey=True), (False, True), strict=True):
        for k, way in enumerate(WAYS):
            found = [1e3 * drawn[truly_frontal, way.name, r] for r in RANGES_M]
            shifted = np.array(RANGES_M) + 0.25 * (k - 0.5 * (len(WAYS) - 1))
            axes.errorbar(
                shifted, [f.mean() for f in found], [f.std() for f in found], fmt="o", ms=4, lw=1.0, label=way.name
            )
        axes.axhline(0.0, color="black", lw=0.8)
        axes.set(xlabel="range [m]", title="truly frontal" if truly_frontal else "believed frontal")
    figure.axes[0].set_ylabel("range error, mean and σ [mm]")
    figure.axes[0].legend(frameon=False, fontsize=8, loc="lower left")
    figure.savefig(path)
