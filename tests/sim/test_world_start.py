"""How a flight begins: the receiver trimmed where it is, in the wake that blows there."""

from functools import cache

import numpy as np
import pytest

from dockair.calibration import Mounting
from dockair.clock import Clock
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.air.motion import AirMotion
from dockair.sim.air.wake import WakeParameters, wake_coefficients
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.receiver import Receiver
from dockair.sim.aircraft.trim import level_trim, steady_trim
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.hose.fuel import FuelParameters
from dockair.sim.hose.reel import ReelParameters
from dockair.sim.outlines import TankerParameters
from dockair.sim.world import World, WorldParameters, WorldStart

AIR, V, CLOCK = standard_atmosphere(6000.0), 180.0, Clock(1000)
AIRFRAME = load_parameters("airframe", AirframeParameters)
MOUNTING = Mounting(R_BC=np.eye(3), p_BC=np.array([3.3, -0.45, 0.75]), p_BP=np.array([6.0, -0.9, 0.6]))
TANKER = load_parameters("tanker", TankerParameters)
QUIET = dict.fromkeys(
    (
        "attitude_sigma_rad",
        "rate_sigma_rad_s",
        "specific_force_sigma_m_s2",
        "velocity_sigma_m_s",
        "airspeed_sigma_m_s",
        "inertial_velocity_sigma_m_s",
    ),
    0.0,
)


def receiver() -> Receiver:
    return Receiver(
        airframe=AIRFRAME,
        flight_control=load_parameters("flight_control", FlightControlParameters, QUIET),
        probe_B=MOUNTING.p_BP,
        airspeed_m_s=V,
        air=AIR,
        step_s=CLOCK.step_s,
        rng=np.random.default_rng(0),
    )


def world(wake: bool) -> World:
    """Still air but for the wake; the receiver 15 m behind the drogue, its sensors without noise and drift."""
    parameters = WorldParameters(
        hose=load_parameters("hose", HoseParameters),
        drogue=load_parameters("drogue", DrogueParameters),
        reel=load_parameters("reel", ReelParameters),
        coupling=load_parameters("coupling", CouplingParameters),
        fuel=load_parameters("fuel", FuelParameters),
        tanker=TANKER,
        mounting=MOUNTING,
        air=AIR,
        airspeed_m_s=V,
        sun_direction_W=np.array([0.0, 0.0, 1.0]),
    )
    sheet = load_parameters("wake", WakeParameters)
    table = wake_coefficients(sheet, mass_kg=TANKER.mass_kg, span_m=TANKER.span_m, airspeed_m_s=V, air=AIR)
    air = AirMotion(wake=table, exit_T=TANKER.exit_m, receiver_points_B=AIRFRAME.gust_points_m) if wake else None
    start = WorldStart(p_PD_B=np.array([15.0, 0.0, 0.0]), settle_s=0.0)
    return World(parameters, receiver(), air, start, CLOCK)


@cache
def tips(wake: bool) -> np.ndarray:
    """(2001, 3) the tip's places in the first 2 s without a command."""
    flown = world(wake)
    places = [flown.truth.p_WP]
    places += [flown.step(ReceiverCommand()).p_WP for _ in range(2000)]
    return np.array(places)


@pytest.mark.parametrize("wake", [False, True])
def test_flight_begins_at_rest_with_the_wake_and_without(wake: bool) -> None:
    """The wake blows down with 3.6 m/s there: trimmed for still air the tip would fall by 7 cm within 2 s."""
    moved = tips(wake) - tips(wake)[0]
    assert np.abs(moved[:, 2]).max() < (0.02 if wake else 1e-9)
    assert np.linalg.norm(moved, axis=1).max() < (0.02 if wake else 1e-9)


def test_receiver_starts_nose_up_by_the_angle_of_the_wakes_downwash() -> None:
    """And the drogue is where it was asked for, in the axes of the body that is trimmed so."""
    started, still = world(True), level_trim(AIRFRAME, V, AIR)
    truth, downwash = started.truth, -started.truth.gust_B_m_s[2]
    assert downwash > 2.0
    raised = np.arcsin(truth.R_WB[2, 0]) - still.pitch_rad  # less than that: air that turns about the wing lifts, too
    assert 0.85 < raised / np.arctan2(downwash, V) < 1.0
    np.testing.assert_allclose(truth.p_PD_B, [15.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(truth.v_WB, 0.0)


def test_receiver_is_trimmed_in_the_air_of_the_very_place_where_that_trim_puts_it() -> None:
    """The place goes by the attitude and the air by the place: after three rounds to a ten-thousandth."""
    started = world(True)
    trim, air = started._receiver.trim, started._air_state  # type: ignore[attr-defined]
    assert trim.downwash_m_s == pytest.approx(-air.receiver_W[2], rel=1e-4)
    there = steady_trim(
        AIRFRAME, V, AIR, downwash_m_s=-air.receiver_W[2], pitching_air_rad_s=air.receiver_rotation_B[1]
    )
    np.testing.assert_allclose(started.truth.R_WB, there.R_WB, atol=1e-6)


def test_first_commands_in_the_wake_are_where_the_actuators_stand() -> None:
    """Elevator and thrust; what the wake does beside its axis is left to the first second."""
    flown = world(True)
    trim = flown._receiver.trim  # type: ignore[attr-defined]
    flown.step(ReceiverCommand())
    actuators = flown._receiver.actuators  # type: ignore[attr-defined]
    np.testing.assert_allclose(actuators.surfaces_rad, trim.surfaces_rad, atol=np.radians(0.01))
    assert actuators.thrust_n == pytest.approx(trim.thrust_n, abs=10.0)
    assert np.abs(trim.elevator_rad - level_trim(AIRFRAME, V, AIR).elevator_rad) > np.radians(0.05)
