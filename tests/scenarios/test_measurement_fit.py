"""The measurement model's fit gives back the sheet that the material was drawn from."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dockair.scenarios.reproduce.measurement_model.fit import fit, rounded
from dockair.scenarios.reproduce.measurement_model.frames import Seen
from dockair.scenarios.reproduce.measurement_model.model import compared
from dockair.sim.camera.electronics import output_black, output_gain
from dockair.sim.faults import LedDim, LedOff

_PLACE = Path(__file__).with_name("test_measured_leds.py")
_SPEC = importlib.util.spec_from_file_location("measured_leds_stand", _PLACE)
stand_module = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(stand_module)
Stand, SHEETS = stand_module.Stand, stand_module.SHEETS
DRAWN = replace(
    stand_module.PARAMETERS, unnamed_share=0.03, no_ring_share=0.05, stray_share=0.01, stray_px=0.7,
    texture_lasting_share=0.4, error_over_sigma=0.8, clipped_error_over_sigma=0.6, photon_factor=1.3,
)  # fmt: skip
ALL_NAMED = {"unnamed_share": 0.0, "no_ring_share": 0.0, "ring_least": 1}  # whatever is seen
_FACTORS = (0.6, 0.3, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02)
_FEW = ((0, 2, 5), (0, 2, 5, 7), (0, 2, 3, 5, 7))


def _drawn(flight: int, depth_m: float, frames: int, faults=(), depth_rate_m: float = 0.0) -> list[dict]:
    """Rows of the model's own observations, in the columns of the camera's."""
    stand = Stand(DRAWN, faults, seed=flight)
    found_by = Stand(replace(DRAWN, **ALL_NAMED), faults, seed=flight)  # of the same numbers
    rows = []
    for k in range(frames):
        stand.put(depth_m + k * depth_rate_m)
        drawn, found = (one.leds.expose(stand.data, 0.02 * k, k, None) for one in (stand, found_by))
        exposure_s = stand.leds.exposure_s
        view = stand.leds.view(stand.data, 0.02 * k, exposure_s)
        levels, width_px = stand.leds.spots(view)
        window = stand.leds._window
        error, sigma = np.full((8, 2), np.nan), np.full(8, np.nan)
        error[found.led_numbers] = found.centroids_px - view.pixels_px[found.led_numbers]
        sigma[found.led_numbers] = found.sigma_px
        for led in range(8):
            full = int((levels[led] == 255).sum())
            off = view.pixels_px[led] - np.round(view.pixels_px[led])
            rows.append({
                "flight": flight, "frame": k, "ring": len(drawn.led_numbers) > 0, "named": led in drawn.led_numbers,
                "led": led, "depth_m": view.depth_m[led], "electrons": view.electrons[led], "off_px2": float(off @ off),
                "width_px": width_px[led], "full_pixels": full, "spot_peak_dn": int(levels[led].max()),
                "exposure_s": exposure_s, "latency_s": 0.01, "rows": window.shape[0],
                "height_px": float(np.ptp(view.pixels_px[:, 1])), "error_px": error[led], "sigma_px": sigma[led],
                "clipped": full > 0, "peak_dn": int(levels[led].max()), "model_exposure_s": exposure_s,
                "model_latency_s": 0.01, "model_error_px": error[led], "model_sigma_px": sigma[led],
            })  # fmt: skip
    return rows


@pytest.fixture(scope="module")
def material() -> Seen:
    dims = [LedDim(leds=(led,), factor=f, start_s=k, stop_s=k + 1.0)
            for k, f in enumerate(_FACTORS) for led in (1, 4, 6)]  # fmt: skip
    outs = [LedOff(leds=leds, start_s=float(k), stop_s=k + 1.0) for k, leds in enumerate(_FEW)]
    rows = _drawn(0, 7.0, 400, dims) + _drawn(1, 15.0, 400, dims) + _drawn(2, 27.0, 250)
    rows += _drawn(3, 7.0, 200, outs) + _drawn(4, 7.0, 300, depth_rate_m=-0.015)
    return Seen(**{name: np.array([row[name] for row in rows]) for name in Seen.__dataclass_fields__})


@pytest.mark.slow
def test_the_fit_gives_back_the_numbers_that_the_material_was_drawn_from(material):
    """From 12400 rows; a formula or a pair of numbers mixed up is out by more than is allowed here."""
    found = fit(material, DRAWN, output_gain(SHEETS.sensor), output_black(SHEETS.sensor))
    within = {
        "spot_sigma_px": 0.02, "widening_share": 0.15, "sigma_floor_px": 0.05, "photon_factor": 0.02,
        "background_e": 0.05, "texture_e": 0.02, "texture_exponent": 0.02, "clipped_sigma_px": 0.01,
        "error_over_sigma": 0.05, "clipped_error_over_sigma": 0.12, "texture_lasting_share": 0.35,
        "window_heights": 0.02, "window_margin_px": 0.1, "no_ring_share": 0.3, "stray_share": 0.6, "stray_px": 0.4,
        "faintest_dn": 0.1, "faintest_dn_per_e": 0.1, "faintest_spread": 0.15, "unnamed_share": 0.2,
    }  # fmt: skip
    for name, relative in within.items():
        assert found[name] == pytest.approx(getattr(DRAWN, name), rel=relative), name


def test_a_model_is_compared_with_itself_without_a_difference(material):
    for row in compared(replace(material, named=material.found)):
        assert row["ours"] == pytest.approx(row["reference"])


def test_numbers_go_into_the_sheet_with_three_digits():
    assert rounded({"a": 0.0012345, "b": 4321.0}) == {"a": 0.00123, "b": 4320.0}
