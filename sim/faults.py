"""Faults of LEDs, camera, IMU and reel: what breaks, when, and how badly.

A fault acts in start_s <= t < stop_s. Those that overlap compose: LEDs' factors multiply, hot pixels and gyro biases
add, dirt leaves the product of what each layer leaves, of ranges the smallest holds, and of stuck exposures the one
that began last (of two at once, the later in the list).

A flickering LED is fully on for the first `duty` of each period from start_s on, and on 1 - depth for the rest:

    factor = 1 - depth (1 - F),   F = part of the exposure, centred on t, in which the LED is fully on           (1)

Hot pixels are the first `count` different places of a sequence that is a hash of (key, number): more of them contain
the fewer, and a window has those of the full frame.

Not modelled: faults at random times; a fault that begins or ends within an exposure acts in all of it or not at all,
as it does at the middle; flickers of one LED multiply as their means.
Source of the hash: Steele, Lea & Flood 2014 (SplitMix64), its finaliser applied to a counter.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.rotations import Array

T = TypeVar("T", bound="Fault")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something that is wrong for a time."""

    start_s: float = 0.0
    stop_s: float = math.inf  #: the first moment at which it no longer acts


@dataclass(frozen=True, slots=True, kw_only=True)
class LedFault(Fault):
    """A fault of some LEDs."""

    leds: tuple[int, ...] | None = None  #: their numbers, None for all


@dataclass(frozen=True, slots=True, kw_only=True)
class LedOff(LedFault):
    """These LEDs are dark."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LedDim(LedFault):
    """These LEDs shine with a part of their intensity."""

    factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LedFlicker(LedFault):
    """These LEDs flicker, all in step, Eq. (1)."""

    frequency_hz: float
    duty: float  #: part of a period in which the LED is fully on
    depth: float = 1.0  #: part of the intensity that is missing in the rest


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraDropOut(Fault):
    """No frame arrives."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StuckFrame(Fault):
    """The camera sends its last picture again and again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HotPixels(Fault):
    """Some pixels of the sensor are white."""

    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DirtyWindow(Fault):
    """Smudges on the window in front of the lens."""

    cover: float  #: part of the window under them


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureStuck(Fault):
    """The exposure stays at this time."""

    exposure_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroBiasStep(Fault):
    """The gyros' biases jump by this much."""

    rate_rad_s: tuple[float, float, float]  #: gyro axes


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroSaturation(Fault):
    """The gyros' range shrinks to this."""

    limit_rad_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroDropOut(Fault):
    """No sample of the IMU arrives."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeadReel(Fault):
    """The reel's drum is locked: it neither takes hose up nor pays it out."""

    unnoticed: bool = False  #: by the hose unit, so that the pod's light does not turn red


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFault:
    """What is wrong with the camera at one time; as it is by default, nothing."""

    dropped: bool = False
    stuck: bool = False
    hot_pixels: int = 0
    dirt_cover: float = 0.0
    exposure_s: float | None = None  #: the exposure it is stuck at


_SOUND = CameraFault()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImuFault:
    """What is wrong with the IMU at one time; as it is by default, nothing."""

    bias_rad_s: Array = field(default_factory=lambda: np.zeros(3))  #: (3,) on top of the gyros' own, gyro axes
    range_rad_s: float | None = None  #: of the gyros
    dropped: bool = False


class Faults:
    """All faults of a flight.

    Args:
        faults: in any order.
        led_count: on the ring.

    Raises:
        DockairError: a number that makes no sense, named as `faults[i].key`.
    """

    def __init__(self, faults: Sequence[Fault], led_count: int) -> None:
        self._faults, self._led_count = tuple(faults), led_count
        for index, fault in enumerate(self._faults):
            _check(fault, f"faults[{index}]", led_count)

    @property
    def any(self) -> bool:
        """Whether there are any, at whatever time."""
        return bool(self._faults)

    @property
    def exposures_s(self) -> dict[int, float]:
        """Exposures at which the camera will be stuck, by the fault's place in the list."""
        return {k: fault.exposure_s for k, fault in enumerate(self._faults) if isinstance(fault, ExposureStuck)}

    @property
    def most_hot_pixels(self) -> tuple[int, int]:
        """Which fault's beginning makes them most, by its place in the list, and how many then; (-1, 0) without any."""
        hot = [(k, fault) for k, fault in enumerate(self._faults) if isinstance(fault, HotPixels)]
        counts = [(k, self.camera(fault.start_s).hot_pixels) for k, fault in hot]
        return max(counts, key=lambda one: one[1], default=(-1, 0))

    def led_factors(self, time_s: float, exposure_s: float = 0.0) -> Array:
        """(n,) what is left of each LED's light in an exposure.

        Args:
            time_s: its middle.
            exposure_s: its length, 0 for a moment.
        """
        factors = np.ones(self._led_count)
        for fault in self._acting(LedFault, time_s):
            where = slice(None) if fault.leds is None else list(fault.leds)
            factors[where] *= _led_factor(fault, time_s, exposure_s)
        return factors

    def camera(self, time_s: float) -> CameraFault:
        """What is wrong with the camera at a time."""
        if not self._faults:
            return _SOUND
        clear = math.prod(1.0 - fault.cover for fault in self._acting(DirtyWindow, time_s))
        exposures = sorted(self._acting(ExposureStuck, time_s), key=lambda fault: fault.start_s)
        return CameraFault(
            dropped=bool(self._acting(CameraDropOut, time_s)),
            stuck=bool(self._acting(StuckFrame, time_s)),
            hot_pixels=sum(fault.count for fault in self._acting(HotPixels, time_s)),
            dirt_cover=1.0 - clear,
            exposure_s=exposures[-1].exposure_s if exposures else None,
        )

    def imu(self, time_s: float) -> ImuFault:
        """What is wrong with the IMU at a time."""
        limits = [fault.limit_rad_s for fault in self._acting(GyroSaturation, time_s)]
        bias = np.zeros(3)
        for step in self._acting(GyroBiasStep, time_s):
            bias += step.rate_rad_s
        return ImuFault(
            bias_rad_s=bias,
            range_rad_s=min(limits, default=None),
            dropped=bool(self._acting(GyroDropOut, time_s)),
        )

    def reel_locked(self, time_s: float) -> bool:
        """Whether the reel is dead at a time."""
        return bool(self._faults) and bool(self._acting(DeadReel, time_s))

    def reel_seen_dead(self, time_s: float) -> bool:
        """Whether the reel at a time is dead in a way that the hose unit can notice."""
        return bool(self._faults) and any(not fault.unnoticed for fault in self._acting(DeadReel, time_s))

    def _acting(self, kind: type[T], time_s: float) -> list[T]:
        return [f for f in self._faults if isinstance(f, kind) and f.start_s <= time_s < f.stop_s]


def hot_pixel_places(key: int, count: int, height: int, width: int) -> NDArray[np.int64]:
    """(count, 2) rows and columns of hot pixels, all different; those of a smaller count come first.

    Args:
        key: of `dockair.streams.counter_key`.
        count: at most all pixels.
        height: of the sensor [px].
        width: of the sensor [px].
    """
    size = height * width
    if not 0 <= count <= size:
        raise DockairError("hot_pixels.count", expected=f"0 to {size} pixels", got=count)
    length, places = count + 64, np.empty(0, dtype=np.int64)
    while len(places) < count:
        sequence = (_hash(key, length) % np.uint64(size)).astype(np.int64)
        _, first = np.unique(sequence, return_index=True)
        places = sequence[np.sort(first)]
        length *= 2
    return np.column_stack(np.divmod(places[:count], width))


def _hash(key: int, length: int) -> NDArray[np.uint64]:
    """(length,) SplitMix64's sequence from a 64-bit key."""
    with np.errstate(over="ignore"):  # modulo 2^64 is meant
        x = np.uint64(key) + np.arange(1, length + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return x ^ (x >> np.uint64(31))


def _led_factor(fault: LedFault, time_s: float, exposure_s: float) -> float:
    match fault:
        case LedDim():
            return fault.factor
        case LedFlicker():
            periods = fault.frequency_hz * exposure_s
            begin = fault.frequency_hz * (time_s - fault.start_s) - 0.5 * periods
            return 1.0 - fault.depth * (1.0 - _on_part(begin % 1.0, periods, fault.duty))
    return 0.0


def _on_part(begin: float, length: float, duty: float) -> float:
    """F of Eq. (1): exposure from `begin` (0 to 1) over `length`, in periods."""
    if length == 0.0:
        return float(begin < duty)
    whole, rest = divmod(begin + length, 1.0)
    return (whole * duty + min(rest, duty) - min(begin, duty)) / length


def _check(fault: Fault, where: str, led_count: int) -> None:
    """Refuse a fault that makes no sense."""
    _require(math.isfinite(fault.start_s), f"{where}.start_s", "a time [s]", fault.start_s)
    _require(fault.stop_s > fault.start_s, f"{where}.stop_s", f"a time after start_s = {fault.start_s}", fault.stop_s)
    if isinstance(fault, LedFault) and fault.leds is not None:
        _require(len(fault.leds) > 0, f"{where}.leds", "at least one LED, or None for all", fault.leds)
        exist = all(led in range(led_count) for led in fault.leds) and len(set(fault.leds)) == len(fault.leds)
        _require(exist, f"{where}.leds", f"different numbers of LEDs, 0 to {led_count - 1}", fault.leds)
    for name in ("factor", "duty", "depth", "cover"):
        value = getattr(fault, name, 0.0)
        _require(0.0 <= value <= 1.0, f"{where}.{name}", "a part from 0 to 1", value)
    for name in ("frequency_hz", "exposure_s", "limit_rad_s"):
        value = getattr(fault, name, 1.0)
        _require(0.0 < value < math.inf, f"{where}.{name}", "a number > 0", value)
    count = getattr(fault, "count", 0)
    _require(isinstance(count, int | np.integer) and count >= 0, f"{where}.count", "a number of pixels", count)
    rate = getattr(fault, "rate_rad_s", (0.0, 0.0, 0.0))
    _require(np.shape(rate) == (3,) and bool(np.isfinite(rate).all()), f"{where}.rate_rad_s", "3 numbers [rad/s]", rate)


def _require(holds: bool | np.bool, where: str, expected: str, got: object) -> None:
    if not holds:
        raise DockairError(where, expected=expected, got=got)
