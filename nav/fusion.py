"""Drogue relative to receiver over time: gyro between frames, frames with their own capture time.

Error-state Kalman filter on `belief`: R_BD, s = p_BD_B and v = v_BD_B of the drogue's ring centre from the centre of
gravity, which are run forward with the gyro and corrected with frames there. The probe's tip is a point of the body,
so what guidance wants follows with the rate w = w_WB_B of the moment:

    p_PD = s - p_BP,   v_PD = v - w x p_BP,   d/dt p_PD (in body axes) = v - w x s                    (1)

A frame is taken at its capture time: the belief is rolled back to the stamp, corrected, and everything newer is run
again, in whatever order frames arrive. Between gyro samples the rate is linear. The gate is the frame's likelihood
ratio against the prediction, chi-square with 6 degrees of freedom (`pose.posterior`). Several refusals in a row are
taken for a drogue that was struck or let go: the belief is widened before the next frame.

Errors of calibration and mounting are constant in the camera: frames neither show them nor average them. They stand
beside the filter and join the covariance where it goes out. A camera turned by dtheta, misplaced by dp, of scale 1 + k:

    phi += dtheta,    p_PD += dtheta x c + dp + k c,    c = s - p_BC                                  (2)

Not modelled: gyro bias as a state (at 10 deg/h it moves a drogue 10 m away by 0.5 mm/s; it is in the gyro's noise),
single LEDs out of place (0.3 mm is 0.3 px at 3 m: say so in the frame's sigma_px), the drogue's swing as a system.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from dockair.calibration import NavigationSheets
from dockair.messages import ImuSample
from dockair.nav.belief import Belief, MotionNoise, corrected, mixture, moved, pose_prior
from dockair.nav.pose.estimate import PoseEstimate, PoseStatus
from dockair.rotations import Array, skew


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionSettings:
    """Belief about motion, and the gate."""

    #: Relative acceleration [m/s^2/sqrt(Hz)]: twice variance times correlation time. Drogue in light gusts 0.7 m/s^2
    #: over 0.5 s (rms excursion 0.17 m at 0.35 m/s), receiver 0.3 m/s^2 over 1 s; together 0.7 m^2/s^3.
    acceleration_density: float = 0.85
    attitude_density: float = 0.05  # turning of the drogue [rad/sqrt(s)]; assumed: 1 degree of swing at 1 Hz
    start_velocity_sigma_m_s: float = 1.0  # assumed: joining up ends within this of the drogue's velocity
    bias_correlation_s: float = 1.0  # the gyro's bias counts as noise of this correlation time; of the filter's memory
    gate_probability: float = 0.9999  # a good frame is refused once in 10 000
    #: A drogue that is struck or let go changes its velocity at once, which white acceleration does not foresee. After
    #: so many frames refused in a row the belief is widened: by the closure speed, its way over the refused frames, and
    #: some degrees of swing.
    refusals_until_doubt: int = 3
    doubt_velocity_sigma_m_s: float = 1.2
    doubt_position_sigma_m: float = 0.08
    doubt_attitude_sigma_rad: float = 0.1
    buffer_s: float = 0.25  # how late a frame may be
    #: Hardware beside its sheets, 1 sigma each: 0.05 degrees of mounting and 1 px of principal point; 2 mm of mounting;
    #: 0.05 % of focal length and 0.3 mm of the ring's diameter of 0.5 m (as-built hardware is drawn so).
    camera_axes_sigma_rad: float = 9.4e-4
    camera_place_sigma_m: float = 2e-3
    camera_scale_sigma: float = 7.8e-4
    rate_average_s: float = 0.01  # gyro samples averaged for Eq. (1): noise against lag, 5 samples at 500 Hz


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilterState:
    """The belief at one moment."""

    time_s: float
    R_BD: Array  #: (3, 3)
    p_PD_B: Array  #: (3,) ring centre from the probe's tip [m]
    v_PD_B: Array  #: (3,) velocity of the ring centre less that of the probe's tip, not seen from turning axes [m/s]
    rate_PD_B: Array  #: (3,) d/dt of p_PD_B in body axes [m/s]
    covariance: Array  #: (9, 9) of (phi, p_PD_B, v_PD_B): R_BD <- exp(phi) R_BD [rad, m, m/s]


@dataclass(slots=True, eq=False)
class _Node:
    """A moment in the buffer, a gyro sample's or a frame's, and the belief after it."""

    time_s: float
    pose: PoseEstimate | None
    beliefs: list[Belief]
    doubted: bool = False  #: the belief was widened before the frame was taken


def _time(node: _Node) -> float:
    return node.time_s


class RelativeFilter:
    """See the head of the module. Gyro samples that are not newer than the last, or not finite, are ignored.

    Args:
        sheets: calibration, mounting, start geometry, gyro.
        settings: belief about motion, and the gate.
    """

    def __init__(self, sheets: NavigationSheets, settings: FusionSettings | None = None) -> None:
        self._settings = settings or FusionSettings()
        self._sheets, self._mounting, start = sheets, sheets.mounting, sheets.start
        self._gate = float(chi2.ppf(self._settings.gate_probability, 6))
        sigma = np.concatenate(
            [np.full(3, start.sigma_R_rad), start.sigma_p_m, np.full(3, self._settings.start_velocity_sigma_m_s)]
        )
        s = np.array(start.p_PD_B + self._mounting.p_BP, dtype=float)
        self._start = [Belief(np.array(start.R_BD, dtype=float), s, np.zeros(3), np.diag(sigma**2))]
        self._nodes: list[_Node] = []
        self._refusals = 0
        self._gyro_times: list[float] = []
        self._gyro_rates: list[Array] = []
        gyro, bias_s = sheets.gyro, self._settings.bias_correlation_s
        self._noise = MotionNoise(
            attitude2=self._settings.attitude_density**2,
            acceleration2=self._settings.acceleration_density**2,
            gyro2=gyro.noise_density_rad_s_rthz**2 + 2.0 * gyro.bias_sigma_rad_s**2 * bias_s,
        )

    def propagate(self, imu: Sequence[ImuSample]) -> None:
        """Take gyro samples, oldest first."""
        for sample in imu:
            w_B = self._mounting.R_BI @ sample.angular_rate_rad_s
            if np.isfinite(w_B).all() and np.isfinite(sample.time_stamp_s):
                self._take_gyro(sample.time_stamp_s, w_B)
        if self._nodes:
            oldest = self._nodes[-1].time_s - self._settings.buffer_s
            del self._nodes[: max(bisect_right(self._nodes, oldest, key=_time) - 1, 0)]
            first = max(bisect_right(self._gyro_times, self._nodes[0].time_s) - 1, 0)
            del self._gyro_times[:first], self._gyro_rates[:first]

    def update(self, pose: PoseEstimate, time_stamp_s: float) -> bool:
        """Correct the belief by a frame's pose, at the moment it was taken.

        Args:
            pose: of the LEDs, with its lines of sight if it comes from `solve_pose`.
            time_stamp_s: middle of the exposure; at most `buffer_s` before the newest message.

        Returns:
            True if it was used; False when there is no pose, it is older than the buffer, or the gate refuses it (which
            counts toward doubt).
        """
        if pose.status is not PoseStatus.CONVERGED or not np.isfinite(time_stamp_s):
            return False
        if not self._nodes:
            self._nodes.append(_Node(time_stamp_s, None, self._start))
        if time_stamp_s < self._nodes[0].time_s:
            return False
        before, doubted = self._beliefs(time_stamp_s), False
        beliefs = corrected(before, pose, self._mounting, self._gate)
        if not beliefs and self._refusals + 1 >= self._settings.refusals_until_doubt:
            beliefs, doubted = corrected(self._widened(before), pose, self._mounting, self._gate), True
        if not beliefs:
            self._refusals += 1
            return False
        self._refusals = 0
        index = bisect_right(self._nodes, time_stamp_s, key=_time)
        self._nodes.insert(index, _Node(time_stamp_s, pose, beliefs, doubted))
        self._run_from(index + 1)
        return True

    def state(self, time_s: float | None = None) -> FilterState:
        """Return the belief at a time; at that of the newest message if none is given."""
        if time_s is None:
            time_s = self._nodes[-1].time_s if self._nodes else 0.0
        belief, p_BP, w = mixture(self._beliefs(time_s)), self._mounting.p_BP, self._averaged_rate(time_s)
        gyro = self._sheets.gyro
        sigma_w2 = gyro.noise_density_rad_s_rthz**2 / self._settings.rate_average_s + gyro.bias_sigma_rad_s**2
        covariance = belief.P.copy()
        covariance[6:, 6:] += sigma_w2 * skew(p_BP) @ skew(p_BP).T
        covariance[:6, :6] += self._calibration_covariance(belief.p_BD - self._mounting.p_BC)
        return FilterState(
            time_s=time_s,
            R_BD=belief.R_BD,
            p_PD_B=belief.p_BD - p_BP,
            v_PD_B=belief.v_BD - np.cross(w, p_BP),
            rate_PD_B=belief.v_BD - np.cross(w, belief.p_BD),
            covariance=covariance,
        )

    def rate_B(self, time_s: float) -> Array:
        """(3,) gyro rate w_WB_B [rad/s], linear between samples, that of the nearest one outside."""
        index = bisect_right(self._gyro_times, time_s)
        if index == 0:
            return self._gyro_rates[0] if self._gyro_rates else np.zeros(3)
        if index == len(self._gyro_times):
            return self._gyro_rates[-1]
        t0, t1 = self._gyro_times[index - 1 : index + 1]
        k = (time_s - t0) / (t1 - t0)
        return np.asarray((1.0 - k) * self._gyro_rates[index - 1] + k * self._gyro_rates[index])

    def predicted_pose(self, time_s: float) -> tuple[Array, Array, Array]:
        """R_CD (3, 3), p_CD (3,) [m] and their covariance (6, 6) of (phi, delta) in camera axes, at a time."""
        prior = pose_prior(mixture(self._beliefs(time_s)), self._mounting)
        return prior.R_CD, prior.p_CD, prior.covariance

    def predicted_led_pixels(self, time_s: float) -> tuple[Array, Array]:
        """Where the LEDs should be seen.

        Returns:
            (count, 2) pixels, NaN behind the camera; (count,) standard deviation of each in its worst direction [px],
            from the belief alone: without the centroid's noise, the lens's distortion neglected.
        """
        R_CD, p_CD, covariance = self.predicted_pose(time_s)
        camera = self._sheets.camera
        a = self._sheets.ring.positions_D @ R_CD.T
        pixels = camera.pixels_from_points(a + p_CD)
        sigma = np.full(len(a), np.nan)
        for i in np.flatnonzero(np.isfinite(pixels).all(axis=1)):
            x, y, z = a[i] + p_CD
            G = camera.focal_length_px / x * np.array([[y / x, -1.0, 0.0], [z / x, 0.0, -1.0]])
            H = G @ np.hstack([-skew(a[i]), np.eye(3)])
            sigma[i] = np.sqrt(np.linalg.eigvalsh(H @ covariance @ H.T)[-1])
        return pixels, sigma

    def _calibration_covariance(self, p_CD_B: Array) -> Array:
        """(6, 6) of (phi, p_PD_B), Eq. (2), for the ring centre p_CD_B (3,) from the camera [m]."""
        settings, covariance = self._settings, np.zeros((6, 6))
        axes2, lever = settings.camera_axes_sigma_rad**2, skew(p_CD_B)
        covariance[:3, :3] = axes2 * np.eye(3)
        covariance[:3, 3:], covariance[3:, :3] = axes2 * lever, axes2 * lever.T
        covariance[3:, 3:] = axes2 * lever @ lever.T + settings.camera_place_sigma_m**2 * np.eye(3)
        covariance[3:, 3:] += settings.camera_scale_sigma**2 * np.outer(p_CD_B, p_CD_B)
        return covariance

    def _take_gyro(self, time_s: float, w_B: Array) -> None:
        before = self._gyro_times[-1] if self._gyro_times else -np.inf
        if time_s <= before:
            return
        self._gyro_times.append(time_s)
        self._gyro_rates.append(w_B)
        index = bisect_right(self._nodes, time_s, key=_time)
        self._nodes.insert(index, _Node(time_s, None, self._start))
        self._run_from(bisect_right(self._nodes, before, key=_time))  # frames after it had to guess the rate

    def _run_from(self, index: int) -> None:
        """Run the buffer again from a node on; the first node is given."""
        for i in range(max(index, 1), len(self._nodes)):
            node = self._nodes[i]
            node.beliefs = self._moved(self._nodes[i - 1], node.time_s)
            if node.doubted:
                node.beliefs = self._widened(node.beliefs)
            if node.pose is not None:
                node.beliefs = corrected(node.beliefs, node.pose, self._mounting, self._gate) or node.beliefs

    def _widened(self, beliefs: list[Belief]) -> list[Belief]:
        """Return the beliefs with less certainty of motion and place: the drogue has been struck or let go."""
        s = self._settings
        sigmas = (s.doubt_attitude_sigma_rad, s.doubt_position_sigma_m, s.doubt_velocity_sigma_m_s)
        return [replace(belief, P=belief.P + np.diag(np.repeat(np.square(sigmas), 3))) for belief in beliefs]

    def _beliefs(self, time_s: float) -> list[Belief]:
        """Return the belief at a time; the oldest kept if it is older."""
        if not self._nodes:
            return self._start
        index = bisect_right(self._nodes, time_s, key=_time)
        return self._moved(self._nodes[index - 1], time_s) if index else self._nodes[0].beliefs

    def _averaged_rate(self, time_s: float) -> Array:
        last = bisect_right(self._gyro_times, time_s)
        first = bisect_right(self._gyro_times, time_s - self._settings.rate_average_s)
        return np.mean(self._gyro_rates[first:last], axis=0) if last > first else self.rate_B(time_s)

    def _moved(self, node: _Node, time_s: float) -> list[Belief]:
        """Return a node's beliefs at a time with no gyro sample in between."""
        w_B = 0.5 * (self.rate_B(node.time_s) + self.rate_B(time_s))
        return [moved(belief, w_B, time_s - node.time_s, self._noise) for belief in node.beliefs]
