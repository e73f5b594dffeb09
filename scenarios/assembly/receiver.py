"""The receiver's airframe that a scenario chose."""

from collections.abc import Mapping
from typing import Any

from dockair.parameters import load_parameters
from dockair.scenarios.schema import Scenario
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.derivatives import DerivativeAirframe

_KINDS: dict[str, type[AirframeData]] = {"fighter": AirframeParameters, "unmanned": DerivativeAirframe}


def airframe(scenario: Scenario, overrides: Mapping[str, Mapping[str, Any]]) -> AirframeData:
    """Return the airframe of `hardware.airframe`.

    Args:
        scenario: which one.
        overrides: sheet -> key -> value instead of the sheet's; the scenario's own for the aircraft as it flies, none
            for what the navigation is told.
    """
    sheet = scenario.hardware.receiver_sheet("airframe")
    return load_parameters(sheet, _KINDS[scenario.hardware.airframe], overrides.get(sheet))
