"""Heading of an aircraft from its gyros, its own roll and pitch, and a frame now and then.

    body rates ► heading's rate (`levelling`) ─┬─► aligning: bias about the vertical, by vision
    frame, roll and pitch ► `visual` ──────────┴─► from then on: `vdr` ► heading

It begins by aligning: over the first seconds with frames, the bias about the vertical is what the gyro's turn exceeds
vision's by, per second; without this a gyro that is off by degrees a second would seem to turn for ever.
A frame counts at its own time stamp; what the gyro has turned since is added. Gaps in the gyro's stamps are filled with
its last rate up to `longest_gap_s`; after a longer one the heading is lost, and says so. Samples that are not finite
are gaps; those whose stamps do not rise are passed over.

Not modelled: covariance of the heading, the Earth's rotation (15 deg/h), convergence of meridians.
Source: [Kyung et al. 2015] for the parts; alignment and levelling are ours.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera, Mounting
from dockair.errors import DockairError
from dockair.messages import CameraFrame, ImuSample
from dockair.nav.heading.levelling import Levelling, without_yaw
from dockair.nav.heading.turn import Turn, TurnStatus, VisualSettings
from dockair.nav.heading.vdr import VisionDriftReduction, VisionDriftSettings
from dockair.nav.heading.visual import VisualHeading
from dockair.rotations import Array

__all__ = ["HeadingReference", "HeadingSettings", "HeadingSolution", "HeadingStatus", "SeesHeading"]


class SeesHeading(Protocol):
    """What is asked of a visual heading: `visual.VisualHeading`."""

    heading_rad: float

    def step(
        self,
        image: NDArray[Any],
        *,
        mask: NDArray[np.bool_] | None = None,
        R_HC: Array | None = None,
        predicted_turn_rad: float = 0.0,
    ) -> Turn:
        """Take an image and bring `heading_rad` up to date."""
        ...


class HeadingStatus(Enum):
    """What the heading rests on."""

    ALIGNING = "aligning"  #: the gyro's bias is not known yet
    GYRO = "gyro"  #: with heuristic drift reduction
    VISION = "vision"  #: the curve switch is closed
    LOST = "lost"  #: the gyro was away for too long


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingSettings:
    """Constants; the parts' defaults here are an aircraft's."""

    align_s: float = 30.0  #: 0: not at all
    fewest_aligned: int = 5  #: frames after which the alignment may end
    longest_gap_s: float = 0.5
    remembered_s: float = 1.0  #: how late a frame may come
    levelling_s: float = 60.0  #: over which bias across the vertical is averaged
    drift: VisionDriftSettings = field(default_factory=VisionDriftSettings.for_aircraft)
    visual: VisualSettings = field(default_factory=VisualSettings.for_aircraft)

    def __post_init__(self) -> None:
        for name in ("align_s", "longest_gap_s", "remembered_s", "levelling_s"):
            if not getattr(self, name) >= 0.0:
                raise DockairError(name, expected="a time >= 0", got=getattr(self, name))
        if not self.fewest_aligned >= 1:
            raise DockairError("fewest_aligned", expected="a number >= 1", got=self.fewest_aligned)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadingSolution:
    """The heading at the newest gyro sample."""

    time_stamp_s: float  #: NaN before the first
    heading_rad: float  #: to the left, not wrapped; NaN once it is lost
    status: HeadingStatus
    correction_rad_s: float  #: what is added to the gyro's rate
    turn: TurnStatus | None  #: what came of the frame, None without one


@dataclass(frozen=True, slots=True)
class _Begin:
    """Of an alignment: a frame's stamp, the gyro's turn and the visual heading there."""

    stamp_s: float
    turned_rad: float
    seen_rad: float


class HeadingReference:
    """The parts, stepped as a navigator is.

    Args:
        camera: calibration.
        mounting: of camera and gyros.
        rate_hz: of the gyros.
        settings: constants.
        heading_rad: at the beginning.
        visual: another visual heading than `visual.VisualHeading`.
    """

    def __init__(
        self,
        camera: Camera,
        mounting: Mounting,
        rate_hz: float,
        settings: HeadingSettings | None = None,
        heading_rad: float = 0.0,
        visual: SeesHeading | None = None,
    ) -> None:
        self._settings, self._mounting, self._rate_hz = settings or HeadingSettings(), mounting, rate_hz
        self._visual = visual or VisualHeading(camera, self._settings.visual)
        self._vdr = VisionDriftReduction(rate_hz, self._settings.drift, heading_rad)
        self._status = HeadingStatus.ALIGNING if self._settings.align_s > 0.0 else HeadingStatus.GYRO
        self._stamp_s, self._rate_rad_s = float("nan"), 0.0
        self._turned_rad = 0.0  # by the gyro as it comes
        self._past: deque[tuple[float, float]] = deque()  # (stamp, turned) of the last second
        self._frame: tuple[float, float] | None = None  # the last one's stamp, turned there
        self._start_rad, self._passed_s = heading_rad, 0.0  # heading at the start; the gyro's time since
        self._begin: _Begin | None = None  # of the alignment
        self._frames = 0  # since then
        self._correction_rad_s = 0.0  # while aligning
        self._pending_rad: float | None = None  # a visual heading for the next sample
        self._levelling = Levelling(self._settings.levelling_s)

    @property
    def bias_B(self) -> Array:
        """(3,) of the gyros as far as it is known, body axes [rad/s]; `vdr` corrects the heading's rate besides."""
        return self._levelling.bias_B.copy()

    def step(
        self,
        imu: Sequence[ImuSample],
        R_LB: Array,
        frame: CameraFrame | None = None,
        *,
        frame_R_LB: Array | None = None,
        mask: NDArray[np.bool_] | None = None,
    ) -> HeadingSolution:
        """Take what arrived since the last step.

        Args:
            imu: samples.
            R_LB: (3, 3) the aircraft's roll and pitch at the samples, of its own reference; its yaw is ignored.
            frame: a full frame.
            frame_R_LB: (3, 3) roll and pitch at the frame's time stamp; by default `R_LB`.
            mask: (h, w) bool: where in the frame features may lie.
        """
        turn = None
        level = without_yaw(R_LB)
        for sample in imu:
            self._take(sample, level)
        turning_rad_s = self._settings.drift.heuristic.turn_rate_rad_s
        self._levelling.average(self._stamp_s, level, self._correction(), turning_rad_s)
        if frame is not None and np.isfinite(self._stamp_s):
            turn = self._see(frame, level if frame_R_LB is None else without_yaw(frame_R_LB), mask)
        return HeadingSolution(
            time_stamp_s=self._stamp_s,
            heading_rad=self._heading_rad(),
            status=self._status,
            correction_rad_s=self._correction(),
            turn=None if turn is None else turn.status,
        )

    def _correction(self) -> float:
        aligning = self._status is HeadingStatus.ALIGNING
        return self._correction_rad_s if aligning else self._vdr.correction_rad_s

    def _heading_rad(self) -> float:
        if self._status is HeadingStatus.LOST:
            return float("nan")
        if self._status is not HeadingStatus.ALIGNING:
            return self._vdr.heading_rad
        # what is known of the bias by now holds from the start
        return self._start_rad + self._turned_rad + self._correction_rad_s * self._passed_s

    def _take(self, sample: ImuSample, R_LB: Array) -> None:
        """Go on by a sample and by those that are missing before it."""
        stamp, w_I = sample.time_stamp_s, np.asarray(sample.angular_rate_rad_s, dtype=float)
        if not (np.isfinite(stamp) and np.isfinite(w_I).all()) or stamp <= self._stamp_s:
            return
        rate = self._levelling.heading_rate_rad_s(self._mounting.R_BI @ w_I, R_LB)
        missing = 0 if np.isnan(self._stamp_s) else max(round((stamp - self._stamp_s) * self._rate_hz) - 1, 0)
        if missing > self._settings.longest_gap_s * self._rate_hz:
            self._status = HeadingStatus.LOST
        else:
            for _ in range(missing):
                self._go_on(self._rate_rad_s)
            self._go_on(rate)
        self._stamp_s, self._rate_rad_s = stamp, rate
        self._past.append((stamp, self._turned_rad))
        while self._past[0][0] < stamp - self._settings.remembered_s:
            self._past.popleft()

    def _go_on(self, rate_rad_s: float) -> None:
        self._turned_rad += rate_rad_s / self._rate_hz
        self._passed_s += 1.0 / self._rate_hz
        if self._status in (HeadingStatus.GYRO, HeadingStatus.VISION):
            self._vdr.step(rate_rad_s, self._pending_rad)
            self._status = HeadingStatus.VISION if self._vdr.is_turning else HeadingStatus.GYRO
        self._pending_rad = None

    def _see(self, frame: CameraFrame, R_LB: Array, mask: NDArray[np.bool_] | None) -> Turn | None:
        """Take a frame at its own time; None when it came too late, or before the one before."""
        stamp = frame.time_stamp_s
        if not self._past or stamp < self._past[0][0] or (self._frame is not None and stamp <= self._frame[0]):
            return None
        stamps, turned = np.array(self._past).T
        ahead_s = max(stamp - self._stamp_s, 0.0)  # the rate goes on past the newest sample
        turned_then = float(np.interp(stamp, stamps, turned)) + self._rate_rad_s * ahead_s
        predicted = 0.0
        if self._frame is not None:
            since = stamp - self._frame[0]
            predicted = turned_then - self._frame[1] + self._correction() * since
        self._frame = stamp, turned_then
        turn = self._visual.step(frame.pixels, mask=mask, R_HC=R_LB @ self._mounting.R_BC, predicted_turn_rad=predicted)
        seen = self._visual.heading_rad
        if self._status is HeadingStatus.ALIGNING:
            self._align(turn, stamp, turned_then, seen, R_LB)
        elif turn.status is TurnStatus.MEASURED:
            # what the gyro has turned since, and will by the next sample
            late_s = self._stamp_s - stamp + 1.0 / self._rate_hz
            since = self._turned_rad - turned_then + self._rate_rad_s / self._rate_hz
            self._pending_rad = seen + since + self._correction() * late_s
        return turn

    def _align(self, turn: Turn, stamp: float, turned: float, seen: float, R_LB: Array) -> None:
        """The gyro's bias from what vision has seen since the alignment began; a refused frame begins anew."""
        begin = self._begin
        if begin is None or turn.status is not TurnStatus.MEASURED:
            self._begin, self._frames = _Begin(stamp, turned, seen), 0
            return
        self._frames += 1
        self._correction_rad_s = ((seen - begin.seen_rad) - (turned - begin.turned_rad)) / (stamp - begin.stamp_s)
        if stamp - begin.stamp_s < self._settings.align_s or self._frames < self._settings.fewest_aligned:
            return
        self._vdr = VisionDriftReduction(self._rate_hz, self._settings.drift, self._heading_rad())
        self._levelling.bias_B = self._levelling.bias_B - self._correction_rad_s * R_LB[2]  # about the vertical
        self._status = HeadingStatus.GYRO
