"""International Standard Atmosphere from sea level to 20 km.

    troposphere,   h <= 11 km:   T = T_0 - lapse h,    p = p_0 (T / T_0)^(g_0 / (lapse R))        (1)
    above,         h <= 20 km:   T = T_11,             p = p_11 exp(-g_0 (h - 11 km) / (R T_11))  (2)
    rho = p / (R T),   a = sqrt(gamma R T),   mu = beta T^1.5 / (T + S),   nu = mu / rho          (3)

h is the geopotential altitude; below 20 km the geometric one differs by less than 0.4 %.
Not modelled: humidity, weather, days that are not standard.
Source: ISO 2533:1975, whose defining constants these are.
"""

from dataclasses import dataclass
from math import exp, sqrt

from dockair.errors import DockairError

STANDARD_GRAVITY_M_S2 = 9.80665  #: g_0

_SEA_LEVEL_TEMPERATURE_K = 288.15
_SEA_LEVEL_PRESSURE_PA = 101325.0
_GAS_CONSTANT = 287.05287  # R of air [J/(kg K)]
_LAPSE_K_M = 0.0065
_TROPOPAUSE_M = 11000.0
_TOP_M = 20000.0
_HEAT_CAPACITY_RATIO = 1.4
_SUTHERLAND_BETA = 1.458e-6  # [kg/(m s K^0.5)]
_SUTHERLAND_TEMPERATURE_K = 110.4


@dataclass(frozen=True, slots=True, kw_only=True)
class Air:
    """State of the air at one altitude."""

    density_kg_m3: float
    kinematic_viscosity_m2_s: float
    pressure_pa: float
    temperature_k: float
    speed_of_sound_m_s: float


def standard_atmosphere(altitude_m: float) -> Air:
    """Air of the standard day at a geopotential altitude [m].

    Raises:
        DockairError: the altitude is not between 0 and 20 km.
    """
    if not 0.0 <= altitude_m <= _TOP_M:
        raise DockairError("altitude_m", expected=f"an altitude from 0 to {_TOP_M:.0f} m", got=altitude_m)
    exponent = STANDARD_GRAVITY_M_S2 / (_LAPSE_K_M * _GAS_CONSTANT)
    temperature = _SEA_LEVEL_TEMPERATURE_K - _LAPSE_K_M * min(altitude_m, _TROPOPAUSE_M)  # Eq. (1)
    pressure = _SEA_LEVEL_PRESSURE_PA * (temperature / _SEA_LEVEL_TEMPERATURE_K) ** exponent
    above = max(altitude_m - _TROPOPAUSE_M, 0.0)
    pressure *= exp(-STANDARD_GRAVITY_M_S2 * above / (_GAS_CONSTANT * temperature))  # Eq. (2)
    density = pressure / (_GAS_CONSTANT * temperature)
    viscosity = _SUTHERLAND_BETA * temperature**1.5 / (temperature + _SUTHERLAND_TEMPERATURE_K)
    return Air(
        density_kg_m3=density,
        kinematic_viscosity_m2_s=viscosity / density,
        pressure_pa=pressure,
        temperature_k=temperature,
        speed_of_sound_m_s=sqrt(_HEAT_CAPACITY_RATIO * _GAS_CONSTANT * temperature),
    )
