"""The band in which the camera looks: solar spectrum x filter x lens x quantum efficiency, with the LEDs' line in it.

[Yoon 2018, fig 1] is the solar spectrum and fig 27 the sensor's response; both are pictures without numbers, so that
the spectrum is compared with its standard and the band with the text's 800-1000 nm. Tables 4 to 6, camera, lens and
filter, are the default calibration data. Where a printed number is a limit, ours is what the sheets allow: the frame
rate is the highest at which the sensor can be read, f-number and focus are the ends of their ranges. Our band holds
98 % of the Sun's electrons.
"""

from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import Camera
from dockair.parameters import load_parameters, read_sheet
from dockair.rotations import Array
from dockair.scenarios.reproduce.reference import picture_name, read_reference
from dockair.sim.camera.radiometry import (
    detection,
    filter_transmittance,
    led_spectrum_1_m,
    led_wavelength_m,
    solar_spectrum,
)
from dockair.sim.camera.readout import shortest_period_s
from dockair.sim.camera.sheets import (
    ExposureParameters,
    FilterParameters,
    LedParameters,
    LensParameters,
    SensorParameters,
)

ID = "sensor/band"
TITLE = "solar spectrum, filter, lens, quantum efficiency and the LEDs' line; tables 4 to 6"
_SOURCE = "[Yoon 2018, tables 4-6, figs 1 and 27]; ASTM G173-03"
_STEP_M = 0.1e-9
_SIZE_IN, _DPI = (9.0, 8.0), 110
_Row = dict[str, Any]


def reproduce(out: Path | None) -> dict[str, Any]:
    """Compare spectrum, band and default sheets with what is printed; its picture in `out`."""
    printed = {(row["table"], row["quantity"]): float(row["value"]) for row in read_reference("yoon_2018_tables")}
    tables = [
        ("4", "table 4, sensor", _sensor()),
        ("5", "table 5, lens", _lens()),
        ("6", "table 6, filter", _filter()),
        ("text", "LEDs' line, band", _line_and_band()),
    ]
    rows = [*_sunlight(), *(_row(case, ours, printed, table) for table, case, ours in tables)]
    if out is not None:
        _draw(out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _row(case: str, ours: dict[str, float], printed: dict[tuple[str, str], float], table: str) -> _Row:
    return {"case": case, "ours": ours, "reference": {key: printed[table, key] for key in ours}}


def _sunlight() -> list[_Row]:
    """Irradiance in bands from the camera's solar table, beside the integrals over the standard's."""
    table = solar_spectrum()
    columns = {
        "extraterrestrial": table.extraterrestrial_w_m3,
        "global_tilt": table.global_tilt_w_m3,
        "direct": table.direct_w_m3,
    }
    rows = []
    for band in read_reference("astm_g173_bands"):
        wavelength = np.arange(1e-9 * float(band["low_nm"]), 1e-9 * float(band["high_nm"]) + 0.5 * _STEP_M, _STEP_M)
        ours = {
            f"{name}_w_m2": float(np.trapezoid(np.interp(wavelength, table.wavelength_m, column), wavelength))
            for name, column in columns.items()
        }
        reference = {f"{name}_w_m2": float(band[name]) for name in columns}
        rows.append({"case": f"sunlight, {band['low_nm']}-{band['high_nm']} nm", "ours": ours, "reference": reference})
    return rows


def _sensor() -> dict[str, float]:
    camera, sensor = Camera(), load_parameters("sensor", SensorParameters)
    shortest_s = load_parameters("exposure", ExposureParameters).shortest_s
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "active_width_mm": 1e3 * camera.width_px * camera.pixel_pitch_m,
        "active_height_mm": 1e3 * camera.height_px * camera.pixel_pitch_m,
        "pixel_pitch_um": 1e6 * camera.pixel_pitch_m,
        "frame_rate_hz": 1.0 / shortest_period_s(camera.height_px, sensor, shortest_s),
    }


def _lens() -> dict[str, float]:
    lens = read_sheet("lens")
    return {
        "focal_length_mm": 1e3 * Camera().focal_length_m,
        "f_number_from": lens["f_number"].low,
        "f_number_to": lens["f_number"].high,
        "focus_from_mm": 1e3 * lens["focus_distance_m"].low,
    }


def _filter() -> dict[str, float]:
    """Read off the filter's curve, not off its sheet."""
    filter_ = load_parameters("filter_long_pass", FilterParameters)
    wavelength = np.arange(200e-9, 2000e-9, _STEP_M)
    passed = filter_transmittance(filter_, wavelength) / filter_.transmittance
    full = wavelength[passed > 1.0 - 1e-6]
    return {
        "cut_on_nm": 1e9 * float(wavelength[np.argmax(passed >= 0.5)]),
        "transmits_from_nm": 1e9 * float(full[0]),
        "transmits_to_nm": 1e9 * float(full[-1]),
        "rejects_to_nm": 1e9 * float(wavelength[np.argmax(passed > 1e-6) - 1]),
    }


def _line_and_band() -> dict[str, float]:
    wavelength, electrons, _ = _chain("filter_long_pass")
    share = np.cumsum(electrons) / np.sum(electrons)
    return {
        "led_wavelength_nm": 1e9 * led_wavelength_m(load_parameters("leds", LedParameters)),
        "band_from_nm": 1e9 * float(np.interp(0.01, share, wavelength)),
        "band_to_nm": 1e9 * float(np.interp(0.99, share, wavelength)),
    }


def _chain(filter_sheet: str) -> tuple[Array, Array, Array]:
    """Wavelengths [m], the Sun's electrons and the LED's electrons per metre of wavelength."""
    lens, sensor = load_parameters("lens", LensParameters), load_parameters("sensor", SensorParameters)
    wavelength = np.arange(700e-9, sensor.wavelength_m[-1], _STEP_M)
    passed = detection(lens, load_parameters(filter_sheet, FilterParameters), sensor, wavelength)
    sun = np.interp(wavelength, solar_spectrum().wavelength_m, solar_spectrum().extraterrestrial_w_m3)
    return wavelength, sun * passed, led_spectrum_1_m(load_parameters("leds", LedParameters), wavelength) * passed


def _draw(path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    sunlight, parts, electrons = figure.subplots(3, 1)
    _draw_sunlight(sunlight)
    _draw_parts(parts)
    _draw_electrons(electrons)
    line_nm = 1e9 * led_wavelength_m(load_parameters("leds", LedParameters))
    for axes, corner in ((sunlight, "upper right"), (parts, "center right"), (electrons, "upper right")):
        axes.axvspan(800.0, 1000.0, color="#f3e9d2", zorder=0)
        axes.axvline(line_nm, color="#c0392b", linewidth=1.0, linestyle="--", label=f"LED, {line_nm:.0f} nm")
        axes.set_ylim(bottom=0.0)
        axes.legend(loc=corner, fontsize=8)
        axes.set_xlabel("wavelength [nm]")
    figure.savefig(path)


def _draw_sunlight(axes: Any) -> None:
    table = solar_spectrum()
    nm = 1e9 * table.wavelength_m
    axes.plot(nm, 1e-9 * table.extraterrestrial_w_m3, color="#9a9a9a", linewidth=0.8, label="outside the air")
    axes.plot(nm, 1e-9 * table.global_tilt_w_m3, color="#1f77b4", linewidth=0.8, label="ground, global")
    axes.plot(nm, 1e-9 * table.direct_w_m3, color="#ff7f0e", linewidth=0.8, label="ground, direct")
    axes.set(title="Sunlight, ASTM G173-03; shaded: 800-1000 nm", ylabel="W m$^{-2}$ nm$^{-1}$", xlim=(300.0, 1700.0))


def _draw_parts(axes: Any) -> None:
    lens, sensor = load_parameters("lens", LensParameters), load_parameters("sensor", SensorParameters)
    wavelength = np.arange(700e-9, sensor.wavelength_m[-1], _STEP_M)
    nm = 1e9 * wavelength
    axes.plot(nm, np.full(nm.shape, lens.transmittance), color="#9a9a9a", label="lens")
    for sheet, colour in (("filter_long_pass", "#1f77b4"), ("filter_band_pass", "#34a853")):
        passed = filter_transmittance(load_parameters(sheet, FilterParameters), wavelength)
        axes.plot(nm, passed, color=colour, label=sheet.replace("_", " "))
    eta = np.interp(wavelength, sensor.wavelength_m, sensor.quantum_efficiency)
    axes.plot(nm, eta, color="#8e44ad", label="quantum efficiency")
    axes.set(title="Lens, filters, sensor", ylabel="transmittance, e$^-$/photon", xlim=(700.0, 1100.0))


def _draw_electrons(axes: Any) -> None:
    scale = None
    for sheet, colour in (("filter_long_pass", "#1f77b4"), ("filter_band_pass", "#34a853")):
        wavelength, sun, led = _chain(sheet)
        scale = scale or (float(sun.max()), float(led.max()))
        name = sheet.removeprefix("filter_").replace("_", " ")
        axes.fill_between(1e9 * wavelength, sun / scale[0], color=colour, alpha=0.3, label=f"Sun, {name}")
        axes.plot(1e9 * wavelength, led / scale[1], color=colour, label=f"LED, {name}")
    axes.set(
        title="What becomes electrons, each source over its highest through the long-pass",
        ylabel="relative",
        xlim=(700.0, 1100.0),
    )
