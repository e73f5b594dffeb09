"""What the reproductions of the hose share: conditions, sheets, the continuous cable."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air, standard_atmosphere
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.rig import HoseRig

_TOLERANCE = 1e-10  # of the cable's integration


@dataclass(frozen=True, slots=True, kw_only=True)
class HoseCase:
    """One steady flight with one hose."""

    airspeed_m_s: float
    altitude_m: float
    hose: HoseParameters
    drogue: DrogueParameters

    @classmethod
    def of(
        cls,
        airspeed_m_s: float,
        altitude_m: float,
        hose: dict[str, float] | None = None,
        drogue: dict[str, float] | None = None,
    ) -> "HoseCase":
        """From the sheets with some values of its own."""
        return cls(
            airspeed_m_s=airspeed_m_s,
            altitude_m=altitude_m,
            hose=load_parameters("hose", HoseParameters, hose),
            drogue=load_parameters("drogue", DrogueParameters, drogue),
        )

    @property
    def air(self) -> Air:
        """The standard day's."""
        return standard_atmosphere(self.altitude_m)

    @property
    def wind_W(self) -> Array:
        """Velocity of the undisturbed air in W [m/s]."""
        return np.array([-self.airspeed_m_s, 0.0, 0.0])

    @property
    def name(self) -> str:
        """Airspeed and altitude."""
        return f"{self.airspeed_m_s:g} m/s, {self.altitude_m:g} m"

    def rig(self, step_s: float = 1e-3) -> HoseRig:
        """Return hose and drogue alone, at rest."""
        return HoseRig(self.hose, self.drogue, self.wind_W, self.air, step_s=step_s)


def steady_flights() -> tuple[HoseCase, HoseCase]:
    """The default flight, and the slower and lower one of the open peer."""
    return HoseCase.of(180.0, 6000.0), HoseCase.of(120.0, 3000.0)


def continuous_cable(case: HoseCase, points: int = 2) -> tuple[Array, Array]:
    """The hose without joints: d(T t)/ds + load + weight = 0, integrated from the drogue up.

    t points down the hose; coordinates are aft and down from the exit. The loads are written anew here, for
    subcritical flow and a drogue without lift at incidence.

    Returns:
        (points, 2) places aft and below from the exit down to the hose's end [m], (points,) tensions [N].
    """
    hose, air, speed = case.hose, case.air, case.airspeed_m_s
    rho, nu, d = air.density_kg_m3, air.kinematic_viscosity_m2_s, 2.0 * hose.radius_m
    drag = 0.5 * rho * speed**2 * case.drogue.drag_coefficient * np.pi / 4.0 * case.drogue.drag_diameter_m**2
    pull = np.array([drag, case.drogue.mass_kg * STANDARD_GRAVITY_M_S2])
    weight = np.array([0.0, hose.line_density_kg_m * STANDARD_GRAVITY_M_S2])

    def slope(_: float, state: Array) -> Array:
        t = state[:2] / np.hypot(*state[:2])
        normal = np.array([-t[1], t[0]])
        across, along = -speed * t[1], speed * t[0]
        c_f = hose.friction_coefficient * (np.pi * d * speed**2 / (2.0 * nu * abs(across))) ** (-1.0 / 6.0)
        f_n = 0.5 * rho * hose.normal_drag_coefficient * d * abs(across) * across
        return np.concatenate([f_n * normal + 0.5 * rho * c_f * np.pi * d * along**2 * t + weight, t])

    solution = solve_ivp(
        slope,
        (0.0, hose.length_m),
        np.concatenate([pull, np.zeros(2)]),
        t_eval=np.linspace(0.0, hose.length_m, points),
        rtol=_TOLERANCE,
        atol=_TOLERANCE,
    )
    up = solution.y[:, ::-1]
    return up[2:, :1].T - up[2:].T, np.hypot(up[0], up[1])
