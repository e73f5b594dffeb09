"""Standard atmosphere against the tables of ISO 2533 and the hydrostatic equation."""

import pytest

from dockair.errors import DockairError
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere

TABLE = [  # geopotential altitude m, K, Pa, kg/m^3, speed of sound m/s
    (0.0, 288.15, 101325.0, 1.22500, 340.294),
    (5000.0, 255.65, 54019.9, 0.736116, 320.529),
    (11000.0, 216.65, 22632.0, 0.363918, 295.069),
    (20000.0, 216.65, 5474.87, 0.0880345, 295.069),
]
VISCOSITY = [(0.0, 1.7894e-5), (11000.0, 1.4216e-5), (20000.0, 1.4216e-5)]  # dynamic [Pa s], at 288.15 and 216.65 K


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row[0]:.0f}m")
def test_air_is_that_of_the_standard_tables(row: tuple[float, ...]) -> None:
    air = standard_atmosphere(row[0])
    ours = (air.temperature_k, air.pressure_pa, air.density_kg_m3, air.speed_of_sound_m_s)
    assert ours == pytest.approx(row[1:], rel=1e-5)


@pytest.mark.parametrize(("altitude_m", "dynamic_viscosity"), VISCOSITY)
def test_viscosity_is_that_of_the_standard_tables(altitude_m: float, dynamic_viscosity: float) -> None:
    air = standard_atmosphere(altitude_m)
    assert air.kinematic_viscosity_m2_s * air.density_kg_m3 == pytest.approx(dynamic_viscosity, rel=5e-5)


@pytest.mark.parametrize("altitude_m", [100.0, 6000.0, 10999.0, 11001.0, 19000.0])
def test_pressure_carries_the_air_above(altitude_m: float) -> None:
    """dp/dh = -rho g, by central differences; h^2 p''' / 6 is below 1e-7 of it."""
    half = 0.5
    slope = standard_atmosphere(altitude_m + half).pressure_pa - standard_atmosphere(altitude_m - half).pressure_pa
    weight = standard_atmosphere(altitude_m).density_kg_m3 * STANDARD_GRAVITY_M_S2
    assert -slope == pytest.approx(weight, rel=1e-6)


@pytest.mark.parametrize("altitude_m", [-1.0, 20001.0, float("nan")])
def test_altitudes_outside_the_model_are_refused(altitude_m: float) -> None:
    with pytest.raises(DockairError, match="altitude_m: expected an altitude from 0 to 20000 m"):
        standard_atmosphere(altitude_m)
