"""What the navigation received, exactly as delivered, and what it answered: enough to run it again, and nothing else.

| file               | one row a control tick                                                             |
|--------------------|------------------------------------------------------------------------------------|
| messages.parquet   | IMU samples and, if they arrived, the frame (lossless PNG, window, stamp, exposure, gain) and |
|                    | what the tanker announced, what the pod's light began to show                      |
| estimates.parquet  | every field of `NavSolution`; all numbers as 64-bit floats                         |
| navigator.json     | how to make the navigator again, of `navigator_recipe`                             |

Frames are encoded in a thread of their own: OpenCV releases the interpreter lock meanwhile, so that the control loop
waits only when the encoder is more than `QUEUE_TICKS` behind. No truth enters these files.
"""

import queue
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from dockair.errors import DockairError, MachineError
from dockair.messages import (
    CameraFrame,
    ImuSample,
    Light,
    NavSolution,
    PodSignal,
    TankerAnnouncement,
    Window,
)
from dockair.rotations import Array
from dockair.scenarios.navigator_recipe import NavigatorRecipe, recorded_file
from dockair.scenarios.parquet_file import open_parquet

QUEUE_TICKS = 200  # ticks waiting for the encoder; at 50 frames/s of 2.2 MB full frames at most 220 MB
ROW_GROUP_TICKS = 100
_LATER_COLUMNS = {"announcement", "pod_signal"}  # which recordings of before do not have
MESSAGES, ESTIMATES = "messages.parquet", "estimates.parquet"
#: Sensor noise has no patterns to look back for: Huffman coding alone is smaller and quicker than a search.
_PNG = [cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY]

_FLOATS = pa.list_(pa.float64())
_WINDOW_COLUMNS = [f.name for f in fields(Window)]
_MESSAGE_SCHEMA = pa.schema(
    [
        ("gyro_time_stamp_s", _FLOATS),
        ("gyro_angular_rate_rad_s", _FLOATS),
        ("accelerometer_specific_force_m_s2", _FLOATS),
        ("frame_time_stamp_s", pa.float64()),
        *[(name, pa.int32()) for name in _WINDOW_COLUMNS],
        ("exposure_s", pa.float64()),
        ("gain", pa.float64()),
        ("announcement", _FLOATS),
        ("pod_signal", _FLOATS),
        ("png", pa.binary()),
    ]
)
_ESTIMATE_SCHEMA = pa.schema([(f.name, pa.string() if f.type is str else _FLOATS) for f in fields(NavSolution)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TickMessages:
    """What one control tick delivered."""

    imu: tuple[ImuSample, ...]
    frame: CameraFrame | None
    png: bytes | None  #: the frame's pixels as stored
    announcement: TankerAnnouncement | None = None
    signal: PodSignal | None = None


def numbers(value: Any) -> Array:
    """(n,) 64-bit floats of a number, an array, a light, a message of such, or nothing (None)."""
    if value is None:
        return np.empty(0)
    if isinstance(value, Light):
        return np.array([float(value.value)])
    if is_dataclass(value):
        return np.concatenate([numbers(getattr(value, f.name)) for f in fields(value)])
    return np.asarray(value, dtype=np.float64).ravel()


def estimate_row(solution: NavSolution) -> dict[str, Array | str]:
    """Return every field of a solution as text or as (n,) floats."""
    values = {f.name: getattr(solution, f.name) for f in fields(solution)}
    return {name: value if isinstance(value, str) else numbers(value) for name, value in values.items()}


_Entry = tuple[tuple[ImuSample, ...], CameraFrame | None, TankerAnnouncement | None, PodSignal | None, NavSolution]


class MessageLog:
    """Writes the three files while a flight goes on; use it in a `with` statement."""

    def __init__(self, out_dir: str | Path, recipe: NavigatorRecipe) -> None:
        self._folder = folder = Path(out_dir)
        recipe.write(folder)
        with ExitStack() as opened:  # Arrow takes no path but of UTF-8
            messages, estimates = (opened.enter_context((folder / name).open("wb")) for name in (MESSAGES, ESTIMATES))
            self._messages = opened.enter_context(
                pq.ParquetWriter(
                    messages, _MESSAGE_SCHEMA, compression={"png": "NONE"} | dict.fromkeys(_compressed(), "ZSTD")
                )
            )
            self._estimates = opened.enter_context(pq.ParquetWriter(estimates, _ESTIMATE_SCHEMA, compression="ZSTD"))
            self._files = opened.pop_all()
        self._queue: queue.Queue[_Entry | None] = queue.Queue(QUEUE_TICKS)
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._work, name="message log", daemon=True)
        self._thread.start()

    def append(
        self,
        imu: Sequence[ImuSample],
        frame: CameraFrame | None,
        solution: NavSolution,
        announcement: TankerAnnouncement | None = None,
        signal: PodSignal | None = None,
    ) -> None:
        """Take one control tick; blocks while the encoder is too far behind.

        Raises:
            MachineError: the disk refused an earlier tick.
        """
        self._raise_failure()
        self._queue.put((tuple(imu), frame, announcement, signal, solution))

    def close(self) -> None:
        """Write what is still waiting and close the files.

        Raises:
            MachineError: the disk refused it.
        """
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()
        try:
            self._files.close()
        except OSError as failure:
            self._failure = self._failure or failure
        self._raise_failure()

    def _raise_failure(self) -> None:
        if isinstance(self._failure, OSError):
            remedy, expected = f"{self._failure}; free some space or record none", "a disk that takes the recording"
            raise MachineError(str(self._folder), expected=expected, remedy=remedy) from self._failure
        if self._failure is not None:
            raise self._failure

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _work(self) -> None:
        messages: list[dict[str, Any]] = []
        estimates: list[dict[str, Any]] = []
        while (entry := self._queue.get()) is not None:
            if self._failure is not None:
                continue  # keep taking, so that the flight is not blocked before it is told
            try:
                messages.append(_message_row(*entry[:4]))
                estimates.append(estimate_row(entry[4]))
                if len(messages) == ROW_GROUP_TICKS:
                    self._flush(messages, estimates)
            except BaseException as failure:  # noqa: B036 - handed to the flight's thread
                self._failure = failure
        try:
            self._flush(messages, estimates)
        except BaseException as failure:  # noqa: B036
            self._failure = self._failure or failure

    def _flush(self, messages: list[dict[str, Any]], estimates: list[dict[str, Any]]) -> None:
        if messages:
            self._messages.write_table(pa.Table.from_pylist(messages, _MESSAGE_SCHEMA))
            self._estimates.write_table(pa.Table.from_pylist(estimates, _ESTIMATE_SCHEMA))
        messages.clear()
        estimates.clear()


def _compressed() -> list[str]:
    leaves = [f"{f.name}.list.element" for f in _MESSAGE_SCHEMA if f.type == _FLOATS]
    return leaves + [f.name for f in _MESSAGE_SCHEMA if f.type != _FLOATS and f.name != "png"]


def _message_row(
    imu: tuple[ImuSample, ...],
    frame: CameraFrame | None,
    announcement: TankerAnnouncement | None,
    signal: PodSignal | None,
) -> dict[str, Any]:
    row: dict[str, Any] = {
        "gyro_time_stamp_s": [sample.time_stamp_s for sample in imu],
        "gyro_angular_rate_rad_s": [float(rate) for sample in imu for rate in sample.angular_rate_rad_s],
        "accelerometer_specific_force_m_s2": [float(f) for sample in imu for f in sample.specific_force_m_s2],
        "announcement": numbers(announcement).tolist(),
        "pod_signal": numbers(signal).tolist(),
    }
    if frame is not None:
        row |= {name: getattr(frame.window, name) for name in _WINDOW_COLUMNS}
        row |= {"frame_time_stamp_s": frame.time_stamp_s, "exposure_s": frame.exposure_s, "gain": frame.gain}
        row["png"] = png_from_pixels(frame.pixels)
    return row


def read_messages(out_dir: str | Path, *, pixels: bool = True) -> Iterator[TickMessages]:
    """Yield what each control tick delivered, in order.

    Args:
        out_dir: a flight's folder.
        pixels: decode the frames; without, `frame.pixels` is empty and only `png` holds them.

    Raises:
        DockairError: nothing was recorded there, or what is there is damaged.
    """
    path = Path(out_dir) / MESSAGES
    for row in _rows(Path(out_dir), MESSAGES, set(_MESSAGE_SCHEMA.names) - _LATER_COLUMNS):
        yield _tick_from_row(row, pixels, path)


def _rows(out_dir: Path, name: str, needed: set[str]) -> Iterator[dict[str, Any]]:
    path, expected = recorded_file(out_dir, name), "a whole table as a flight records it"
    try:
        with open_parquet(path) as file:
            if missing := sorted(needed - set(file.schema_arrow.names)):
                raise DockairError(str(path), expected=expected, got=f"none with the column {missing[0]}")
            for group in range(file.num_row_groups):
                yield from file.read_row_group(group, use_threads=False).to_pylist()
    except (pa.ArrowException, OSError) as error:  # cut off, or of another kind
        raise DockairError(str(path), expected=expected, got=str(error).partition("\n")[0]) from None


def _tick_from_row(row: dict[str, Any], pixels: bool, path: Path) -> TickMessages:
    rates = np.array(row["gyro_angular_rate_rad_s"], dtype=np.float64).reshape(-1, 3)
    forces = np.array(row["accelerometer_specific_force_m_s2"], dtype=np.float64).reshape(-1, 3)
    imu = tuple(
        ImuSample(time_stamp_s=t, angular_rate_rad_s=rate, specific_force_m_s2=force)
        for t, rate, force in zip(row["gyro_time_stamp_s"], rates, forces, strict=True)
    )
    png, said, shown = row["png"], row.get("announcement"), row.get("pod_signal")
    names = [f.name for f in fields(TankerAnnouncement)]
    announcement = TankerAnnouncement(**dict(zip(names, said, strict=True))) if said else None
    signal = PodSignal(time_stamp_s=shown[0], light=Light(shown[1])) if shown else None
    if png is None:
        return TickMessages(imu=imu, frame=None, png=None, announcement=announcement, signal=signal)
    window = Window(*(row[name] for name in _WINDOW_COLUMNS))
    frame = CameraFrame(
        time_stamp_s=row["frame_time_stamp_s"],
        pixels=pixels_from_png(png, path) if pixels else np.empty((0, 0), np.uint8),
        window=window,
        exposure_s=row["exposure_s"],
        gain=row["gain"],
    )
    return TickMessages(imu=imu, frame=frame, png=png, announcement=announcement, signal=signal)


def png_from_pixels(pixels: NDArray[np.uint8]) -> bytes:
    """Return a lossless PNG of (rows, columns) pixels."""
    done, png = cv2.imencode(".png", pixels, _PNG)
    if not done:
        raise OSError("a camera frame could not be encoded as PNG")
    return png.tobytes()


def pixels_from_png(png: bytes, path: str | Path = MESSAGES) -> NDArray[np.uint8]:
    """(rows, columns) pixels of a stored frame.

    Args:
        png: the frame.
        path: where it is stored.

    Raises:
        DockairError: the frame is damaged.
    """
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED) if png else None
    if pixels is None:
        raise DockairError(str(path), expected="frames as a flight records them", got="a PNG that cannot be decoded")
    return np.asarray(pixels, dtype=np.uint8)


def read_estimates(out_dir: str | Path) -> Iterator[dict[str, Array | str]]:
    """Yield the recorded answer of each control tick as `estimate_row` gives it.

    Raises:
        DockairError: nothing was recorded there, or what is there is damaged.
    """
    for row in _rows(Path(out_dir), ESTIMATES, set()):  # a field that was not there yet is a difference
        yield {name: v if isinstance(v, str) else np.array(v, np.float64) for name, v in row.items()}
