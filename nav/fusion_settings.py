"""Belief about motion and hardware that the relative filter starts from."""

import math
from dataclasses import dataclass, fields

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from dockair.calibration import GyroSheet, LedRing, NavigationSheets
from dockair.errors import DockairError, check_numbers
from dockair.nav.belief import Taking
from dockair.nav.belief_motion import GUST, PHI, REST, SWING, SWING_RATE, VELOCITY, Motion
from dockair.nav.belief_sight import Belief
from dockair.rotations import Array

_SETTINGS_AT_HZ = 50.0  # camera for which the settings per frame are made


@dataclass(frozen=True, slots=True, kw_only=True)
class FusionSettings:
    """Belief about motion, and the gate.

    Raises:
        DockairError: a coupling that does not exist, a number that cannot be.
    """

    #: "tight": a frame's lines of sight are fitted together with the belief, single LEDs can be used; "loose": the
    #: frame's own pose and covariance are averaged with it.
    coupling: str = "tight"
    #: The drogue's swing across the hose, left and up: the first mode as guidance fitted it to flights (15 m
    #: of hose, 20 kg, 180 m/s); damping between that to the sides (0.07) and up and down (0.18).
    swing_frequency_hz: tuple[float, float] = (0.345, 0.433)
    swing_damping: float = 0.1
    #: What drives it, forward, left, up: an acceleration that lasts [m/s^3/sqrt(Hz)], and a white one beside it
    #: [m/s^2/sqrt(Hz)]. On seven flights in light and moderate gusts velocity is least in error so, and the covariance
    #: of it cautious in moderate ones (docs/fusion.md).
    gust_time_s: float = 0.7
    gust_density: tuple[float, float, float] = (0.7, 2.5, 6.0)
    drogue_acceleration_density: float = 0.05
    receiver_acceleration_density: float = (
        0.42  # where it is not measured: 0.3 m/s^2 over 1 s, twice variance times time
    )
    formation_walk_m_s2_rts: float = 0.3  # entry of a turn: 4 m/s^2 within some seconds; costs little (docs/fusion.md)
    start_formation_sigma_m_s2: float = 0.5  # gusts and manoeuvre at the first sample
    #: Turning of the drogue [rad/sqrt(s)] about its attitude of rest, and how fast it goes back there: 0.8 degrees rms.
    #: In light gusts it turns by 0.3 degrees to the sides and 0.4 up and down, in moderate ones by 0.7 and 1.2.
    #: Believed to be slower or less, what it turns is taken for bias of the gyro.
    attitude_density: float = 0.025
    attitude_time_s: float = 0.6
    rest_walk_rad_rts: float = (
        0.0017  # 0.3 degrees in 10 s: slow wander of the receiver's heading and of the air's direction
    )
    start_velocity_sigma_m_s: float = 1.0  # assumed: joining up ends within this of the drogue's, its swing not counted
    #: A rate that is not measured departs from that of the last sample: 3 degrees/s within a quarter of a second, the
    #: rolling of a receiver that flies in light gusts; then nothing is known of it but this.
    held_rate_sigma_rad_s: float = 0.05
    held_rate_time_s: float = 0.25
    manoeuvre_s: float = 1.0  # how long the gyro's error of scale keeps its sign: of one roll or pitch movement
    saturated_share: float = 0.999  # of the range of gyros and accelerometers; the last digit may be rounded down
    gate_probability: float = 0.9999  # a good frame is refused once in 10 000
    #: Which of two minima is right: a frame counts three tenths, because the LEDs are as far off in the next one, and
    #: is forgotten within fifty, so that what they say for the wrong one does not add up.
    evidence_share: float = 0.3
    evidence_memory: float = 0.98
    #: A drogue that is struck or let go changes its velocity at once, which no gust does. After
    #: so many frames refused in a row the belief is widened: by the closure speed, its way over the refused frames, and
    #: some degrees of swing.
    refusals_until_doubt: int = 3
    doubt_velocity_sigma_m_s: float = 1.2
    doubt_position_sigma_m: float = 0.08
    doubt_attitude_sigma_rad: float = 0.1
    buffer_s: float = 0.45  # how late a frame may be
    leap_s: float = 1.0  # how far ahead of all others a frame's stamp is believed without a second one
    imu_leap_s: float = 0.1  # the same of a sample: it sets the time that all else is held against
    #: Between beliefs kept to begin at when a frame is late: none while frames come every 20 ms, one control tick late.
    node_interval_s: float = 0.04
    longest_gap_s: float = 0.02  # between samples of acceleration: a receiver does not change it much sooner
    longest_step_s: float = 0.01  # of Eq. (2) of `belief_motion`: the swing's period is 300 of them
    #: Hardware beside its sheets, 1 sigma each: 0.05 degrees of mounting and 1 px of principal point; 2 mm of mounting;
    #: 0.05 % of focal length; 0.3 mm of the ring's diameter (as-built hardware is drawn so).
    camera_axes_sigma_rad: float = 9.4e-4
    camera_place_sigma_m: float = 2e-3
    focal_scale_sigma: float = 5e-4
    ring_diameter_sigma_m: float = 3e-4
    led_place_sigma_m: float = 3e-4  # each LED, in the ring's plane
    led_place_share: float = 0.3  # of what a frame says of the LEDs' places (docs/fusion.md)
    #: LEDs out of the ring's plane and the lens's distortion show as places that change with the view: 0.03 mm in 10 s.
    led_place_walk_m_rts: float = 1e-5
    rate_average_s: float = 0.01  # gyro samples averaged for Eq. (1) of `fusion`: noise against lag, 5 at 500 Hz

    def __post_init__(self) -> None:
        exists = ("tight", "loose")
        if self.coupling not in exists:
            raise DockairError("fusion.coupling", expected="one that exists", got=self.coupling, exists=exists)
        exact = [field.name for field in fields(self) if {"sigma", "density", "walk"} & set(field.name.split("_"))]
        exact.remove("held_rate_sigma_rad_s")  # of a rate that is not measured something is always unknown
        none = *exact, "swing_damping", "led_place_share"
        check_numbers("fusion", self, zero=none, below_one=("gate_probability",))
        if not self.gust_time_s > self.longest_step_s:
            expected = f"a number above longest_step_s = {self.longest_step_s:g}"
            raise DockairError("fusion.gust_time_s", expected=expected, got=self.gust_time_s)


def taking_of(settings: FusionSettings, camera_rate_hz: float) -> Taking:
    """Return how frames are taken.

    What is taken of a frame for the LEDs' places is said of one at 50 Hz. Of a faster camera, whose frames see the LEDs
    off in the same way, the frames of a second say as much as those; of a slower one no frame says more.
    """
    return Taking(
        tight=settings.coupling == "tight",
        memory=settings.evidence_memory,
        share=settings.evidence_share,
        ring=settings.led_place_share * min(_SETTINGS_AT_HZ / camera_rate_hz, 1.0),
    )


def refusals_until_doubt(settings: FusionSettings, camera_rate_hz: float) -> int:
    """Return how many frames in a row are refused before the belief is widened: as long a time at a faster camera."""
    return math.ceil(settings.refusals_until_doubt * max(camera_rate_hz / _SETTINGS_AT_HZ, 1.0))


def longest_gap_s(settings: FusionSettings, gyro: GyroSheet) -> float:
    """Return how far apart two samples of acceleration may be: of a slow IMU, a period and a half."""
    return max(settings.longest_gap_s, 1.5 / gyro.rate_hz)


def motion_of(settings: FusionSettings, gyro: GyroSheet) -> Motion:
    """Return what the kernel takes."""
    omega = 2.0 * np.pi * np.array([0.0, *settings.swing_frequency_hz])
    held2 = settings.held_rate_sigma_rad_s**2
    return Motion(
        stiffness=omega**2,
        friction=2.0 * settings.swing_damping * omega,
        gust_1_s=1.0 / settings.gust_time_s,
        gust2=np.square(settings.gust_density),
        attitude2=settings.attitude_density**2,
        return_1_s=1.0 / settings.attitude_time_s,
        rest2=settings.rest_walk_rad_rts**2,
        ring2=settings.led_place_walk_m_rts**2,
        drive2=settings.drogue_acceleration_density**2,
        receiver2=settings.receiver_acceleration_density**2,
        accelerometer2=gyro.accelerometer_noise_density_m_s2_rthz**2,
        gyro2=gyro.noise_density_rad_s_rthz**2,
        bias2=gyro.bias_walk_rad_s_rts**2,
        formation2=settings.formation_walk_m_s2_rts**2,
        scale2=2.0 * gyro.scale_factor_sigma**2 * settings.manoeuvre_s,
        held_turn2=held2 / settings.held_rate_time_s**2,
        held_most2=2.0 * held2 * settings.held_rate_time_s,
        longest_gap_s=longest_gap_s(settings, gyro),
        longest_step_s=settings.longest_step_s,
    )


def start_of(settings: FusionSettings, sheets: NavigationSheets) -> Belief:
    """Return the belief before the first message; the swing is that of gusts that have blown for ever."""
    start, gyro = sheets.start, sheets.gyro
    turning2 = 0.5 * settings.attitude_density**2 * settings.attitude_time_s
    variances = np.concatenate(
        [
            np.square(start.sigma_R_rad) + turning2,
            np.square(start.sigma_p_m),
            np.full(3, settings.start_velocity_sigma_m_s**2),
            np.zeros(6),
            np.full(3, gyro.bias_sigma_rad_s**2),
            np.full(3, settings.start_formation_sigma_m_s2**2 + gyro.accelerometer_bias_sigma_m_s2**2),
            np.full(3, turning2),
            np.zeros(3),
            _hardware_variances(settings, sheets.ring),
        ]
    )
    P = np.diag(variances)
    for axis in range(3):
        phi, u = PHI.start + axis, REST.start + axis
        P[phi, u] = P[u, phi] = -turning2
        rows = [block.start + axis for block in (VELOCITY, SWING, SWING_RATE, GUST)]
        of = [1, 0, 1, 2]  # (n, m, g): the velocity is the rate of the swing, and more
        P[np.ix_(rows, rows)] += swing_covariance(settings, axis)[np.ix_(of, of)]
    x = np.zeros((8, 3))
    x[0] = start.p_PD_B + sheets.mounting.p_BP - sheets.mounting.p_BI
    return Belief(np.array(start.R_BD, dtype=float), x, P)


def swing_covariance(settings: FusionSettings, axis: int) -> Array:
    """(3, 3) of (n, m, g) of an axis, forward, left, up, in gusts that have blown for ever; forward n, m are 0."""
    gust2, decay = settings.gust_density[axis] ** 2, 1.0 / settings.gust_time_s
    if axis == 0:
        return np.diag([0.0, 0.0, 0.5 * gust2 / decay])
    omega = 2.0 * np.pi * settings.swing_frequency_hz[axis - 1]
    A = np.array([[0.0, 1.0, 0.0], [-(omega**2), -2.0 * settings.swing_damping * omega, 1.0], [0.0, 0.0, -decay]])
    return np.asarray(solve_continuous_lyapunov(A, -np.diag([0.0, settings.drogue_acceleration_density**2, gust2])))


def _hardware_variances(settings: FusionSettings, ring: LedRing) -> Array:
    """(23,) of camera axes, camera place, scale (lens and ring show alike), and of each LED's place."""
    return np.concatenate(
        [
            np.full(3, settings.camera_axes_sigma_rad**2),
            np.full(3, settings.camera_place_sigma_m**2),
            [settings.focal_scale_sigma**2 + (settings.ring_diameter_sigma_m / ring.diameter_m) ** 2],
            np.full(2 * len(ring.positions_D), settings.led_place_sigma_m**2),
        ]
    )
