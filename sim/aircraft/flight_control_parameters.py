"""Numbers of the receiver's flight control, as they stand in its sheet, and the groups its parts take."""

from dataclasses import dataclass

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.aircraft.flight_path import FlightPathParameters
from dockair.sim.aircraft.own_sensors import OwnSensorsParameters
from dockair.sim.aircraft.rate_relief import RateReliefParameters
from dockair.sim.aircraft.reference import ReferenceLimits
from dockair.sim.aircraft.regulator import Swing, Tolerances


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightControlParameters:
    """Sheet `flight_control`.

    Raises:
        DockairError: swings that would be cut whole before they begin to be.
    """

    velocity_tolerance_m_s: Array  #: (3,) forward, left, up
    integral_tolerance_m: Array  #: (3,)
    attitude_tolerance_rad: Array  #: (3,) roll, pitch, yaw
    rate_tolerance_rad_s: Array  #: (3,)
    surface_tolerance_rad: Array  #: (3,) elevator, aileron, rudder
    thrust_tolerance_m_s2: float
    following_velocity_tolerance_m_s: Array  #: (3,)
    following_integral_tolerance_m: Array  #: (3,)
    following_attitude_tolerance_rad: Array  #: (3,)
    following_rate_tolerance_rad_s: Array  #: (3,)
    following_surface_tolerance_rad: Array  #: (3,)
    following_thrust_tolerance_m_s2: float
    swing_frequency_rad_s: Array  #: (3,)
    swing_damping: Array  #: (3,)
    gust_length_m: float
    gust_bandwidth_rad_s: float
    reference_gain_1_s: Array  #: (3,) forward, left, up
    smoothing_bandwidth_rad_s: float
    smoothing_damping: float
    acceleration_limit_m_s2: Array  #: (3,)
    jerk_limit_m_s3: Array  #: (3,)
    velocity_limit_m_s: float
    increment_bank_rad: Array  #: (2,)
    relief_time_s: float
    relief_busy_share: float
    relief_least: float
    relief_stop_share: float
    busy_tolerance_factors: Array  #: (4,) velocity, integral, attitude, rate
    path_bandwidth_rad_s: float
    path_damping: float
    path_catching_up: float
    bank_limit_rad: float
    roll_rate_limit_rad_s: float
    climb_limit_rad: float
    climb_rate_limit_rad_s: float
    inertial_lag_s: float
    air_data_lag_s: float
    attitude_sigma_rad: float
    rate_sigma_rad_s: float
    specific_force_sigma_m_s2: float
    velocity_sigma_m_s: float
    airspeed_sigma_m_s: float
    inertial_velocity_sigma_m_s: float
    inertial_velocity_time_s: float

    def __post_init__(self) -> None:
        begins, whole = self.increment_bank_rad
        if not begins < whole:
            where, expected = "flight_control.increment_bank_rad", "two banks, the second larger than the first"
            raise DockairError(where, expected=expected, got=[float(begins), float(whole)])

    @property
    def tolerances(self) -> Tolerances:
        """Weights of the feedback."""
        return Tolerances(
            velocity_m_s=self.velocity_tolerance_m_s,
            integral_m=self.integral_tolerance_m,
            attitude_rad=self.attitude_tolerance_rad,
            rate_rad_s=self.rate_tolerance_rad_s,
            surfaces_rad=self.surface_tolerance_rad,
            thrust_m_s2=self.thrust_tolerance_m_s2,
        )

    @property
    def busy_tolerances(self) -> Tolerances:
        """Weights of the feedback where surfaces are at their limits."""
        return self.tolerances.relaxed(self.busy_tolerance_factors)

    @property
    def following_tolerances(self) -> Tolerances:
        """Weights of the model that is followed."""
        return Tolerances(
            velocity_m_s=self.following_velocity_tolerance_m_s,
            integral_m=self.following_integral_tolerance_m,
            attitude_rad=self.following_attitude_tolerance_rad,
            rate_rad_s=self.following_rate_tolerance_rad_s,
            surfaces_rad=self.following_surface_tolerance_rad,
            thrust_m_s2=self.following_thrust_tolerance_m_s2,
        )

    @property
    def swing(self) -> Swing:
        """How commands are expected to go on."""
        return Swing(frequency_rad_s=self.swing_frequency_rad_s, damping=self.swing_damping)

    @property
    def reference_limits(self) -> ReferenceLimits:
        """Constants of the reference."""
        return ReferenceLimits(
            gain_1_s=self.reference_gain_1_s,
            bandwidth_rad_s=self.smoothing_bandwidth_rad_s,
            damping=self.smoothing_damping,
            acceleration_m_s2=self.acceleration_limit_m_s2,
            jerk_m_s3=self.jerk_limit_m_s3,
            velocity_m_s=self.velocity_limit_m_s,
            bank_rad=self.increment_bank_rad,
        )

    @property
    def relief(self) -> RateReliefParameters:
        """Constants of what takes the reference back."""
        return RateReliefParameters(
            time_s=self.relief_time_s,
            busy_share=self.relief_busy_share,
            least=self.relief_least,
            stop_share=self.relief_stop_share,
        )

    @property
    def path(self) -> FlightPathParameters:
        """Constants of the path."""
        return FlightPathParameters(
            bandwidth_rad_s=self.path_bandwidth_rad_s,
            damping=self.path_damping,
            catching_up=self.path_catching_up,
            bank_limit_rad=self.bank_limit_rad,
            roll_rate_limit_rad_s=self.roll_rate_limit_rad_s,
            climb_limit_rad=self.climb_limit_rad,
            climb_rate_limit_rad_s=self.climb_rate_limit_rad_s,
        )

    @property
    def own_sensors(self) -> OwnSensorsParameters:
        """Lags and noise of what it measures."""
        return OwnSensorsParameters(
            inertial_lag_s=self.inertial_lag_s,
            air_data_lag_s=self.air_data_lag_s,
            attitude_sigma_rad=self.attitude_sigma_rad,
            rate_sigma_rad_s=self.rate_sigma_rad_s,
            specific_force_sigma_m_s2=self.specific_force_sigma_m_s2,
            velocity_sigma_m_s=self.velocity_sigma_m_s,
            airspeed_sigma_m_s=self.airspeed_sigma_m_s,
        )
