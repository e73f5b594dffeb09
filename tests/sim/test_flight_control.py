"""The flight control by itself; flown on a rigid body it is in test_receiver.py, its gains are in test_regulator.py."""

import numpy as np

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.flight_control import FlightControl, FlightControlParameters
from dockair.sim.aircraft.trim import level_trim

AIRFRAME = load_parameters("airframe", AirframeParameters)
PARAMETERS = load_parameters("flight_control", FlightControlParameters)


def test_control_finds_the_gust_that_explains_airspeed_and_accelerometers() -> None:
    """The plant flown through a small gust at trim; at engagement the estimate is the measurement, unfiltered."""
    trim, gust_W = level_trim(AIRFRAME, 180.0, standard_atmosphere(6000.0)), np.array([0.05, -0.04, 0.03])
    design = FlightControl(PARAMETERS, AIRFRAME, trim, 1e-3)
    velocity_W = np.array([180.0, 0.0, 0.0])
    v_air_B = trim.R_WB.T @ (velocity_W - gust_W)
    force_B, _ = trim.aerodynamics.force_and_moment(v_air_B, np.zeros(3), trim.surfaces_rad)
    force_B[0] += trim.thrust_n
    design.step(
        R_WB=trim.R_WB,
        w_WB_B=np.zeros(3),
        velocity_W=velocity_W,
        airspeed_m_s=float(np.linalg.norm(v_air_B)),
        specific_force_B=force_B / AIRFRAME.mass_kg,
        surfaces_rad=trim.surfaces_rad,
        thrust_n=trim.thrust_n,
        command=ReceiverCommand(),
    )
    np.testing.assert_allclose(design._gust_W, gust_W, atol=5e-4)
