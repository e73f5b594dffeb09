"""The ground test: a drogue carried by hand from 15 m to 6 m in 16 s, its pose from pixels alone.

The complete chain on rendered frames at 50 Hz, without gyro, hose or flight: detect, identify, track, pose by
Levenberg-Marquardt. A frame's start is the pose of the frame before. A flat ring has two poses that look nearly alike,
mirror images in pitch and yaw, and beyond about 12 m one frame hardly tells them apart; the other one is taken when the
chi2 of the last 0.2 s speaks for it by 3 sigma.

Truth is the hardware as built and the navigation has its nominal sheets, so that calibration errors count: an LED ring
larger than its sheet is seen nearer by as much. The source prints the distances, the duration and its rate; it measured
roughly, with a laser, so that its errors are not known.

Not modelled: the ground (the scene is the hose, the tanker and the sky behind the drogue).
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import NavigationSheets
from dockair.messages import CameraFrame, Window
from dockair.nav.identify.result import nothing
from dockair.nav.identify.ring import IdentificationStatus, identify
from dockair.nav.image.detect import detect
from dockair.nav.navigator import NavigatorSettings
from dockair.nav.pose.estimate import PoseEstimate, PoseStatus, solve_pose
from dockair.nav.track import RingTracker
from dockair.rotations import Array, matrix_from_yaw_pitch_roll, yaw_pitch_roll_from_matrix
from dockair.scenarios.reproduce.reference import picture_name, read_figure
from dockair.scenarios.studio import Studio, TrueFrame, studio

ID = "ground/fig29"
TITLE = "drogue carried from 15 m to 6 m in 16 s: range and attitude from pixels alone"
_SOURCE = "[Yoon 2018, fig 29]"
_START_M, _END_M, _DURATION_S, _RATE_HZ = 15.0, 6.0, 16.0, 50
_BANDS_M = ((12.0, 15.1), (9.0, 12.0), (5.9, 9.0))
_MOMENT_S = 1e-4  # between two places that give a velocity
_FLIP_CHI2 = 9.0
_MEMORY = 0.9  # a frame, of what spoke for the mirrored pose: 0.2 s at 50 Hz
_MIRRORED_DEG = 5.0  # an attitude so far off is the mirrored one's
_SIZE_IN, _DPI = (10.0, 8.5), 110
_COLUMNS = ("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg")


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """One sine of the hands."""

    amplitude: float
    period_s: float
    phase_rad: float

    def at(self, time_s: float) -> float:
        """Value at a time, in the amplitude's unit."""
        return self.amplitude * float(np.sin(2.0 * np.pi * time_s / self.period_s + self.phase_rad))


def _degrees(amplitude: float, period_s: float, phase_rad: float) -> Swing:
    return Swing(amplitude=float(np.radians(amplitude)), period_s=period_s, phase_rad=phase_rad)


# A walk of 1.1 s a step, a drogue held in two hands: the sizes are assumed, Fig. 29 is a picture without numbers.
_ROLL = (_degrees(3.0, 3.1, 0.3), _degrees(1.0, 1.1, 1.0))
_PITCH = (_degrees(6.0, 2.3, 1.1), _degrees(2.0, 1.1, 0.0))
_YAW = (_degrees(8.0, 4.7, 2.0), _degrees(2.0, 2.2, 0.5))
_LEFT = (
    Swing(amplitude=0.25, period_s=6.1, phase_rad=0.0),
    Swing(amplitude=0.03, period_s=2.2, phase_rad=0.0),
)
_UP = (
    Swing(amplitude=0.15, period_s=4.3, phase_rad=1.0),
    Swing(amplitude=0.03, period_s=1.1, phase_rad=0.0),
)


def true_pose(time_s: float) -> tuple[Array, Array]:
    """R_CD (3, 3) and p_CD (3,) [m] of the carried drogue."""
    yaw, pitch, roll = (sum(swing.at(time_s) for swing in swings) for swings in (_YAW, _PITCH, _ROLL))
    ahead_m = _START_M + (_END_M - _START_M) * time_s / _DURATION_S
    left_m, up_m = (sum(swing.at(time_s) for swing in swings) for swings in (_LEFT, _UP))
    return matrix_from_yaw_pitch_roll(yaw, pitch, roll), np.array([ahead_m, left_m, up_m])


class PixelChain:
    """Detect, identify, track, pose: frame in, pose out; nothing else is known but the sheets.

    Args:
        sheets: nominal.
        roll_rad: of the drogue when it is first seen; settles which LED is which. None leaves that to the ring's code.
    """

    def __init__(self, sheets: NavigationSheets, roll_rad: float | None = 0.0) -> None:
        self._sheets, self._roll_rad = sheets, roll_rad
        self._tracker = RingTracker(sheets.camera, 1.0 / sheets.camera_rate_hz)
        self._last: tuple[Array, Array] | None = None
        self._mirror_chi2 = 0.0  # chi2 of the mirrored pose less that of the pose, summed over frames that fade

    @property
    def window(self) -> Window | None:
        """What to read next; None for the full frame."""
        return self._tracker.window()

    def step(self, frame: CameraFrame) -> PoseEstimate | None:
        """Pose in a frame; None when no ring was identified."""
        camera, tracker = self._sheets.camera, self._tracker
        blobs = detect(frame.pixels, None, frame.window, gain_dn_per_electron=frame.gain)
        tracker.predict()
        found = identify(
            blobs.centroids_px,
            camera=camera,
            ring=self._sheets.ring,
            brightness=blobs.flux,
            expected_led_px=tracker.expected_led_px,
            expected_sigma_px=tracker.expected_sigma_px if tracker.tracking else None,
            expected_roll_rad=tracker.roll_rad if np.isfinite(tracker.roll_rad) else self._roll_rad,
        )
        if not found.absolute:  # numbers that may be any of eight are none
            found = nothing(IdentificationStatus.AMBIGUOUS)
        tracker.update(found)
        if found.status is not IdentificationStatus.FOUND:
            return None
        self._roll_rad = None if self._roll_rad is None else found.roll_rad
        misplaced_px = NavigatorSettings().led_position_sigma_m / (0.5 * self._sheets.ring.diameter_m) * found.radius_px
        pose = solve_pose(
            blobs.centroids_px[found.members],
            self._sheets.ring.positions_D[found.led_numbers],
            camera,
            sigma_px=np.hypot(blobs.sigma_px[found.members], misplaced_px),
            initial=self._last,
        )
        pose = self._likelier(pose)
        if pose.status is not PoseStatus.CONVERGED:
            return None
        self._last = pose.R_CD, pose.p_CD
        return pose

    def _likelier(self, pose: PoseEstimate) -> PoseEstimate:
        """The pose that was led to, or its mirror image, if a few frames together speak for that."""
        if pose.alternative is None:
            return pose
        self._mirror_chi2 = _MEMORY * self._mirror_chi2 + pose.alternative.chi2 - pose.chi2
        if self._mirror_chi2 > -_FLIP_CHI2:
            return pose
        self._mirror_chi2 = -self._mirror_chi2
        return pose.alternative


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Carried:
    """What a run gave, a row a frame; NaN where there was no pose."""

    time_s: Array
    true: Array  #: (n, 6) p_CD [m], roll, pitch, yaw [rad]
    solved: Array  #: (n, 6)
    chain_s: Array  #: (n,) processor time that the chain took
    pixels: Array  #: (n,) read
    scale: float  #: what nominal focal length and ring make of a range, over the range


def carry(seed: int = 3, duration_s: float = _DURATION_S) -> Carried:
    """Render the walk and solve it, as far as `duration_s`."""
    rows, times = [], np.arange(round(duration_s * _RATE_HZ)) / _RATE_HZ
    with studio(seed=seed) as made:
        PixelChain(made.parts.sheets).step(made.take(made.seen_at(*true_pose(0.0))).frame)  # settles, loads, compiles
        chain, scale = PixelChain(made.parts.sheets), _scale(made)
        for time_s in times:
            taken = _moving(made, float(time_s), chain.window)
            began = time.process_time()  # of all threads: what one core would take
            pose = chain.step(taken.frame)
            took = time.process_time() - began
            solved = np.full(6, np.nan) if pose is None else _six(pose.R_CD, pose.p_CD)
            rows.append((_six(taken.R_CD, taken.p_CD), solved, took, taken.frame.pixels.size))
    true, solved_rows, chain_s, pixels = (np.array(column) for column in zip(*rows, strict=True))
    return Carried(time_s=times, true=true, solved=solved_rows, chain_s=chain_s, pixels=pixels, scale=scale)


def _scale(made: Studio) -> float:
    built, sheets = made.parts.as_built, made.parts.sheets
    rings = built.ring_positions_D, sheets.ring.positions_D
    radii = [float(np.linalg.norm(ring - ring.mean(axis=0), axis=1).mean()) for ring in rings]
    return sheets.camera.focal_length_px / built.camera.focal_length_px * radii[1] / radii[0]


def _moving(made: Studio, time_s: float, window: Window | None) -> TrueFrame:
    now, soon = (made.seen_at(*true_pose(t)) for t in (time_s, time_s + _MOMENT_S))
    return made.take(made.seen_between(now, soon, _MOMENT_S), 1, window)


def _six(R_CD: Array, p_CD: Array) -> Array:
    yaw, pitch, roll = yaw_pitch_roll_from_matrix(R_CD)
    return np.array([*p_CD, roll, pitch, yaw])


def reproduce(out: Path | None) -> dict[str, Any]:
    """Carry the drogue once; range and attitude beside truth in `out`."""
    printed = read_figure("yoon_2018_image", "29")
    run = carry()
    error = run.solved - run.true
    solved = np.isfinite(error[:, 0])
    walk = {
        "from_m": float(run.true[0, 0]),
        "to_m": float(run.true[-1, 0]),
        "duration_s": float(len(run.time_s) / _RATE_HZ),
        "frames_per_second": float(len(run.time_s) / run.chain_s.sum()),
        "frames": len(run.time_s),
        "frames_with_pose": int(solved.sum()),
        "frames_mirrored": int((np.abs(error[solved, 4:]) > np.radians(_MIRRORED_DEG)).any(axis=1).sum()),
        "calibration_scale": run.scale,
        "median_ms": float(1e3 * np.median(run.chain_s)),
        "mean_window_kpx": float(1e-3 * run.pixels.mean()),
    }
    rows = [{"case": "whole chain, one core", "ours": walk, "reference": printed}]
    for near, far in _BANDS_M:
        of = solved & (run.true[:, 0] >= near) & (run.true[:, 0] < far)
        ours = _rmse(error[of])
        ours["x_calibrated_m"] = _rms(run.solved[of, 0] / run.scale - run.true[of, 0])
        rows.append({"case": f"RMSE {near:.0f}-{far:.0f} m", "ours": ours, "reference": {}})
    if out is not None:
        _draw(run, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _rmse(error: Array) -> dict[str, float]:
    scale = np.array([1.0, 1.0, 1.0, *3 * [180.0 / np.pi]])
    return {name: _rms(scale[k] * error[:, k]) for k, name in enumerate(_COLUMNS)}


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2))) if len(error) else float("nan")


def _draw(run: Carried, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    scale, labels = (1.0, *3 * (180.0 / np.pi,)), ("x [m]", "roll [°]", "pitch [°]", "yaw [°]")
    panels = figure.subplots(4, 2, sharex=True, width_ratios=(2.0, 1.0))
    for (left, right), column, factor, label in zip(panels, (0, 3, 4, 5), scale, labels, strict=True):
        left.plot(run.time_s, factor * run.solved[:, column], ".", ms=2.0, color="tab:red", label="from pixels")
        left.plot(run.time_s, factor * run.true[:, column], color="black", lw=0.9, label="truth")
        left.set_ylabel(label)
        error = factor * (run.solved - run.true)[:, column]
        right.plot(run.time_s, error, ".", ms=2.0, color="tab:blue")
        right.axhline(0.0, color="black", lw=0.5)
        right.set_ylabel(f"error {label}")
    panels[0, 0].legend(frameon=False)
    panels[0, 0].set_title("Drogue from 15 m to 6 m, swung by hand; 50 Hz, no gyro", fontsize=10)
    panels[0, 1].set_title("estimate - truth", fontsize=10)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    figure.savefig(path)
