"""Where the drogue will be in a moment: its swing across the probe's line, estimated on the receiver's own scale.

The receiver's velocity in W is unknown, but what it was told to do is not: after its response time it flies u. With
y_r the integral of u so delayed, y_D = e + y_r is the drogue's place on a scale that drifts steadily with the bias of
the receiver's inertial velocity. Each axis of y_D is modelled as drift plus a swing that the gusts drive:

    m' = d,   d' = noise;     s'' = -omega^2 s - 2 zeta omega s' + noise;     y_D = m + s             (1)

A Kalman filter of constant gain (the Riccati equation solved once) follows (m, d, s, s') from e and its rate. Its
prediction over the response time is what a command given now can still meet.

Not modelled: the bow wave, coupling of the axes, the change of frequency with the hose's length.
Settings: a 15 m hose with a 20 kg drogue at 180 m/s swings near 0.33 Hz across and 0.4 Hz up and down, in the
simulated hose as in the peers' (research on hose-drogue dynamics gives 0.2-0.5 Hz).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingSettings:
    """Model of the drogue's motion; (2,) values are left and up."""

    frequency_hz: tuple[float, float] = (0.33, 0.40)
    damping: float = 0.15  # of the swing, between its bare pendulum and what the gusts' own spectrum adds
    swing_acceleration_density: float = 0.15  # [m/s^2/sqrt(Hz)], excursion of some 0.07 m at 0.33 Hz
    drift_acceleration_density: float = 0.05  # [m/s^2/sqrt(Hz)], gusts slower than the swing
    position_sigma_m: float = 0.01  # of the fused relative position, its error being correlated over frames
    rate_sigma_m_s: float = 0.06  # of its rate, likewise


class DrogueMotion:
    """Filter of Eq. (1) for the axes left and up.

    Args:
        settings: the model.
        step_s: control period [s].
        lead_s: how far ahead `ahead` predicts: the receiver's response time [s].
    """

    def __init__(self, settings: SwingSettings, step_s: float, lead_s: float) -> None:
        H = np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
        noise = np.diag([settings.position_sigma_m, settings.rate_sigma_m_s]) ** 2
        self._H = H
        self._x = np.zeros((2, 4))
        self._F, self._K, self._lead, self._rates = [], [], [], []
        for frequency_hz in settings.frequency_hz:
            omega = 2.0 * np.pi * frequency_hz
            A = np.zeros((4, 4))
            A[0, 1] = A[2, 3] = 1.0
            A[3, 2:] = -(omega**2), -2.0 * settings.damping * omega
            F = expm(A * step_s)
            drive = [0.0, settings.drift_acceleration_density**2, 0.0, settings.swing_acceleration_density**2]
            P = solve_discrete_are(F.T, H.T, np.diag(drive) * step_s, noise)
            self._F.append(F)
            self._K.append(P @ H.T @ np.linalg.inv(H @ P @ H.T + noise))
            self._lead.append(expm(A * lead_s))
            self._rates.append(A)

    def start(self, position_m: Array, rate_m_s: Array) -> None:
        """Begin anew with everything taken for drift; (2,) each, left and up."""
        self._x = np.column_stack([position_m, rate_m_s, np.zeros((2, 2))])

    def step(self, position_m: Array | None, rate_m_s: Array | None) -> None:
        """Advance by one control period; (2,) place and velocity on the receiver's scale, or None if not seen."""
        for axis in range(2):
            x = self._F[axis] @ self._x[axis]
            if position_m is not None and rate_m_s is not None:
                innovation = np.array([position_m[axis], rate_m_s[axis]]) - self._H @ x
                x = x + self._K[axis] @ innovation
            self._x[axis] = x

    @property
    def drift_m_s(self) -> Array:
        """(2,) velocity without the swing."""
        return self._x[:, 1].copy()

    def ahead(self) -> tuple[Array, Array, Array]:
        """(2,) place [m], velocity [m/s] and acceleration [m/s^2] after the lead time."""
        x = [lead @ now for lead, now in zip(self._lead, self._x, strict=True)]
        derivative = [A @ later for A, later in zip(self._rates, x, strict=True)]
        place = np.array([self._H @ later for later in x])
        change = np.array([self._H[1] @ d for d in derivative])
        return place[:, 0], place[:, 1], change
