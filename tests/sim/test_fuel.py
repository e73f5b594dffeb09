"""Fuel: the valve's lag in closed form, when it flows, and a hold in the whole world."""

import numpy as np
import pytest

from dockair.messages import Light, ReceiverCommand
from dockair.parameters import load_parameters
from dockair.sim.hose.fuel import Fuel, FuelParameters
from dockair.sim.hose.reel import reel_light

SHEET = load_parameters("fuel", FuelParameters)
GREEN, AMBER, FLASHING, RED = Light.GREEN, Light.AMBER, Light.FLASHING_AMBER, Light.RED


def run(fuel, light, seconds, step_s, latched=True):
    for _ in range(round(seconds / step_s)):
        fuel.step(light, latched)
    return fuel


@pytest.mark.parametrize("step_s", [0.001, 0.01])
def test_flow_and_amount_follow_the_lag_of_the_valve_opening_and_shutting(step_s):
    """Q = Q_0 (1 - exp(-t/tau)) and its integral; from there Q_1 exp(-t/tau), whatever the step."""
    fuel = run(Fuel(SHEET, step_s), GREEN, 3.0, step_s)
    tau, full = SHEET.opening_time_s, SHEET.flow_kg_s
    flow = full * (1.0 - np.exp(-3.0 / tau))
    given = full * 3.0 - flow * tau
    assert fuel.flow_kg_s == pytest.approx(flow, rel=1e-9)
    assert fuel.given_kg == pytest.approx(given, rel=1e-9)
    run(fuel, AMBER, 0.7, step_s)
    tau = SHEET.closing_time_s
    assert fuel.flow_kg_s == pytest.approx(flow * np.exp(-0.7 / tau), rel=1e-9)
    assert fuel.given_kg == pytest.approx(given + flow * tau * (1.0 - np.exp(-0.7 / tau)), rel=1e-9)


@pytest.mark.parametrize("light", [AMBER, FLASHING, RED])
def test_nothing_flows_under_another_light_than_green(light):
    assert run(Fuel(SHEET, 0.001), light, 1.0, 0.001).given_kg == 0.0


def test_the_flow_stops_at_once_where_coupling_and_nozzle_part():
    fuel = run(Fuel(SHEET, 0.001), GREEN, 2.0, 0.001)
    given = fuel.given_kg
    run(fuel, GREEN, 1.0, 0.001, latched=False)
    assert fuel.flow_kg_s == 0.0 and fuel.given_kg == given > 0.0


def test_fuel_flows_in_a_hold_only_while_the_hose_stands_in_its_refuelling_range(make_world):
    """Pushed in at 1.2 m/s through the range and beyond it: from amber over green to flashing amber."""
    world, held = make_world(p_PD_B=(0.1, 0.0, 0.0)), []
    reel = world.parameters.reel
    for _ in range(6500):
        truth = world.step(ReceiverCommand(velocity_m_s=np.array([1.2, 0.0, 0.0])))
        if truth.latched:
            held.append(truth)
        if truth.reel_position_m > reel.inner_limit_m + 0.3:
            break
    lights = [reel_light(truth.reel_position_m, False, reel) for truth in held]
    assert {AMBER, GREEN, FLASHING} == set(lights)
    flow = np.array([truth.fuel_flow_kg_s for truth in held])
    rises = np.diff(flow) > 0.0
    assert np.array_equal(rises, [light is GREEN for light in lights[:-1]])  # the light of the tick's beginning
    assert held[-1].fuel_kg == pytest.approx(np.trapezoid(flow, dx=0.001), rel=1e-3)
    assert held[-1].fuel_kg > 0.7 * SHEET.flow_kg_s * (reel.inner_limit_m - reel.refuelling_from_m) / 1.2
    in_half_a_second = np.exp(-0.5 / SHEET.closing_time_s)
    peak = int(np.argmax(flow))
    assert flow[-1] < flow[peak] * max(in_half_a_second, np.exp(-(len(flow) - 1 - peak) / 500.0)) * 1.001


@pytest.mark.parametrize("known", [True, False])
def test_a_reel_that_dies_in_the_refuelling_range_stops_the_fuel_where_the_unit_knows_of_it(make_world, known):
    dead = {"reel_locked": lambda time_s: time_s > 2.0}
    world = make_world(p_PD_B=(0.1, 0.0, 0.0), **dead, reel_known_dead=dead["reel_locked"] if known else None)
    for _ in range(2000):
        truth = world.step(ReceiverCommand(velocity_m_s=np.array([1.2, 0.0, 0.0])))
    assert truth.latched and truth.fuel_flow_kg_s > 0.0
    before, flows = truth.fuel_flow_kg_s, []
    for tick in range(100):  # a probe that stopped at once would be torn off
        truth = world.step(ReceiverCommand(velocity_m_s=np.array([1.2 - 1e-3 * tick, 0.0, 0.0])))
        flows.append(truth.fuel_flow_kg_s)
    assert before < flows[0] and (flows[1] < flows[0]) is known  # the tick that begins at 2 s knows of nothing yet
    assert truth.latched and (truth.fuel_flow_kg_s < before) is known


def test_nothing_flows_any_more_in_the_tick_after_the_coupling_has_let_go(make_world):
    world = make_world(p_PD_B=(60.0, 0.0, 0.0))
    world._fuel.flow_kg_s = 5.0  # as if the probe had been held until now
    truth = world.step(ReceiverCommand())
    assert truth.fuel_flow_kg_s == 0.0 and truth.fuel_kg == 0.0


def test_a_restored_world_gives_the_same_fuel_to_the_bit(make_world):
    command = ReceiverCommand(velocity_m_s=np.array([1.2, 0.0, 0.0]))
    world = make_world(p_PD_B=(0.1, 0.0, 0.0))
    for _ in range(1800):
        world.step(command)
    state = world.save()
    once = [world.step(command).fuel_kg for _ in range(200)]
    world.restore(state)
    again = [world.step(command).fuel_kg for _ in range(200)]
    assert once == again and once[-1] > once[0] > 0.0
