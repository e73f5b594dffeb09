"""What a camera's sheets refuse although every value is in its range: combinations that no camera can have."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.sim.camera.radiometry import detection, filter_transmittance
from dockair.sim.camera.sheets import CameraSheets

NODES = [750e-9, 800e-9, 850e-9, 900e-9, 950e-9, 1000e-9, 1050e-9, 1100e-9]


@pytest.mark.parametrize(
    ("sheet", "values", "words"),
    [
        ("sensor", {"wavelength_m": NODES[::-1]}, "wavelength_m: expected rising wavelengths"),
        ("sensor", {"wavelength_m": [*NODES[:6], NODES[7], NODES[6]]}, "wavelength_m: expected rising"),
        ("sensor", {"wavelength_m": [NODES[0], *NODES[:7]]}, "wavelength_m: expected rising"),
        ("sensor", {"converter_bits": 12, "outputs": 4}, "clock_hz: expected up to 4e"),
        ("filter_long_pass", {"cut_on_m": 900e-9, "cut_off_m": 700e-9}, "cut_on_m: expected less than"),
        ("filter_long_pass", {"cut_on_m": 900e-9, "cut_off_m": 900e-9}, "cut_on_m: expected less than"),
        ("exposure", {"exposure_s": 0.6e-3}, "exposure_s: expected 1.4e-05 to 0.0005 s"),
        (
            "filter_long_pass",
            {"cut_on_m": 850e-9, "cut_off_m": 864e-9},
            "cut_off_m: expected at least 8.8e-07 m",
        ),
        ("glare", {"dirt_smallest_rad": 0.06, "dirt_largest_rad": 0.03}, "dirt_smallest_rad: expected at most"),
        ("sky", {"zenith": 0.1, "airlight": 0.1}, "zenith: expected less than sky.airlight"),
        ("sky", {"aureole_decay_1_rad": 0.5}, "aureole_decay_1_rad: expected a decay that leaves light"),
        ("sky", {"aureole": 24.0, "aureole_decay_1_rad": 1.6}, "aureole_decay_1_rad: expected a decay"),
    ],
)
def test_values_that_exclude_each_other_are_refused(sheet: str, values: dict[str, Any], words: str) -> None:
    with pytest.raises(DockairError) as caught:
        CameraSheets.load(overrides={sheet: values})
    assert str(caught.value).startswith(f"parameters.{sheet}.{words}")


def test_a_filter_that_opens_where_the_sensors_efficiency_is_not_known_is_refused() -> None:
    said = r"^parameters\.sensor\.wavelength_m: expected the first at 7.49e-07 m or less"
    with pytest.raises(DockairError, match=said):
        CameraSheets.load(overrides={"filter_long_pass": {"cut_on_m": 764e-9}})


def test_a_quantum_efficiency_without_its_wavelength_is_refused() -> None:
    sensor = CameraSheets.load().sensor
    with pytest.raises(DockairError, match="sensor.wavelength_m: expected rising wavelengths, one for each"):
        replace(sensor, quantum_efficiency=sensor.quantum_efficiency[:-1])


def test_a_filter_may_open_at_the_sensors_first_wavelength() -> None:
    sheets = CameraSheets.load(overrides={"filter_long_pass": {"cut_on_m": 765e-9}})
    assert not detection(sheets.lens, sheets.filter, sheets.sensor, np.linspace(600e-9, 749e-9, 150)).any()


def test_smudges_may_all_be_of_one_size() -> None:
    one_size = CameraSheets.load(overrides={"glare": {"dirt_smallest_rad": 0.05, "dirt_largest_rad": 0.05}}).glare
    assert one_size.dirt_smallest_rad == one_size.dirt_largest_rad == 0.05


@pytest.mark.parametrize(("cut_on_ramp_m", "cut_off_ramp_m"), [(20e-9, 20e-9), (35e-9, 5e-9)])
def test_ramps_that_just_fit_into_the_band_leave_the_sheets_transmittance_at_its_peak(
    cut_on_ramp_m: float, cut_off_ramp_m: float
) -> None:
    ramps = {"cut_on_ramp_m": cut_on_ramp_m, "cut_off_ramp_m": cut_off_ramp_m}
    band = {"cut_on_m": 840e-9, "cut_off_m": 860.01e-9}
    filter_ = CameraSheets.load("band_pass", {"filter_band_pass": {**band, **ramps}}).filter
    peak = filter_transmittance(filter_, np.linspace(820e-9, 880e-9, 6001)).max()
    assert peak == pytest.approx(filter_.transmittance, rel=1e-3)
    with pytest.raises(DockairError, match="filter.cut_off_m: expected at least 8.6e-07 m"):
        replace(filter_, cut_off_m=859.9e-9)
