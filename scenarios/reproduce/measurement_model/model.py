"""The measurement model fitted to the camera chain, and held against it on flights that it was not fitted to.

The fit's flights: two approaches in the default's gusts and one in light gusts; a stand-off at 7, 11 and 15 m from the
lens with LEDs dimmed to 2 % in steps; one at 28 m; one with LEDs out, down to three; and all of that with other seeds,
five times in all. The sheet `measurement_model` is what this printed, rounded to three digits; the standard errors come
of the scatter between the five. Then the model runs beside the camera on two approaches and a stand-off with other
seeds: error, stated sigma, share of LEDs named, exposure and latency by range.

The camera's stray light, glints and clouds are not in the material: the Sun stands behind.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.scenarios.assembly.measured import SHEET
from dockair.scenarios.measured_leds import MeasurementParameters
from dockair.scenarios.reproduce.measurement_model.fit import Fitted, fit
from dockair.scenarios.reproduce.measurement_model.frames import Mask, Seen, joined, seen_in_flight
from dockair.scenarios.reproduce.reference import picture_name
from dockair.sim.camera.electronics import output_black, output_gain
from dockair.sim.camera.sheets import SensorParameters

ID = "measurement-model/fit"
TITLE = "LEDs measured without a picture: the error model fitted to the camera chain, and held against it"
_SOURCE = "this test bed's own camera and image stages"
_DIMMED = {1: (0.6, 0.3, 0.15, 0.08, 0.04), 4: (0.4, 0.2, 0.1, 0.05, 0.03), 6: (0.25, 0.12, 0.06, 0.035, 0.02)}
_OUT = ((1.0, (0, 2, 5)), (2.0, (0, 2, 5, 7)), (3.0, (0, 2, 3, 5, 7)), (5.0, (1, 3, 4, 6)))  # start [s], LEDs
_STEP_S = 1.0
_RANGES_M = (2.0, 2.7, 3.5, 4.5, 5.5, 6.5, 8.0, 16.0, 30.0)
_FEWEST = 200  # rows of a range that is compared
_SIZE_IN, _DPI = (11.0, 8.0), 110
_STANDING_S = 6.0
_Flight = tuple[str, dict[str, Any], int, float]


def _dimmed() -> list[dict[str, Any]]:
    return [
        {"kind": "led_dim", "leds": [led], "factor": factor, "start_s": _STEP_S * k, "stop_s": _STEP_S * (k + 1)}
        for led, factors in _DIMMED.items()
        for k, factor in enumerate(factors, start=1)
    ]


def _out() -> list[dict[str, Any]]:
    return [
        {"kind": "led_off", "leds": list(leds), "start_s": start, "stop_s": start + _STEP_S} for start, leds in _OUT
    ]


def standing(aft_m: float, faults: list[dict[str, Any]]) -> dict[str, Any]:
    """Settings of a flight that begins so far aft and comes to its stand-off, from where no approach is begun."""
    return {"start.aft_m": aft_m, "faults": faults, "guidance.stabilise_s": 60.0}


_ONCE: tuple[_Flight, ...] = (
    ("default", {}, 0, np.inf),
    ("default", {}, 1, np.inf),
    ("light_gusts", {}, 2, np.inf),
    ("default", standing(4.0, _dimmed()), 3, _STANDING_S),
    ("default", standing(12.0, _dimmed()), 4, _STANDING_S),
    ("default", standing(25.0, []), 5, _STANDING_S),
    ("default", standing(4.0, _out()), 6, _STANDING_S),
    ("light_gusts", standing(8.0, []), 7, _STANDING_S),
)
_REPEATS, _SEEDS_APART = 5, 100
FITTED: tuple[_Flight, ...] = tuple(
    (name, settings, seed + _SEEDS_APART * k, until_s)
    for k in range(_REPEATS)
    for name, settings, seed, until_s in _ONCE
)
HELD_OUT: tuple[_Flight, ...] = (
    ("default", {}, 8, np.inf),
    ("light_gusts", {}, 9, np.inf),
    ("default", standing(10.0, []), 10, _STANDING_S),
)


def reproduce(out: Path | None) -> dict[str, Any]:
    """Fit the sheet anew, compare the model with the camera; its picture in `out`."""
    sheet, sensor = load_parameters(SHEET, MeasurementParameters), load_parameters("sensor", SensorParameters)
    levels = output_gain(sensor), output_black(sensor)
    seen = joined([seen_in_flight(*flight) for flight in FITTED])
    once = seen.flight // _SEEDS_APART
    fitted, apart = fit(seen, sheet, *levels), [fit(seen.select(once == k), sheet, *levels) for k in np.unique(once)]
    held_out = joined([seen_in_flight(*flight) for flight in HELD_OUT])
    stands = asdict(sheet)
    rows = [{"case": "sheet", "ours": fitted, "reference": {name: float(stands[name]) for name in fitted}}]
    rows.append({"case": "standard error", "ours": _standard_errors(apart), "reference": {}})
    rows += compared(held_out)
    if out is not None:
        _draw(out / picture_name(ID), seen, held_out)
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _standard_errors(apart: list[Fitted]) -> Fitted:
    """Return those of the numbers fitted to all parts, from the scatter of what is fitted to each of n: s/sqrt(n)."""
    return {name: float(np.std([fitted[name] for fitted in apart], ddof=1) / np.sqrt(len(apart))) for name in apart[0]}


def compared(seen: Seen) -> list[dict[str, Any]]:
    """Return a row a range: the model's figures as ours, the camera's as reference."""
    rows = []
    for low, high in zip(_RANGES_M, _RANGES_M[1:], strict=False):
        one = seen.select((seen.depth_m >= low) & (seen.depth_m < high))
        if len(one) < _FEWEST:
            continue
        rows.append(beside(f"{low:g} to {high:g} m, {len(one)} LEDs", one))
    return rows


def beside(case: str, seen: Seen) -> dict[str, Any]:
    """Return one row: the model's figures as ours, the camera's as reference."""
    model = _figures(seen.model_error_px, seen.model_sigma_px, seen.model_exposure_s, seen.model_latency_s)
    camera = _figures(*_of_camera(seen), seen.exposure_s, seen.latency_s)
    return {"case": case, "ours": model, "reference": camera}


def _of_camera(seen: Seen) -> tuple[Array, Array]:
    """Errors and stated sigma of the LEDs that were named; NaN for the others."""
    error, sigma = seen.error_px.copy(), seen.sigma_px.copy()
    error[~seen.named], sigma[~seen.named] = np.nan, np.nan
    return error, sigma


def _figures(error_px: Array, sigma_px: Array, exposure_s: Array, latency_s: Array) -> dict[str, float]:
    return {
        "error_rms_px": float(np.sqrt(np.nanmean(error_px**2))),
        "stated_sigma_rms_px": float(np.sqrt(np.nanmean(sigma_px**2))),
        "stated_sigma_median_px": float(np.nanmedian(sigma_px)),
        "named_share": float(np.isfinite(sigma_px).mean()),
        "exposure_us": float(1e6 * np.median(exposure_s)),
        "latency_ms": float(1e3 * np.mean(latency_s)),
    }


def _draw(path: Path, fitted: Seen, held_out: Seen) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    _draw_sigma(axes[0, 0], fitted)
    _draw_residuals(axes[0, 1], held_out)
    _draw_seen(axes[1, 0], fitted)
    _draw_exposure(axes[1, 1], joined([fitted, held_out]))
    figure.savefig(path)


def _binned(x: Array, error: Array, use: Mask, edges: Array) -> tuple[Array, Array]:
    """Middles of bins with at least 15 rows, and the RMS of both axes' errors in them."""
    middle, rms = [], []
    for low, high in zip(edges, edges[1:], strict=False):
        of = use & (x >= low) & (x < high) & np.isfinite(error[:, 0])
        if of.sum() >= 15:
            middle.append(np.sqrt(low * high))
            rms.append(float(np.sqrt(np.mean(error[of] ** 2))))
    return np.array(middle), np.array(rms)


def _draw_sigma(axes: Any, seen: Seen) -> None:
    edges = np.geomspace(400.0, 150e3, 24)
    for low_us, high_us, colour in ((0.0, 50.0, "#1f77b4"), (50.0, 250.0, "#ff7f0e"), (250.0, 1e4, "#8e44ad")):
        use = (1e6 * seen.exposure_s >= low_us) & (1e6 * seen.exposure_s < high_us)
        label = f"{low_us:.0f} to {high_us:.0f} us" if high_us < 1e4 else f"over {low_us:.0f} us"
        axes.plot(*_binned(seen.electrons, seen.error_px, use, edges), "o", color=colour, markersize=4, label=label)
        axes.plot(*_binned(seen.electrons, seen.model_error_px, use, edges), "-", color=colour, linewidth=1.2)
    axes.set(xscale="log", yscale="log", xlabel="electrons of the spot", ylabel="RMS error of an axis [px]")
    axes.set_title("Error: camera (dots), model (lines), by exposure")
    axes.legend(fontsize=8)


def _draw_residuals(axes: Any, seen: Seen) -> None:
    z = np.linspace(-5.0, 5.0, 81)
    error, sigma = _of_camera(seen)
    for label, e, s, colour in (
        ("camera", error, sigma, "#1f77b4"),
        ("model", seen.model_error_px, seen.model_sigma_px, "#c0392b"),
    ):
        values = (e / s[:, None]).ravel()
        axes.hist(values[np.isfinite(values)], bins=z, density=True, histtype="step", color=colour, label=label)
    axes.plot(z, np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi), color="#9a9a9a", linewidth=0.8, label="normal")
    axes.set(yscale="log", ylim=(1e-4, 1.0), xlabel="error over stated sigma", ylabel="density")
    axes.set_title("Residuals of flights that were not fitted")
    axes.legend(fontsize=8)


def _draw_seen(axes: Any, seen: Seen) -> None:
    edges = np.array([0.0, 4.0, 7.0, 10.0, 14.0, 19.0, 25.0, 32.0, 40.0, 55.0, 75.0, 100.0, 140.0])
    for low_us, high_us, colour in ((0.0, 50.0, "#1f77b4"), (50.0, 250.0, "#ff7f0e"), (250.0, 1e4, "#8e44ad")):
        use = (1e6 * seen.exposure_s >= low_us) & (1e6 * seen.exposure_s < high_us)
        for style, found in (("o", seen.found), ("-", np.isfinite(seen.model_sigma_px))):
            x, share = [], []
            for low, high in zip(edges, edges[1:], strict=False):
                of = use & (seen.spot_peak_dn >= low) & (seen.spot_peak_dn < high)
                if of.sum() >= 15:
                    x.append(0.5 * (low + high))
                    share.append(float(found[of].mean()))
            axes.plot(x, share, style, color=colour, markersize=4)
    axes.set(
        xlabel="peak of the spot [DN]", ylabel="share of LEDs", title="Seen by the camera (dots), named by the model"
    )


def _draw_exposure(axes: Any, seen: Seen) -> None:
    order = np.argsort(seen.depth_m)
    for label, values, colour in (("camera", seen.exposure_s, "#1f77b4"), ("model", seen.model_exposure_s, "#c0392b")):
        axes.plot(seen.depth_m[order], 1e6 * values[order], ".", color=colour, markersize=1.5, label=label, alpha=0.4)
    axes.set(xscale="log", yscale="log", xlabel="depth of the LED [m]", ylabel="exposure [us]", title="Exposure")
    axes.set_xticks([3.0, 5.0, 10.0, 20.0, 30.0], ["3", "5", "10", "20", "30"])
    axes.set_yticks([15.0, 30.0, 60.0, 120.0, 250.0, 500.0], ["15", "30", "60", "120", "250", "500"])
    axes.minorticks_off()
    axes.legend(fontsize=8, markerscale=6.0)
