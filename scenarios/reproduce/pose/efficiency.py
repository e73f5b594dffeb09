"""How near the pose of one frame comes to its Cramer-Rao bound, by range, tilt and pixel noise.

A ring on the camera's axis, tilted by a given angle in eight directions in turn, rolled by up to 20 degrees. Rows give
the root mean square error of range, place across and attitude over the bound's sigma, and the mean NEES.

A flat ring has a second pose, tilted the other way. Let D be its cost, in chi-square, when there is no noise. With
noise its cost less the right one's has the mean D and about the standard deviation 2 sqrt(D), so it is lower in

    P(flip) = Phi(-sqrt(D)/2):    D = 16: 2.3 %,    D = 64: 3e-5                                             (1)

of the frames, whoever solves them. Where D >= 64 the problem is near linear, and all frames count. From 16 to 64 the
frames on the right side count, and the flips are counted beside. Below, and with the ring exactly frontal, where the
two poses are one and the tilt enters by its square, there is no near-linear problem: there all frames stand beside the
best of OpenCV's solvers, each refined to the end; as the estimate that is most likely and as the `expectation` over
both minima. OpenCV's SQPNP chooses between two nearly equal minima by the tilt's direction, not by its error: hence
eight.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from dockair.calibration import Camera, LedRing
from dockair.nav.dop import pose_bound
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import solve_pose
from dockair.nav.pose.expectation import expectation
from dockair.rotations import Array, matrix_from_yaw_pitch_roll
from dockair.scenarios.reproduce.pose.opencv_pose import OpenCvSolvers
from dockair.scenarios.reproduce.reference import picture_name

ID = "pose/efficiency"
TITLE = "error of one frame's pose over its Cramér-Rao bound, by range, tilt and pixel noise"
_SOURCE = "Cramér-Rao bound; OpenCV"
RANGES_M, TILTS_DEG, SIGMAS_PX = (2.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0), (0.0, 5.0, 10.0, 15.0, 20.0), (0.05, 0.1)
_DIRECTIONS = 8
_ROLL_RAD = np.deg2rad(20.0)
_TRIALS = 2000  # standard error of a root mean square: 1.6 %
_TWO_SIDES, _NEAR_LINEAR = 16.0, 64.0  # D
_FALSE_ALARM = 0.01  # of each NEES band
_WRONG_SIGMAS = 10.0
_SEED = 51
_SIZE_IN, _DPI = (11.0, 6.4), 110
QUANTITIES = ("range", "lateral", "attitude")
_UNITS = (("range", "mm", 1e3), ("lateral", "mm", 1e3), ("attitude", "deg", float(np.rad2deg(1.0))))


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """Where the ring is."""

    range_m: float
    tilt_deg: float
    sigma_px: float

    def poses(self, rng: np.random.Generator) -> list[tuple[Array, Array]]:
        """R_CD, p_CD for each direction of the tilt."""
        tilt, p_CD = np.deg2rad(self.tilt_deg), np.array([self.range_m, 0.0, 0.0])
        turns = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        rolls = rng.uniform(-_ROLL_RAD, _ROLL_RAD, _DIRECTIONS)
        return [
            (matrix_from_yaw_pitch_roll(tilt * np.cos(turn), tilt * np.sin(turn), roll), p_CD)
            for turn, roll in zip(turns, rolls, strict=True)
        ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """What a node gave."""

    node: Node
    second_minimum_chi2: float | None  #: D, least over the directions; None when there is none
    bound: Array  #: (3,) sigma of QUANTITIES [m, m, rad]
    ratio: Array  #: (3,) root mean square error over it, of all frames
    right_ratio: Array  #: (3,) of those on the right side
    expectation_ratio: Array  #: (3,) of all frames' expectations
    nees: float
    right_nees: float
    expectation_nees: float
    right: int  #: frames on the right side
    ambiguous: int  #: frames that are called so
    wrong: int  #: frames wrong by more than 10 of their own sigmas that are not
    trials: int
    opencv_ratio: Array | None  #: (3,) the least of OpenCV's, each quantity for itself; None at near-linear nodes

    @property
    def regime(self) -> str:
        """Which frames count: all when "near linear", those on the "right side", or all for what they are."""
        D = self.second_minimum_chi2
        if self.node.tilt_deg == 0.0 or (D is not None and D < _TWO_SIDES):
            return "ambiguous"
        return "right side" if D is not None and D < _NEAR_LINEAR else "near linear"

    @property
    def counted(self) -> tuple[Array, float, int]:
        """Ratio, NEES and number of the frames that count in this regime."""
        if self.regime == "right side":
            return self.right_ratio, self.right_nees, self.right
        return self.ratio, self.nees, self.trials

    @property
    def nees_band(self) -> tuple[float, float]:
        """99 % band of the mean NEES of the frames that count."""
        n = self.counted[2]
        low, high = chi2.ppf([0.5 * _FALSE_ALARM, 1.0 - 0.5 * _FALSE_ALARM], 6 * n) / n
        return float(low), float(high)


def run(node: Node, trials: int, rng: np.random.Generator) -> Outcome:
    """Solve a node's frames, as many in each direction."""
    camera, points_D = Camera(), LedRing().positions_D
    poses = node.poses(rng)
    second = _second_minimum(node, poses, camera, points_D)
    opencv = OpenCvSolvers(camera, points_D)
    solvers = (opencv.ippe_refined, opencv.iterative_refined, opencv.sqpnp_refined)
    compare = node.tilt_deg == 0.0 or (second is not None and second < _TWO_SIDES)
    frames: dict[str, list[Any]] = {name: [] for name in ("own", "mean", "nees", "mean_nees", "flagged", "theirs")}
    for k in range(trials):
        R, p = poses[k % _DIRECTIONS]
        pixels = camera.pixels_from_points(points_D @ R.T + p)
        pixels += node.sigma_px * rng.standard_normal(pixels.shape)
        pose = solve_pose(pixels, points_D, camera, sigma_px=node.sigma_px)
        for errors, distances, found in (("own", "nees", pose), ("mean", "mean_nees", expectation(pose))):
            e = pose_difference(R, p, found.R_CD, found.p_CD)
            frames[errors].append(e)
            frames[distances].append(e @ np.linalg.solve(found.covariance, e))
        frames["flagged"].append(pose.ambiguous)
        if compare:
            frames["theirs"].append([_error(solver(pixels), R, p) for solver in solvers])
    bounds = [pose_bound(points_D, R, p, camera, node.sigma_px, sensor_edges=False).covariance for R, p in poses]
    bound = np.sqrt(np.mean([_squares(P) for P in bounds], axis=0))
    own, nees, flagged = np.array(frames["own"]), np.array(frames["nees"]), np.array(frames["flagged"])
    right = np.linalg.norm(own[:, :3], axis=1) < np.deg2rad(
        node.tilt_deg
    )  # nearer to the truth than to its mirror image
    right |= node.tilt_deg == 0.0
    theirs = [_rms(errors) for errors in np.array(frames["theirs"]).swapaxes(0, 1)] if compare else None
    return Outcome(
        node=node,
        second_minimum_chi2=second,
        bound=bound,
        ratio=_rms(own) / bound,
        right_ratio=_rms(own[right]) / bound,
        expectation_ratio=_rms(np.array(frames["mean"])) / bound,
        nees=float(nees.mean()),
        right_nees=float(nees[right].mean()),
        expectation_nees=float(np.mean(frames["mean_nees"])),
        right=int(right.sum()),
        ambiguous=int(flagged.sum()),
        wrong=int(((nees > _WRONG_SIGMAS**2) & ~flagged).sum()),
        trials=trials,
        opencv_ratio=None if theirs is None else np.min(theirs, axis=0) / bound,
    )


def _second_minimum(node: Node, poses: list[tuple[Array, Array]], camera: Camera, points_D: Array) -> float | None:
    """D, the least over the directions."""
    costs = []
    for R, p in poses:
        pixels = camera.pixels_from_points(points_D @ R.T + p)
        pose = solve_pose(pixels, points_D, camera, sigma_px=node.sigma_px, initial=(R, p))
        if pose.alternative is not None:
            costs.append(pose.alternative.cost)
    return min(costs) if costs else None


def _error(found: tuple[Array, Array] | None, R: Array, p: Array) -> Array:
    return np.full(6, np.nan) if found is None else pose_difference(R, p, *found)


def _squares(P: Array) -> Array:
    """(3,) variances of QUANTITIES."""
    return np.array([P[3, 3], P[4, 4] + P[5, 5], np.trace(P[:3, :3])])


def _rms(errors: Array) -> Array:
    """(3,) root mean squares of QUANTITIES."""
    return np.sqrt(_squares(errors.T @ errors / len(errors)))


def outcomes(trials: int) -> list[Outcome]:
    """Run all nodes."""
    nodes = [
        Node(range_m=r, tilt_deg=t, sigma_px=s) for s in SIGMAS_PX for t in TILTS_DEG for r in RANGES_M
    ]  # fmt: skip
    return [run(node, trials, np.random.default_rng((_SEED, k))) for k, node in enumerate(nodes)]


def reproduce(out: Path | None, trials: int = _TRIALS) -> dict[str, Any]:
    """Run all nodes; ratios against range in `out`."""
    results = outcomes(trials)
    if out is not None:
        _draw(results, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": [_row(result) for result in results]}


def _row(result: Outcome) -> dict[str, Any]:
    node, (ratio, nees, counted), (low, high) = result.node, result.counted, result.nees_band
    ours: dict[str, Any] = {"regime": result.regime, "second_minimum_chi2": result.second_minimum_chi2}
    reference = {}
    for k, (name, unit, scale) in enumerate(_UNITS):
        reference[f"{name}_rmse_{unit}"] = float(scale * result.bound[k])
        ours[f"{name}_rmse_{unit}"] = float(scale * result.bound[k] * ratio[k])
    ours |= {"mean_nees": nees, "nees_band_low": low, "nees_band_high": high, "frames_that_count": counted}
    ours["flips_percent"] = 100.0 * (1.0 - result.right / result.trials)
    ours["wrong_by_10_sigma_without_a_flag"] = result.wrong
    ours["ambiguous_percent"] = 100.0 * result.ambiguous / result.trials
    reference["mean_nees"] = 6.0
    if result.opencv_ratio is not None:
        for k, name in enumerate(QUANTITIES):
            ours[f"{name}_over_bound"] = float(result.ratio[k])
            ours[f"{name}_of_expectation_over_bound"] = float(result.expectation_ratio[k])
            ours[f"{name}_of_opencv_over_bound"] = float(result.opencv_ratio[k])
        ours["mean_nees_of_expectation"] = result.expectation_nees
    case = f"{node.range_m:g} m, {node.tilt_deg:g} deg, {node.sigma_px:g} px"
    return {"case": case, "ours": ours, "reference": reference}


def _draw(results: list[Outcome], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(len(SIGMAS_PX), len(QUANTITIES), sharex=True, squeeze=False)
    for row, sigma_px in zip(panels, SIGMAS_PX, strict=True):
        for k, (axes, quantity) in enumerate(zip(row, QUANTITIES, strict=True)):
            for colour, tilt_deg in enumerate(TILTS_DEG):
                line = [r for r in results if r.node.sigma_px == sigma_px and r.node.tilt_deg == tilt_deg]
                x = [r.node.range_m for r in line]
                axes.plot(x, [r.ratio[k] for r in line], "o-", ms=4, lw=0.8, color=f"C{colour}", label=f"{tilt_deg:g}°")
                axes.plot(x, [r.expectation_ratio[k] for r in line], "--", lw=0.8, color=f"C{colour}")
                theirs = [(r.node.range_m, r.opencv_ratio[k]) for r in line if r.opencv_ratio is not None]
                if theirs:
                    axes.plot(*zip(*theirs, strict=True), "x", ms=6, color=f"C{colour}")
            axes.axhline(1.05, color="black", lw=0.8, ls=":")
            axes.set(
                yscale="log" if quantity == "attitude" else "linear",
                title=f"{quantity}, {sigma_px:g} px",
                ylabel="rms error over the bound's σ",
            )
    for axes in panels[-1]:
        axes.set_xlabel("range [m]")
    panels[0, 0].legend(
        frameon=False, fontsize=8, title="tilt (dashed: expectation,\n× best of OpenCV's)", title_fontsize=8
    )
    figure.savefig(path)
