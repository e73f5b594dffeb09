"""The image-plane Kalman filter on a target at rest, on a moving one, and on one that has the filter's own noise.

The source's two truths have no process noise, so that its filter is conservative: the innovations are smaller than it
expects. By how much is a closed form. In the steady state, with gain K, the true covariance of the error solves

    P = A P A' + K R K',    A = (I - K H) F                                                                (1)
    mean NIS = tr(S^-1 (H F P F' H' + R)),    S the filter's own innovation covariance                     (2)

while with the filter's Q in the truth the mean is 2. P_0 and the measurement noise are not printed: sigma is 2 px, as R
says, and the filter starts at the first measurement.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.stats import chi2

from dockair.calibration import Camera
from dockair.nav.identify.ring import Identification, IdentificationStatus
from dockair.nav.track import RingTracker, TrackSettings
from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name, read_figure

ID = "image/fig18-20"
TITLE = "image-plane Kalman filter: at rest, moving, and with process noise"
_SOURCE = "[Yoon 2018, figs 18-20, eqs 27-37]"
_RADIUS_PX = 100.0
_SETTLING_S = 5.0
_FALSE_ALARM = 1e-3  # of the chi2 band
_SEED = 18
_SIZE_IN, _DPI = (11.0, 8.6), 110


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracked:
    """One simulation, a row a frame."""

    time_s: Array
    true: Array  #: (n, 2) px
    measured: Array  #: (n, 2) px
    estimated: Array  #: (n, 2) px
    sigma: Array  #: (n, 2) px
    nis: Array  #: (n,) of the centre, 2 degrees of freedom; NaN in the first frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """The set-up."""

    duration_s: float
    rate_hz: float
    end_px: tuple[float, float]
    Q_px2: float
    R_px2: float

    @classmethod
    def read(cls) -> "Printed":
        """Take it from the reference table."""
        value = read_figure("yoon_2018_image", "18-19")
        return cls(
            duration_s=value["duration_s"],
            rate_hz=value["rate_hz"],
            end_px=(value["end_u_px"], value["end_v_px"]),
            Q_px2=value["Q_px2"],
            R_px2=value["R_px2"],
        )

    @property
    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """F, H, Q, R."""
        eye, zero, dt = np.eye(2), np.zeros((2, 2)), 1.0 / self.rate_hz
        F, H = np.block([[eye, dt * eye], [zero, eye]]), np.hstack([eye, zero])
        return F, H, self.Q_px2 * np.eye(4), self.R_px2 * eye


def simulate(printed: Printed, true: Array, rng: np.random.Generator) -> Tracked:
    """Run the tracker's centre filter on a truth (n, 2) [px]; its radius is measured as exactly."""
    sigma_px = float(np.sqrt(printed.R_px2))
    settings = TrackSettings(
        process_variance=printed.Q_px2, measurement_variance=printed.R_px2, acceleration_radii_s2=0.0
    )
    tracker = RingTracker(Camera(), 1.0 / printed.rate_hz, settings)
    measured = true + sigma_px * rng.standard_normal(true.shape)
    estimated, sigma, nis = np.empty_like(true), np.empty_like(true), np.full(len(true), np.nan)
    for k, z in enumerate(measured):
        tracker.predict()
        if tracker.tracking:
            innovation = z - tracker.centre_px
            S = tracker.covariance[:2, :2] + printed.R_px2 * np.eye(2)
            nis[k] = innovation @ np.linalg.solve(S, innovation)
        tracker.update(_seen(z))
        estimated[k], sigma[k] = tracker.centre_px, np.sqrt(np.diag(tracker.covariance)[:2])
    time_s = np.arange(len(true)) / printed.rate_hz
    return Tracked(time_s=time_s, true=true, measured=measured, estimated=estimated, sigma=sigma, nis=nis)


def _seen(centre: Array) -> Identification:
    angle = np.arange(8) * np.pi / 4.0
    leds = centre - _RADIUS_PX * np.column_stack([np.cos(angle), np.sin(angle)])
    return Identification(
        status=IdentificationStatus.FOUND, members=np.arange(8), led_numbers=np.arange(8), centre_px=centre,
        radius_px=_RADIUS_PX, roll_rad=0.0, led_pixels_px=leds, ellipse=None, rms_px=0.0,
    )  # fmt: skip


def reproduce(out: Path | None) -> dict[str, Any]:
    """Run the three simulations; errors, paths and innovations in `out`."""
    printed, rng = Printed.read(), np.random.default_rng(_SEED)
    n = round(printed.duration_s * printed.rate_hz)
    along = np.arange(n)[:, None] / n
    F, _, Q, _ = printed.matrices
    truths = {
        "at rest": np.zeros((n, 2)),
        "moving": along * np.array(printed.end_px),
        "with process noise": _walk(F, Q, n, rng),
    }
    runs = {case: simulate(printed, true, rng) for case, true in truths.items()}
    sigma_px, conservative = steady_state(printed)
    rows = [
        _row(printed, case, run, sigma_px, 2.0 if case == "with process noise" else conservative)
        for case, run in runs.items()
    ]
    if out is not None:
        _draw(runs, [row["ours"]["mean_nis"] for row in rows], out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _walk(F: Array, Q: Array, n: int, rng: np.random.Generator) -> Array:
    x, path = np.zeros(4), np.empty((n, 2))
    for k in range(n):
        path[k] = x[:2]
        x = F @ x + np.sqrt(np.diag(Q)) * rng.standard_normal(4)
    return path


def steady_state(printed: Printed) -> tuple[float, float]:
    """Sigma of the estimated position [px], and mean NIS for a truth without process noise, Eqs. (1)-(2)."""
    F, H, Q, R = printed.matrices
    prior = solve_discrete_are(F.T, H.T, Q, R)
    S = H @ prior @ H.T + R
    K = prior @ H.T @ np.linalg.inv(S)
    posterior = (np.eye(4) - K @ H) @ prior
    P = solve_discrete_lyapunov((np.eye(4) - K @ H) @ F, K @ R @ K.T)
    mean_nis = np.trace(np.linalg.solve(S, H @ F @ P @ F.T @ H.T + R))
    return float(np.sqrt(posterior[0, 0])), float(mean_nis)


def _row(printed: Printed, case: str, run: Tracked, sigma_px: float, mean_nis: float) -> dict[str, Any]:
    settled = run.time_s >= _SETTLING_S
    nis = run.nis[settled]
    inside = np.abs(run.estimated - run.true)[settled] <= 3.0 * run.sigma[settled]
    low, high = chi2.ppf([0.5 * _FALSE_ALARM, 1.0 - 0.5 * _FALSE_ALARM], 2 * len(nis)) / len(nis)
    ours = {
        "duration_s": float(len(run.time_s) / printed.rate_hz),
        "inside_3_sigma_percent": float(100.0 * inside.mean()),
        "sigma_px": float(run.sigma[-1, 0]),
        "rms_px": float(np.sqrt(((run.estimated - run.true)[settled] ** 2).mean())),
        "rms_measured_px": float(np.sqrt(((run.measured - run.true)[settled] ** 2).mean())),
        "mean_nis": float(nis.mean()),
        "nis_band_low": float(low),
        "nis_band_high": float(high),
    }
    return {
        "case": case,
        "ours": ours,
        "reference": {"duration_s": printed.duration_s, "sigma_px": sigma_px, "mean_nis": mean_nis},
    }


def _draw(runs: dict[str, Tracked], mean_nis: list[float], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    panels = figure.subplots(3, 2, width_ratios=(1.6, 1.0))
    for (left, right), (case, run), mean in zip(panels, runs.items(), mean_nis, strict=True):
        for axis, colour in ((0, "tab:blue"), (1, "tab:orange")):
            left.plot(
                run.time_s, (run.estimated - run.true)[:, axis], lw=0.6, color=colour, label=f"error in {'uv'[axis]}"
            )
        for sign in (-3.0, 3.0):
            left.plot(run.time_s, sign * run.sigma[:, 0], color="black", lw=1.0, ls="--")
        left.set(ylabel="px", ylim=(-5.0, 5.0), title=f"{case}: error and 3 σ, mean NIS {mean:.3f}")
        right.plot(*run.measured.T, ".", ms=1.5, color="tab:green", label="measured")
        right.plot(*run.estimated.T, lw=0.9, color="tab:red", label="estimated")
        right.plot(*run.true.T, lw=1.4, color="black", label="true", marker="o" if case == "at rest" else "")
        right.set(xlabel="u [px]", ylabel="v [px]")
        right.set_aspect("equal", adjustable="datalim")
    panels[0, 0].legend(frameon=False, fontsize=8, loc="upper right")
    panels[0, 1].legend(frameon=False, fontsize=8, loc="upper right")
    panels[-1, 0].set_xlabel("time [s]")
    figure.savefig(path)
