"""What a caller of the Python interface may hand over, and the one line for what cannot be."""

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.scenarios.campaign.folder import rows_of
from dockair.scenarios.loop import fly
from dockair.scenarios.schema import load_scenario

STILL = load_scenario("still_air")


@pytest.mark.parametrize("scenario", ["default", None, {"name": "x"}])
def test_a_flight_of_no_scenario_says_where_one_comes_from(scenario):
    with pytest.raises(DockairError, match=r"fly: scenario: expected a Scenario, as load_scenario\(name\) returns it"):
        fly(scenario, seed=1)


@pytest.mark.parametrize("seed", [-1, 3.0, "3", True, np.float64(2.0), 2**63])
def test_a_seed_is_a_whole_number_that_a_table_holds(seed):
    with pytest.raises(DockairError, match=r"fly: seed: expected an integer from 0 to 9223372036854775807"):
        fly(STILL, seed=seed)


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        ((None,), "name_or_path"),
        ((3,), "name_or_path"),
        (("default", ["a=1"]), "overrides"),
        (("default", "a=1"), "overrides"),
    ],
)
def test_a_scenario_is_loaded_by_name_with_a_mapping(arguments, where):
    with pytest.raises(DockairError, match=f"load_scenario: {where}: expected"):
        load_scenario(*arguments)


def test_rows_are_read_from_a_folder_named_by_text(tmp_path):
    with pytest.raises(DockairError, match="expected the folder of a campaign"):
        rows_of(str(tmp_path))


def test_progress_is_told_of_every_control_tick_and_of_the_last_one_too():
    told = []
    short = load_scenario("truth_navigation", {"flight.duration_s": 0.05})
    result = fly(short, progress=lambda truth, solution: told.append((truth.time_s, solution.time_stamp_s)))
    assert told == pytest.approx(np.tile(0.01 * np.arange(1, 6), (2, 1)).T)
    assert (result.outcome, result.duration_s) == ("timeout", told[-1][0])
