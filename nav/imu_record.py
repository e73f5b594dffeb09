"""The IMU's samples of the last moments, in body axes: which are believed, and the rate between them.

Not taken are samples that are not newer than the last, whose stamp or rate is not a number, or with a rate at the
gyro's limit, which says no more than that the true one is beyond. A specific force at its limit is none. A stamp that
jumps ahead is not believed until a second one near it says the same, and by more than a minute never: then it is no gap
but another clock.

Not modelled: a first stamp that is wrong. It sets the clock, and those of a right one that is behind it are too old.
"""

import math

import numpy as np

from dockair.calibration import GyroSheet, Mounting
from dockair.kernels import njit
from dockair.messages import STAMP_RESOLUTION_S, ImuSample
from dockair.rotations import Array

_FIRST_ROOM = 256  # samples; doubled when needed
_LONGEST_LEAP_S = 60.0  # no drogue is foretold for as long: a flight whose IMU was away for it has to be begun anew


class Stamps:
    """Which stamps may be believed.

    Args:
        leap_s: how far ahead of the newest a stamp may be without a second one.
    """

    def __init__(self, leap_s: float) -> None:
        self._leap_s, self._doubtful_s = leap_s, np.nan

    def believed(self, time_s: float, newest_s: float) -> bool:
        """Whether a stamp is, where the newest of all that is known is `newest_s` (-inf: nothing)."""
        leap_s = time_s - newest_s if math.isfinite(newest_s) else 0.0
        near, again = leap_s <= self._leap_s, 0.0 < time_s - self._doubtful_s <= self._leap_s
        if math.isfinite(time_s) and leap_s <= _LONGEST_LEAP_S and (near or again):
            self._doubtful_s = np.nan
            return True
        self._doubtful_s = time_s
        return False


class ImuRecord:
    """Samples in order.

    Args:
        mounting: of the IMU.
        gyro: its sheet.
        saturated: share of their ranges from which on a rate or a specific force says nothing.
    """

    def __init__(self, mounting: Mounting, gyro: GyroSheet, saturated: float) -> None:
        self._R_BI = np.ascontiguousarray(mounting.R_BI, dtype=float)
        self._rate_hz = float(gyro.rate_hz)
        self._limits = saturated * gyro.range_rad_s, saturated * gyro.accelerometer_range_m_s2  # rad/s, m/s^2
        self._times, self._rates, self._forces = np.empty(_FIRST_ROOM), np.empty((_FIRST_ROOM, 3)), self._none()
        self._first = self._end = 0
        self.newest_s = -np.inf  #: stamp of the newest sample; -inf before the first

    @staticmethod
    def _none() -> Array:
        return np.full((_FIRST_ROOM, 3), np.nan)

    @property
    def times_s(self) -> Array:
        """(k,) stamps, increasing."""
        return self._times[self._first : self._end]

    @property
    def rates_B(self) -> Array:
        """(k, 3) of the gyro [rad/s]."""
        return self._rates[self._first : self._end]

    @property
    def forces_B(self) -> Array:
        """(k, 3) of the accelerometers [m/s^2], NaN where there is none."""
        return self._forces[self._first : self._end]

    def take(self, sample: ImuSample) -> bool:
        """Keep a sample; False if it is not taken."""
        if not self.newest_s < sample.time_stamp_s < np.inf:
            return False
        if self._end == len(self._times):
            self._make_room()
        rate_I = np.asarray(sample.angular_rate_rad_s, dtype=float)
        force_I = np.asarray(sample.specific_force_m_s2, dtype=float)
        if not _put(self._rates, self._forces, self._end, rate_I, force_I, self._R_BI, self._limits):
            return False
        self._times[self._end] = self.newest_s = sample.time_stamp_s
        self._end += 1
        return True

    def forget(self, time_s: float) -> None:
        """Drop what is older than a time but for the last sample before it."""
        last = int(np.searchsorted(self.times_s, time_s, side="right")) - 1
        self._first += max(last, 0)

    def rate_B(self, time_s: float) -> Array:
        """(3,) rate [rad/s], linear between samples, that of the nearest one outside, 0 when there is none."""
        return _rate_at(self.times_s, self.rates_B, time_s)

    def mean_rate_B(self, time_s: float, span_s: float) -> Array:
        """(3,) mean of the newest samples up to a time, always of as many: the rate `mean_age_s` before the newest.

        They are counted, because stamps jitter: a span that begins where a sample should be holds it or not, by chance.
        After a gap they are fewer: none is older than the newest by as many periods. With none up to the time it is the
        rate there.

        Args:
            time_s: to the microsecond.
            span_s: as long as so many periods, to the nearest: of 0.01 s five at 500 Hz, two at 225 Hz, one at 125 Hz
                and below. Noise and age of the mean go with it.
        """
        samples = self._samples_in(span_s)
        return _mean_of_newest(self.times_s, self.rates_B, time_s, samples, samples / self._rate_hz)

    def mean_age_s(self, span_s: float) -> float:
        """How long before the newest of its samples the moment is of which `mean_rate_B` is the rate [s]."""
        return 0.5 * (self._samples_in(span_s) - 1) / self._rate_hz

    def mean_force_B(self, start_s: float, end_s: float) -> Array:
        """(3,) mean specific force of the samples after `start_s` up to `end_s`; NaN when any or all are none.

        From the stamp of one sample to that of another jitter moves none in or out, and none counts in two steps.
        """
        return _mean_between(self.times_s, self.forces_B, start_s, end_s)

    def is_unbroken(self, start_s: float, end_s: float, longest_gap_s: float, *, forces: bool) -> bool:
        """Whether samples came all the time from one moment to another.

        Args:
            start_s: the first moment.
            end_s: the last one, at or after the newest sample.
            longest_gap_s: without a sample, before the first and after the last one included.
            forces: whether the specific force of every one has to be a number.
        """
        return bool(
            _is_unbroken(self.times_s, self.forces_B, start_s, end_s, longest_gap_s + STAMP_RESOLUTION_S, forces)
        )

    def _samples_in(self, span_s: float) -> int:
        return max(math.floor(span_s * self._rate_hz + 0.5), 1)

    def _make_room(self) -> None:
        kept = self._end - self._first
        room = max(_FIRST_ROOM, 2 * kept)
        for name in ("_times", "_rates", "_forces"):
            old = getattr(self, name)
            new = np.full((room, *old.shape[1:]), np.nan)
            new[:kept] = old[self._first : self._end]
            setattr(self, name, new)
        self._first, self._end = 0, kept


@njit(cache=True, error_model="numpy")
def _put(
    rates: Array, forces: Array, k: int, rate_I: Array, force_I: Array, R_BI: Array, limits: tuple[float, float]
) -> bool:
    """Put rate and force (3,) in body axes into row k; False if a rate is beyond its limit or not a number."""
    for i in range(3):
        if not abs(rate_I[i]) < limits[0]:
            return False
    np.dot(R_BI, rate_I, rates[k])
    np.dot(R_BI, force_I, forces[k])
    for i in range(3):
        if not abs(force_I[i]) < limits[1]:
            forces[k] = np.nan
    return True


@njit(cache=True, error_model="numpy")
def _rate_at(times: Array, rates: Array, time_s: float) -> Array:
    """(3,) of rates (k, 3), see `ImuRecord.rate_B`."""
    out, n = np.zeros(3), len(times)
    if n == 0:
        return out
    k = int(np.searchsorted(times, time_s, side="right"))
    if k in (0, n):
        out[:] = rates[min(k, n - 1)]
        return out
    share = (time_s - times[k - 1]) / (times[k] - times[k - 1])
    for i in range(3):
        out[i] = (1.0 - share) * rates[k - 1, i] + share * rates[k, i]
    return out


@njit(cache=True, error_model="numpy")
def _mean_of_newest(times: Array, rates: Array, time_s: float, samples: int, longest_s: float) -> Array:
    """(3,) of rates (k, 3), see `ImuRecord.mean_rate_B`; left out are those as old as `longest_s` beside the newest."""
    stop = int(np.searchsorted(times, time_s + STAMP_RESOLUTION_S, side="right"))
    if stop == 0:
        return _rate_at(times, rates, time_s)
    first, after_s = stop - 1, times[stop - 1] - longest_s + STAMP_RESOLUTION_S
    while first > 0 and stop - first < samples and times[first - 1] > after_s:
        first -= 1
    return _mean(rates, first, stop)


@njit(cache=True, error_model="numpy")
def _mean_between(times: Array, values: Array, start_s: float, end_s: float) -> Array:
    """(3,) mean of the values (k, 3) of samples after a time up to another, both to the microsecond; NaN of none."""
    first = int(np.searchsorted(times, start_s + STAMP_RESOLUTION_S, side="right"))
    stop = int(np.searchsorted(times, end_s + STAMP_RESOLUTION_S, side="right"))
    return _mean(values, first, stop) if stop > first else np.full(3, np.nan)


@njit(cache=True, error_model="numpy")
def _mean(values: Array, first: int, stop: int) -> Array:
    """(3,) mean of some rows of (k, 3)."""
    out = values[first].copy()
    for k in range(first + 1, stop):
        out += values[k]
    return out / (stop - first)


@njit(cache=True, error_model="numpy")
def _is_unbroken(
    times: Array, forces: Array, start_s: float, end_s: float, longest_gap_s: float, with_forces: bool
) -> bool:
    """See `ImuRecord.is_unbroken`; the last sample at or before the first moment is one of them."""
    before_s = start_s if len(times) else -np.inf
    for k in range(max(int(np.searchsorted(times, start_s, side="right")) - 1, 0), len(times)):
        if times[k] - before_s > longest_gap_s:
            return False
        for i in range(3):
            if with_forces and not np.isfinite(forces[k, i]):
                return False
        before_s = times[k]
    return end_s - before_s <= longest_gap_s
