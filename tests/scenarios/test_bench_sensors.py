"""The sensors' benchmark takes several processes together; how fast they are is not tested."""

import os

import pytest

from dockair.scenarios.bench import sensors
from dockair.scenarios.schema import load_scenario


def _times(drawn_ms, traced_ms):
    """Of one process, all else at 4 ms."""
    names = [
        f"{name}: {stage}, {size}"
        for name in ("mujoco", "analytic")
        for stage in ("expose", "background")
        for size in ("full frame", "400 rows", "300 x 300")
    ]
    names += ["bare mujoco.Renderer, RGB, full size", "NumPy: normals alone, full frame", "electronics, full frame"]
    drawn, traced = "mujoco: background, full frame", "analytic: background, full frame"
    return dict.fromkeys(names, 4.0) | {drawn: drawn_ms, traced: traced_ms}


def test_times_and_ratios_are_medians_over_processes_with_the_range_of_the_ratios(monkeypatch):
    runs = [_times(8.0, 4.0), _times(9.0, 2.0), _times(6.0, 2.0)]
    monkeypatch.setattr(sensors, "require_rendering", lambda: None)
    monkeypatch.setattr(sensors, "_in_fresh_processes", lambda measure, scenario: runs)
    figures = sensors.bench_sensors(load_scenario("default"))
    what = "MuJoCo's background over the analytic one, full frame"
    assert figures["milliseconds"]["mujoco: background, full frame"] == 8.0
    assert figures["milliseconds"]["analytic: background, full frame"] == 2.0
    assert figures["ratios"][what] == 3.0  # not that of the medians, 4
    assert (figures["ratios"][f"{what}, lowest"], figures["ratios"][f"{what}, highest"]) == (2.0, 4.5)
    assert figures["ratios"]["analytic: full frame over 400 rows"] == pytest.approx(1.0)


def test_ratios_are_of_what_their_names_say():
    """Both cameras alike: 60 ms for a full frame, 20 for 400 rows, 5 for a window, 15 for a bare render."""
    full, rows, window = ({f"{name}: expose, {size}": ms for name in ("mujoco", "analytic")} for size, ms in (
        ("full frame", 60.0), ("400 rows", 20.0), ("300 x 300", 5.0)
    ))  # fmt: skip
    others = {"bare mujoco.Renderer, RGB, full size": 15.0, "electronics, full frame": 6.0}
    others["NumPy: normals alone, full frame"] = 9.0
    ratios = sensors._ratios(_times(8.0, 2.0) | full | rows | window | others)
    for name in ("mujoco", "analytic"):
        assert ratios.pop(f"{name}: full frame with everything on, over a bare render") == 4.0
        assert ratios.pop(f"{name}: full frame over 400 rows") == 3.0
        assert ratios.pop(f"{name}: full frame over 300 x 300") == 12.0
    assert ratios == {
        "MuJoCo's background over the analytic one, full frame": 4.0,
        "NumPy's normals over all electronics": 1.5,
    }


def test_a_time_is_the_least_of_all_turns_after_some_calls_that_do_not_count(monkeypatch):
    """The first calls are the quickest here; of those that count the least is 4 ms, in the second turn."""
    calls, now_s = iter([0.001, 0.001, 0.001, 0.009, 0.008, 0.004, 0.006]), [0.0]

    def call():
        now_s[0] += next(calls)

    monkeypatch.setattr(sensors, "_EACH", 2)
    monkeypatch.setattr(sensors.time, "process_time", lambda: now_s[0])
    assert sensors._least({"what": call}, turns=2) == {"what": pytest.approx(4.0)}


def test_every_measurement_has_a_process_of_its_own(monkeypatch):
    monkeypatch.setattr(sensors, "_PROCESSES", 3)
    numbers = sensors._in_fresh_processes(os.getpid)
    assert len({*numbers, os.getpid()}) == 4


@pytest.mark.slow
@pytest.mark.gl
def test_one_process_measures_all_that_the_ratios_are_made_of(monkeypatch):
    for name in ("_TURNS", "_EACH", "_WARM_UP"):
        monkeypatch.setattr(sensors, name, 1)
    milliseconds = sensors._measure(load_scenario("still_air"))
    assert all(ms > 0.0 for ms in milliseconds.values())
    assert all(ratio > 0.0 for ratio in sensors._ratios(milliseconds).values())
    assert {"IMU sample", "NumPy: Poisson alone, full frame"} < set(milliseconds)
