"""The measurement model beside the camera in light that it was not fitted in.

The first three seconds of flights that begin 7, 10 and 20 m from the lens, in the light of the fit, at night, in haze,
through the band-pass filter, and with the Sun ahead of the ring, out of the camera's field: error, stated sigma, share
of LEDs named, exposure and latency.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dockair.scenarios.assembly.measured import FITTED_IN
from dockair.scenarios.reproduce.measurement_model.frames import seen_in_flight
from dockair.scenarios.reproduce.measurement_model.model import beside, standing
from dockair.scenarios.reproduce.reference import picture_name

ID = "measurement-model/light"
TITLE = "LEDs measured without a picture: by day and night, in haze, through the other filter, beside the camera"
STANDING_S = 3.0
RANGES_M = (7, 10, 20)  #: from the lens, at the start
LIGHTS: Mapping[str, Mapping[str, Any]] = {
    "day": {},
    "night": {"weather.night": True},
    "haze, 150 m": {"weather.visibility_m": 150.0},
    "band-pass": {"camera.filter": "band_pass"},
    "Sun ahead": {"sun.azimuth_deg": 0.0, "sun.elevation_deg": 60.0},
}
_SOURCE = "this test bed's own camera and image stages"
_BEFORE_TIP_M = 3.0  # from the lens to the probe's tip, about
_FIRST_SEED = 20
_SIZE_IN, _DPI = (7.0, 4.5), 110


def reproduce(
    out: Path | None,
    ranges_m: Sequence[int] = RANGES_M,
    lights: Sequence[str] = tuple(LIGHTS),
    standing_s: float = STANDING_S,
) -> dict[str, Any]:
    """Fly from each range in each light, and compare; the picture in `out`."""
    rows = []
    for seed, range_m in enumerate(ranges_m, start=_FIRST_SEED):  # the same gusts and hardware in every light
        for light in lights:
            settings = standing(range_m - _BEFORE_TIP_M, []) | dict(LIGHTS[light])
            rows.append(beside(f"{range_m} m, {light}", seen_in_flight(FITTED_IN, settings, seed, standing_s)))
    if out is not None:
        _draw(rows, out / picture_name(ID))
    return {"id": ID, "source": _SOURCE, "rows": rows}


def _draw(rows: list[dict[str, Any]], path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE_IN, dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    places = range(len(rows))
    for key, label, colour in (("reference", "camera", "#1f77b4"), ("ours", "model", "#c0392b")):
        axes.plot([row[key]["error_rms_px"] for row in rows], places, "o", color=colour, label=f"{label}: error")
        axes.plot(
            [row[key]["stated_sigma_rms_px"] for row in rows], places, "|", color=colour, label=f"{label}: stated"
        )
    axes.set_yticks(places, [row["case"] for row in rows])
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="RMS of an axis [px]", title="Error and stated sigma by range and light")
    axes.legend(fontsize=8)
    figure.savefig(path)
