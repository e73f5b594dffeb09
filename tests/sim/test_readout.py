"""Read-out times against the data sheet's formulas, and the transfer's law."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.messages import Window
from dockair.parameters import load_parameters
from dockair.sim.camera.readout import (
    latency_s,
    readout_time_s,
    row_time_s,
    shortest_period_s,
    transfer_jitter_s,
)
from dockair.sim.camera.sheets import SensorParameters

SENSOR = load_parameters("sensor", SensorParameters)
EXPOSURE_S = 20e-6


def test_a_full_frame_is_read_in_2_96_ms_and_a_window_in_proportion_to_its_rows() -> None:
    """129/48 MHz x (1088 + 12) = 2.956 ms: 338 frames per second."""
    assert readout_time_s(1088, SENSOR) == pytest.approx(129.0 / 48e6 * 1100.0, rel=1e-12)
    assert 1.0 / readout_time_s(1088, SENSOR) == pytest.approx(338.0, abs=0.5)
    per_row = (readout_time_s(600, SENSOR) - readout_time_s(100, SENSOR)) / 500.0
    assert per_row == pytest.approx(129.0 / 48e6, rel=1e-9)
    assert row_time_s(SENSOR) == pytest.approx(per_row, rel=1e-9)


def test_a_quarter_of_the_outputs_takes_four_times_as_long_for_a_row_but_not_for_the_fixed_overhead() -> None:
    """12 bits, 129/40 MHz x (4 x 1088 + 10 + 2 x 4) = 14.09 ms: 71 frames per second."""
    twelve = replace(SENSOR, converter_bits=12, outputs=4, clock_hz=40e6)
    assert readout_time_s(1088, twelve) == pytest.approx(129.0 / 40e6 * 4370.0, rel=1e-12)
    assert 1.0 / readout_time_s(1088, twelve) == pytest.approx(71.0, abs=0.1)
    assert row_time_s(twelve) == pytest.approx(4.0 * 48.0 / 40.0 * row_time_s(SENSOR), rel=1e-12)


def test_latency_counts_rows_and_not_columns() -> None:
    narrow, wide, tall = Window(0, 300, 0, 10), Window(0, 300, 0, 2048), Window(0, 600, 0, 10)
    assert latency_s(narrow, SENSOR, EXPOSURE_S) == latency_s(wide, SENSOR, EXPOSURE_S)
    assert latency_s(narrow, SENSOR, EXPOSURE_S) < latency_s(tall, SENSOR, EXPOSURE_S)
    assert latency_s(Window(0, 1088, 0, 2048), SENSOR, EXPOSURE_S) == pytest.approx(10e-3, abs=1e-4)


def test_latency_counts_from_the_middle_of_the_exposure() -> None:
    window = Window(0, 300, 0, 10)
    after_exposure = readout_time_s(300, SENSOR) + SENSOR.transfer_s
    assert latency_s(window, SENSOR, EXPOSURE_S) - after_exposure == pytest.approx(10e-6, rel=1e-9)
    assert latency_s(window, SENSOR, 420e-6) - after_exposure == pytest.approx(210e-6, rel=1e-9)


@pytest.mark.parametrize("sigma_s", [0.001, 0.007, 0.02])
def test_the_transfer_has_the_sheets_mean_and_deviation_and_is_never_negative(sigma_s: float) -> None:
    """4.5 standard errors: of the variance of a gamma law of shape k, sqrt((2 + 6/k)/n)."""
    sensor, n = replace(SENSOR, transfer_jitter_s=sigma_s), 40000
    rng = np.random.default_rng(3)
    draws = np.array([transfer_jitter_s(sensor, rng) for _ in range(n)])
    assert draws.min() >= -sensor.transfer_s
    assert draws.mean() == pytest.approx(0.0, abs=4.5 * sigma_s / np.sqrt(n))
    error = np.sqrt((2.0 + 6.0 * (sigma_s / sensor.transfer_s) ** 2) / n)
    assert draws.var() == pytest.approx(sigma_s**2, rel=4.5 * error)


def test_a_transfer_without_jitter_or_without_length_has_none() -> None:
    rng = np.random.default_rng(0)
    assert transfer_jitter_s(replace(SENSOR, transfer_jitter_s=0.0), rng) == 0.0
    assert transfer_jitter_s(replace(SENSOR, transfer_s=0.0), rng) == 0.0


def test_a_short_exposure_hides_behind_the_read_out_of_the_frame_before_and_a_long_one_sets_the_period() -> None:
    overhead = 129.0 / 48e6 * 12.0
    assert shortest_period_s(1088, SENSOR, EXPOSURE_S) == pytest.approx(readout_time_s(1088, SENSOR), rel=1e-12)
    assert shortest_period_s(1088, SENSOR, 10e-3) == pytest.approx(10e-3 + overhead, rel=1e-12)
    assert shortest_period_s(50, SENSOR, 500e-6) == pytest.approx(500e-6 + overhead, rel=1e-12)
    assert shortest_period_s(1088, SENSOR, 500e-6) < 1.0 / 180.0
