"""The tables `[[faults]]`: which keys a kind takes, in which unit, and what is refused in which words."""

from typing import get_args

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.scenarios.schema import load_scenario
from dockair.scenarios.tables.fault import FaultKind, FaultTable
from dockair.sim import faults

#: One right table a kind, and what it becomes.
RIGHT = [
    ("kind = 'led_off', leds = [0, 7]", faults.LedOff(leds=(0, 7))),
    ("kind = 'led_dim', factor = 0.25, start_s = 3.0", faults.LedDim(factor=0.25, start_s=3.0)),
    (
        "kind = 'led_flicker', leds = [2], frequency_hz = 50.0, duty = 0.5, stop_s = 9.0",
        faults.LedFlicker(leds=(2,), frequency_hz=50.0, duty=0.5, stop_s=9.0),
    ),
    (
        "kind = 'led_flicker', frequency_hz = 50.0, duty = 0.5, depth = 0.3",
        faults.LedFlicker(frequency_hz=50.0, duty=0.5, depth=0.3),
    ),
    ("kind = 'camera_drop_out', start_s = 1.0, stop_s = 2.0", faults.CameraDropOut(start_s=1.0, stop_s=2.0)),
    ("kind = 'stuck_frame'", faults.StuckFrame()),
    ("kind = 'hot_pixels', count = 300", faults.HotPixels(count=300)),
    ("kind = 'dirty_window', cover = 0.4", faults.DirtyWindow(cover=0.4)),
    ("kind = 'exposure_stuck', exposure_us = 250.0", faults.ExposureStuck(exposure_s=250e-6)),
    (
        "kind = 'gyro_bias_step', rate_deg_s = [0.0, 1.0, -2.0]",
        faults.GyroBiasStep(rate_rad_s=(0.0, np.pi / 180.0, -np.pi / 90.0)),
    ),
    ("kind = 'gyro_saturation', limit_deg_s = 5.0", faults.GyroSaturation(limit_rad_s=np.pi / 36.0)),
    ("kind = 'gyro_drop_out'", faults.GyroDropOut()),
    ("kind = 'dead_reel', start_s = 4.0", faults.DeadReel(start_s=4.0)),
    ("kind = 'dead_reel', unnoticed = true", faults.DeadReel(unnoticed=True)),
]


def of(table):
    return load_scenario("default", {"faults": f"[{{{table}}}]"}).faults[0].fault


@pytest.mark.parametrize(("table", "expected"), RIGHT, ids=[table.split("'")[1] for table, _ in RIGHT])
def test_a_table_becomes_its_fault_in_si_units(table, expected):
    got = of(table)
    assert type(got) is type(expected)
    for name in got.__dataclass_fields__:
        mine, wanted = getattr(got, name), getattr(expected, name)
        assert mine == wanted or np.allclose(mine, wanted, rtol=1e-12), name


def test_there_is_a_right_table_of_every_kind_above():
    assert {table.split("'")[1] for table, _ in RIGHT} == set(get_args(FaultKind))


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("kind = 'led_of'", "faults[0].kind: expected one of the names that exist, got 'led_of'; exists: led_off, "),
        ("start_s = 1.0", "faults[0].kind: expected one of the names that exist"),
        ("kind = 'led_off', led = 3", "faults[0].led: expected a known key, got 'led'; exists: count, "),
        ("kind = 'led_off', leds = [8]", "faults[0].leds[0]: expected numbers of LEDs, from 0 to 7, got 8"),
        (
            "kind = 'led_off', cover = 0.1",
            "faults[0]: expected a key of the kind led_off, got 'cover'; exists: kind, leds, ",
        ),
        (
            "kind = 'led_off', leds = []",
            "faults[0].leds: expected numbers of LEDs, each once; for all of them no such key",
        ),
        ("kind = 'led_off', leds = [1, 1]", "faults[0].leds: expected numbers of LEDs, each once"),
        ("kind = 'led_dim'", "faults[0]: expected the key factor of the kind led_dim"),
        ("kind = 'led_dim', factor = 1.5", "faults[0].factor: expected a number from 0.0 to 1.0, got 1.5"),
        (
            "kind = 'led_off', start_s = 3.0, stop_s = 3.0",
            "faults[0].stop_s: expected a time after start_s = 3.0, got 3.0",
        ),
        ("kind = 'hot_pixels', count = 0", "faults[0].count: expected an integer from 1 to 100000, got 0"),
        ("kind = 'gyro_bias_step', rate_deg_s = [1.0]", "faults[0].rate_deg_s: expected three numbers"),
        ("kind = 'gyro_bias_step', rate_deg_s = [0.0, -1e300, 0.0]", "faults[0].rate_deg_s[1]: expected three numbers"),
        ("kind = 'exposure_stuck', exposure_us = 0.0", "faults[0].exposure_us: expected a number above 0.0"),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(table, words):
    with pytest.raises(DockairError) as caught:
        of(table)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value) and "dockair.scenarios" not in str(caught.value)


def test_of_several_tables_the_wrong_one_is_named():
    tables = "[{kind = 'stuck_frame'}, {kind = 'led_dim', factor = 0.5}, {kind = 'led_dim'}]"
    with pytest.raises(DockairError, match=r"--set faults\[2\]: expected the key factor of the kind led_dim"):
        load_scenario("default", {"faults": tables})


@pytest.mark.parametrize("text", ["3", "[3]", '{kind = "led_off"}'])
def test_what_is_no_array_of_tables_is_refused(text):
    with pytest.raises(DockairError, match=r"tables \[\[faults\]\], each with a kind"):
        load_scenario("default", {"faults": text})


def test_every_key_of_a_table_belongs_to_a_kind():
    """A key that no kind takes could be given and would do nothing."""
    common = {"kind", "start_s", "stop_s"}
    taken = {key.strip().split(" = ")[0] for table, _ in RIGHT for key in table.split(", ") if " = " in key}
    assert set(FaultTable.model_fields) == taken | common
