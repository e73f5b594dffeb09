"""The wrong one of a flat ring's two attitudes: how often one frame chooses it, alone and with a 3 degree prior.

Eight LEDs, 0.1 px, the ring on the boresight, turned about a random axis across it and rolled at random. The mirror
image is the second minimum of the frame without noise. An estimate is a flip when its attitude is nearer to the mirror
image than to the truth. A node counts when the two lie farther apart than the frame's own sigma of attitude at the
truth; else there is one broad minimum and nothing to confuse (empty in the picture).

With D the mirror image's cost without noise and s its angle in sigmas of the prior, the difference of both costs is
normal with mean D + s^2 and variance 4 (D + s^2), so that the mirror image is the lower one with probability

    P = Phi(-sqrt(D + s^2) / 2),    s = 0 without a prior                                 (1)

The prior is honest: its mean is off by 3 degrees about each axis. No use of it can do better than (1): less than 0.1 %
needs D + s^2 > 38. Below that the estimate must say that it does not know. A flip misleads when it does not: when its
weight among the posteriors is 0.999 or more (the other is not handed on as likely), and the truth lies outside the
99.9 % ellipsoid of its own attitude covariance (it is not one broad minimum). Last, the rate with a prior of the same
sigma whose mean happens to be right.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2, norm

from dockair.calibration import Camera, LedRing
from dockair.nav.integrity.sensitivity import worst_sigmas
from dockair.nav.pose.estimate import PoseEstimate, PoseStatus, solve_pose
from dockair.nav.pose.posterior import PosePosterior, posteriors
from dockair.nav.pose.prior import PosePrior
from dockair.rotations import Array, exp, log
from dockair.scenarios.reproduce.reference import picture_name

ID = "pose/flips"
TITLE = "the wrong one of two attitudes, by range and tilt, alone and with a 3 degree prior"
_SOURCE = "closed form, Eq. (1) of the module"
_CAMERA, _RING = Camera(), LedRing().positions_D
_SIGMA_PX = 0.1
_PRIOR_RAD = np.deg2rad(3.0)
_UNKNOWN_M = 1e3  # sigma of the prior's position
_SURE = 0.999
_RANGES_M = (3.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
_TILTS_DEG = (0.0, 2.5, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0)
_TRIALS = 2000
_SEED = 56
_SIZE_IN, _DPI = (14.5, 4.8), 110


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Node:
    """One range and tilt, and the two attitudes that its image allows."""

    range_m: float
    tilt_deg: float
    mirror_cost: float  #: D
    apart_deg: float  #: angle between truth and mirror image
    sigma_deg: float  #: of attitude in the worst direction, at the truth

    @property
    def apart(self) -> bool:
        """Whether there is a mirror image at all."""
        return self.apart_deg > self.sigma_deg

    def expected(self, sigma_rad: float) -> float:
        """Eq. (1) with a prior of that sigma."""
        return float(norm.cdf(-0.5 * np.sqrt(self.mirror_cost + (np.deg2rad(self.apart_deg) / sigma_rad) ** 2)))


def node(range_m: float, tilt_deg: float) -> Node:
    """Return a node from its frame without noise."""
    R, p = exp(np.deg2rad([0.0, tilt_deg, 0.0])), np.array([range_m, 0.0, 0.0])
    frame = solve_pose(_pixels(R, p), _RING, _CAMERA, sigma_px=_SIGMA_PX, initial=(R, p))
    other = frame.alternative
    return Node(
        range_m=range_m,
        tilt_deg=tilt_deg,
        mirror_cost=0.0 if other is None else other.chi2,
        apart_deg=0.0 if other is None else float(np.rad2deg(_angle(other.R_CD, R))),
        sigma_deg=float(np.rad2deg(worst_sigmas(frame.covariance)[2])),
    )


def reproduce(out: Path | None) -> dict[str, Any]:
    """Count flips at every node."""
    return run(_TRIALS, out)


def run(trials: int, out: Path | None) -> dict[str, Any]:
    """Return the rows of so many trials a node; a map of the rates in `out`."""
    rng = np.random.default_rng(_SEED)
    nodes = [node(range_m, tilt_deg) for range_m in _RANGES_M for tilt_deg in _TILTS_DEG]
    rows = [_row(n, trials, rng) for n in nodes]
    if out is not None:
        _draw(rows, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _row(n: Node, trials: int, rng: np.random.Generator) -> dict[str, Any]:
    case = f"{n.range_m:g} m, tilt {n.tilt_deg:g} deg"
    ours: dict[str, Any] = {"minima_apart_deg": n.apart_deg, "sigma_deg": n.sigma_deg, "mirror_chi2": n.mirror_cost}
    if not n.apart:
        return {"case": case + ": one minimum", "ours": ours, "reference": {}}
    counts = np.sum([_trial(n, rng) for _ in range(trials)], axis=0)
    names = ("alone", "with_prior", "misleading_with_prior", "with_right_prior")
    ours |= {f"{name}_percent": 100.0 * float(count) / trials for name, count in zip(names, counts, strict=True)}
    reference = {
        "alone_percent": 100.0 * n.expected(np.inf),
        "with_prior_percent": 100.0 * n.expected(float(_PRIOR_RAD)),
    }
    return {"case": case, "ours": ours, "reference": reference}


def _trial(n: Node, rng: np.random.Generator) -> list[bool]:
    """Flip alone; with an honest prior; such a flip that misleads; flip with a prior whose mean is right."""
    axis, roll = rng.uniform(-np.pi, np.pi, 2)
    turn = np.deg2rad(n.tilt_deg) * np.array([0.0, np.cos(axis), np.sin(axis)])
    R, p = exp(turn) @ exp(np.array([roll, 0.0, 0.0])), np.array([n.range_m, 0.0, 0.0])
    mirror = exp(-turn / np.deg2rad(n.tilt_deg) * np.deg2rad(n.apart_deg)) @ R
    frame = solve_pose(_pixels(R, p) + _SIGMA_PX * rng.standard_normal((len(_RING), 2)), _RING, _CAMERA)
    assert frame.status is PoseStatus.CONVERGED, "eight LEDs in front of the camera have a pose"
    drawn, weight = _most_likely(frame, exp(_PRIOR_RAD * rng.standard_normal(3)) @ R, p)
    right, _ = _most_likely(frame, R, p)
    flips = [_angle(attitude, mirror) < _angle(attitude, R) for attitude in (frame.R_CD, drawn.R_CD, right.R_CD)]
    off = log(R @ drawn.R_CD.T)
    outside = off @ np.linalg.solve(drawn.covariance[:3, :3], off) > chi2.ppf(_SURE, 3)
    return [flips[0], flips[1], bool(flips[1] and weight >= _SURE and outside), flips[2]]


def _most_likely(frame: PoseEstimate, R_CD: Array, p_CD: Array) -> tuple[PosePosterior, float]:
    """Return the frame's most likely posterior under a prior with the attitude given, and its weight."""
    variances = np.repeat([_PRIOR_RAD**2, _UNKNOWN_M**2], 3)
    found = posteriors(PosePrior(R_CD=R_CD, p_CD=p_CD, covariance=np.diag(variances)), frame)
    logs = np.array([posterior.log_evidence for posterior in found])
    weights = np.exp(logs - logs.max())
    return found[int(np.argmax(logs))], float(1.0 / weights.sum())


def _pixels(R: Array, p: Array) -> Array:
    return _CAMERA.pixels_from_points(_RING @ R.T + p)


def _angle(R: Array, other: Array) -> float:
    return float(np.arccos(np.clip(0.5 * (np.trace(R @ other.T) - 1.0), -1.0, 1.0)))


def _draw(rows: list[dict[str, Any]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = {
        "alone_percent": "one frame alone",
        "with_prior_percent": "with an honest 3° prior",
        "misleading_with_prior_percent": "with that prior, misleading",
    }
    for axes, (key, words) in zip(figure.subplots(1, 3, sharey=True), panels.items(), strict=True):
        rates = np.array([row["ours"].get(key, np.nan) for row in rows]).reshape(len(_RANGES_M), len(_TILTS_DEG))
        image = axes.imshow(np.maximum(rates, 0.01), norm="log", cmap="magma_r", origin="lower", aspect="auto")
        image.set_clim(0.01, 50.0)
        for i, j in np.ndindex(rates.shape):
            if np.isfinite(rates[i, j]):
                colour = "white" if rates[i, j] > 3.0 else "black"
                axes.text(j, i, f"{rates[i, j]:.3g}", ha="center", va="center", fontsize=8, color=colour)
        axes.text(0.0, 0.0, "one minimum", fontsize=8, color="grey")
        axes.set_xticks(range(len(_TILTS_DEG)), [f"{tilt:g}" for tilt in _TILTS_DEG])
        axes.set_yticks(range(len(_RANGES_M)), [f"{range_m:g}" for range_m in _RANGES_M])
        axes.set(xlabel="tilt [deg]", title=f"flips [%], {words}")
    figure.axes[0].set_ylabel("range [m]")
    figure.colorbar(image, ax=figure.axes, label="flips [%]", fraction=0.02)
    figure.savefig(path)
