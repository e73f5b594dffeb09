"""Camera, gyro or some of the LEDs gone for a while at 5 m, and frames that are late: errors beside what is believed.

Outages begin when the ring is 5 m from the camera. At their end stand the error over all approaches and the sigma that
the filter states; then the frames until the error is again no more than three of the sigmas from before the outage, in
the worst approach. Late frames: the error at the exposure's own time, when the frame has just been taken, and that of
the belief about the present, which has to foresee the drogue for as long. The last row is the machine's: the least of
many times, from Python.
"""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dockair.nav.fusion import FusionSettings, RelativeFilter
from dockair.nav.pose.estimate import solve_pose
from dockair.rotations import Array
from dockair.scenarios.reproduce.fusion.cases import Case, tracks
from dockair.scenarios.reproduce.fusion.flight import Approach, fly
from dockair.scenarios.reproduce.fusion.follow import Track, Watching, calibrated
from dockair.scenarios.reproduce.reference import picture_name

ID = "fusion/outages"
TITLE = "relative filter without camera, gyro or most LEDs for a while, and with late frames"
_SOURCE = "none: limits are those wanted of it"
_TRIALS = 40
_APPROACH = Approach(duration_s=6.0, first_m=6.0)
_BEGIN_S = 3.1  # the ring is 5 m from the camera: 2.7 m from it to the tip
_BEFORE_S, _SIGMAS, _WORST_FRAMES = 0.2, 3.0, 50
_LATENCIES_S = (0.0, 0.02, 0.05, 0.1)
_NEAR_M = 5.0
_SIZE_IN, _DPI = (11.0, 4.4), 110


def _outage(settings: FusionSettings, length_s: float, *, camera: bool, gyro: bool, leds: int = 0) -> Watching:
    def out(time_s: float) -> bool:
        return _BEGIN_S < time_s <= _BEGIN_S + length_s

    return Watching(
        settings=settings,
        seen=lambda time_s: not (camera and leds == 0 and out(time_s)),
        leds=lambda time_s: leds if leds and out(time_s) else 8,
        turned=lambda time_s: not (gyro and out(time_s)),
    )


def outages() -> dict[str, tuple[float, Watching]]:
    """Return name, length and what is left, hardware as its sheets say."""
    exact = calibrated(FusionSettings())
    return {
        "camera off for 0.5 s": (0.5, _outage(exact, 0.5, camera=True, gyro=False)),
        "camera off for 1 s": (1.0, _outage(exact, 1.0, camera=True, gyro=False)),
        "IMU off for 0.5 s": (0.5, _outage(exact, 0.5, camera=False, gyro=True)),
        "both off for 0.5 s": (0.5, _outage(exact, 0.5, camera=True, gyro=True)),
        "two LEDs for 1 s": (1.0, _outage(exact, 1.0, camera=False, gyro=False, leds=2)),
        "one LED for 1 s": (1.0, _outage(exact, 1.0, camera=False, gyro=False, leds=1)),
    }


def reproduce(out: Path | None, trials: int = _TRIALS) -> dict[str, Any]:
    """Run all cases; errors and sigmas against time in `out`."""
    rows, shown = [], {}
    for name, (length_s, watching) in outages().items():
        flown = tracks(Case(name=name, approach=_APPROACH, watching=watching), trials)
        rows.append({"case": name, "ours": _at_end(flown, length_s), "reference": {"frames_to_recover": 3}})
        shown[name] = flown
    late = [_late(latency_s, trials) for latency_s in _LATENCIES_S]
    rows += [
        {
            "case": f"frames {1e3 * latency_s:.0f} ms late",
            "ours": ours,
            "reference": {key: late[0][key] for key in ours},
        }
        for latency_s, ours in zip(_LATENCIES_S, late, strict=True)
    ]
    rows.append({"case": "time", "ours": _times(), "reference": {"imu_sample_us": 50.0, "frame_50_ms_late_ms": 1.0}})
    if out is not None:
        _draw(shown, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _at_end(flown: list[Track], length_s: float) -> dict[str, float]:
    time_s = flown[0].time_s
    end = int(np.searchsorted(time_s, _BEGIN_S + length_s + 1e-6)) - 1
    first = int(np.searchsorted(time_s, _BEGIN_S))
    error = np.array([track.error[end] for track in flown])
    P = np.array([track.covariance[end] for track in flown])
    found = {"range_rmse_mm": (3,), "across_rmse_mm": (4, 5)}
    ours = {name: 1e3 * float(np.sqrt((error[:, rows] ** 2).sum(axis=1).mean())) for name, rows in found.items()}
    for name, rows in (("range_sigma_mm", (3,)), ("across_sigma_mm", (4, 5))):
        ours[name] = 1e3 * float(np.sqrt(P[:, rows, rows].sum(axis=1).mean()))
    ours["nees_over_n"] = float(np.mean([track.nees[end] for track in flown])) / 9.0
    ours["frames_to_recover"] = max(_recovered_after(track, first, end) for track in flown)
    return ours


def _recovered_after(track: Track, first: int, end: int) -> int:
    sigma = np.sqrt(np.diagonal(track.covariance[first - 1])[3:6])
    back = (np.abs(track.error[end + 1 :, 3:6]) <= _SIGMAS * sigma).all(axis=1)
    return int(np.argmax(back)) + 1 if back.any() else _WORST_FRAMES


def _late(latency_s: float, trials: int) -> dict[str, float]:
    watching = Watching(settings=calibrated(FusionSettings()), latency_s=latency_s)
    flown = tracks(Case(name="", approach=_APPROACH, watching=watching), trials)
    near = np.concatenate([track.range_m < _NEAR_M for track in flown])
    seen = np.concatenate([track.error_C for track in flown])[near]
    now = np.concatenate([track.error for track in flown])[near]
    return {
        "range_rmse_mm_at_exposure": 1e3 * _rms(seen[:, 3:4]),
        "across_rmse_mm_at_exposure": 1e3 * _rms(seen[:, 4:6]),
        "range_rmse_mm_now": 1e3 * _rms(now[:, 3:4]),
        "across_rmse_mm_now": 1e3 * _rms(now[:, 4:6]),
    }


def _rms(errors: Array) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def _times() -> dict[str, float]:
    """Least time of a sample, and of a frame 50 ms late, at 500 Hz and 50 Hz."""
    flown = fly(replace(_APPROACH, duration_s=3.0, imu_rate_hz=500), 0)
    sheets, rng = flown.sheets, np.random.default_rng(0)
    filter_ = RelativeFilter(sheets)
    samples_s, frames_s = [], []
    for tick, sample in enumerate(flown.imu):
        start = time.perf_counter()
        filter_.propagate([sample])
        samples_s.append(time.perf_counter() - start)
        if tick % 10 == 5 and tick > 50:
            stamp_s = float(flown.time_s[tick - 25])
            R_CD, p_CD, _ = filter_.predicted_pose(stamp_s)
            pixels, points_D = flown.pixels(tick - 25, 0.1, rng), sheets.ring.positions_D
            pose = solve_pose(pixels, points_D, sheets.camera, initial=(R_CD, p_CD))
            start = time.perf_counter()
            filter_.update(pose, stamp_s)
            frames_s.append(time.perf_counter() - start)
    return {"imu_sample_us": 1e6 * min(samples_s), "frame_50_ms_late_ms": 1e3 * min(frames_s)}


def _draw(shown: dict[str, list[Track]], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    for axes, (title, rows) in zip(figure.subplots(1, 2), (("along", (3,)), ("across", (4, 5))), strict=True):
        for k, (name, flown) in enumerate(shown.items()):
            error = np.sqrt(np.mean([(track.error[:, rows] ** 2).sum(axis=1) for track in flown], axis=0))
            variances = [track.covariance[:, rows, rows].sum(axis=1) for track in flown]
            axes.plot(flown[0].time_s, 1e3 * error, lw=1.0, color=f"C{k}", label=name)
            axes.plot(flown[0].time_s, 1e3 * np.sqrt(np.mean(variances, axis=0)), lw=1.0, ls=":", color=f"C{k}")
        axes.set(
            yscale="log", xlim=(_BEGIN_S - 0.5, _BEGIN_S + 1.6), ylim=(0.1, 500.0), xlabel="time [s]",
            ylabel="[mm]", title=f"{title}: rms error (dotted: what the filter states)",
        )  # fmt: skip
    figure.axes[0].legend(frameon=False, fontsize=8)
    figure.savefig(path)
