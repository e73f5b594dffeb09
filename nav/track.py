"""The ring followed from frame to frame: an image-plane Kalman filter, and the window the next frame needs.

    x = [u v du dv],   x_k = F x_{k-1} + w,   F = [[I, dt I], [0, I]],   z = [u v] = H x + v,  H = [I 0]
                                                                              [Yoon 2018, eqs 27-37]
Radius r and roll phi have filters of the same form; filterpy runs all in one, x = [u v r phi du dv dr dphi]. The
source's Q = 0.01 I and R = 4 I suit a target that rests or drifts. A drogue in gusts accelerates; to Q comes white
acceleration of a r [px/s^2], in units of the ring's radius so that one number serves all ranges (a = 8 radii/s^2 is
2 m/s^2 for a 0.5 m ring), and of alpha [rad/s^2] for the roll:

    Q = 0.01 I + (a r)^2 [[dt^4/4 I, dt^3/2 I], [dt^3/2 I, dt^2 I]]                        (1)

With a = 0 it is the source's filter. The camera's own rotation is no motion of the drogue: `predict` takes the turn
that the gyro measured and moves the ring as one at rest would be seen to move; the filter sees only the rest.

Every LED is carried by itself, seen or hidden, at its place q_k on the ring of the last frame (radius 1, roll 0):

    (u, v)_k = (u, v) + r R(phi) q_k                                                       (2)

so that LEDs which hide and come back keep their numbers; those of a lost ring do while three sigma of its roll are less
than half a place (22.5 degrees), which is for half a second.

A measurement counts when its innovation passes a chi-square gate of three degrees of freedom (centre and radius);
otherwise the frame is a miss, like one without a ring. The window is the predicted ring with three sigma and a margin,
shifted by the turn to come, and wider with every miss; after `lost_s` of them, at least one, there is none (full
frame), and the next ring found starts the filter afresh. Frames that never arrive are no misses.

Not modelled: the ring's tilt (its window is a square around the circle), correlation between the four, what a turn does
to the ring's shape (2 px at the frame's corner at 2 m and 45 deg/s), distortion in a turn.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from dockair.calibration import Camera
from dockair.errors import DockairError, check_numbers
from dockair.messages import Window
from dockair.nav.identify.perspective import SLOTS
from dockair.nav.identify.ring import Identification, IdentificationStatus
from dockair.nav.track_kernels import ahead, innovation_squared, process_noise, turn
from dockair.rotations import Array
from dockair.vectors import largest_sigma

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter

_U, _R, _PHI = slice(0, 2), 2, 3
_AXES = 4  # u, v, r, phi: their rates follow in the same order
_PLACES, _RATES = np.arange(_AXES), np.arange(_AXES, 2 * _AXES)
_CENTRE = np.array([0, 1, _AXES, _AXES + 1])
_COMPLEX = np.array([1.0, 1.0j])
_NO_TURN = np.zeros(3)
_HALF_PLACE = np.pi / SLOTS  # a roll off by more is another numbering


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackSettings:
    """Settings of the tracker; lengths in pixels."""

    process_variance: float = 0.01  # Q's diagonal [Yoon 2018, III.3]
    measurement_variance: float = 4.0  # R's diagonal; sigma = 2 px, as the source's plots imply
    acceleration_radii_s2: float = 8.0  # a of Eq. (1): gusts of 2 m/s^2 on a 0.25 m ring
    start_velocity_radii_s: float = 4.0  # 1 sigma at the first frame: 1 m/s
    roll_sigma_px: float = 0.5  # of a measured roll, at the ring's rim: a fit's, tilt and hidden LEDs included
    roll_acceleration_rad_s2: float = 4.0  # alpha: white for 1.3 rad/s^2 over 0.8 s, from 30 deg/s one way to the other
    start_roll_rate_rad_s: float = 0.5  # 1 sigma at the first frame: 30 deg/s
    gate_probability: float = 0.9999  # of a true measurement to pass
    window_sigmas: float = 3.0
    window_margin_px: float = 12.0  # the LEDs' own spots and the rim beyond the ring's circle
    window_margin_radii: float = 0.15  # perspective and tilt
    growth: float = 1.5  # of the window, for every so long that no measurement counts:
    growth_s: float = 0.02  # a frame at 50 Hz
    lost_s: float = 0.1  # without a measurement that counts: what the drogue does meanwhile is the same at every rate

    def __post_init__(self) -> None:
        still = "process_variance", "acceleration_radii_s2", "roll_acceleration_rad_s2"
        margins = "window_margin_px", "window_margin_radii"
        check_numbers("track", self, zero=(*still, *margins), below_one=("gate_probability",))


class RingTracker:
    """Follows one ring. Call `predict` once a frame, then `update` with what was identified, then `window`.

    Args:
        camera: whose pixels these are.
        frame_interval_s: time between frames.
        settings: None for the defaults.
        ring_radius_m: for the range, which matters to a lever alone.
        lever_C: (3,) the camera from the point about which it turns, in its own axes [m]; None for itself.

    Raises:
        DockairError: frame interval not positive.
    """

    def __init__(
        self,
        camera: Camera,
        frame_interval_s: float,
        settings: TrackSettings | None = None,
        *,
        ring_radius_m: float = 0.25,
        lever_C: Array | None = None,
    ) -> None:
        if not frame_interval_s > 0.0:
            raise DockairError("tracker.frame_interval_s", expected="a number > 0", got=frame_interval_s)
        self._camera, self._dt, self._settings = camera, frame_interval_s, settings or TrackSettings()
        lever_C = np.zeros(3) if lever_C is None else _row(lever_C)
        self._optics = camera.focal_length_px, camera.principal_point_px, ring_radius_m, lever_C  # of the kernels
        s = self._settings
        self._noise = s.process_variance, s.acceleration_radii_s2, s.roll_acceleration_rad_s2
        self._misses_until_lost = max(round(s.lost_s / frame_interval_s), 1)
        self._gate = float(chdtri(3, 1.0 - self._settings.gate_probability))
        self._kalman: KalmanFilter | None = None
        self._newest: Identification | None = None  # whose ring has the places q_k of Eq. (2)
        self._misses = 0
        self.normalised_innovation_squared = float("nan")  #: of the last measurement, 3 degrees of freedom

    def lose(self) -> None:
        """Give the ring up; its roll is remembered."""
        self._misses = self._misses_until_lost
        if self._kalman is not None:
            self._kalman.x[_AXES : _AXES + 3] = 0.0  # nothing is followed but the roll

    @property
    def tracking(self) -> bool:
        """Whether there is a ring to follow."""
        return self._kalman is not None and self._misses < self._misses_until_lost

    @property
    def misses(self) -> int:
        """Frames since the last accepted measurement."""
        return self._misses

    @property
    def centre_px(self) -> Array:
        """(2,) of the ring; NaN when there is none."""
        return self._state[_U]

    @property
    def velocity_px_s(self) -> Array:
        """(2,) of the centre, camera rotation taken out; NaN when there is none."""
        return self._state[_AXES : _AXES + 2]

    @property
    def radius_px(self) -> float:
        """Of the ring; NaN when there is none."""
        return float(self._state[_R])

    @property
    def covariance(self) -> Array:
        """(4, 4) of (u, v, du, dv) [px, px/s]; NaN when there is none."""
        if self._kalman is None or not self.tracking:
            return np.full((4, 4), np.nan)
        return np.array(self._kalman.P[np.ix_(_CENTRE, _CENTRE)])

    @property
    def roll_rad(self) -> float:
        """Expected roll of LED 0, as `identify` defines it; NaN when it no longer tells one numbering from the next."""
        if self._kalman is None or not 3.0 * np.sqrt(self._kalman.P[_PHI, _PHI]) < _HALF_PLACE:
            return float("nan")
        return math.remainder(self._kalman.x[_PHI, 0], 2.0 * math.pi)

    @property
    def expected_led_px(self) -> Array | None:
        """(8, 2) where each numbered LED should be now, for `identify`; None when there is no ring."""
        if self._kalman is None or self._newest is None or not self.tracking:
            return None
        u, v, r, phi = self._kalman.x[:_AXES, 0]
        offset = (self._newest.led_pixels_px - self._newest.centre_px) @ _COMPLEX
        places = offset / self._newest.radius_px * np.exp(-1j * self._newest.roll_rad)  # q_k
        z = r * np.exp(1j * phi) * places  # Eq. (2)
        return np.column_stack([u + z.real, v + z.imag])

    @property
    def expected_sigma_px(self) -> float:
        """Standard deviation of the expected centre, the larger axis; NaN when there is none."""
        return largest_sigma(self.covariance[:2, :2]) if self.tracking else float("nan")

    def predict(self, turn_C: Array | None = None, interval_s: float | None = None) -> None:
        """Advance to the next frame.

        Args:
            turn_C: (3,) rotation vector of the camera since the last frame, in its own axes [rad].
            interval_s: time since the last frame; None for the frame interval.
        """
        if self._kalman is None:
            return
        dt = self._dt if interval_s is None else interval_s
        self._kalman.F[_PLACES, _RATES] = dt
        self._kalman.predict(Q=self._process_noise(dt))
        if turn_C is not None:
            turn(self._kalman.x[:, 0], _row(turn_C), *self._optics)

    def update(self, identification: Identification) -> bool:
        """Take what was identified in the frame; true when it was accepted (or began a track)."""
        found = identification.status is IdentificationStatus.FOUND
        if not self.tracking:
            if found:
                self._begin(identification)
            return found
        z, variance = _measured(identification), self._measurement_noise(identification.radius_px)
        if not found or not self._passes(z, variance):
            self._misses += 1
            if not self.tracking:
                self.lose()
            return False
        self._correct(z, variance)
        self._misses, self._newest = 0, identification
        return True

    def window(self, turn_C: Array | None = None, interval_s: float | None = None) -> Window | None:
        """What the camera should read next; None for the full frame.

        Args:
            turn_C: (3,) rotation vector of the camera expected until then, in its own axes [rad].
            interval_s: from the last frame to that one; None for the frame interval.
        """
        if self._kalman is None or not self.tracking:
            return None
        s, camera = self._settings, self._camera
        dt = self._dt if interval_s is None else interval_s
        u, v, r, sigma = ahead(
            self._kalman.x[:, 0], self._kalman.P, dt, self._noise, _NO_TURN if turn_C is None else _row(turn_C),
            *self._optics,
        )  # fmt: skip
        sigma_u, sigma_v, sigma_r, _ = sigma.tolist()
        radius = (r + s.window_sigmas * sigma_r) * (1.0 + s.window_margin_radii) + s.window_margin_px
        growth = s.growth ** (self._misses * self._dt / s.growth_s)
        half_u, half_v = growth * (radius + s.window_sigmas * sigma_u), growth * (radius + s.window_sigmas * sigma_v)
        window = Window(
            max(math.floor(v - half_v), 0),
            min(math.ceil(v + half_v) + 1, camera.height_px),
            max(math.floor(u - half_u), 0),
            min(math.ceil(u + half_u) + 1, camera.width_px),
        )
        rows, columns = window.shape
        return window if rows > 0 and columns > 0 and window != self._camera.full_window else None

    @property
    def _state(self) -> Array:
        if self._kalman is None or not self.tracking:
            return np.full(2 * _AXES, np.nan)
        return np.array(self._kalman.x[:, 0])

    def _process_noise(self, dt: float) -> Array:
        """(8, 8) Q, Eq. (1)."""
        assert self._kalman is not None
        return process_noise(float(self._kalman.x[_R, 0]), dt, *self._noise)

    def _measurement_noise(self, radius_px: float) -> Array:
        variance = self._settings.measurement_variance
        return np.array([variance, variance, variance, (self._settings.roll_sigma_px / radius_px) ** 2])

    def _begin(self, found: Identification) -> None:
        from filterpy.kalman import KalmanFilter  # takes a second to import, so only where it is used

        s, r = self._settings, found.radius_px
        rates = np.array([*3 * (s.start_velocity_radii_s * r,), s.start_roll_rate_rad_s])
        kalman = KalmanFilter(dim_x=2 * _AXES, dim_z=_AXES)
        kalman.F, kalman.H = np.eye(2 * _AXES), np.eye(_AXES, 2 * _AXES)
        kalman.P = np.diag(np.concatenate([self._measurement_noise(r), rates**2]))
        kalman.x = np.concatenate([_measured(found), np.zeros(_AXES)]).reshape(-1, 1)
        self._kalman = kalman
        self.normalised_innovation_squared = float("nan")
        self._misses, self._newest = 0, found

    def _correct(self, z: Array, variance: Array) -> None:
        assert self._kalman is not None
        x, P = self._kalman.x, self._kalman.P
        off = math.remainder(z[_PHI] - x[_PHI, 0], 2.0 * math.pi)
        if abs(off) > _HALF_PLACE:  # the numbers have changed: a code was read
            x[_PHI], off, P[_PHI], P[:, _PHI] = z[_PHI], 0.0, 0.0, 0.0
            P[_PHI, _PHI] = _HALF_PLACE**2
        z[_PHI] = x[_PHI, 0] + off  # without a jump at half a turn
        self._kalman.update(z, R=np.diag(variance))

    def _passes(self, z: Array, variance: Array) -> bool:
        """Whether centre and radius do; a roll that is off is another numbering, which `identify` has to settle."""
        assert self._kalman is not None
        square = innovation_squared(z, self._kalman.x[:, 0], self._kalman.P, variance)
        self.normalised_innovation_squared = float(square)
        return self.normalised_innovation_squared <= self._gate


def _row(vector: Array) -> Array:
    """(3,) as the kernels take it."""
    return np.ascontiguousarray(vector, dtype=float)


def _measured(found: Identification) -> Array:
    """(4,) z."""
    return np.array([*found.centre_px, found.radius_px, found.roll_rad])
