"""The receiver beside the book's printed figures, and the scenario's choice of the airframe."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.scenarios.assembly import receiver as build_receiver
from dockair.scenarios.assembly.mounting_parameters import MountingParameters
from dockair.scenarios.reproduce.world import receiver as world_receiver
from dockair.scenarios.schema import load_scenario
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.derivatives import DerivativeAirframe


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    out = tmp_path_factory.mktemp("receiver")
    made = world_receiver.reproduce(out)
    made["picture"] = next(Path(out).iterdir())
    return made


def row(result: dict[str, Any], case: str) -> dict[str, Any]:
    return next(row for row in result["rows"] if row["case"] == case)


def test_every_state_derivative_of_the_check_agrees_to_five_digits(result: dict[str, Any]) -> None:
    """The sixth differs where the book takes 57.3 degrees for a radian; the rates are printed to seven."""
    ours, printed = row(result, "state derivatives")["ours"], row(result, "state derivatives")["reference"]
    assert len(printed) == 9 and set(ours) == set(printed)
    for key, value in printed.items():
        assert ours[key] == pytest.approx(value, rel=1e-5), key
    for key in ("phi_rad_s", "theta_rad_s", "psi_rad_s", "beta_rad_s", "p_rad_s2", "r_rad_s2"):
        assert ours[key] == pytest.approx(printed[key], rel=1e-6), key


def test_trims_and_turns_agree_within_two_parts_in_a_thousand(result: dict[str, Any]) -> None:
    cases = [entry for entry in result["rows"] if entry["case"].startswith("trim")]
    assert len(cases) == 5
    for entry in cases:
        for key, value in entry["reference"].items():
            assert entry["ours"][key] == pytest.approx(value, rel=2e-3, abs=1e-3), (entry["case"], key)


def test_modes_at_held_throttle_agree_within_a_part_in_a_hundred_in_all_eight_numbers(result: dict[str, Any]) -> None:
    """The slowest are printed to two and three digits."""
    entry = row(result, "modes, held throttle")
    assert len(entry["reference"]) == 8
    for key, value in entry["reference"].items():
        assert entry["ours"][key] == pytest.approx(value, rel=5e-3), key
    held = row(result, "modes, held thrust")["ours"]
    assert -held["phugoid_real_1_s"] < 0.7 * -entry["ours"]["phugoid_real_1_s"]


def test_both_airframes_fly_both_flights_with_their_five_modes(result: dict[str, Any]) -> None:
    for name in ("fighter", "unmanned"):
        for flight in ("120 m/s, 3000 m", "180 m/s, 6000 m"):
            ours = row(result, f"{name}, {flight}")["ours"]
            assert all(np.isfinite(value) for value in ours.values())
            assert 0.0 < ours["of_thrust_range"] < 1.0 and ours["turn_thrust_n"] > ours["thrust_n"]
            for key, value in ours.items():
                if key.endswith("_1_s") and "imag" not in key:
                    assert value < 0.0, (name, key)


def test_picture_shows_something(result: dict[str, Any]) -> None:
    picture = cv2.imread(str(result["picture"]))
    assert result["picture"].name == "world-receiver.png"
    assert picture is not None and picture.std() > 10.0


def test_scenario_chooses_airframe_and_mounting_by_one_word() -> None:
    fighter, unmanned = (load_scenario("default", {"hardware.airframe": name}) for name in ("fighter", "unmanned"))
    assert isinstance(build_receiver.airframe(fighter, {}), AirframeParameters)
    other = build_receiver.airframe(unmanned, {"airframe_unmanned": {"mass_kg": 3000.0}})
    assert isinstance(other, DerivativeAirframe) and other.mass_kg == 3000.0
    assert unmanned.hardware.receiver_sheet("mounting") == "mounting_unmanned"
    assert load_scenario("default").hardware.receiver_sheet("airframe") == "airframe"


def test_sheet_of_the_airframe_that_does_not_fly_is_refused() -> None:
    with pytest.raises(DockairError, match=r"parameters\.airframe.*airframe_unmanned"):
        load_scenario("default", {"hardware.airframe": "unmanned", "parameters.airframe.mass_kg": 9000.0})
    with pytest.raises(DockairError, match="hardware.airframe"):
        load_scenario("default", {"hardware.airframe": "balloon"})


def test_probe_and_camera_keep_their_places_to_one_another_on_the_unmanned_receiver() -> None:
    one, other = (load_parameters(name, MountingParameters) for name in ("mounting", "mounting_unmanned"))
    apart, other_apart = (sheet.camera_position_m - sheet.probe_tip_m for sheet in (one, other))
    np.testing.assert_allclose(other_apart, apart, atol=1e-12)
    assert one.camera_yaw_rad == other.camera_yaw_rad
