"""The gate: how often it fails a build that is good, counted out; and that it fails one that is not."""

import itertools
import math
import re
from pathlib import Path

import pytest

from dockair.errors import DockairError
from dockair.scenarios.campaign.gate import judge, require_power
from dockair.scenarios.campaign.jobs import jobs_of
from dockair.scenarios.campaign.plan import Gate
from dockair.scenarios.campaign.plan_file import PlanFile
from dockair.scenarios.campaign.row import unflown


def rows(docked: int, flights: int, scenario: str = "light", **changes):
    common = {"scenario": scenario, "sensing": "camera", "navigator": "n", "controller": "c", "unsafe": "", "error": ""}
    return [
        common
        | {"seed": seed, "command": f"dockair fly {scenario} --seed {seed}"}
        | {"success": seed < docked, "first_attempt": seed < docked // 2, "outcome": "contact"}
        | changes
        for seed in range(flights)
    ]


def chance(docked: int, flights: int, rate: float) -> float:
    return math.comb(flights, docked) * rate**docked * (1.0 - rate) ** (flights - docked)


@pytest.mark.parametrize("false_alarm", [0.05, 0.001])
@pytest.mark.parametrize(("flights", "rate"), [(12, 0.9), (20, 0.95), (60, 0.7)])
def test_a_build_of_the_rate_asked_fails_as_seldom_as_the_gate_says(flights, rate, false_alarm):
    gate = Gate(success_rate=rate, false_alarm=false_alarm)
    failed = sum(chance(k, flights, rate) for k in range(flights + 1) if not judge(gate, rows(k, flights)).passed)
    assert 0.0 < failed < false_alarm
    worst_passed = min(k for k in range(flights + 1) if judge(gate, rows(k, flights)).passed)
    assert failed + chance(worst_passed, flights, rate) >= false_alarm  # it could not have been stricter


def test_what_is_just_as_unlikely_as_a_false_alarm_may_be_is_none():
    """Eq. (1) has "<": none of two under a rate of 1/2 has a probability of 1/4, exactly in binary."""
    (test,) = judge(Gate(success_rate=0.5, false_alarm=0.25), rows(0, 2)).tests
    assert (test.probability, test.passed, test.fails_up_to) == (0.25, True, -1)
    (test,) = judge(Gate(success_rate=0.5, false_alarm=math.nextafter(0.25, 1.0)), rows(0, 2)).tests
    assert (test.passed, test.fails_up_to) == (False, 0)


def test_two_scenarios_together_fail_no_more_often_than_the_gate_says():
    gate, flights, rate = Gate(success_rate=0.8, false_alarm=0.05), 20, 0.8  # one alone 0.032, twice is too often
    failed = sum(
        chance(a, flights, rate) * chance(b, flights, rate)
        for a, b in itertools.product(range(flights + 1), repeat=2)
        if not judge(gate, rows(a, flights) + rows(b, flights, "severe")).passed
    )
    assert 0.0 < failed < 0.05


def test_a_build_that_docks_half_the_time_is_noticed():
    gate = Gate(success_rate=0.95, false_alarm=0.001)
    noticed = sum(chance(k, 20, 0.5) for k in range(21) if not judge(gate, rows(k, 20)).passed)
    assert noticed == pytest.approx(0.979, abs=0.001)


def test_sensing_kinds_are_never_pooled():
    gate = Gate(success_rate=0.9, false_alarm=0.01)
    mixed = rows(20, 20) + rows(8, 20, sensing="truth")
    verdict = judge(gate, mixed)
    assert [(test.successes, test.flights) for test in verdict.tests] == [(20, 20), (8, 20)]
    assert not verdict.passed
    assert "perfect navigation" in verdict.reasons[0]


def test_a_scenario_may_be_asked_for_a_rate_of_its_own():
    gate = Gate.model_validate({"success_rate": 0.9, "scenarios": {"severe": {"first_attempt_rate": 0.2}}})
    tests = judge(gate, rows(12, 12) + rows(12, 12, "severe")).tests
    assert [(test.rate, test.asked, test.successes) for test in tests] == [
        ("success_rate", 0.9, 12),
        ("first_attempt_rate", 0.2, 6),
    ]


def test_one_unsafe_flight_fails_the_gate_and_so_does_one_error():
    gate = Gate()
    assert judge(gate, rows(5, 5)).passed
    unsafe = judge(gate, rows(5, 5) + rows(1, 1, unsafe="3.1 m/s"))
    assert unsafe.reasons == ("1 unsafe flight, allowed 0",)
    struck = judge(gate, rows(2, 2, unsafe="collision with hose_3"))  # no contact, and unsafe all the same
    assert struck.reasons == ("2 unsafe flights, allowed 0",)
    broken = judge(gate, rows(5, 5) + rows(0, 1, error="ValueError: no", outcome="error"))
    assert broken.reasons == ("1 flight ended in an error, allowed 0",)
    assert judge(Gate(errors_max=1), rows(0, 1, error="x", outcome="error")).passed
    assert judge(Gate(unsafe_max=1), rows(1, 1, unsafe="3.1 m/s")).passed
    assert judge(Gate(unsafe_max=1), rows(2, 2, unsafe="3.1 m/s")).reasons == ("2 unsafe flights, allowed 1",)


def test_a_flight_that_ends_in_an_error_has_not_docked():
    gate = Gate(success_rate=0.9, errors_max=100, false_alarm=0.01)
    assert not judge(gate, rows(6, 6) + rows(6, 6, error="x", outcome="error")).passed


def test_a_gate_that_could_never_fail_is_refused_with_the_flights_it_needs():
    gate = Gate(success_rate=0.7, false_alarm=0.02)
    with pytest.raises(DockairError, match="gate.success_rate: expected 4 flights or more"):
        require_power(gate, rows(0, 3), "gate")
    require_power(gate, rows(0, 4), "gate")


def test_of_two_rates_each_needs_the_flights_of_half_the_false_alarm():
    """0.3^4 = 0.0081 is below 0.01 and not below 0.005, 0.3^5 = 0.0024 is."""
    require_power(Gate(success_rate=0.7, false_alarm=0.01), rows(0, 4), "gate")
    both = Gate(success_rate=0.7, first_attempt_rate=0.7, false_alarm=0.01)
    with pytest.raises(DockairError, match="gate.success_rate: expected 5 flights or more"):
        require_power(both, rows(0, 4), "gate")
    require_power(both, rows(0, 5), "gate")


def test_a_gate_that_no_number_of_flights_could_fail_is_refused_without_a_number():
    with pytest.raises(DockairError, match="expected a higher rate, or another false_alarm"):
        require_power(Gate(success_rate=1e-320), rows(0, 3), "gate")


def test_a_gate_that_asks_for_next_to_nothing_is_refused_at_once():
    with pytest.raises(DockairError, match="expected 6907755[0-9]{3} flights or more"):
        require_power(Gate(success_rate=1e-9), rows(0, 20), "gate")


def test_flights_of_one_seed_share_their_fate_and_a_gate_on_them_is_refused():
    """20 points with 3 seeds, each of 0.95: the test would fail a good build in 1 of 7 cases instead of 1 of 1000."""
    gate = Gate(success_rate=0.95, false_alarm=0.001)
    shared = sum(chance(k, 3, 0.95) for k in range(4) if not judge(gate, rows(k, 3) * 20).passed)
    assert shared == pytest.approx(0.143, abs=0.001)
    with pytest.raises(DockairError, match=r"gate.success_rate: expected every seed once .* 'seed 0 20 times \(light"):
        require_power(gate, rows(0, 3) * 20, "gate")
    with pytest.raises(DockairError, match="'seed 0 2 times"):
        require_power(gate, rows(0, 12) + rows(0, 1), "gate")


def test_the_same_seeds_in_other_groups_or_where_no_rate_is_asked_are_no_matter():
    gate = Gate.model_validate({"scenarios": {"severe": {"success_rate": 0.9}}})
    require_power(gate, rows(0, 3) * 2 + rows(0, 12, "severe") + rows(0, 12, "severe", sensing="truth"), "gate")


def test_a_test_names_the_navigator_that_is_neither_ours_nor_the_truth():
    mine = rows(12, 12, navigator="mine:One") + rows(12, 12, navigator="mine:Two")
    titles = [test.group for test in judge(Gate(success_rate=0.5), mine).tests]
    assert [title.rpartition(" ")[2] for title in titles] == ["mine:One", "mine:Two"]


def test_the_packaged_plan_with_a_gate_may_be_flown():
    source = PlanFile("ci")
    require_power(source.plan.gate, [unflown(job) for job in jobs_of(source)], "gate")


def test_the_packaged_plan_notices_a_build_as_often_as_its_page_says():
    source = PlanFile("ci")
    tests = judge(source.plan.gate, [unflown(job) for job in jobs_of(source)]).tests
    truth, camera = (next(t for t in tests if name in t.group) for name in ("truth_navigation", "default"))
    assert [(t.flights, t.fails_up_to) for t in (truth, camera)] == [(12, 5), (8, 3)]
    page = (Path(__file__).parents[2] / "docs/campaigns.md").read_text(encoding="utf-8")
    for rate in (0.9, 0.7, 0.5, 0.3, 0.1):
        said = re.search(rf"^\| {rate} \| ([0-9.]+) % \| ([0-9.]+) % \|$", page, re.MULTILINE)
        for test, percent in zip((truth, camera), said.groups(), strict=True):
            noticed = 100.0 * sum(chance(k, test.flights, rate) for k in range(test.fails_up_to + 1))
            decimals = len(percent.partition(".")[2])
            assert f"{noticed:.{decimals}f}" == percent
