"""The receiver's equations of motion about trim, and their Jacobians."""

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.linear_model import INPUTS, STATES, linear_model, state_derivative
from dockair.sim.aircraft.trim import level_trim

FLIGHTS = [(180.0, 6000.0), (120.0, 3000.0)]
AIRFRAME = load_parameters("airframe", AirframeParameters)


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_linear_model_has_the_modes_of_an_f16(airspeed_m_s: float, altitude_m: float) -> None:
    """Stable short period and Dutch roll of 1 to 4 rad/s, roll mode near 2 /s, a slow phugoid; nothing unstable."""
    trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))
    modes = np.linalg.eigvals(linear_model(AIRFRAME, trim).A)
    assert modes.real.max() < 1e-9
    oscillations = np.sort(np.abs(modes[modes.imag > 1e-3]))
    # Lanchester: phugoid at sqrt(2) g / V
    assert oscillations[0] == pytest.approx(np.sqrt(2.0) * 9.80665 / airspeed_m_s, rel=0.15)
    assert np.all((oscillations[1:] > 1.0) & (oscillations[1:] < 4.0))


@pytest.mark.parametrize(("airspeed_m_s", "altitude_m"), FLIGHTS)
def test_linear_model_is_the_derivative_of_the_equations_of_motion(airspeed_m_s: float, altitude_m: float) -> None:
    """Along random directions, with a step other than the model's own: the remainder is of second order."""
    trim = level_trim(AIRFRAME, airspeed_m_s, standard_atmosphere(altitude_m))
    model, rng = linear_model(AIRFRAME, trim), np.random.default_rng(8)
    for _ in range(10):
        x, u, g = rng.normal(size=STATES) * 1e-3, rng.normal(size=INPUTS) * 1e-3, rng.normal(size=3) * 1e-3
        slope = 0.5 * (state_derivative(AIRFRAME, trim, x, u, g) - state_derivative(AIRFRAME, trim, -x, -u, -g))
        np.testing.assert_allclose(slope, model.A @ x + model.B @ u + model.B_gust @ g, atol=1e-6)
