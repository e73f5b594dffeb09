"""The key `navigation.heading`: who may ask for a heading, and what its frames cost the LEDs' navigation."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.nav.navigator import NavigatorSettings
from dockair.scenarios.assembly.parts import build, camera_sheets, guidance_settings
from dockair.scenarios.loop import Flight
from dockair.scenarios.schema import load_scenario
from dockair.scenarios.truth_navigation import TruthNavigator
from dockair.sim.camera.exposure import ExposureControl

FLOWN_S = 7.0


@pytest.mark.parametrize(
    "keys", [{"navigation.navigator": "truth"}, {"camera.sensing": "measurements"}, {"navigation.navigator": "a:B"}]
)
def test_a_heading_is_kept_by_our_navigator_and_by_frames_alone(keys):
    with pytest.raises(DockairError, match=r"navigation.heading: expected false but with .*, got True"):
        load_scenario("racetrack", {"navigation.heading": True, **keys})


def test_the_keys_reach_the_navigator_with_the_briefed_airspeed():
    settings = []
    for keys in ({}, {"navigation.heading": True, "navigation.heading_every_s": 1.5}):
        recipe = build(load_scenario("slow_set", keys), 0).recipe
        assert recipe is not None and isinstance(recipe.settings, NavigatorSettings)
        settings.append(recipe.settings.heading)
    assert settings[0] is None and settings[1] is not None
    assert (settings[1].every_s, settings[1].airspeed_m_s) == (1.5, 120.0)


@pytest.mark.parametrize(
    ("limits_s", "asked_s"),
    [({}, 500e-6), ({"longest_s": 2e-4}, 2e-4), ({"shortest_s": 8e-4, "exposure_s": 9e-4, "longest_s": 1e-3}, 8e-4)],
)
def test_no_exposure_is_asked_for_that_the_camera_cannot_make(limits_s, asked_s):
    """It would make the nearest one, and by another exposure the heading does not know its frame."""
    keys = {f"parameters.exposure.{name}": value for name, value in limits_s.items()}
    scenario = load_scenario("racetrack", {"navigation.heading": True, **keys})
    recipe, sheets = build(scenario, 0).recipe, camera_sheets(scenario)
    assert recipe is not None and isinstance(recipe.settings, NavigatorSettings) and recipe.settings.heading is not None
    assert recipe.settings.heading.exposure_s == asked_s
    assert ExposureControl(sheets.exposure, sheets.sensor).within_limits(asked_s) == asked_s


def test_a_gyro_that_is_too_bad_for_it_is_refused_in_one_line():
    keys = {"navigation.heading": True, "hardware.imu": "consumer"}
    with pytest.raises(DockairError, match="heading.gyro: expected gyros whose bias is below"):
        build(load_scenario("racetrack", keys), 0)


def _watched(heading: bool) -> dict[float, str]:
    """Status after each frame of a flight that the truth steers, "asked" for those of the heading."""
    scenario = load_scenario("racetrack", {"navigation.heading": heading})
    flight = Flight(scenario, 0)
    truth_navigator = TruthNavigator(flight.sheets, guidance_settings(scenario))
    command, statuses = None, {}
    while flight.truth.time_s < FLOWN_S:
        tick = flight.step(command)
        truth_navigator.truth = tick.truth
        command = truth_navigator.step(tick.imu, None).command
        if tick.frame is not None:
            own = flight.navigator._heading
            asked = own is not None and own.was_asked(tick.frame)
            statuses[tick.frame.time_stamp_s] = "asked" if asked else tick.solution.status
        last = tick.solution
    flight.close()
    assert np.isfinite(last.heading_rad) == heading
    return statuses


@pytest.mark.slow
def test_a_heading_costs_the_frames_that_it_asks_for_and_no_other():
    with_heading, without = _watched(True), _watched(False)
    assert with_heading.keys() == without.keys()
    assert sum(status == "asked" for status in with_heading.values()) == 2  # from 4 s on, every 2 s
    assert set(with_heading.values()) == {"asked", "pose used"}
    assert set(without.values()) == {"pose used"}
