"""Half an hour of racetrack behind the tanker: heading of the gyro as it comes, aligned, with HDR, with VDR.

The receiver, its attitude and its frames are `formation` and `frames`; gyros of MTi and of consumer
grade are the simulator's. The aircraft's own roll and pitch are wrong by a Gauss-Markov error. Frames are taken every
2 s and matched once, for all gyros: what a gyro adds to a visual heading is the way over refused frames alone.

    raw       the gyro as it was switched on
    aligned   less the bias that the first half minute shows with frames and own attitude; gyro alone from then on
    HDR       aligned, heuristic drift reduction with an aircraft's constants
    VDR       aligned, `heading_reference`

The source has no aircraft, so that nothing is printed to compare with.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from dockair.calibration import Camera, Mounting
from dockair.messages import CameraFrame, ImuSample, Window
from dockair.nav.heading.hdr import HeuristicDriftReduction
from dockair.nav.heading.heading_reference import HeadingReference, HeadingSettings, HeadingStatus
from dockair.nav.heading.levelling import without_yaw
from dockair.nav.heading.turn import Turn, TurnStatus, VisualSettings
from dockair.nav.heading.visual import VisualHeading
from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.scenarios.reproduce.heading.formation import Formation, Racetrack
from dockair.scenarios.reproduce.heading.frames import EXPOSURE_S, formation_camera
from dockair.scenarios.reproduce.reference import picture_name
from dockair.sim.imu import Imu, ImuParameters
from dockair.streams import random_stream

ID = "heading/racetrack"
TITLE = "half an hour of racetrack in the world: heading of gyro, HDR and VDR, MTi and consumer grade"
GRADES, SEEDS = ("mti", "consumer"), 3
_SOURCE = "the world; [Kyung et al. 2015] for the method"
_FRAME_S, _STEP_S = 2.0, 0.04
_ATTITUDE_DEG, _ATTITUDE_S, _ATTITUDE_SEED = 0.3, 60.0, 5  # error of the aircraft's own roll and pitch
_SIZE_IN, _DPI = (10.0, 9.0), 110
_EMPTY = Window(0, 1, 0, 1)


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What vision saw on a flight, frame by frame."""

    samples: NDArray[np.int64]  #: (f,) gyro samples at which frames were taken
    statuses: tuple[TurnStatus, ...]
    turns_rad: Array  #: (f,) since the frame before; 0 where refused
    R_BC: Array  #: (3, 3)


class SeenAgain:
    """A visual heading that was seen before: `heading_reference.SeesHeading`."""

    def __init__(self, seen: Seen) -> None:
        self._seen, self._frame, self.heading_rad = seen, 0, 0.0

    def step(
        self,
        image: NDArray[Any],
        *,
        mask: NDArray[np.bool_] | None = None,
        R_HC: Array | None = None,
        predicted_turn_rad: float = 0.0,
    ) -> Turn:
        """Go on by a frame; image, mask and attitude are those of then."""
        status, turn = self._seen.statuses[self._frame], float(self._seen.turns_rad[self._frame])
        self._frame += 1
        self.heading_rad += turn if status is TurnStatus.MEASURED else predicted_turn_rad
        return Turn.none(status)


def reproduce(out: Path | None) -> dict[str, Any]:
    """Tabulate errors at the end and in turns; their course as a picture in `out`."""
    formation = formation_of(Racetrack())
    flights = {(grade, seed): fly(formation, grade, seed) for grade in GRADES for seed in range(SEEDS)}
    rows = [_seen_row(formation)]
    for (grade, seed), errors in flights.items():
        rows.append({"case": f"{grade}, seed {seed}", "ours": figures(errors, formation), "reference": {}})
    if out is not None:
        _draw(out / picture_name(ID), formation, flights)
    return {"id": ID, "source": _SOURCE, "rows": rows}


@cache
def formation_of(track: Racetrack) -> Formation:
    """The flight of a racetrack."""
    return Formation(track)


@cache
def own_attitudes(formation: Formation) -> Array:
    """(n + 1, 3, 3) R_LB: roll and pitch as the aircraft believes them, without yaw."""
    rate_hz, rng = formation.track.rate_hz, np.random.default_rng(_ATTITUDE_SEED)
    kept = float(np.exp(-1.0 / (rate_hz * _ATTITUDE_S)))
    white = rng.standard_normal((formation.time_s.size, 2))
    wrong = np.radians(_ATTITUDE_DEG) * lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], white, axis=0)
    R_WB, angles = formation.attitudes_R_WB, np.zeros((len(wrong), 3))
    angles[:, 0], angles[:, 1] = wrong[:, 0], wrong[:, 1]
    back = Rotation.from_euler("z", -np.arctan2(R_WB[:, 1, 0], R_WB[:, 0, 0])[:, None])
    believed = (back * Rotation.from_matrix(R_WB) * Rotation.from_rotvec(angles)).as_matrix()
    again = Rotation.from_euler("z", -np.arctan2(believed[:, 1, 0], believed[:, 0, 0])[:, None])
    return np.asarray((again * Rotation.from_matrix(believed)).as_matrix())


@cache
def seen(formation: Formation, seed: int = 3) -> Seen:
    """Fly the camera along, a frame every 2 s."""
    every = round(_FRAME_S * formation.track.rate_hz)
    samples = np.arange(every, formation.time_s.size, every)
    attitudes, statuses, headings = own_attitudes(formation), [], []
    with formation_camera(formation, seed) as camera:
        visual = VisualHeading(Camera(), VisualSettings.for_aircraft())
        mask = camera.mask()
        for sample in samples:
            level = without_yaw(attitudes[sample])
            here = mask & camera.below_horizon(level)
            turn = visual.step(camera.take(int(sample)).pixels, mask=here, R_HC=level @ camera.R_BC)
            statuses.append(turn.status)
            headings.append(visual.heading_rad)
        R_BC = camera.R_BC
    return Seen(samples, tuple(statuses), np.diff(headings, prepend=0.0), R_BC)


def fly(formation: Formation, grade: str, seed: int) -> dict[str, Array]:
    """(m,) heading errors [rad] at every step of 40 ms: raw, aligned, hdr, vdr; and whether vision was flown."""
    rates = _gyro_rates(formation, grade, seed)
    step, attitudes = round(_STEP_S * formation.track.rate_hz), own_attitudes(formation)
    vdr, bias, on = _step_through(formation, rates, step)
    true = formation.headings_rad[1:]
    headings = {"raw": np.cumsum(_heading_rates(rates, attitudes)) / formation.track.rate_hz}
    less = _heading_rates(rates - bias, attitudes)
    headings["aligned"] = np.cumsum(less) / formation.track.rate_hz
    hdr = HeuristicDriftReduction(formation.track.rate_hz, HeadingSettings().drift.heuristic)
    headings["hdr"] = np.cumsum(hdr.run(less)) / formation.track.rate_hz
    errors: dict[str, Array] = {name: (heading - true)[step - 1 :: step] for name, heading in headings.items()}
    errors["vdr"], errors["vision"] = vdr - true[step - 1 :: step], on.astype(float)
    return errors


def figures(errors: dict[str, Array], formation: Formation) -> dict[str, float]:
    """Errors at the end, and the most of them in turns."""
    step = round(_STEP_S * formation.track.rate_hz)
    turning = formation.is_turning[1:][step - 1 :: step]
    ours: dict[str, float] = {"turned_deg": float(np.degrees(formation.headings_rad[-1]))}
    for name in ("raw", "aligned", "hdr", "vdr"):
        degrees = np.degrees(errors[name])
        ours[f"{name}_end_deg"] = float(degrees[-1])
        ours[f"{name}_most_in_turns_deg"] = float(np.abs(degrees[turning]).max())
    ours["raw_over_vdr_at_end"] = float(np.abs(errors["raw"][-1] / errors["vdr"][-1]))
    ours["gained_in_turns_raw_deg"], ours["gained_in_turns_vdr_deg"] = (
        _most_gained_deg(errors[name], turning) for name in ("raw", "vdr")
    )
    ours["vdr_worse_in_turns_share"] = float(np.mean(np.abs(errors["vdr"]) > np.abs(errors["raw"]), where=turning))
    return ours


def _most_gained_deg(error: Array, turning: NDArray[np.bool_]) -> float:
    """The most that an error changes from the beginning of a turn to its end."""
    changes = np.diff(turning.astype(int), prepend=0, append=0)
    pairs = zip(np.flatnonzero(changes > 0), np.flatnonzero(changes < 0) - 1, strict=True)
    return float(np.degrees(max(abs(error[last] - error[first]) for first, last in pairs)))


def _gyro_rates(formation: Formation, grade: str, seed: int) -> Array:
    """(n, 3) as measured, the gyros mounted along the body's axes."""
    parameters, rate_hz = load_parameters(f"imu_{grade}", ImuParameters), formation.track.rate_hz
    gyro, accelerometer, clock = (random_stream(seed, name) for name in ("gyro", "accelerometer", "imu_clock"))
    imu = Imu(parameters, rate_hz, gyro, accelerometer, clock, np.eye(3), np.zeros(3))
    w_B = formation.rates_rad_s
    return imu.record(len(w_B), w_B, np.zeros_like(w_B), formation.specific_forces_m_s2).angular_rate_rad_s


def _step_through(formation: Formation, rates: Array, step: int) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(m,) headings of `HeadingReference`, the bias (3,) that it aligned to, and (m,) whether vision was flown."""
    sight, attitudes, rate_hz = seen(formation), own_attitudes(formation), formation.track.rate_hz
    mounting = Mounting(R_BC=sight.R_BC, p_BC=np.zeros(3), p_BP=np.zeros(3))
    reference = HeadingReference(Camera(), mounting, rate_hz, visual=SeenAgain(sight))
    frames = {int(sample) for sample in sight.samples}
    headings, on, bias = [], [], None
    for first in range(0, len(rates) - step + 1, step):
        last = first + step
        stamps_s = formation.time_s[first + 1 : last + 1]
        imu = [
            ImuSample(time_stamp_s=float(stamp), angular_rate_rad_s=rate)
            for stamp, rate in zip(stamps_s, rates[first:last], strict=True)
        ]
        frame = _frame_at(float(formation.time_s[last])) if last in frames else None
        solution = reference.step(imu, attitudes[last], frame)
        headings.append(solution.heading_rad)
        on.append(solution.status is HeadingStatus.VISION)
        if bias is None and solution.status is not HeadingStatus.ALIGNING:
            bias = reference.bias_B
    return np.array(headings), np.zeros(3) if bias is None else bias, np.array(on)


def _frame_at(time_s: float) -> CameraFrame:
    """A frame whose picture has been seen already."""
    pixels = np.zeros(_EMPTY.shape, np.uint8)
    return CameraFrame(time_stamp_s=time_s, pixels=pixels, window=_EMPTY, exposure_s=EXPOSURE_S, gain=1.0)


def _heading_rates(rates_B: Array, R_LB: Array) -> Array:
    """(n,) rates of the heading, as `levelling` has them, attitudes at the end of each sample."""
    R = R_LB[1:]
    w_L = np.einsum("nij,nj->ni", R, rates_B)
    return np.asarray(w_L[:, 2] - w_L[:, 0] * R[:, 2, 0] / R[:, 0, 0])


def _seen_row(formation: Formation) -> dict[str, Any]:
    sight = seen(formation)
    true = np.diff(formation.headings_rad[sight.samples])
    measured = np.array([status is TurnStatus.MEASURED for status in sight.statuses])[1:]
    errors, turning = np.degrees(sight.turns_rad[1:] - true), formation.is_turning[sight.samples[1:]]
    ours: dict[str, float] = {"frames": len(sight.samples), "refused": int((~measured).sum())}
    for name, here in (("straight", measured & ~turning), ("turns", measured & turning)):
        ours |= {f"rms_{name}_deg": float(np.sqrt(np.mean(errors[here] ** 2)))}
        ours |= {f"mean_{name}_deg": float(errors[here].mean()), f"most_{name}_deg": float(np.abs(errors[here]).max())}
    ours["whole_flight_deg"] = float(errors[measured].sum())
    return {"case": "vision alone, from frame to frame", "ours": ours, "reference": {}}


def _draw(path: Path, formation: Formation, flights: dict[tuple[str, int], dict[str, Array]]) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(len(GRADES) + 1, 1, figsize=_SIZE_IN, sharex=True, layout="constrained")
    step = round(_STEP_S * formation.track.rate_hz)
    time_s = formation.time_s[step::step]
    axes[0].plot(formation.time_s, np.degrees(formation.headings_rad), color="0.3")
    axes[0].set(ylabel="heading [deg]", title="Racetrack at 180 m/s, bank 25 deg: what the headings are off by")
    colours = {"raw": "0.6", "aligned": "tab:orange", "hdr": "tab:green", "vdr": "tab:blue"}
    labels = {"raw": "raw gyro", "aligned": "aligned gyro", "hdr": "HDR", "vdr": "VDR"}
    for (grade, seed), errors in flights.items():
        each = axes[1 + GRADES.index(grade)]
        for name, colour in colours.items():
            label = labels[name] if seed == 0 else None
            each.plot(time_s, np.abs(np.degrees(errors[name])) + 1e-2, color=colour, label=label, lw=1.0)
        each.set(yscale="log", ylabel=f"{grade}: error [deg]")
    turning = formation.is_turning
    for each in axes:
        each.fill_between(formation.time_s, 0, 1, where=turning, transform=each.get_xaxis_transform(), alpha=0.12)
        each.grid(alpha=0.3)
    for each in axes[1:]:
        each.set_ylim(bottom=1e-2)
    axes[1].legend(loc="lower left", ncols=4)
    axes[-1].set_xlabel("time [s]; shaded: turning")
    figure.savefig(path, dpi=_DPI)
    plt.close(figure)
