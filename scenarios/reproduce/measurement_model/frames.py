"""LEDs as the camera chain measures them beside what the measurement model draws of the same: the material of its fit.

One row an LED and frame, of those that are on the sensor, in the window and not hidden. The image stages are run on
every frame that arrives, and the blob nearest to where the LED is imaged, within `_NEAR_PX`, is its measurement. The
navigation's own answer says which LEDs were named. The model runs beside the camera on the same world, with an
exposure control of its own.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.messages import CameraFrame, LedObservation
from dockair.nav.image.detect import detect
from dockair.rotations import Array
from dockair.scenarios.assembly.measured import measured_leds
from dockair.scenarios.loop import Flight
from dockair.scenarios.measured_leds import View
from dockair.scenarios.schema import load_scenario
from dockair.sim.faults import Faults

_NEAR_PX = 1.5  # an LED's blob is nearer; another's is not
_HZ = 1e6  # stamps are told apart by the microsecond
_WHITE = 255

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """(n,) rows; those of the model's own draw, with its own exposure, begin with `model`."""

    flight: NDArray[np.int64]
    frame: NDArray[np.int64]  #: of the flight
    ring: Mask  #: LEDs of the frame are named, all at once or one by one
    named: Mask
    led: NDArray[np.int64]
    depth_m: Array
    electrons: Array
    off_px2: Array  #: of the spot's centre from the nearest pixel's, squared
    width_px: Array  #: w of the model at the camera's exposure, as the next two
    full_pixels: NDArray[np.int64]
    spot_peak_dn: NDArray[np.int64]
    exposure_s: Array
    latency_s: Array
    rows: NDArray[np.int64]  #: of the window
    height_px: Array  #: of the ring's image
    error_px: Array  #: (n, 2), NaN where no blob is near
    sigma_px: Array  #: as the image stages state it, likewise
    clipped: Mask
    peak_dn: NDArray[np.int64]
    model_exposure_s: Array
    model_latency_s: Array
    model_error_px: Array  #: (n, 2), NaN where it names no such LED
    model_sigma_px: Array

    def __len__(self) -> int:
        return len(self.frame)

    def select(self, keep: Mask) -> "Seen":
        """Return some of the rows."""
        return Seen(**{f.name: getattr(self, f.name)[keep] for f in fields(self)})

    @property
    def found(self) -> Mask:
        """(n,) which have a measurement."""
        return np.isfinite(self.sigma_px)


def joined(parts: list[Seen]) -> Seen:
    """Return all rows."""
    return Seen(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Seen)})


def seen_in_flight(name: str, overrides: dict[str, Any], seed: int, until_s: float = np.inf) -> Seen:
    """Fly a scenario with the camera until the coupling takes the probe, and return what was measured.

    Args:
        name: of the scenario.
        overrides: dotted key -> value.
        seed: of the flight.
        until_s: at most.
    """
    flight = Flight(load_scenario(name, overrides), seed)
    watched = _Watched(flight, seed)
    flight.camera = watched  # type: ignore[assignment]
    rows: list[dict[str, Any]] = []
    try:
        number = 0
        while True:
            tick = flight.step()
            if isinstance(tick.frame, CameraFrame):
                named, ring = np.isfinite(tick.solution.led_pixels_px[:, 0]), tick.solution.status[:4] != "ring"
                for row in watched.rows(tick.frame):
                    rows.append(row | {"flight": seed, "frame": number, "ring": ring, "named": named[row["led"]]})
                number += 1
            if tick.outcome is not None or tick.truth.latched or tick.truth.time_s >= until_s:
                break
    finally:
        flight.close()
    return Seen(**{f.name: np.array([row[f.name] for row in rows]) for f in fields(Seen)})


@dataclass(slots=True, kw_only=True, eq=False)
class _Note:
    """One exposure: where the LEDs are, and what the model drew."""

    view: View
    drawn: LedObservation
    columns: dict[str, float]

    def of(self, led: int) -> dict[str, Any]:
        """The model's columns of an LED."""
        at, error, sigma = np.flatnonzero(self.drawn.led_numbers == led), np.full(2, np.nan), float("nan")
        if len(at):
            error = self.drawn.centroids_px[at[0]] - self.view.pixels_px[led]
            sigma = float(self.drawn.sigma_px[at[0]])
        return self.columns | {"model_error_px": error, "model_sigma_px": sigma}


class _Watched:
    """A camera beside which the model runs; of each exposure it remembers what both made of it."""

    def __init__(self, flight: Flight, seed: int) -> None:
        self._camera: Any = flight.camera
        faults = Faults([table.fault for table in flight.scenario.faults], flight.sheets.ring.count)
        self._model = measured_leds(flight.scenario, seed, flight.as_built, faults, flight.world)
        self._notes = dict[int, _Note]()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._camera, name)

    def expose(self, data: Any, time_s: float, frame_number: int, window: Any) -> CameraFrame | None:
        """Return the camera's frame, with a note kept."""
        frame: CameraFrame | None = self._camera.expose(data, time_s, frame_number, window)
        drawn = self._model.expose(data, time_s, frame_number, window)
        if frame is not None and drawn is not None:
            times = {"model_exposure_s": self._model.exposure_s, "model_latency_s": self._model.latency_s(drawn)}
            view = self._model.view(data, time_s, frame.exposure_s)
            self._notes[round(_HZ * time_s)] = _Note(view=view, drawn=drawn, columns=times)
        return frame

    def latency_s(self, frame: CameraFrame) -> float:
        """Return the camera's draw, with a note kept."""
        latency_s = float(self._camera.latency_s(frame))
        self._notes[round(_HZ * frame.time_stamp_s)].columns["latency_s"] = latency_s
        return latency_s

    def rows(self, frame: CameraFrame) -> list[dict[str, Any]]:
        """Return the rows of a frame, without what the navigation says."""
        note, w = self._notes.pop(round(_HZ * frame.time_stamp_s)), frame.window
        view = note.view
        levels, width_px = self._model.spots(view)
        blobs = detect(frame.pixels, window=w, gain_dn_per_electron=frame.gain)
        first, stop = np.array([w.column_start, w.row_start]), np.array([w.column_stop, w.row_stop])
        inside = ((view.pixels_px >= first) & (view.pixels_px <= stop - 1)).all(axis=1) & view.clear
        height_px, rows = float(np.ptp(view.pixels_px[view.clear, 1])) if view.clear.any() else 0.0, []
        for k in np.flatnonzero(inside):
            away = np.linalg.norm(blobs.centroids_px - view.pixels_px[k], axis=1)
            near = int(away.argmin()) if len(away) and away.min() < _NEAR_PX else -1
            rows.append(note.of(int(k)) | {
                "led": int(k), "depth_m": view.depth_m[k], "electrons": view.electrons[k], "width_px": width_px[k],
                "full_pixels": int((levels[k] == _WHITE).sum()), "spot_peak_dn": int(levels[k].max()),
                "off_px2": float(np.sum((view.pixels_px[k] - np.round(view.pixels_px[k])) ** 2)),
                "exposure_s": frame.exposure_s, "rows": w.shape[0], "height_px": height_px,
                "error_px": blobs.centroids_px[near] - view.pixels_px[k] if near >= 0 else np.full(2, np.nan),
                "sigma_px": blobs.sigma_px[near] if near >= 0 else np.nan,
                "clipped": bool(blobs.clipped[near]) if near >= 0 else False,
                "peak_dn": int(blobs.peak[near]) if near >= 0 else 0,
            })  # fmt: skip
        return rows
