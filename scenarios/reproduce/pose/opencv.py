"""Ten thousand frames solved by this project's solver and by OpenCV's: errors, failures and time.

Range uniform from 2 to 30 m, up to a tenth of it off the axis each way, each angle uniform within 20 degrees, eight
LEDs with 0.1 px of noise, nobody has a start. Every solver gets the same pixels in its own frames.

A *failure* is a result that is not finite, behind the camera, or wrong by more than ten of the Cramer-Rao bound's
sigmas in range, across or in attitude without a flag. The flag is `ambiguous`: the other minimum costs less than 25
more. The mirror image of a far ring is wrong by that much, and in a frame alone nobody can exclude it: the row without
flagged frames shows what is left. OpenCV has no such flag; the wrong ones of IPPE, refined, are the same frames.

Times are of one call from Python, the least of several passes over some of the frames; they belong to the machine.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera, LedRing
from dockair.nav.dop import pose_bound
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseStatus, solve_pose
from dockair.nav.pose.expectation import expectation
from dockair.rotations import Array, matrix_from_yaw_pitch_roll
from dockair.scenarios.reproduce.pose.opencv_pose import OpenCvSolvers, Pose
from dockair.scenarios.reproduce.reference import picture_name

ID = "pose/opencv"
TITLE = "ten thousand frames: this project's pose and OpenCV's ITERATIVE, IPPE + RefineLM and SQPNP"
_SOURCE = "OpenCV, cv2.solvePnP"
_FRAMES = 10_000
_NEAREST_M, _FARTHEST_M, _OFF_AXIS, _LARGEST_ANGLE_RAD = 2.0, 30.0, 0.1, np.deg2rad(20.0)
_SIGMA_PX = 0.1
_WRONG_SIGMAS = 10.0
_TIMED_FRAMES, _PASSES = 200, 5
_SEED = 52
_SIZE_IN, _DPI = (11.0, 4.6), 110
OURS, OURS_EXPECTED = "Dockair", "Dockair, expectation"
_UNITS = (("range", "mm", 1e3), ("lateral", "mm", 1e3), ("attitude", "deg", float(np.rad2deg(1.0))))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frames:
    """What everybody gets."""

    R_CD: Array  #: (n, 3, 3)
    p_CD: Array  #: (n, 3) [m]
    pixels: Array  #: (n, 8, 2)
    bounds: Array  #: (n, 3) sigma of range, across, attitude [m, m, rad]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """What one solver made of the frames."""

    errors: Array  #: (n, 3) length of the error in range, across, attitude [m, m, rad]; NaN where it has none
    sigmas: Array  #: (n,) the largest of these over the bound's
    behind: NDArray[np.bool_]  #: (n,)
    flagged: NDArray[np.bool_]  #: (n,)
    microseconds: float

    @property
    def failed(self) -> NDArray[np.bool_]:
        """(n,)."""
        return ~np.isfinite(self.sigmas) | self.behind | ((self.sigmas > _WRONG_SIGMAS) & ~self.flagged)


def frames(count: int, rng: np.random.Generator) -> Frames:
    """Draw the frames."""
    camera, points_D = Camera(), LedRing().positions_D
    attitudes, positions, pixels, bounds = [], [], [], []
    for _ in range(count):
        R = matrix_from_yaw_pitch_roll(*rng.uniform(-_LARGEST_ANGLE_RAD, _LARGEST_ANGLE_RAD, 3))
        p = rng.uniform(_NEAREST_M, _FARTHEST_M) * np.array([1.0, *rng.uniform(-_OFF_AXIS, _OFF_AXIS, 2)])
        seen = camera.pixels_from_points(points_D @ R.T + p)
        P = pose_bound(points_D, R, p, camera, _SIGMA_PX, sensor_edges=False).covariance
        attitudes.append(R)
        positions.append(p)
        pixels.append(seen + _SIGMA_PX * rng.standard_normal(seen.shape))
        bounds.append(np.sqrt([P[3, 3], P[4, 4] + P[5, 5], np.trace(P[:3, :3])]))
    return Frames(R_CD=np.array(attitudes), p_CD=np.array(positions), pixels=np.array(pixels), bounds=np.array(bounds))


def results(given: Frames) -> dict[str, Result]:
    """Run every solver on all frames."""
    camera, points_D = Camera(), LedRing().positions_D
    opencv = OpenCvSolvers(camera, points_D)

    def own(pixels: Array) -> tuple[Pose, bool] | None:
        pose = solve_pose(pixels, points_D, camera, sigma_px=_SIGMA_PX)
        return ((pose.R_CD, pose.p_CD), pose.ambiguous) if pose.status is PoseStatus.CONVERGED else None

    def expected(pixels: Array) -> tuple[Pose, bool] | None:
        pose = solve_pose(pixels, points_D, camera, sigma_px=_SIGMA_PX)
        if pose.status is not PoseStatus.CONVERGED:
            return None
        mean = expectation(pose)
        return (mean.R_CD, mean.p_CD), pose.ambiguous

    def unflagged(solver: Callable[[Array], Pose | None]) -> Callable[[Array], tuple[Pose, bool] | None]:
        def solve(pixels: Array) -> tuple[Pose, bool] | None:
            found = solver(pixels)
            return None if found is None else (found, False)

        return solve

    return {
        OURS: _result(given, own),
        OURS_EXPECTED: _result(given, expected),
        "OpenCV ITERATIVE": _result(given, unflagged(opencv.iterative)),
        "OpenCV IPPE + RefineLM": _result(given, unflagged(opencv.ippe_refined)),
        "OpenCV SQPNP": _result(given, unflagged(opencv.sqpnp)),
        "OpenCV SQPNP + RefineLM": _result(given, unflagged(opencv.sqpnp_refined)),
    }


def _result(given: Frames, solver: Callable[[Array], tuple[Pose, bool] | None]) -> Result:
    n = len(given.pixels)
    errors, behind, flagged = np.full((n, 3), np.nan), np.zeros(n, bool), np.zeros(n, bool)
    for i, pixels in enumerate(given.pixels):
        found = solver(pixels)
        if found is None:
            continue
        (R, p), flagged[i] = found
        e = pose_difference(given.R_CD[i], given.p_CD[i], R, p)
        errors[i] = abs(e[3]), np.hypot(e[4], e[5]), np.linalg.norm(e[:3])
        behind[i] = not p[0] > 0.0
    return Result(
        errors=errors,
        sigmas=(errors / given.bounds).max(axis=1),
        behind=behind,
        flagged=flagged,
        microseconds=_microseconds(solver, given.pixels[:_TIMED_FRAMES]),
    )


def _microseconds(solver: Callable[[Array], object], pixels: Array) -> float:
    passes = []
    for _ in range(_PASSES):
        begun = time.perf_counter()
        for frame in pixels:
            solver(frame)
        passes.append(time.perf_counter() - begun)
    return 1e6 * min(passes) / len(pixels)


def reproduce(out: Path | None, count: int = _FRAMES) -> dict[str, Any]:
    """Draw and solve the frames; distributions of the errors in `out`."""
    given = frames(count, np.random.default_rng(_SEED))
    solved = results(given)
    clear = ~solved[OURS].flagged
    rows = [_row(name, given, result, np.ones(count, bool)) for name, result in solved.items()]
    rows += [_row(f"{name}, frames that are not ambiguous", given, result, clear) for name, result in solved.items()]
    if out is not None:
        _draw(solved, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _row(case: str, given: Frames, result: Result, chosen: NDArray[np.bool_]) -> dict[str, Any]:
    ours: dict[str, float] = {"frames": int(chosen.sum())}
    reference: dict[str, float] = {}
    finite = chosen & np.isfinite(result.sigmas)
    for k, (name, unit, scale) in enumerate(_UNITS):
        ours[f"{name}_rms_{unit}"] = float(scale * np.sqrt(np.mean(result.errors[finite, k] ** 2)))
        ours[f"{name}_95_percent_{unit}"] = float(scale * np.quantile(result.errors[finite, k], 0.95))
        reference[f"{name}_rms_{unit}"] = float(scale * np.sqrt(np.mean(given.bounds[chosen, k] ** 2)))
    ours |= {
        "not_finite": int((chosen & ~np.isfinite(result.sigmas)).sum()),
        "behind_the_camera": int((chosen & result.behind).sum()),
        "wrong_by_10_sigma": int((chosen & (result.sigmas > _WRONG_SIGMAS)).sum()),
        "of_these_without_a_flag": int((chosen & (result.sigmas > _WRONG_SIGMAS) & ~result.flagged).sum()),
        "failures": int((chosen & result.failed).sum()),
        "microseconds_a_frame": result.microseconds,
    }
    return {"case": case, "ours": ours, "reference": reference}


def _draw(solved: dict[str, Result], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(1, len(_UNITS), sharey=True)
    for k, (axes, (name, unit, scale)) in enumerate(zip(panels, _UNITS, strict=True)):
        for place, (solver, result) in enumerate(solved.items()):
            values = np.sort(result.errors[np.isfinite(result.sigmas), k]) * scale
            share = 1.0 - np.arange(len(values)) / len(values)
            axes.plot(values, share, lw=2.0 - 0.25 * place, label=solver, ls="-" if "Dockair" in solver else "--")
        axes.set(xscale="log", yscale="log", xlabel=f"error of {name} [{unit}]", xlim=(1e-2, None))
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("share of frames with a larger error")
    panels[0].legend(frameon=False, fontsize=8, loc="lower left")
    figure.savefig(path)
