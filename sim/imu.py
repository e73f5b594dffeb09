"""Inertial measurement unit: three gyros and three accelerometers at one place on the receiver.

    w_I = R_BI' w_B                                              measured by the gyros' triad                   (1)
    f_I = R_BI' (f_B + alpha x r + w x (w x r)),   r = p_BI      measured by the accelerometers'                (2)
    stamp = t + clip( N(0, s_t^2), 0.49 dt )                     jitter; stamps stay in order                   (3)

f is the specific force, acceleration less gravity. The gyros feel a little of it (g-sensitivity); the errors of both
triads are in sim/triad.py. Every source of chance has its own stream: gyros, accelerometers, clock.

Not modelled: the Earth's rotation (15 deg/h; W does not turn), vibration of the mounting, size of the triads, what
the motion does between two samples, a clock that runs fast or slow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.messages import ImuSample
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.faults import ImuFault
from dockair.sim.triad import GAUSS_MARKOV_PEAK, Triad, TriadParameters

_JITTER_LIMIT = 0.49  # of the sample time
_BLOCK = 8192  # samples whose random numbers are drawn at a time
_STILL = np.zeros(3)
_UPRIGHT = np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])  # specific force of a body that stands upright


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuParameters:
    """Sheets `imu_tactical`, `imu_mti`, `imu_consumer`: sigmas of what is drawn, Allan coefficients of what moves."""

    gyro_noise_density_rad_s_rthz: float
    gyro_bias_instability_rad_s: float  #: floor of the Allan deviation
    gyro_bias_correlation_s: float
    gyro_rate_random_walk_rad_s_rts: float
    gyro_turn_on_bias_sigma_rad_s: float
    gyro_scale_factor_sigma: float
    gyro_misalignment_sigma_rad: float  #: of each axis toward each other
    gyro_g_sensitivity_sigma_rad_s_m: float  #: rad/s per m/s^2
    gyro_bandwidth_hz: float
    gyro_damping_ratio: float
    gyro_range_rad_s: float
    gyro_quantum_rad_s: float
    accelerometer_noise_density_m_s2_rthz: float
    accelerometer_bias_instability_m_s2: float  #: floor of the Allan deviation
    accelerometer_bias_correlation_s: float
    accelerometer_random_walk_m_s2_rts: float
    accelerometer_turn_on_bias_sigma_m_s2: float
    accelerometer_scale_factor_sigma: float
    accelerometer_misalignment_sigma_rad: float
    accelerometer_bandwidth_hz: float
    accelerometer_damping_ratio: float
    accelerometer_range_m_s2: float
    accelerometer_quantum_m_s2: float
    time_stamp_jitter_s: float

    @property
    def gyro_bias_walk_rad_s_rts(self) -> float:
        """Random walk that stands for both the rate random walk and, below its correlation time, the instability."""
        markov2 = 2.0 * (self.gyro_bias_instability_rad_s / GAUSS_MARKOV_PEAK) ** 2 / self.gyro_bias_correlation_s
        return math.sqrt(self.gyro_rate_random_walk_rad_s_rts**2 + markov2)


class ImuRecord(NamedTuple):
    """Samples one after the other."""

    time_stamp_s: Array  #: (n,)
    angular_rate_rad_s: Array  #: (n, 3)
    specific_force_m_s2: Array  #: (n, 3)


class Imu:
    """Six sensors and a clock. Their state is the filters', the biases and the generators'."""

    def __init__(
        self,
        parameters: ImuParameters,
        rate_hz: float,
        gyro_rng: np.random.Generator,
        accelerometer_rng: np.random.Generator,
        clock_rng: np.random.Generator,
        R_BI: Array,
        p_BI: Array,
    ) -> None:
        """Switch the sensors on: draw what stays as it is.

        Args:
            parameters: sheet.
            rate_hz: at which `step` is called.
            gyro_rng: stream "gyro".
            accelerometer_rng: stream "accelerometer".
            clock_rng: stream "imu_clock".
            R_BI: (3, 3) its axes in the body's, as built.
            p_BI: (3,) its place from the body's origin, the centre of gravity [m].

        Raises:
            DockairError: rate not positive.
        """
        if not rate_hz > 0.0:
            raise DockairError("imu.rate_hz", expected="a rate > 0 Hz", got=rate_hz)
        self._rate_hz = rate_hz
        self._R_BI, self._p_BI = _contiguous(R_BI), _contiguous(p_BI)
        self._gyros = Triad(_gyro_sheet(parameters), rate_hz, gyro_rng)
        self._accelerometers = Triad(_accelerometer_sheet(parameters), rate_hz, accelerometer_rng)
        self._jitter_s, self._clock_rng = parameters.time_stamp_jitter_s, clock_rng

    @property
    def gyro_bias_I(self) -> Array:
        """(3,) the gyros' own bias at the last sample [rad/s]: truth, for logs and tests; no fault is in it."""
        return self._gyros.bias

    @property
    def accelerometer_bias_I(self) -> Array:
        """(3,) the accelerometers' bias at the last sample [m/s^2], likewise."""
        return self._accelerometers.bias

    def step(
        self, time_s: float, w_WB_B: Array, alpha_WB_B: Array, specific_force_B: Array, fault: ImuFault | None = None
    ) -> ImuSample | None:
        """Return the sample at a time, or None when it drops out (inside, everything goes on all the same).

        Args:
            time_s: of the sample.
            w_WB_B: (3,) true angular velocity [rad/s].
            alpha_WB_B: (3,) its rate [rad/s^2].
            specific_force_B: (3,) acceleration of the centre of gravity less gravity [m/s^2].
            fault: what is wrong at this time.
        """
        w, f = self._felt(_row(w_WB_B), _row(alpha_WB_B), _row(specific_force_B))
        if fault is None:
            rates = self._gyros.sense(w, f)
        else:
            limit = np.inf if fault.range_rad_s is None else fault.range_rad_s
            rates = self._gyros.sense(w, f, fault.bias_rad_s, limit)
        forces = self._accelerometers.sense(f, w)
        limit_s = _JITTER_LIMIT / self._rate_hz
        stamp_s = time_s + min(max(self._jitter_s * self._clock_rng.standard_normal(), -limit_s), limit_s)
        if fault is not None and fault.dropped:
            return None
        return ImuSample(time_stamp_s=stamp_s, angular_rate_rad_s=rates[0], specific_force_m_s2=forces[0])

    def steps(
        self, times_s: Sequence[float], w_WB_B: Array, alpha_WB_B: Array, specific_force_B: Array
    ) -> tuple[ImuSample, ...]:
        """Return the samples at some times, the very numbers of as many steps without faults.

        Args:
            times_s: of the samples.
            w_WB_B: (n, 3) as in `step`.
            alpha_WB_B: (n, 3).
            specific_force_B: (n, 3).
        """
        stamps_s, rates, forces = self._sensed(np.array(times_s), w_WB_B, alpha_WB_B, specific_force_B)
        return tuple(
            ImuSample(time_stamp_s=stamp_s, angular_rate_rad_s=w, specific_force_m_s2=f)
            for stamp_s, w, f in zip(stamps_s.tolist(), rates, forces, strict=True)
        )

    def record(
        self,
        n: int,
        w_WB_B: Array | None = None,
        alpha_WB_B: Array | None = None,
        specific_force_B: Array | None = None,
        start_s: float = 0.0,
    ) -> ImuRecord:
        """Return n samples, the very numbers of n steps without faults.

        Args:
            n: how many.
            w_WB_B: (n, 3) as in `step`; not turning by default.
            alpha_WB_B: (n, 3).
            specific_force_B: (n, 3); standing upright by default.
            start_s: time of the first.
        """
        record = ImuRecord(np.empty(n), np.empty((n, 3)), np.empty((n, 3)))
        for first in range(0, n, _BLOCK):
            part = slice(first, min(first + _BLOCK, n))
            sensed = self._sensed(
                start_s + np.arange(first, part.stop) / self._rate_hz,
                _rows(w_WB_B, part, _STILL),
                _rows(alpha_WB_B, part, _STILL),
                _rows(specific_force_B, part, _UPRIGHT),
            )
            for column, values in zip(record, sensed, strict=True):
                column[part] = values
        return record

    def _sensed(self, times_s: Array, w_B: Array, alpha_B: Array, f_B: Array) -> ImuRecord:
        w, f = self._felt(w_B, alpha_B, f_B)
        rates, forces = self._gyros.sense(w, f), self._accelerometers.sense(f, w)
        return ImuRecord(times_s + self._jitter(len(times_s)), rates, forces)

    def _felt(self, w_B: Array, alpha_B: Array, f_B: Array) -> tuple[Array, Array]:
        return _at_imu(w_B, alpha_B, f_B, self._R_BI, self._p_BI)

    def _jitter(self, n: int) -> Array:
        limit_s = _JITTER_LIMIT / self._rate_hz
        return np.minimum(np.maximum(self._jitter_s * self._clock_rng.standard_normal(n), -limit_s), limit_s)


@njit(cache=True)
def _at_imu(w_B: Array, alpha_B: Array, f_B: Array, R_BI: Array, p_BI: Array) -> tuple[Array, Array]:
    """(n, 3) angular velocity and specific force at I, in its axes, Eqs. (1) and (2)."""
    w_I, f_I, at_I = np.zeros_like(w_B), np.zeros_like(w_B), np.empty(3)
    for k in range(len(w_B)):
        w_r, w_w = 0.0, 0.0  # w x (w x r) = w (w r) - r w^2
        for a in range(3):
            w_r += w_B[k, a] * p_BI[a]
            w_w += w_B[k, a] * w_B[k, a]
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            tangential = alpha_B[k, j] * p_BI[m] - alpha_B[k, m] * p_BI[j]
            at_I[i] = f_B[k, i] + tangential + w_B[k, i] * w_r - p_BI[i] * w_w
        for i in range(3):
            for a in range(3):
                w_I[k, i] += R_BI[a, i] * w_B[k, a]
                f_I[k, i] += R_BI[a, i] * at_I[a]
    return w_I, f_I


def _gyro_sheet(p: ImuParameters) -> TriadParameters:
    return TriadParameters(
        noise_density=p.gyro_noise_density_rad_s_rthz,
        bias_instability=p.gyro_bias_instability_rad_s,
        bias_correlation_s=p.gyro_bias_correlation_s,
        random_walk=p.gyro_rate_random_walk_rad_s_rts,
        turn_on_bias_sigma=p.gyro_turn_on_bias_sigma_rad_s,
        scale_factor_sigma=p.gyro_scale_factor_sigma,
        misalignment_sigma=p.gyro_misalignment_sigma_rad,
        cross_sensitivity_sigma=p.gyro_g_sensitivity_sigma_rad_s_m,
        bandwidth_hz=p.gyro_bandwidth_hz,
        damping_ratio=p.gyro_damping_ratio,
        range=p.gyro_range_rad_s,
        quantum=p.gyro_quantum_rad_s,
    )


def _accelerometer_sheet(p: ImuParameters) -> TriadParameters:
    return TriadParameters(
        noise_density=p.accelerometer_noise_density_m_s2_rthz,
        bias_instability=p.accelerometer_bias_instability_m_s2,
        bias_correlation_s=p.accelerometer_bias_correlation_s,
        random_walk=p.accelerometer_random_walk_m_s2_rts,
        turn_on_bias_sigma=p.accelerometer_turn_on_bias_sigma_m_s2,
        scale_factor_sigma=p.accelerometer_scale_factor_sigma,
        misalignment_sigma=p.accelerometer_misalignment_sigma_rad,
        cross_sensitivity_sigma=0.0,
        bandwidth_hz=p.accelerometer_bandwidth_hz,
        damping_ratio=p.accelerometer_damping_ratio,
        range=p.accelerometer_range_m_s2,
        quantum=p.accelerometer_quantum_m_s2,
    )


def _row(vector: Array) -> Array:
    row = np.empty((1, 3))
    row[0] = vector
    return row


def _rows(motion: Array | None, part: slice, still: Array) -> Array:
    return np.tile(still, (part.stop - part.start, 1)) if motion is None else _contiguous(motion[part])


def _contiguous(array: Array) -> Array:
    """Return a copy of the one layout that the kernels are compiled for."""
    return np.array(array, dtype=float, order="C")
