"""Level flight of the receiver."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.trim import level_trim

AIRFRAME = load_parameters("airframe", AirframeParameters)


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), [(180.0, 6000.0), (120.0, 3000.0), (220.0, 9000.0)])
def test_at_trim_air_engine_and_weight_balance_and_no_moment_is_left(airspeed_m_s: float, altitude_m: float) -> None:
    trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))
    v_B = trim.R_WB.T @ [airspeed_m_s, 0.0, 0.0]
    force_B, moment_B = trim.aerodynamics.force_and_moment(v_B, np.zeros(3), trim.surfaces_rad)
    weight_n = AIRFRAME.mass_kg * STANDARD_GRAVITY_M_S2
    balance_W = trim.R_WB @ (force_B + [trim.thrust_n, 0.0, 0.0]) - [0.0, 0.0, weight_n]
    np.testing.assert_allclose(balance_W, 0.0, atol=1e-6 * weight_n)
    np.testing.assert_allclose(moment_B, 0.0, atol=1e-6 * weight_n)
    assert trim.thrust_range.idle_n < trim.thrust_n < trim.thrust_range.military_n


def test_nose_is_up_by_the_angle_of_attack_and_more_so_when_slow() -> None:
    angles = []
    for airspeed_m_s in (120.0, 150.0, 180.0):
        trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(3000.0))
        np.testing.assert_allclose(trim.R_WB[:, 0], [np.cos(trim.alpha_rad), 0.0, np.sin(trim.alpha_rad)], atol=1e-12)
        np.testing.assert_allclose(trim.R_WB[:, 1], [0.0, 1.0, 0.0], atol=1e-12)
        angles.append(trim.alpha_rad)
    assert angles[0] > angles[1] > angles[2] > 0.0
    # lift = weight with a linear slope: alpha less that of zero lift goes with 1/V^2, and the elevator's share is small
    slope = -(AIRFRAME.normal_force[3] - AIRFRAME.normal_force[2]) / np.deg2rad(5.0)
    pressure = 0.5 * standard_atmosphere(3000.0).density_kg_m3 * AIRFRAME.wing_area_m2 * slope
    expected = AIRFRAME.mass_kg * STANDARD_GRAVITY_M_S2 / pressure * (120.0**-2 - 180.0**-2)
    assert angles[0] - angles[2] == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("airspeed_m_s", [0.0, 60.0, 340.0])
def test_airspeed_at_which_level_flight_is_impossible_is_refused(airspeed_m_s: float) -> None:
    with pytest.raises(DockairError, match="airspeed_m_s"):
        level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(12000.0))
