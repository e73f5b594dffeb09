"""How a drogue swings on its hose: the model that guidance foretells with (`drogue_motion`).

Each axis of the drogue's place y_D, on the receiver's own scale, is drift plus the modes i of a hose with a drogue on
its end, a swing (i = 1) and two overtones, that gusts g drive, each by its share q_i, and noise of their own;
the receiver's bow wave b pushes the swing:

    m' = d,   d' = noise;     s_i'' = -omega_i^2 s_i - 2 zeta_i omega_i s_i' + q_i g + noise,   b besides for i = 1
    g' = -g/T + noise;        y_D = m + sum_i s_i                                                         (1)

What a gust gives the drogue the hose takes back when the wave from the pod has come down, half a second later: that is
the overtones' part. The gust reaches the receiver, too, and gives its tip the velocity dw of [own_path, eq 4]; up,

    s_i' <- s_i' + c_i dw,     g <- g + c_g dw                                                            (2)

The state of an axis is (m, d, s_i, s_i', g), n numbers.

Other frequencies, for another hose or drogue, are for `multiple_models` to find.

Not modelled: coupling of the axes, what the bow wave does to the overtones. Forward there is the reel: one mode, and
nothing is felt.
Settings: frequencies, and to the left damping, of the nominal hose's own linear modes (15 m, drogue of 20 kg) at
180 m/s; all else fitted so that places are foretold best 0.2-0.5 s ahead in moderate gusts, as one would to records of
flight. The peers' hoses and research on hose-drogue dynamics give 0.2-0.5 Hz for the swing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from dockair.errors import DockairError, check_numbers, keep_tuples
from dockair.rotations import Array

#: Of the states: m and d come before it, then place and rate of each mode, then g.
FIRST_MODE = 2
_FITTED_AT_PA = 10_690.0  # dynamic pressure at 180 m/s and 6000 m
_STIFFENS = 0.4  # frequencies over dynamic pressure: at 120 m/s and 3000 m, 0.61 of it, 0.83 foretells best


@dataclass(frozen=True, slots=True, kw_only=True)
class HoseMode:
    """A mode of the hose; (3,) values are forward, left, up."""

    frequency_hz: tuple[float, float, float]
    damping: tuple[float, float, float]
    gust_density: tuple[float, float, float]  # q_i, of a g' of one [m/s^3/sqrt(Hz)]; below zero: against the swing
    felt_share: tuple[float, float, float] = (0.0, 0.0, 0.0)  # c_i

    def __post_init__(self) -> None:
        check_numbers("guidance.predictive.swing.modes", self, signed=("gust_density", "felt_share"))
        keep_tuples(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingSettings:
    """Model of the drogue's motion; (3,) values are forward, left, up."""

    modes: tuple[HoseMode, ...] = (
        HoseMode(
            frequency_hz=(0.45, 0.345, 0.432),
            damping=(0.27, 0.072, 0.176),
            gust_density=(1.0, 0.896, 2.797),
            felt_share=(0.0, 0.0, -0.651),
        ),
        HoseMode(
            frequency_hz=(0.9, 0.864, 0.901),
            damping=(0.5, 0.028, 0.027),
            gust_density=(0.0, -0.208, -2.001),
            felt_share=(0.0, 0.0, -0.117),
        ),
        HoseMode(
            frequency_hz=(1.5, 1.497, 1.517),
            damping=(0.5, 0.016, 0.058),
            gust_density=(0.0, 0.127, -0.697),
            felt_share=(0.0, 0.0, 0.428),
        ),
    )
    #: T: what drives the swing is all but white in its rate, as gusts are above 0.1 Hz; 3 to 10 s foretell alike.
    gust_time_s: tuple[float, float, float] = (3.0, 3.0, 3.0)
    gust_felt_share: tuple[float, float, float] = (0.0, 0.0, 1.522)  # c_g [1/(m/s)]
    #: Of every s_i'': what drives a mode by itself [m/s^2/sqrt(Hz)]. Forward there is the reel, and no mode.
    rattle_density: tuple[float, float, float] = (0.0, 0.02, 0.126)
    drift_sigma_m_s: float = 0.4  # of d at the start: the inertial velocity's bias, twice its 0.2 m/s
    drift_kept_sigma_m_s: float = 0.09  # of d where the swing alone is begun anew: it has not changed much meanwhile
    drift_density: float = 0.03  # of d' [m/s^2/sqrt(Hz)]: the inertial velocity's drift, gusts far below the swing
    #: Of the place in a tick of 0.01 s; at other rates the same white noise. The fusion knows the place better than its
    #: rate, for which it has its own model of the drogue: this one does without.
    position_sigma_m: tuple[float, float, float] = (0.001, 0.001, 0.001)
    #: r of `multiple_models`: of hoses of 10 to 23 m on which drogues of 15 to 30 kg drag by 0.6 to 1.0 the frequencies
    #: that foretold best lay from 0.6 to 1.5. Steps of 1.2 leave 2 % more unforeseen, of 1.1 as much less.
    frequency_ratios: tuple[float, ...] = (0.658, 0.756, 0.870, 1.0, 1.15, 1.322, 1.521)
    ratio_sigma: float = 0.2  # of ln r, before a drogue has been seen; 0.15 to 0.3 foretell alike within 1 %
    ratio_memory_s: float = 10.0  # T_m; 10 and 20 s foretell alike within 2 %
    unforeseen_s: float = 0.2  # T_n: of what none of the models foresees; 0.1 to 0.2 s foretell alike within 2 %

    def __post_init__(self) -> None:
        zero = "rattle_density", "drift_density"
        check_numbers("guidance.predictive.swing", self, zero=zero, signed=("gust_felt_share",))
        given: object = self.modes
        modes = given if isinstance(given, Sequence) else ()
        if not modes or not all(isinstance(mode, HoseMode) for mode in modes):
            raise DockairError("guidance.predictive.swing.modes", expected="one HoseMode or more", got=given)
        keep_tuples(self)

    def at(self, dynamic_pressure_pa: float) -> "SwingSettings":
        """Return the same for another dynamic pressure [Pa], which stretches the hose more or less across."""
        return self.stiffened(frequency_ratio(dynamic_pressure_pa))

    def stiffened(self, k: float) -> "SwingSettings":
        """Return the same with frequencies across k times as high."""
        across = ((mode.frequency_hz[0], k * mode.frequency_hz[1], k * mode.frequency_hz[2]) for mode in self.modes)
        modes = (replace(mode, frequency_hz=f) for mode, f in zip(self.modes, across, strict=True))
        return replace(self, modes=tuple(modes))


def frequency_ratio(dynamic_pressure_pa: float) -> float:
    """Return the modes' frequencies across at a dynamic pressure [Pa], of those that the settings have."""
    return float((dynamic_pressure_pa / _FITTED_AT_PA) ** _STIFFENS)


def dynamics(settings: SwingSettings, axis: int) -> Array:
    """(n, n) A of Eq. (1), b apart."""
    n = FIRST_MODE + 2 * len(settings.modes) + 1
    A = np.zeros((n, n))
    A[0, 1] = 1.0
    for i, mode in enumerate(settings.modes):
        omega, s = 2.0 * np.pi * mode.frequency_hz[axis], FIRST_MODE + 2 * i
        A[s, s + 1] = 1.0
        A[s + 1, s : s + 2] = -(omega**2), -2.0 * mode.damping[axis] * omega
        A[s + 1, -1] = mode.gust_density[axis]
    A[-1, -1] = -1.0 / settings.gust_time_s[axis]
    return A


def _drive(settings: SwingSettings, axis: int) -> Array:
    """(n, n) densities, squared, of what drives Eq. (1); that of g' is one."""
    densities = np.zeros(FIRST_MODE + 2 * len(settings.modes) + 1)
    densities[1], densities[FIRST_MODE + 1 : -1 : 2] = settings.drift_density, settings.rattle_density[axis]
    densities[-1] = 1.0
    return np.diag(densities**2)


def held_push(A: Array, step_s: float) -> Array:
    """(n,) what an acceleration of the swing of one, held for a step, adds to the state."""
    n = len(A)
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[FIRST_MODE + 1, n] = A, 1.0
    return np.asarray(expm(augmented * step_s)[:n, n])


@lru_cache(maxsize=128)
def step_noise(settings: SwingSettings, axis: int, step_s: float) -> Array:
    """(n, n) covariance of what drives Eq. (1) over a step, by Van Loan's method."""
    A, drive = dynamics(settings, axis), _drive(settings, axis)
    n = len(A)
    loan = expm(np.block([[-A, drive], [np.zeros_like(A), A.T]]) * step_s)
    Q = loan[n:, n:].T @ loan[:n, n:]
    return np.asarray(0.5 * (Q + Q.T))


@lru_cache(maxsize=128)
def any_moment(settings: SwingSettings, axis: int, drift_sigma_m_s: float) -> Array:
    """(n, n) covariance of a state at any moment, place and drift not known but for `drift_sigma_m_s`."""
    A, drive = dynamics(settings, axis), _drive(settings, axis)
    P = np.zeros_like(A)
    P[FIRST_MODE:, FIRST_MODE:] = solve_continuous_lyapunov(
        A[FIRST_MODE:, FIRST_MODE:], -drive[FIRST_MODE:, FIRST_MODE:]
    )
    P[0, 0], P[1, 1] = P[FIRST_MODE, FIRST_MODE], drift_sigma_m_s**2
    return P
