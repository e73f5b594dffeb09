"""How a drogue swings on its hose: the model that guidance foretells with (`drogue_motion`).

Each axis of the drogue's place y_D, on the receiver's own scale, is drift plus the modes i of a hose with a drogue on
its end, a swing (i = 1) and two overtones, that coloured gusts g drive, each by its share q_i, and noise of their own;
the receiver's bow wave b pushes the swing:

    m' = d,   d' = noise;     s_i'' = -omega_i^2 s_i - 2 zeta_i omega_i s_i' + q_i g + noise,   b besides for i = 1
    g' = -g/T + noise;        y_D = m + sum_i s_i                                                         (1)

What a gust gives the drogue the hose takes back when the wave from the pod has come down, half a second later: that is
the overtones' part. The gust reaches the receiver, too, and its tip is felt to change its velocity by df; with it, up,
the modes'

    s_i' <- s_i' + c_i df                                                                                 (2)

The state of an axis is (m, d, s_i, s_i', g), n numbers.

Not modelled: coupling of the axes, other frequencies for another length of hose, how a gust that is felt goes on, what
the bow wave does to the overtones. Forward there is the reel: one mode, well damped, and nothing is felt.
Settings: fitted to the simulated drogue (15 m of hose, 20 kg) at 180 m/s in moderate gusts, as one would to a record of
flight; the peers' hoses and research on hose-drogue dynamics give 0.2-0.5 Hz for the swing.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

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


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingSettings:
    """Model of the drogue's motion; (3,) values are forward, left, up."""

    modes: tuple[HoseMode, ...] = (
        HoseMode(
            frequency_hz=(0.44, 0.345, 0.433),
            damping=(0.5, 0.073, 0.177),
            gust_density=(0.7, 1.49, 4.09),
            felt_share=(0.0, 0.0, -0.52),
        ),
        HoseMode(
            frequency_hz=(0.9, 0.869, 0.865),
            damping=(0.5, 0.03, 0.074),
            gust_density=(0.0, -0.4, 1.76),
            felt_share=(0.0, 0.0, -0.83),
        ),
        HoseMode(
            frequency_hz=(1.5, 1.486, 1.437),
            damping=(0.5, 0.03, 0.051),
            gust_density=(0.0, 0.11, -1.38),
            felt_share=(0.0, 0.0, 0.87),
        ),
    )
    gust_time_s: tuple[float, float, float] = (1.2, 2.8, 0.7)  # T
    #: Of every s_i'': what drives a mode by itself [m/s^2/sqrt(Hz)]. Forward there is the reel, and no mode.
    rattle_density: tuple[float, float, float] = (0.0, 0.035, 0.035)
    drift_sigma_m_s: float = 0.4  # of d at the start: the inertial velocity's bias, twice its 0.2 m/s
    drift_kept_sigma_m_s: float = 0.1  # of d where the swing alone is begun anew: it has not changed much meanwhile
    drift_density: float = 0.03  # of d' [m/s^2/sqrt(Hz)]: the inertial velocity's drift, gusts far below the swing
    #: Of the place, and of its rate, in a tick of 0.01 s; at other rates the same white noise. The camera knows the
    #: place across to a millimetre, but for what does not change; the fusion's rate is as good as its own model of the
    #: drogue, 0.05 m/s left and 0.08 m/s up in error.
    position_sigma_m: tuple[float, float, float] = (0.02, 0.002, 0.002)
    rate_sigma_m_s: tuple[float, float, float] = (0.05, 0.12, 0.12)
    rate_lag_s: float = 0.015  # tau_v: half a frame, its way here, and what the fusion's own filter needs

    def at(self, dynamic_pressure_pa: float) -> "SwingSettings":
        """Return the same for another dynamic pressure [Pa], which stretches the hose more or less across."""
        k = frequency_ratio(dynamic_pressure_pa)
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


def rate_row(settings: SwingSettings, A: Array) -> Array:
    """(n,) what is seen of the rate, b apart: late by tau_v."""
    rate = np.append((np.arange(len(A) - 1) % 2 == 1).astype(float), 0.0)
    return np.asarray(rate - settings.rate_lag_s * (rate @ A))


def held_push(A: Array, step_s: float) -> Array:
    """(n,) what an acceleration of the swing of one, held for a step, adds to the state."""
    n = len(A)
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[FIRST_MODE + 1, n] = A, 1.0
    return np.asarray(expm(augmented * step_s)[:n, n])


@lru_cache(maxsize=24)
def step_noise(settings: SwingSettings, axis: int, step_s: float) -> Array:
    """(n, n) covariance of what drives Eq. (1) over a step, by Van Loan's method."""
    A, drive = dynamics(settings, axis), _drive(settings, axis)
    n = len(A)
    loan = expm(np.block([[-A, drive], [np.zeros_like(A), A.T]]) * step_s)
    Q = loan[n:, n:].T @ loan[:n, n:]
    return np.asarray(0.5 * (Q + Q.T))


@lru_cache(maxsize=24)
def any_moment(settings: SwingSettings, axis: int, drift_sigma_m_s: float) -> Array:
    """(n, n) covariance of a state at any moment, place and drift not known but for `drift_sigma_m_s`."""
    A, drive = dynamics(settings, axis), _drive(settings, axis)
    P = np.zeros_like(A)
    P[FIRST_MODE:, FIRST_MODE:] = solve_continuous_lyapunov(
        A[FIRST_MODE:, FIRST_MODE:], -drive[FIRST_MODE:, FIRST_MODE:]
    )
    P[0, 0], P[1, 1] = P[FIRST_MODE, FIRST_MODE], drift_sigma_m_s**2
    return P
