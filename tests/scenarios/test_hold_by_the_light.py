"""A hold in the whole world goes by the pod's light where the drift that is held on the probe errs."""

from dataclasses import replace

import pytest

from dockair.messages import Light
from dockair.scenarios.loop import Flight
from dockair.scenarios.schema import load_scenario


def test_a_receiver_that_drifts_back_unseen_on_the_probe_refuels_all_the_same():
    """By 0.15 m/s, out of the range from 1.5 m as reckoned: without the light it left content, with 25 kg."""
    settings = {"navigation.navigator": "truth", "guidance.take_in_m": 1.5, "guidance.stabilise_s": 1.0}
    flight, light, green_s, lights = Flight(load_scenario("still_air", settings), 0), Light.AMBER, 0.0, []
    try:
        tick = flight.step()
        while tick.outcome is None and tick.solution.phase != "disconnect":
            command, held = tick.solution.command, tick.truth.latched
            drifts = replace(command, velocity_m_s=command.velocity_m_s + [-0.15 * held, 0.0, 0.0])
            before, tick = tick.truth.time_s, flight.step(drifts)
            if tick.signal is not None:
                light = tick.signal.light
                lights.append(light)
            if tick.solution.phase == "hold" and light is Light.GREEN:
                green_s += tick.truth.time_s - before
    finally:
        flight.close()
    assert tick.solution.phase_reason == "refuelled" and tick.truth.latched
    assert green_s == pytest.approx(5.0, abs=0.03)
    assert tick.truth.fuel_kg > 60.0
    assert lights[:3] == [Light.GREEN, Light.AMBER, Light.GREEN]
