"""The frames of an episode as they are shown: brightened, padded, and of long flights every n-th.

What is on the screen is the square root of a pixel,

    shown = 255 min(1, sqrt(pixel / WHITE)),                                                              (1)

because nearly all pixels of a near-infrared frame are below ten of 255 and would be black beside its LEDs; shot noise
is then as strong everywhere. `messages.parquet` keeps the pixels as they were delivered.

The viewer takes a change of an image's size for a fault of a video, so that windows are padded with black to multiples
of `PADDING_PX` and each size has an entity of its own.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dockair.messages import Window
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.message_log import TickMessages, pixels_from_png, png_from_pixels
from dockair.scenarios.recording.layout import TRUTH

PADDING_PX = 128
WHITE = 64
FRAME_BYTES = 24_000_000  # of an episode's frames as delivered: about 30 MB as shown; the message log holds every one
_BATCH = 64
_SHOWN = np.rint(255.0 * np.minimum(1.0, np.sqrt(np.arange(256) / WHITE))).astype(np.uint8)  # Eq. (1)


def shown_pixels(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return pixels (rows, columns) as they are shown, Eq. (1)."""
    return np.asarray(_SHOWN[pixels])


def padded_shape(window: Window) -> tuple[int, int]:
    """(rows, columns) of the window, rounded up to multiples of PADDING_PX."""
    rows, columns = window.shape
    return -(-rows // PADDING_PX) * PADDING_PX, -(-columns // PADDING_PX) * PADDING_PX


def log_frames(recording: Any, log: FlightLog, messages: Sequence[TickMessages]) -> None:
    """Log the frames that are shown, each at its place on the sensor, with its window's outline.

    Args:
        recording: of rerun.
        log: of the flight.
        messages: of the same control ticks; empty for a recording without frames.
    """
    import rerun as rr

    before = ""
    for number, time_s, window, png in _padded_frames(log, messages):
        recording.set_time("sim_time", duration=time_s)
        recording.set_time("frame", sequence=number)
        entity = f"camera/window/pixels_{'x'.join(str(size) for size in padded_shape(window))}"
        if entity != before:
            if before:
                recording.log(before, rr.EncodedImage.from_fields(opacity=0.0))  # the viewer does not heed a Clear here
            recording.log(entity, rr.EncodedImage.from_fields(opacity=1.0))
            before = entity
        recording.log("camera/window", rr.Transform3D(translation=[window.column_start, window.row_start, 0]))
        recording.log(entity, rr.EncodedImage(contents=png, media_type="image/png", draw_order=-10.0))
        rows, columns = window.shape
        box = rr.Boxes2D(array=[0, 0, columns, rows], array_format=rr.Box2DFormat.XYWH, colors=TRUTH)
        recording.log("camera/window/outline", box)


def shown_frames(sizes_bytes: Sequence[int]) -> range:
    """Return which frames are shown: every n-th, n as small as FRAME_BYTES allow."""
    return range(0, len(sizes_bytes), max(1, -(-sum(sizes_bytes) // FRAME_BYTES)))


def _padded_frames(log: FlightLog, messages: Sequence[TickMessages]) -> Iterator[tuple[int, float, Window, bytes]]:
    """Yield number, time of delivery, window and padded PNG of each frame shown; threads encode a few dozen at once."""

    def pad(entry: tuple[int, float, Window, bytes]) -> tuple[int, float, Window, bytes]:
        number, time_s, window, png = entry
        canvas = np.zeros(padded_shape(window), np.uint8)
        canvas[: window.shape[0], : window.shape[1]] = shown_pixels(pixels_from_png(png))
        return number, time_s, window, png_from_pixels(canvas)

    frames = [
        (int(number), truth.time_s, tick.frame.window, tick.png)
        for number, truth, tick in zip(log.frame_numbers(), log.truths, messages, strict=False)
        if tick.frame is not None and tick.png is not None
    ]
    chosen = [frames[k] for k in shown_frames([len(png) for *_, png in frames])]
    with ThreadPoolExecutor(max_workers=2) as pool:
        for first in range(0, len(chosen), _BATCH):
            yield from pool.map(pad, chosen[first : first + _BATCH])
