"""A made-up approach for the relative filter: receiver in gusts, drogue that swings, pixels of LEDs; truth is known.

In axes N that do not turn, with the receiver's place r (of the accelerometers), the drogue's place s from there:

    r'' = k_p (s - s_wanted) + k_d (s' - s_wanted') + gust,   gust' = -gust/T + noise               (1)
    n'' = -W^2 n - 2 z W n' + g + noise,   g' = -g/T_g + noise,   s'' = n'' - r''                   (2)
    theta'' = -W_a^2 theta - 2 z_a W_a theta' + stir,   stir' = -stir/T_a + noise,   w_B = theta'   (3)
    u' = -u/T_u - noise,   R_ND = exp(-u) R_rest                                                    (4)

The receiver closes from `first_m` to `last_m` between tip and ring and steers on the truth: what is asked of the filter
does not depend on what it says. The drogue turns about an attitude of rest that walks a little. Hardware is nominal
(gyro and accelerometers with the sheet's noise and a bias) or drawn as it was built (`sim.as_built`, `sim.imu`).

Not modelled: whatever the camera does to a spot but Gaussian noise; the world has all of that.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.messages import ImuSample
from dockair.nav.fusion import FusionSettings
from dockair.nav.fusion_settings import swing_covariance
from dockair.parameters import load_parameters
from dockair.rotations import Array, exp, matrix_from_yaw_pitch_roll
from dockair.scenarios.assembly.mounting_parameters import MountingParameters
from dockair.sim.as_built import AsBuilt, AsBuiltParameters, draw_as_built
from dockair.sim.camera.sheets import LedParameters
from dockair.sim.imu import Imu, ImuParameters

GRAVITY_N: Array = np.array([0.0, 0.0, -9.80665])
NOTHING_OFF = "nominal"
_TINY: Array = 1e-12 * np.eye(3)  # along the hose there is no swing to draw


@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """What is flown."""

    duration_s: float = 8.0
    imu_rate_hz: int = 250
    camera_rate_hz: int = 50
    first_m: float = 10.0  # tip to ring
    last_m: float = 2.0
    closing_m_s: float = 1.2
    sigma_px: float = 0.1
    gust_m_s2: float = 0.3  # rms of the receiver's acceleration by gusts
    gust_time_s: float = 1.0
    attitude_rad: float = 0.02  # rms of the receiver's about each axis
    attitude_hz: float = 0.5
    attitude_damping: float = 0.5
    stir_time_s: float = 0.15  # T_a, of controls and gusts
    position_gain_1_s2: float = 0.6
    rate_gain_1_s: float = 1.4
    ramp_s: float = 1.0  # in which the steering begins
    start_sigma_m: float = 0.2
    start_sigma_rad: tuple[float, float, float] = (0.02, 0.009, 0.009)  # as scenarios start
    drogue_pitch_rad: float = 0.12  # of its axis against the receiver's, positive nose down: seen 7 deg off frontal
    belief: FusionSettings = field(default_factory=FusionSettings)  # what the drogue does is drawn from it
    swing_frequency_factor: float = 1.0  # truth over belief
    drive_factor: float = 1.0
    turning_factor: float = 1.0  # of the drogue's attitude
    rest_pitch_rad: float = 0.0  # of its attitude of rest, beyond what is drawn
    as_built: tuple[str, ...] = ()  #: which of camera axes, camera place, lens, ring, imu are as built
    imu: str = NOTHING_OFF  #: or a sheet's name, whose every error is drawn


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flown:
    """Truth and messages of one approach; arrays over the IMU's ticks."""

    sheets: NavigationSheets
    time_s: Array
    R_NB: Array  #: (k, 3, 3)
    R_ND: Array  #: (k, 3, 3)
    s_N: Array  #: (k, 3) ring centre from the IMU [m]
    v_N: Array  #: (k, 3) [m/s]
    w_B: Array  #: (k, 3) [rad/s]
    imu: list[ImuSample]
    built: AsBuilt

    def pixels(self, tick: int, sigma_px: float, rng: np.random.Generator) -> Array:
        """(n, 2) where the LEDs are seen at a tick."""
        built, R_NB = self.built, self.R_NB[tick]
        place_B = R_NB.T @ self.s_N[tick] + built.mounting.p_BI
        arms_B = built.ring_positions_D @ (R_NB.T @ self.R_ND[tick]).T
        p_C = (place_B + arms_B - built.mounting.p_BC) @ built.mounting.R_BC
        return np.asarray(built.camera.pixels_from_points(p_C) + sigma_px * rng.standard_normal((len(p_C), 2)))


def navigation_sheets(approach: Approach, imu: ImuParameters) -> NavigationSheets:
    """Return what the navigation is told."""
    place = load_parameters("mounting", MountingParameters)
    mounting = Mounting(
        R_BC=matrix_from_yaw_pitch_roll(place.camera_yaw_rad, 0.0, 0.0),
        p_BC=np.array(place.camera_position_m),
        p_BP=np.array(place.probe_tip_m),
        p_BI=np.array(place.imu_position_m),
    )
    start = StartGeometry(
        p_PD_B=np.array([approach.first_m, 0.0, 0.0]),
        sigma_p_m=np.full(3, approach.start_sigma_m),
        R_BD=matrix_from_yaw_pitch_roll(0.0, approach.drogue_pitch_rad, 0.0),
        sigma_R_rad=np.array(approach.start_sigma_rad),
    )
    nominal = approach.imu == NOTHING_OFF
    gyro = GyroSheet(
        rate_hz=approach.imu_rate_hz,
        noise_density_rad_s_rthz=imu.gyro_noise_density_rad_s_rthz,
        bias_sigma_rad_s=imu.gyro_turn_on_bias_sigma_rad_s,
        bias_walk_rad_s_rts=0.0 if nominal else imu.gyro_bias_walk_rad_s_rts,
        scale_factor_sigma=0.0 if nominal else imu.gyro_scale_factor_sigma + imu.gyro_misalignment_sigma_rad,
        range_rad_s=imu.gyro_range_rad_s,
        accelerometer_noise_density_m_s2_rthz=imu.accelerometer_noise_density_m_s2_rthz,
        accelerometer_bias_sigma_m_s2=imu.accelerometer_turn_on_bias_sigma_m_s2,
    )
    return NavigationSheets(
        camera=Camera(),
        ring=LedRing(),
        mounting=mounting,
        start=start,
        gyro=gyro,
        camera_rate_hz=approach.camera_rate_hz,
        control_rate_hz=approach.camera_rate_hz,
        coupling_depth_m=0.3,
    )


def fly(approach: Approach, seed: int) -> Flown:
    """Return one approach; the same seed draws the same gusts whatever is as built."""
    imu_sheet = load_parameters("imu_mti" if approach.imu == NOTHING_OFF else f"imu_{approach.imu}", ImuParameters)
    sheets = navigation_sheets(approach, imu_sheet)
    motion = _Motion(approach, sheets, np.random.default_rng((seed, 0)))
    ticks = round(approach.duration_s * approach.imu_rate_hz) + 1
    rows = [motion.step() for _ in range(ticks)]
    R_NB, R_ND, s_N, v_N, w_B, alpha_B, f_B = (np.array(column) for column in zip(*rows, strict=True))
    time_s = np.arange(ticks) / approach.imu_rate_hz
    built = _built(approach, sheets, np.random.default_rng((seed, 1)))
    imu = _samples(approach, sheets, built, imu_sheet, seed, (time_s, w_B, alpha_B, f_B))
    return Flown(
        sheets=sheets, time_s=time_s, R_NB=R_NB, R_ND=R_ND, s_N=s_N, v_N=v_N, w_B=w_B, imu=imu, built=built
    )  # fmt: skip


class _Motion:
    """Eqs (1) to (4), a tick at a time."""

    def __init__(self, approach: Approach, sheets: NavigationSheets, rng: np.random.Generator) -> None:
        self._approach, self._rng, self._dt = approach, rng, 1.0 / approach.imu_rate_hz
        belief, start, mounting = approach.belief, sheets.start, sheets.mounting
        left_hz, up_hz = belief.swing_frequency_hz
        swing_hz = left_hz * approach.swing_frequency_factor, up_hz * approach.swing_frequency_factor
        omega = 2.0 * np.pi * np.array(swing_hz)
        self._stiffness = np.append(0.0, omega**2)
        self._friction = np.append(0.0, 2.0 * belief.swing_damping * omega)
        self._drive = belief.drogue_acceleration_density * approach.drive_factor
        self._gust_drive = np.array(belief.gust_density) * approach.drive_factor
        swings = replace(belief, swing_frequency_hz=swing_hz)  # as they are, not as they are believed
        blown = [np.linalg.cholesky(swing_covariance(swings, axis) + _TINY) for axis in range(3)]
        start_of_swing = np.stack([root @ rng.standard_normal(3) for root in blown], axis=1)
        self._n, self._m, self._drogue_gust = approach.drive_factor * start_of_swing
        self._tip = mounting.p_BP - mounting.p_BI
        self._s = start.p_PD_B + self._tip + start.sigma_p_m * rng.standard_normal(3)
        self._v = self._m + belief.start_velocity_sigma_m_s * rng.standard_normal(3)
        rest = start.sigma_R_rad * rng.standard_normal(3)
        self._R_rest = exp(rest + [0.0, approach.rest_pitch_rad, 0.0]) @ start.R_BD
        self._turning = belief.attitude_density * approach.turning_factor
        self._u = self._turning * np.sqrt(0.5 * belief.attitude_time_s) * rng.standard_normal(3)
        self._R_NB, self._time_s = np.eye(3), 0.0
        self._gust = approach.gust_m_s2 * rng.standard_normal(3)
        self._theta = approach.attitude_rad * rng.standard_normal(3)
        self._w = 2.0 * np.pi * approach.attitude_hz * approach.attitude_rad * rng.standard_normal(3)
        self._stir, self._c = np.zeros(3), GRAVITY_N.copy()

    def step(self) -> tuple[Array, ...]:
        """Return this tick's truth and go on to the next."""
        a, dt, draw = self._approach, self._dt, self._rng.standard_normal
        own = self._own_acceleration()
        omega = 2.0 * np.pi * a.attitude_hz
        stir = 2.0 * a.attitude_rad * np.sqrt(a.attitude_damping * omega**3)
        self._stir = self._stir * np.exp(-dt / a.stir_time_s) + stir * np.sqrt(dt) / a.stir_time_s * draw(3)
        alpha = self._stir - omega**2 * self._theta - 2.0 * a.attitude_damping * omega * self._w
        f_B = self._R_NB.T @ (own - self._c)
        row = (self._R_NB, exp(-self._u) @ self._R_rest, self._s, self._v, self._w, alpha, f_B)
        kick, more = draw((2, 3)) * self._drive
        kick_s, kick_v = dt**1.5 * (kick / 2.0 + more / np.sqrt(12.0)), kick * np.sqrt(dt)
        swing = -self._stiffness * self._n - self._friction * self._m + self._drogue_gust
        across = np.array([0.0, 1.0, 1.0])
        fades = np.exp(-dt / a.belief.gust_time_s)
        self._drogue_gust = fades * self._drogue_gust + self._gust_drive * np.sqrt(dt) * draw(3)
        self._gust = self._gust * np.exp(-dt / a.gust_time_s) + a.gust_m_s2 * np.sqrt(2.0 * dt / a.gust_time_s) * draw(
            3
        )
        later = self._own_acceleration()
        mean = 0.5 * (own + later)
        self._s = self._s + self._v * dt + 0.5 * dt**2 * (swing - mean) + kick_s
        self._v = self._v + (swing - mean) * dt + kick_v
        self._n = self._n + (self._m * dt + 0.5 * dt**2 * swing + kick_s) * across
        self._m = self._m + (swing * dt + kick_v) * across
        w_next = self._w + alpha * dt
        self._R_NB = self._R_NB @ exp(0.5 * (self._w + w_next) * dt)
        self._theta, self._w = self._theta + self._w * dt, w_next
        self._u = self._u * np.exp(-dt / a.belief.attitude_time_s) + self._turning * np.sqrt(dt) * draw(3)
        self._R_rest = exp(a.belief.rest_walk_rad_rts * np.sqrt(dt) * draw(3)) @ self._R_rest
        if a.imu == NOTHING_OFF:
            self._c = self._c + a.belief.formation_walk_m_s2_rts * np.sqrt(dt) * draw(3)
        self._time_s += dt
        return row

    def _own_acceleration(self) -> Array:
        """(3,) of the receiver, Eq. (1); the gust's share does not jump with the drogue's velocity."""
        a = self._approach
        closing = self._time_s * a.closing_m_s < a.first_m - a.last_m
        distance = max(a.first_m - a.closing_m_s * self._time_s, a.last_m)
        wanted, rate = self._tip + [distance, 0.0, 0.0], np.array([-a.closing_m_s if closing else 0.0, 0.0, 0.0])
        steered = a.position_gain_1_s2 * (self._s - wanted) + a.rate_gain_1_s * (self._v - rate)
        return np.asarray(min(self._time_s / a.ramp_s, 1.0) * steered + self._gust)


def _built(approach: Approach, sheets: NavigationSheets, rng: np.random.Generator) -> AsBuilt:
    """Draw the hardware; what is not to be as built is put back to its sheet."""
    parameters, leds = load_parameters("as_built", AsBuiltParameters), load_parameters("leds", LedParameters)
    built = draw_as_built(sheets.camera, sheets.ring, sheets.mounting, parameters, leds, rng)
    real, nominal, keep = built.mounting, sheets.mounting, approach.as_built
    return replace(
        built,
        camera=built.camera if "lens" in keep else sheets.camera,
        ring_positions_D=built.ring_positions_D if "ring" in keep else sheets.ring.positions_D,
        mounting=Mounting(
            R_BC=real.R_BC if "camera axes" in keep else nominal.R_BC,
            p_BC=real.p_BC if "camera place" in keep else nominal.p_BC,
            R_BI=real.R_BI if "imu" in keep else nominal.R_BI,
            p_BI=nominal.p_BI,
            p_BP=nominal.p_BP,
        ),
    )


def _samples(
    approach: Approach,
    sheets: NavigationSheets,
    built: AsBuilt,
    imu: ImuParameters,
    seed: int,
    felt: tuple[Array, Array, Array, Array],
) -> list[ImuSample]:
    """Return what the IMU says; its f_B is that at its own place already."""
    time_s, w_B, alpha_B, f_B = felt
    gyro, rng, stamps = sheets.gyro, np.random.default_rng((seed, 2)), time_s
    if approach.imu == NOTHING_OFF:
        root = np.sqrt(approach.imu_rate_hz)
        w_I: Array = w_B + gyro.bias_sigma_rad_s * rng.standard_normal(3)
        w_I = w_I + gyro.noise_density_rad_s_rthz * root * rng.standard_normal(w_B.shape)
        f_I: Array = f_B + gyro.accelerometer_bias_sigma_m_s2 * rng.standard_normal(3)
        f_I = f_I + gyro.accelerometer_noise_density_m_s2_rthz * root * rng.standard_normal(w_B.shape)
    else:
        gyro_rng, accelerometer_rng, clock_rng = (np.random.default_rng((seed, 3, k)) for k in range(3))
        unit = Imu(imu, approach.imu_rate_hz, gyro_rng, accelerometer_rng, clock_rng, built.mounting.R_BI, np.zeros(3))
        stamps, w_I, f_I = unit.record(len(time_s), w_B, alpha_B, f_B)
    return [
        ImuSample(time_stamp_s=float(t), angular_rate_rad_s=w, specific_force_m_s2=f)
        for t, w, f in zip(stamps, w_I, f_I, strict=True)
    ]
