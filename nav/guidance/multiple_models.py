"""The drogue on a hose that nobody has told about: filters for several frequencies side by side.

How quickly a drogue swings goes with its hose's length and weight and with its own weight and drag, of which a receiver
knows the usual ones at most. For each of a few ratios r a filter (`drogue_motion`) follows the drogue with all the
frequencies across of `swing_model` r times as high, and leaves nu unforeseen, whose variance it takes for S, but for a
factor: how strong the gusts are nobody has told either. With the likeliest factor, the mean of nu^2/S, minus the
logarithm of a filter's likelihood is

    N <- N e + dt/T_n,    A_r <- A_r e + dt/T_n nu^2/S,    B_r <- B_r e + dt/T_n ln S,    e = exp(-dt/T_m)  (1)
    l_r = sum (N ln(A_r/N) + B_r) / 2                                                                     (2)

forgotten in time T_m, and summed over left and up, for it is one hose. What is foretold is the mean by the weights

    w_r ~ exp(-l_r - (ln r)^2 / (2 sigma_r^2))                                                            (3)

(multiple-model adaptive estimation: Magill, IEEE Trans. Automatic Control 10, 1965, 434-439; Bar-Shalom, Li,
Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 11.6.2). There every nu counts; here as many
as are independent of each other, N: what a model leaves unforeseen it leaves so for some T_n.

Not modelled: that a long hose's overtones are lower by more than its swing is; other damping, other shares of what is
felt. On hoses and drogues drawn at random each of these would leave up to 7 % less unforeseen.
"""

import numpy as np

from dockair.kernels import njit
from dockair.nav.guidance.drogue_motion import DrogueMotion
from dockair.nav.guidance.swing_model import SwingSettings
from dockair.rotations import Array

_LEAST = 1e-3  # of all weight: a filter with less than this is followed, but has no say


class MultipleModels:
    """Eqs. (1) to (3); what it can be asked for is what `DrogueMotion` can.

    Args:
        settings: the model; ratios and constants of the equations.
        step_s: control period [s].
        lead_s: (3,) how far ahead `ahead` predicts: the receiver's response times [s].
        node_s: from one place of `path` to the next [s].
    """

    def __init__(self, settings: SwingSettings, step_s: float, lead_s: Array, node_s: float) -> None:
        ratios = np.array(settings.frequency_ratios)
        hoses = [settings.stiffened(r) for r in settings.frequency_ratios]
        self._filters = DrogueMotion(hoses, step_s, lead_s, node_s)
        self._usual_rad_s = 2.0 * np.pi * np.array([mode.frequency_hz for mode in settings.modes])  # (modes, 3)
        self._prior = 0.5 * (np.log(ratios) / settings.ratio_sigma) ** 2
        self._kept, self._counts = np.exp(-step_s / settings.ratio_memory_s), step_s / settings.unforeseen_s
        self._log_ratios = np.log(ratios)
        self._count = 1.0  # N: as if one nu had been as foreseen by all
        self._sums: Array = np.zeros((len(ratios), 2, 2))  # A_r and B_r, left and up
        self._sums[:, 0] = 1.0
        self._weigh()

    def _weigh(self) -> None:
        """Eqs. (2) and (3)."""
        A, B = self._sums[:, 0], self._sums[:, 1]
        cost = 0.5 * (self._count * np.log(A / self._count) + B).sum(axis=1) + self._prior
        weights = np.exp(cost.min() - cost)
        weights[weights < _LEAST * weights.sum()] = 0.0
        weights /= weights.sum()
        self._weights: Array = weights

    @property
    def frequency_ratio(self) -> float:
        """Geometric mean of r: how quickly the drogue swings across, of what the settings say."""
        return float(np.exp(self._weights @ self._log_ratios))

    def start(self, place_m: Array, velocity_m_s: Array) -> None:
        """Begin anew, at rest but for the swing; (3,) each. The hose is the one it was."""
        self._filters.start(place_m, velocity_m_s)

    def resume(self, place_m: Array) -> None:
        """Begin anew at a place (3,) where it comes into view again, whatever the swing; the drift stays as learnt."""
        self._filters.resume(place_m)

    def step(self, place_m: Array | None, push_m_s2: Array, blown_m_s: Array) -> None:
        """Advance by one control period.

        Args:
            place_m: (3,) on the receiver's scale, None if not seen.
            push_m_s2: (3,) b.
            blown_m_s: (3,) dw over the period.
        """
        self._filters.step(place_m, push_m_s2, blown_m_s)
        if place_m is not None and len(self._weights) > 1:
            self._count = self._kept * self._count + self._counts  # (1)
            self._sums = self._kept * self._sums + self._counts * self._filters.unforeseen[..., 1:]
            self._weigh()

    def _mean(self, of_each: Array) -> Array:
        """Mean of (hoses, ...) by the weights."""
        out = np.zeros(of_each.shape[1:])
        _add_weighted(self._weights, of_each.reshape(len(of_each), -1), out.reshape(-1))
        return out

    @property
    def drift_m_s(self) -> Array:
        """(3,) velocity without the swing."""
        return self._mean(self._filters.drift_m_s)

    @property
    def middle_m(self) -> Array:
        """(3,) m: the place without the swing."""
        return self._mean(self._filters.middle_m)

    @property
    def swing_m_s2(self) -> Array:
        """(3,) acceleration at the ends of the swing of now, if it were a swing of the usual hose.

        By its own frequencies a slow swing would ask for less; but on a long hose gusts do more that nobody foresees.
        """
        return self._mean(self._filters.swing_m_s2(self._usual_rad_s))

    def ahead(self, push_m_s2: Array, push_then_m_s2: Array) -> Array:
        """(3, 3) place [m], velocity [m/s] and acceleration [m/s^2] after the lead time, a row each.

        Args:
            push_m_s2: (3,) b now; until then it changes steadily, and the swing does not answer to it yet.
            push_then_m_s2: (3,) b after the lead time.
        """
        return self._mean(self._filters.ahead(push_m_s2, push_then_m_s2))

    def path(self, push_m_s2: Array) -> Array:
        """(n, 3) places [m] at the nodes after the lead time.

        Args:
            push_m_s2: (n + 2, 3) b now, after the lead time and at the nodes; in between it changes steadily.
        """
        return self._mean(self._filters.path(push_m_s2))

    def mean_path(self, nodes: int) -> Array:
        """(nodes, 3) the same without the swing: drift alone."""
        return self._mean(self._filters.mean_path(nodes))

    def mean_ahead(self) -> Array:
        """(3, 3) place, velocity and acceleration after the lead time without the swing: drift alone."""
        return self._mean(self._filters.mean_ahead())


@njit(cache=True)
def _add_weighted(weights: Array, values: Array, out: Array) -> None:
    """Add (n, m) times weights (n,) to (m,)."""
    for k in range(len(weights)):
        if weights[k] > 0.0:
            for i in range(len(out)):
                out[i] += weights[k] * values[k, i]
