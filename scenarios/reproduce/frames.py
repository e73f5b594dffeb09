"""What the image of a ring is worth in a frame of the studio: each LED beside its noise, what was found of it."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.messages import Window
from dockair.rotations import Array
from dockair.scenarios.studio import Studio, TrueFrame, studio
from dockair.sim.camera.electronics import output_gain

_LEDS = 8
_ROUNDING_DN2 = 1.0 / 12.0


@contextmanager
def studio_without_leds(settings: Mapping[str, Any] | None = None, seed: int = 3) -> Iterator[Studio]:
    """As `studio`, with all LEDs off: the same light, clouds and hardware."""
    settings = settings or {}
    off = {"kind": "led_off", "leds": list(range(_LEDS))}
    with studio({**settings, "faults": [*settings.get("faults", []), off]}, seed) as dark:
        yield dark


def signal_to_noise(lit: Studio, dark: Studio, data: mujoco.MjData, taken: TrueFrame) -> Array:
    """(8,) what a filter matched to each LED's image would have, sqrt(sum s^2/v); NaN for LEDs that are not visible.

    s are the electrons of 5 x 5 pixels with the LEDs less those without, v the variance of a pixel without: shot noise,
    read noise, fixed pattern and the rounding of eight bits. Whatever is detected below 5 is luck.
    """
    sensor = lit.sensor
    gain, exposure_s, ratios = output_gain(sensor), taken.frame.exposure_s, np.full(len(taken.leds_px), np.nan)
    quiet_e2 = sensor.read_noise_e**2 + sensor.dark_signal_nonuniformity_e**2 + sensor.column_pattern_e**2
    quiet_e2 += _ROUNDING_DN2 / gain**2
    rows, columns = taken.frame.window.row_stop, taken.frame.window.column_stop
    for k in np.flatnonzero(taken.visible):
        column, row = (round(float(c)) for c in taken.leds_px[k])
        window = Window(max(row - 2, 0), min(row + 3, rows), max(column - 2, 0), min(column + 3, columns))
        bright = lit.camera.expected_electrons(data, window, exposure_s=exposure_s).astype(float)
        without = dark.camera.expected_electrons(data, window, exposure_s=exposure_s).astype(float)
        variance = without + quiet_e2 + (sensor.photo_response_nonuniformity * without) ** 2
        ratios[k] = np.sqrt(((bright - without) ** 2 / variance).sum())
    return ratios


def matches(found_px: Array, leds_px: Array, within_px: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which blobs (n, 2) lie on an LED (m, 2), and which LEDs have a blob: (n,) and (m,)."""
    near = np.linalg.norm(found_px[:, None] - leds_px[None], axis=2) < within_px
    return near.any(axis=1), near.any(axis=0)
