"""What a scenario's light makes of the texture behind the ring: nothing where it is that of the fit."""

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.scenarios.assembly.measured import FITTED_IN, texture_light
from dockair.scenarios.measured_leds import TextureLight
from dockair.scenarios.reproduce.measurement_model.model import FITTED, HELD_OUT
from dockair.scenarios.schema import load_scenario
from dockair.sim.camera.radiometry import responses
from dockair.sim.camera.sheets import CameraSheets

Q = 1.5


def _light(settings=None, exponent: float = Q) -> TextureLight:
    return texture_light(load_scenario(FITTED_IN, settings or {}), exponent)


@pytest.mark.parametrize("name", sorted({flight[0] for flight in FITTED + HELD_OUT}))
def test_in_the_light_of_the_fit_the_texture_is_the_sheets_to_the_bit(name):
    assert texture_light(load_scenario(name), 1.52) == TextureLight(factor=1.0, extinction_1_m=0.0)


def test_at_night_there_is_no_texture():
    """What is left is starlight."""
    assert 0.0 < _light({"weather.night": True}).factor < 1e-6


def test_haze_takes_sunlight_and_contrast():
    """Koschmieder: 3.912 a visibility; without the beam, light from all sides is left, half of the fit's at most."""
    haze = _light({"weather.visibility_m": 150.0})
    assert haze.extinction_1_m == pytest.approx(3.912 / 150.0 - 3.912 / 100e3, rel=1e-4)
    assert 0.2 < haze.factor < 0.5


def test_the_texture_follows_the_filter_in_its_own_light_and_in_the_time_that_the_leds_then_take():
    """Q = 1: the share of sunlight that passes; else the range, too, is read from the LEDs' exposure."""
    narrow, wide = (
        responses(s.lens, s.filter, s.sensor, s.leds, s.light, Camera(), altitude_m=6000.0,
                  sun_elevation_rad=np.radians(35.0))
        for s in map(CameraSheets.load, ("band_pass", "long_pass"))
    )  # fmt: skip
    share = narrow.white_e_s / wide.white_e_s
    leds = narrow.led_e_m2_sr_w_s / wide.led_e_m2_sr_w_s
    assert share < 0.2 and 0.4 < leds < 0.7
    assert _light({"camera.filter": "band_pass"}, 1.0).factor == pytest.approx(share, rel=1e-9)
    assert _light({"camera.filter": "band_pass"}).factor == pytest.approx(share * leds ** (Q - 1.0), rel=1e-9)


def test_brighter_leds_which_need_less_exposure_leave_less_texture_and_no_other_place_for_it():
    """Half the exposure at the same range: T falls by half, not by 2^Q."""
    nominal_a = CameraSheets.load().leds.drive_current_a
    brighter = _light({"parameters.leds.drive_current_a": 1.25 * nominal_a})
    assert brighter.factor * (1.0 / 1.25) ** Q == pytest.approx(1.0 / 1.25, rel=1e-9)


@pytest.mark.parametrize("brightness", [(2.0,) * 8, (4.5, *(1.0,) * 6, 5.5)])
def test_leds_that_the_rings_sheet_makes_brighter_count_as_such_that_their_own_sheet_does(brightness, tmp_path):
    path = tmp_path / "ring.toml"
    path.write_text(f"diameter_m = 0.5\ncount = 8\nbrightness = {list(brightness)}\n", encoding="utf-8")
    twice = 2.0 * CameraSheets.load().leds.drive_current_a
    assert _light({"hardware.ring": str(path)}).factor == pytest.approx(
        _light({"parameters.leds.drive_current_a": twice}).factor, rel=1e-9
    )


def test_a_sun_ahead_leaves_the_lee_that_the_camera_sees_darker_than_a_sun_behind():
    behind, ahead = (_light({"sun.azimuth_deg": a, "sun.elevation_deg": 60.0}).factor for a in (180.0, 0.0))
    assert ahead < 0.7 * behind
