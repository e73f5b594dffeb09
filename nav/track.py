"""The ring followed from frame to frame: an image-plane Kalman filter, and the window the next frame needs.

    x = [u v du dv],   x_k = F x_{k-1} + w,   F = [[I, dt I], [0, I]],   z = [u v] = H x + v,  H = [I 0]
                                                                              [Yoon 2018, eqs 27-37]
The radius has a filter of the same form, x_r = [r dr]. The source's Q = 0.01 I and R = 4 I suit a target that rests or
drifts. A drogue in gusts accelerates; to Q comes white acceleration of a r [px/s^2], in units of the ring's radius so
that one number serves all ranges (a = 8 radii/s^2 is 2 m/s^2 for a 0.5 m ring):

    Q = 0.01 I + (a r)^2 [[dt^4/4 I, dt^3/2 I], [dt^3/2 I, dt^2 I]]                        (1)

With a = 0 it is the source's filter. The camera's own rotation is no motion of the drogue: `predict` takes the shift
that the gyro says it made (f w dt), and the filter sees only the rest.

A measurement counts when its innovation passes a chi-square gate of three degrees of freedom (centre and radius);
otherwise the frame is a miss, like one without a ring. The window is the predicted ring with three sigma and a margin,
shifted by the rotation to come, and wider with every miss; after `misses_until_lost` there is none (full frame), and
the next ring found starts the filter afresh.

Not modelled: the ring's tilt (its window is a square around the circle), correlation between centre and radius.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.messages import Window
from dockair.nav.identify.ring import Identification, IdentificationStatus
from dockair.rotations import Array

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackSettings:
    """Settings of the tracker; lengths in pixels."""

    process_variance: float = 0.01  # Q's diagonal [Yoon 2018, III.3]
    measurement_variance: float = 4.0  # R's diagonal; sigma = 2 px, as the source's plots imply
    acceleration_radii_s2: float = 8.0  # a of Eq. (1): gusts of 2 m/s^2 on a 0.25 m ring
    start_velocity_radii_s: float = 4.0  # 1 sigma at the first frame: 1 m/s
    gate_probability: float = 0.9999  # of a true measurement to pass
    window_sigmas: float = 3.0
    window_margin_px: float = 12.0  # the LEDs' own spots and the rim beyond the ring's circle
    window_margin_radii: float = 0.15  # perspective and tilt
    growth_per_miss: float = 1.5
    misses_until_lost: int = 5  # 0.1 s at 50 Hz


class RingTracker:
    """Follows one ring. Call `predict` once a frame, then `update` with what was identified, then `window`.

    Args:
        camera: whose pixels these are.
        frame_interval_s: time between frames.
        settings: None for the defaults.

    Raises:
        DockairError: frame interval not positive.
    """

    def __init__(self, camera: Camera, frame_interval_s: float, settings: TrackSettings | None = None) -> None:
        if not frame_interval_s > 0.0:
            raise DockairError("tracker.frame_interval_s", expected="a number > 0", got=frame_interval_s)
        self._camera, self._dt, self._settings = camera, frame_interval_s, settings or TrackSettings()
        self._gate = float(chdtri(3, 1.0 - self._settings.gate_probability))
        self._centre: KalmanFilter | None = None
        self._radius: KalmanFilter | None = None
        self._led_offsets_px: Array = np.full((8, 2), np.nan)  # from the centre, at radius 1
        self._misses = 0
        self.normalised_innovation_squared = float("nan")  #: of the last measurement, 3 degrees of freedom

    @property
    def tracking(self) -> bool:
        """Whether there is a ring to follow."""
        return self._centre is not None

    @property
    def misses(self) -> int:
        """Frames since the last accepted measurement."""
        return self._misses

    @property
    def centre_px(self) -> Array:
        """(2,) of the ring; NaN when there is none."""
        return np.full(2, np.nan) if self._centre is None else np.array(self._centre.x[:2, 0])

    @property
    def velocity_px_s(self) -> Array:
        """(2,) of the centre, camera rotation taken out; NaN when there is none."""
        return np.full(2, np.nan) if self._centre is None else np.array(self._centre.x[2:, 0])

    @property
    def radius_px(self) -> float:
        """Of the ring; NaN when there is none."""
        return float("nan") if self._radius is None else float(self._radius.x[0, 0])

    @property
    def covariance(self) -> Array:
        """(4, 4) of (u, v, du, dv) [px, px/s]; NaN when there is none."""
        return np.full((4, 4), np.nan) if self._centre is None else np.array(self._centre.P)

    @property
    def expected_led_px(self) -> Array | None:
        """(8, 2) where each numbered LED should be now, for `identify`; None when there is no ring."""
        if self._centre is None:
            return None
        return self.centre_px + self.radius_px * self._led_offsets_px

    @property
    def expected_sigma_px(self) -> float:
        """Standard deviation of the expected centre, the larger axis; NaN when there is none."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:2, :2])[-1])) if self.tracking else float("nan")

    def predict(self, shift_px: Array | None = None) -> None:
        """Advance by one frame interval.

        Args:
            shift_px: (2,) image shift since the last frame that the camera's own rotation made [px].
        """
        if self._centre is None or self._radius is None:
            return
        acceleration = self._settings.acceleration_radii_s2 * self.radius_px
        self._centre.predict(Q=self._process_noise(2, acceleration))
        self._radius.predict(Q=self._process_noise(1, acceleration))
        if shift_px is not None:
            self._centre.x[:2, 0] += shift_px

    def update(self, identification: Identification) -> bool:
        """Take what was identified in the frame; true when it was accepted (or began a track)."""
        found = identification.status is IdentificationStatus.FOUND
        if self._centre is None or self._radius is None:
            if found:
                self._begin(identification)
            return found
        if not found or not self._passes(identification):
            self._miss()
            return False
        self._centre.update(identification.centre_px.reshape(2, 1))
        self._radius.update(np.array([[identification.radius_px]]))
        self._remember(identification)
        return True

    def window(self, shift_px: Array | None = None) -> Window | None:
        """What the camera should read next; None for the full frame.

        Args:
            shift_px: (2,) image shift until then that the camera's rotation is expected to make [px].
        """
        if self._centre is None or self._radius is None:
            return None
        s = self._settings
        F, H = self._centre.F, self._centre.H
        Q = self._process_noise(2, s.acceleration_radii_s2 * self.radius_px)
        centre = (H @ F @ self._centre.x)[:, 0] + (0.0 if shift_px is None else np.asarray(shift_px))
        sigma = np.sqrt(np.diag(H @ (F @ self._centre.P @ F.T + Q) @ H.T))
        radius = self.radius_px + float(self._radius.x[1, 0]) * self._dt
        radius += s.window_sigmas * float(np.sqrt(self._radius.P[0, 0]))
        half = radius * (1.0 + s.window_margin_radii) + s.window_margin_px + s.window_sigmas * sigma
        half = half * s.growth_per_miss**self._misses
        u, v = np.floor(centre - half).astype(int)
        u_stop, v_stop = np.ceil(centre + half).astype(int) + 1
        window = Window(
            max(int(v), 0), min(int(v_stop), self._camera.height_px),
            max(int(u), 0), min(int(u_stop), self._camera.width_px),
        )  # fmt: skip
        rows, columns = window.shape
        return window if rows > 0 and columns > 0 and window != self._camera.full_window else None

    def reset(self) -> None:
        """Forget the ring."""
        self._centre = self._radius = None
        self._led_offsets_px = np.full((8, 2), np.nan)
        self._misses = 0

    def _process_noise(self, axes: int, acceleration: float) -> Array:
        dt, eye = self._dt, np.eye(axes)
        walk = np.block([[dt**4 / 4.0 * eye, dt**3 / 2.0 * eye], [dt**3 / 2.0 * eye, dt**2 * eye]])
        return self._settings.process_variance * np.eye(2 * axes) + acceleration**2 * walk  # Eq. (1)

    def _filter(self, start: Array, velocity_sigma: float) -> "KalmanFilter":
        from filterpy.kalman import KalmanFilter  # takes a second to import, so only where it is used

        axes = len(start)
        eye, zero = np.eye(axes), np.zeros((axes, axes))
        kalman = KalmanFilter(dim_x=2 * axes, dim_z=axes)
        kalman.F = np.block([[eye, self._dt * eye], [zero, eye]])
        kalman.H = np.hstack([eye, zero])
        kalman.R = self._settings.measurement_variance * eye
        kalman.P = np.diag([self._settings.measurement_variance] * axes + [velocity_sigma**2] * axes)
        kalman.x = np.concatenate([start, np.zeros(axes)]).reshape(-1, 1)
        return kalman

    def _begin(self, identification: Identification) -> None:
        velocity_sigma = self._settings.start_velocity_radii_s * identification.radius_px
        self._centre = self._filter(identification.centre_px, velocity_sigma)
        self._radius = self._filter(np.array([identification.radius_px]), velocity_sigma)
        self.normalised_innovation_squared = float("nan")
        self._remember(identification)

    def _remember(self, identification: Identification) -> None:
        self._misses = 0
        self._led_offsets_px = (identification.led_pixels_px - identification.centre_px) / identification.radius_px

    def _passes(self, identification: Identification) -> bool:
        nis = 0.0
        for kalman, z in ((self._centre, identification.centre_px), (self._radius, [identification.radius_px])):
            assert kalman is not None
            innovation = np.asarray(z) - (kalman.H @ kalman.x)[:, 0]
            nis += float(innovation @ np.linalg.solve(kalman.H @ kalman.P @ kalman.H.T + kalman.R, innovation))
        self.normalised_innovation_squared = nis
        return nis <= self._gate

    def _miss(self) -> None:
        self._misses += 1
        if self._misses >= self._settings.misses_until_lost:
            self.reset()
