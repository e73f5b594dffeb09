"""What is common to every airframe: mass, size, actuators and engine as data, and the form of its aerodynamics.

An airframe is a parameter sheet. Its kind of aerodynamic model is the class the sheet fills: tables (`aerodynamics`)
or derivatives about one flight condition (`derivatives`); whoever flies it needs only what stands here.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dockair.errors import DockairError
from dockair.rotations import FLU_FROM_FRD, Array

NO_ROTATION = np.zeros(3)


class Aerodynamics(Protocol):
    """Force and moment of the air on an airframe, in air of one density."""

    def force_and_moment(
        self, v_B: Array, w_B: Array, surfaces_rad: Array, air_rotation_B: Array = NO_ROTATION
    ) -> tuple[Array, Array]:
        """Force [N] and moment [N m] about the centre of gravity, (3,) each, body axes forward-left-up.

        Args:
            v_B: (3,) velocity of the centre of gravity relative to the air [m/s].
            w_B: (3,) angular velocity [rad/s].
            surfaces_rad: (3,) elevator, aileron, rudder [rad].
            air_rotation_B: (3,) angular velocity of the air about the aircraft, from the gradients of gusts and wakes
                [rad/s]; the damping terms feel w_B less this.
        """
        ...

    def write_wrenches(self, motions: Array, wrenches: Array) -> None:
        """The same of several motions at once, in arrays that are there already.

        Args:
            motions: (n, 12) v_B, w_B, surfaces_rad and air_rotation_B, a motion in each row.
            wrenches: (n, 6) written: force and moment.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AirframeData(ABC):
    """Part of an airframe's sheet that does not depend on its kind of aerodynamics."""

    mass_kg: float
    inertia_kg_m2: Array  #: (4,) Ixx, Iyy, Izz, Ixz, forward-right-down
    wing_area_m2: float
    chord_m: float
    span_m: float
    gust_points_m: Array  #: (n, 3) where gusts and wakes are felt, body axes forward-left-up from the centre of gravity
    actuator_bandwidth_rad_s: float
    surface_limits_rad: Array  #: (3,) elevator, aileron, rudder
    surface_rate_limits_rad_s: Array  #: (3,)
    engine_time_constant_s: float
    engine_slow_time_constant_s: float
    engine_quick_rise: float
    rotor_momentum_kg_m2_s: float
    thrust_mach: Array  #: (m,)
    thrust_altitude_m: Array  #: (n,)
    idle_thrust_n: Array  #: (m, n) by Mach number and altitude
    military_thrust_n: Array  #: (m, n)

    def __post_init__(self) -> None:
        for key in ("thrust_mach", "thrust_altitude_m"):
            if not np.all(np.diff(getattr(self, key)) > 0.0):
                raise DockairError(f"airframe.{key}", expected="rising nodes", got=getattr(self, key).tolist())
        principal = np.linalg.eigvalsh(self.inertia_B)
        if not (principal[0] > 0.0 and principal[0] + principal[1] > principal[2]):
            expected = "the inertia of a body: principal moments > 0, none above the sum of the others"
            raise DockairError("airframe.inertia_kg_m2", expected=expected, got=self.inertia_kg_m2.tolist())

    @property
    def inertia_B(self) -> Array:
        """(3, 3) inertia about the centre of gravity, forward-left-up [kg m^2]."""
        xx, yy, zz, xz = self.inertia_kg_m2
        inertia_frd = np.array([[xx, 0.0, -xz], [0.0, yy, 0.0], [-xz, 0.0, zz]])
        return np.asarray(FLU_FROM_FRD @ inertia_frd @ FLU_FROM_FRD)

    @property
    @abstractmethod
    def angle_of_attack_range_rad(self) -> tuple[float, float]:
        """Angles of attack that the data covers."""

    @abstractmethod
    def aerodynamics(self, density_kg_m3: float) -> Aerodynamics:
        """Return the aerodynamic model in air of a density."""
