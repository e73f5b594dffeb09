"""Makes a scenario's air in motion: turbulence, single gusts, wake, bow wave."""

from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np

from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.scenarios.schema import Scenario
from dockair.sim.air.bow_wave import BowWaveParameters, bow_wave_coefficients
from dockair.sim.air.discrete_gust import DiscreteGust, DiscreteGusts
from dockair.sim.air.motion import AirMotion
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters, gust_sigma
from dockair.sim.air.wake import WakeParameters, wake_coefficients
from dockair.sim.hose.rest import rest_shape
from dockair.sim.parts import WorldParameters

T = TypeVar("T")


class _Loads(Protocol):
    """Loads a sheet with the scenario's own values."""

    def __call__(self, sheet: str, cls: type[T], /) -> T: ...


def air_motion(
    scenario: Scenario,
    load: _Loads,
    world: WorldParameters,
    clock: Clock,
    rng: np.random.Generator,
    *,
    receiver_span_m: float,
    receiver_points_B: Array,
    settle_s: float,
) -> AirMotion | None:
    """Return the sources that the scenario asks for, None for still air.

    Args:
        scenario: its tables turbulence, gusts, wake, bow_wave.
        load: sheet and class -> parameters. All sheets are loaded, whatever is present.
        world: flight condition, tanker, hose.
        clock: physics rate.
        rng: the stream "gust".
        receiver_span_m: for the rolling gust.
        receiver_points_B: (m, 3) where the receiver feels the air, body axes [m].
        settle_s: how long the world runs before time 0.

    Raises:
        DockairError: turbulence whose field ends before the receiver's tail.
    """
    turbulence_sheet = load("turbulence", TurbulenceParameters)
    wake_sheet = load("wake", WakeParameters)
    bow_wave_sheet = load(scenario.hardware.receiver_sheet("bow_wave"), BowWaveParameters)
    V = world.airspeed_m_s
    rearmost_m = _rearmost_m(scenario, world, receiver_points_B)
    gusts = _turbulence(scenario, turbulence_sheet, V, clock, rng, receiver_span_m, rearmost_m)
    single = _single_gusts(scenario, world, clock, settle_s) if scenario.gusts else None
    wake = bow_wave = None
    if scenario.wake.present:
        tanker = world.tanker
        wake = wake_coefficients(
            wake_sheet, mass_kg=tanker.mass_kg, span_m=tanker.span_m, airspeed_m_s=V, air=world.air
        )
    if scenario.bow_wave.present:
        bow_wave = bow_wave_coefficients(bow_wave_sheet, world.mounting.p_BP, V)
    if gusts is None and single is None and wake is None and bow_wave is None:
        return None
    exit_T = world.tanker.exit_m
    return AirMotion(gusts, single, wake, bow_wave, exit_T=exit_T, receiver_points_B=receiver_points_B)


def _rearmost_m(scenario: Scenario, world: WorldParameters, receiver_points_B: Array) -> float:
    """How far aft of the hose's exit, at most, the receiver feels the air where the flight begins [m]."""
    tail_m = float(world.mounting.p_BP[0] - np.min(receiver_points_B[:, 0]))
    return float(world.hose.length_m + scenario.start.aft_m + tail_m)


def _turbulence(
    scenario: Scenario,
    parameters: TurbulenceParameters,
    airspeed_m_s: float,
    clock: Clock,
    rng: np.random.Generator,
    span_m: float,
    rearmost_m: float,
) -> DrydenField | None:
    turbulence = scenario.turbulence
    if turbulence.model == "none":
        return None
    sigma = turbulence.sigma_m_s
    if turbulence.intensity is not None:
        sigma = gust_sigma(turbulence.intensity, scenario.flight.altitude_m)
    if sigma is not None:
        parameters = replace(parameters, sigma_m_s=sigma)
    if parameters.extent_m - parameters.front_m < rearmost_m:
        least_m = np.ceil(parameters.front_m + rearmost_m)
        expected = (
            f"at least {least_m:.0f} m, from turbulence.front_m back over hose and receiver; beyond it is one gust"
        )
        raise DockairError("parameters.turbulence.extent_m", expected=expected, got=parameters.extent_m)
    return DrydenField(parameters, airspeed_m_s, clock.step_s, rng, span_m)


def _single_gusts(scenario: Scenario, world: WorldParameters, clock: Clock, settle_s: float) -> DiscreteGusts:
    wind_W, air = np.array([-world.airspeed_m_s, 0.0, 0.0]), world.air
    rest = rest_shape(world.hose, world.drogue, wind_W, air.density_kg_m3, air.kinematic_viscosity_m2_s)
    return DiscreteGusts(
        [
            DiscreteGust(at_s=one.at_s, length_m=one.length_m, velocity_m_s=np.array(one.velocity_m_s))
            for one in scenario.gusts
        ],
        world.airspeed_m_s,
        clock.step_s,
        met_at_m=float(rest.air_places_W(world.drogue)[-1, 0]),
        start_s=-round(settle_s / clock.step_s) * clock.step_s,
    )
