"""What a camera's sheets refuse although every value is in its range: combinations that no camera can have."""

from typing import Any

import pytest

from dockair.errors import DockairError
from dockair.sim.camera.sheets import CameraSheets

NODES = [750e-9, 800e-9, 850e-9, 900e-9, 950e-9, 1000e-9, 1050e-9, 1100e-9]


@pytest.mark.parametrize(
    ("sheet", "values", "words"),
    [
        ("sensor", {"wavelength_m": NODES[::-1]}, "sensor.wavelength_m: expected rising wavelengths"),
        ("sensor", {"wavelength_m": [*NODES[:6], NODES[7], NODES[6]]}, "sensor.wavelength_m: expected rising"),
        ("sensor", {"wavelength_m": [NODES[0], *NODES[:7]]}, "sensor.wavelength_m: expected rising"),
        ("sensor", {"converter_bits": 12, "outputs": 4}, "sensor.clock_hz: expected up to 4e"),
        ("filter_long_pass", {"cut_on_m": 900e-9, "cut_off_m": 700e-9}, "filter.cut_on_m: expected less than"),
        ("glare", {"dirt_smallest_rad": 0.06, "dirt_largest_rad": 0.03}, "glare.dirt_smallest_rad: expected at most"),
        ("sky", {"zenith": 0.1, "airlight": 0.1}, "sky.zenith: expected less than sky.airlight"),
        ("sky", {"aureole_decay_1_rad": 0.5}, "sky.aureole_decay_1_rad: expected a decay that leaves light"),
        ("sky", {"aureole": 24.0, "aureole_decay_1_rad": 1.6}, "sky.aureole_decay_1_rad: expected a decay"),
    ],
)
def test_values_that_exclude_each_other_are_refused(sheet: str, values: dict[str, Any], words: str) -> None:
    with pytest.raises(DockairError) as caught:
        CameraSheets.load(overrides={sheet: values})
    assert str(caught.value).startswith(words)
