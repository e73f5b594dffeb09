"""Drogue relative to receiver over time: IMU between frames, frames with their own capture time.

Error-state Kalman filter on `belief`, run forward with the IMU as `belief_motion` says and corrected with frames there.
The probe's tip is a point of the body, so what guidance wants follows from the place s = p_ID_B and velocity v of the
drogue from the accelerometers, r = p_IP, and the rate w = w_WB_B of the moment:

    p_PD = s - r,   v_PD = v - w x r,   d/dt p_PD (in body axes) = v - w x s                          (1)

A frame is taken at its capture time: the belief is rolled back to the stamp, corrected, and everything newer is run
again, in whatever order frames arrive; which of them are refused goes by that order. The gate is what frame and belief
cost together, chi-square with two degrees of freedom an LED (six for a pose alone). Several refusals in a row are taken
for a drogue that was struck or let go: the belief is widened before the next frame.

Not modelled: contact (the drogue moves with the probe then, and what stands for gusts has to follow), a formation that
turns or speeds up but by the walk of c.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from dockair.calibration import NavigationSheets
from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.messages import ImuSample
from dockair.nav import belief_motion as motion
from dockair.nav.belief import Correction, begun_again, corrected, felt_first, mixture, rolled, widened
from dockair.nav.belief_buffer import BeliefBuffer, Frame, Node
from dockair.nav.belief_sight import Apparent, Belief, Sight
from dockair.nav.fusion_settings import FusionSettings as FusionSettings
from dockair.nav.fusion_settings import motion_of, refusals_until_doubt, start_of, taking_of
from dockair.nav.imu_record import ImuRecord, Stamps
from dockair.nav.pose.estimate import PoseEstimate, PoseStatus
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.rotations import Array, log, skew
from dockair.vectors import is_finite


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilterState:
    """The belief at one moment."""

    time_s: float
    R_BD: Array  #: (3, 3)
    p_PD_B: Array  #: (3,) ring centre from the probe's tip [m]
    v_PD_B: Array  #: (3,) velocity of the ring centre less that of the probe's tip, not seen from turning axes [m/s]
    rate_PD_B: Array  #: (3,) d/dt of p_PD_B in body axes [m/s]
    covariance: Array  #: (9, 9) of (phi, p_PD_B, v_PD_B): R_BD <- exp(phi) R_BD [rad, m, m/s]


class RelativeFilter:
    """See the head of the module; which samples are not taken, at `ImuRecord`.

    Args:
        sheets: calibration, mounting, start geometry, gyro.
        settings: belief about motion, and the gate.
        look_back_s: how long before the latest frame one may have been taken whose belief can still be asked what it
            foretold of that (`foretold_p_PD_B`).
    """

    def __init__(
        self, sheets: NavigationSheets, settings: FusionSettings | None = None, *, look_back_s: float = 0.0
    ) -> None:
        self._settings = settings or FusionSettings()
        self._sheets = sheets
        self._sight = Sight(mounting=sheets.mounting, points_D=sheets.ring.positions_D)
        self._p_IP = np.asarray(sheets.mounting.p_BP - sheets.mounting.p_BI, dtype=float)
        self._to_tip = np.eye(9, motion.ERRORS)  # from the errors to those of Eq. (1)
        self._to_tip[6:, motion.BIAS] = -skew(self._p_IP)
        self._lever2 = skew(self._p_IP) @ skew(self._p_IP).T
        probability = self._settings.gate_probability
        self._gates = [0.0, *(float(chi2.ppf(probability, freedom)) for freedom in range(1, 17))]
        self._taking = taking_of(self._settings, sheets.camera_rate_hz)
        self._refusals_until_doubt = refusals_until_doubt(self._settings, sheets.camera_rate_hz)
        self._motion = motion_of(self._settings, sheets.gyro)
        self._record = ImuRecord(sheets.mounting, sheets.gyro, self._settings.saturated_share)
        slowest_s = 2.0 / sheets.control_rate_hz  # two periods of an IMU that is no faster than control
        self._imu_stamps = Stamps(max(self._settings.imu_leap_s, slowest_s))
        self._frame_stamps = Stamps(self._settings.leap_s)
        self._buffer = BeliefBuffer(
            self._record,
            self._motion,
            [start_of(self._settings, sheets)],
            self._taken_again,
            span_s=self._settings.buffer_s + look_back_s,
            interval_s=self._settings.node_interval_s,
        )
        self._refusals, self._felt, self._doubted_s = 0, False, -math.inf
        self._last: Correction | None = None
        self._was_contradicted = False
        self._shown: tuple[Belief, Apparent] | None = None  # of the belief asked for last

    @property
    def imu_time_s(self) -> float:
        """Stamp of the newest sample taken; -inf before the first."""
        return self._record.newest_s

    @property
    def doubted_s(self) -> float:
        """Stamp of the newest frame that was taken on a widened belief; -inf before the first."""
        return self._doubted_s

    @property
    def was_contradicted(self) -> bool:
        """Whether the gate refused the newest frame offered; a second of one stamp, or one too old, asks no gate."""
        return self._was_contradicted

    @property
    def innovation(self) -> tuple[float, int] | None:
        """Of the newest frame offered: its chi-square against the prediction, and the degrees of freedom."""
        return None if self._last is None else (self._last.chi2, self._last.degrees_of_freedom)

    def propagate(self, imu: Sequence[ImuSample]) -> list[ImuSample]:
        """Take samples of the IMU, oldest first; return those that could be used."""
        taken: list[ImuSample] = []
        record, believed = self._record, self._imu_stamps.believed
        for sample in imu:
            before_s = record.newest_s
            if sample.time_stamp_s <= before_s or not believed(sample.time_stamp_s, self._buffer.newest_s):
                continue
            if record.take(sample):
                taken.append(sample)
                if not self._felt:
                    self._feel(record.forces_B[-1])
                self._buffer.after_sample(before_s)
        if taken:
            self._buffer.renew_head()
        return taken

    def update(self, pose: PoseEstimate, time_stamp_s: float) -> bool:
        """Correct the belief by a frame's pose, at the moment it was taken.

        Args:
            pose: of the LEDs, with its lines of sight if it comes from `solve_pose`.
            time_stamp_s: middle of the exposure; at most `buffer_s` and `look_back_s` before the newest message.

        Returns:
            True if it was used; False when there is no pose, it is older than the buffer or a second one of the same
            stamp, or the gate refuses it (which counts toward doubt).
        """
        return pose.status is PoseStatus.CONVERGED and self._offer(pose, time_stamp_s)

    def update_leds(self, pixels: Array, points_D: Array, sigma_px: Array, time_stamp_s: float) -> bool:
        """Correct the belief by some named LEDs, even a single one; their attitude is then the belief's.

        Args:
            pixels: (n, 2) where they were seen; rows that are not finite are left out.
            points_D: (n, 3) the same LEDs in drogue axes [m].
            sigma_px: (n,) standard deviation of each pixel coordinate.
            time_stamp_s: as for `update`.

        Raises:
            DockairError: the coupling is loose: a pose takes three LEDs.
        """
        if self._settings.coupling != "tight":
            raise DockairError("fusion.coupling", expected="tight, to use single LEDs", got=self._settings.coupling)
        sight = lines_of_sight_from_pixels(pixels, points_D, self._sheets.camera, np.asarray(sigma_px, dtype=float))
        self._was_contradicted = False
        return len(sight.rays) > 0 and self._offer(sight, time_stamp_s)

    def turn_drogue(self, roll_rad: float, time_s: float) -> None:
        """Begin afresh at a time with the drogue rolled about its axis: its LEDs had been numbered wrongly."""
        led2 = self._settings.led_place_sigma_m**2
        beliefs = [rolled(belief, roll_rad, led2) for belief in self._buffer.beliefs(time_s)]
        self._buffer.begin(time_s, beliefs)

    def begin_again(self, pose: PoseEstimate, time_s: float) -> None:
        """Begin afresh at a time with the drogue where a converged pose has it: it had been lost.

        Its LEDs were numbered without a belief, right up to the ring's symmetry: the attitude that the gyro has carried
        on is turned by as many LEDs as brings it nearest to the pose's.
        """
        mounting, settings = self._sheets.mounting, self._settings
        p_ID = mounting.R_BC @ pose.p_CD + mounting.p_BC - mounting.p_BI
        lost = mixture(self._buffer.beliefs(time_s))
        apart_rad = 2.0 * np.pi / self._sheets.ring.count
        turn = log(lost.R_BD.T @ mounting.R_BC @ pose.R_CD)
        leds = round(float(turn[0]) / apart_rad)
        if leds != 0:
            lost = rolled(lost, leds * apart_rad, settings.led_place_sigma_m**2)
        start = self._buffer.start
        self._buffer.begin(time_s, [begun_again(lost, s, p_ID, settings.doubt_attitude_sigma_rad) for s in start])
        self._refusals = 0

    def state(self, time_s: float | None = None) -> FilterState:
        """Return the belief at a time; at that of the newest message if none is given."""
        if time_s is None:
            time_s = self._buffer.newest_s if self._buffer.last is not None else 0.0
        belief, r, average_s = self._belief(time_s), self._p_IP, self._settings.rate_average_s
        w_B = self._record.mean_rate_B(time_s, average_s) - belief.bias
        rate2 = self._rate_variance(time_s)
        v, rate, covariance = _of_tip(w_B, belief.p_ID, belief.v_ID, belief.P, r, self._to_tip, self._lever2, rate2)
        return FilterState(
            time_s=time_s,
            R_BD=belief.R_BD.copy(),  # the belief's own is no consumer's to write into
            p_PD_B=belief.p_ID - r,
            v_PD_B=v,
            rate_PD_B=rate,
            covariance=covariance,
        )

    def rate_B(self, time_s: float) -> Array:
        """(3,) gyro rate less its bias [rad/s], linear between samples, that of the nearest one outside."""
        return self._record.rate_B(time_s) - self.bias_B if math.isfinite(self.imu_time_s) else np.zeros(3)

    def mean_rate_B(self, time_s: float, span_s: float) -> Array:
        """(3,) mean of the newest gyro samples up to a time, a span of them, less the bias [rad/s]."""
        felt = math.isfinite(self.imu_time_s)
        return self._record.mean_rate_B(time_s, span_s) - self.bias_B if felt else np.zeros(3)

    @property
    def bias_B(self) -> Array:
        """(3,) of the gyro, as believed now [rad/s]."""
        last = self._buffer.last
        return last.beliefs[0].bias if last is not None else np.zeros(3)

    def mean_force_B(self, start_s: float, end_s: float) -> Array:
        """(3,) mean specific force after `start_s` up to `end_s` [m/s^2]; NaN where none was felt."""
        return self._record.mean_force_B(start_s, end_s)

    def felt(self, start_s: float, end_s: float) -> bool:
        """Whether the receiver's motion was felt from a time to another, now: samples and their forces have no gap.

        Where there never was a force, as of an IMU without accelerometers, none is asked for.
        """
        return self._record.is_unbroken(start_s, end_s, self._motion.longest_gap_s, forces=self._felt)

    def predicted_pose(self, time_s: float) -> tuple[Array, Array, Array]:
        """R_CD (3, 3), p_CD (3,) [m] that a frame would show, and their covariance (6, 6) of (phi, delta) in C."""
        seen = self._apparent(self._belief(time_s))
        return seen.R_CD, seen.p_CD, seen.covariance

    def p_PD_B(self, time_s: float) -> Array:
        """(3,) ring centre from the probe's tip [m], that of `state`."""
        return np.asarray(self._belief(time_s).p_ID - self._p_IP)

    def foretold_p_PD_B(self, time_s: float, horizon_s: float) -> tuple[Array, float]:
        """Where the drogue would be believed to be at a time, had no frame come for `horizon_s` before.

        Returns:
            (3,) ring centre from the probe's tip [m], and for how long no frame would have come [s]; NaN where the
            buffer holds no frame so old.
        """
        x, unseen_s = self._buffer.foretold(time_s, horizon_s)
        return x[motion.S] - self._p_IP, unseen_s

    def led_points_D(self, time_s: float) -> Array:
        """(count, 3) places of the LEDs in drogue axes [m], as far as frames have shown them."""
        return self._sight.led_points_D(self._belief(time_s))

    def predicted_led_pixels(self, time_s: float) -> tuple[Array, Array]:
        """Where the LEDs should be seen.

        Returns:
            (count, 2) pixels, NaN behind the camera; (count,) standard deviation of each in its worst direction [px],
            from the belief alone: without the centroid's noise, the lens's distortion neglected.
        """
        belief = self._belief(time_s)
        return self._sight.led_pixels(belief, self._apparent(belief), self._sheets.camera)

    def _belief(self, time_s: float) -> Belief:
        return mixture(self._buffer.beliefs(time_s))

    def _apparent(self, belief: Belief) -> Apparent:
        """Return what a frame would show; of one belief it is asked for several times, and found once."""
        if self._shown is None or self._shown[0] is not belief:
            self._shown = belief, self._sight.apparent(belief)
        return self._shown[1]

    def _rate_variance(self, time_s: float) -> float:
        """Of the averaged rate, each axis, by what may have changed since the moment that it belongs to.

        The gyro's noise is left out: v was found with the same samples, which took w x s for a part of it, so that in
        v - w x r it nearly cancels.
        """
        averaged_s = self._record.mean_age_s(self._settings.rate_average_s)
        age_s = max(time_s - self._record.newest_s, 0.0) + averaged_s
        return float(min(self._motion.held_turn2 * age_s**2, self._settings.held_rate_sigma_rad_s**2))

    def _feel(self, force_B: Array) -> None:
        """Take the first specific force for that of the formation."""
        if is_finite(force_B):
            self._felt = True
            self._buffer.change_all(lambda belief: felt_first(belief, force_B))

    def _offer(self, frame: Frame, time_s: float) -> bool:
        self._was_contradicted = False
        if not self._frame_stamps.believed(time_s, self._buffer.newest_s):
            return False
        before, doubted = self._buffer.before_frame(time_s), False
        if before is None:
            return False
        correction = self._corrected(before, frame)
        self._last = correction
        is_pose = isinstance(frame, PoseEstimate)  # one or two LEDs may be clutter, to which doubt would give way
        if is_pose and not correction.beliefs and self._refusals + 1 >= self._refusals_until_doubt:
            correction, doubted = self._corrected(self._widened(before), frame), True
        if not correction.beliefs:
            self._refusals += is_pose
            self._was_contradicted = True
            return False
        self._refusals = 0
        if doubted:
            self._doubted_s = max(self._doubted_s, time_s)
        self._buffer.insert(Node(time_s, frame, correction.beliefs, doubted))
        return True

    def _taken_again(self, node: Node, before: list[Belief]) -> list[Belief]:
        """Return what is believed after a node whose past has changed."""
        if node.doubted:
            before = self._widened(before)
        if node.frame is None:
            return before
        return self._corrected(before, node.frame).beliefs or before

    def _corrected(self, beliefs: list[Belief], frame: Frame) -> Correction:
        return corrected(beliefs, frame, self._sight, self._gates, self._taking)

    def _widened(self, beliefs: list[Belief]) -> list[Belief]:
        """Return the beliefs with less certainty: the drogue has been struck or let go, or is seen from elsewhere."""
        s = self._settings
        sigmas = (s.doubt_attitude_sigma_rad, s.doubt_position_sigma_m, s.doubt_velocity_sigma_m_s)
        return [widened(belief, sigmas, s.led_place_sigma_m) for belief in beliefs]


@njit(cache=True, error_model="numpy")
def _of_tip(
    w: Array, s: Array, v: Array, P: Array, r: Array, to_tip: Array, lever2: Array, rate2: float
) -> tuple[Array, Array, Array]:
    """(3,) v_PD and (3,) the rate of p_PD in body axes, Eq. (1), and (9, 9) the state's covariance, with w's `rate2`.

    Products are the library's, as everywhere in the filter: a loop would round otherwise.
    """
    w_cross = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    covariance = np.dot(np.dot(to_tip, P), to_tip.T)
    covariance[6:, 6:] += rate2 * lever2
    return v - np.dot(w_cross, r), v - np.dot(w_cross, s), 0.5 * (covariance + covariance.T)
