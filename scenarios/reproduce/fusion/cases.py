"""What many made-up approaches say of the relative filter: how large its errors are, and whether it knows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from dockair.rotations import Array
from dockair.scenarios.reproduce.fusion.flight import Approach, fly
from dockair.scenarios.reproduce.fusion.follow import Track, Watching, follow

_SETTLED_FRAMES = 5  # the start geometry is not normal enough to be counted
_BAND = (0.025, 0.975)
_FAR_M, _NEAR_M, _INSIDE_M = (9.0, 11.0), 5.0, 10.0
_SEED = 71


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One kind of approach, and what the filter believes of it."""

    name: str
    approach: Approach
    watching: Watching


def tracks(case: Case, seeds: int) -> list[Track]:
    """Fly and follow as many approaches."""
    return [
        follow(fly(case.approach, seed), case.watching, np.random.default_rng((_SEED, seed))) for seed in range(seeds)
    ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Consistency:
    """Averages over approaches, frame by frame."""

    time_s: Array
    nees: Array  #: (k,) per degree of freedom
    nis: Array  #: (k,) likewise
    nees_band: tuple[float, float]  #: 95 %
    nis_band: tuple[float, float]

    @staticmethod
    def _inside(values: Array, band: tuple[float, float]) -> float:
        offered = values[np.isfinite(values)]
        return float(np.mean((offered > band[0]) & (offered < band[1])))

    @property
    def nees_inside(self) -> float:
        """Share of the frames whose average is in the band."""
        return self._inside(self.nees, self.nees_band)

    @property
    def nis_inside(self) -> float:
        """Likewise."""
        return self._inside(self.nis, self.nis_band)


def consistency(flown: Sequence[Track]) -> Consistency:
    """Return the averages; of the innovations those of frames that were offered."""
    nees = np.mean([track.nees for track in flown], axis=0)[_SETTLED_FRAMES:]
    ratio = np.array([track.nis / np.where(track.freedom > 0, track.freedom, np.nan) for track in flown])
    offered = np.isfinite(ratio).sum(axis=0)  # how many approaches had a frame then
    nis = np.where(offered > 0, np.nansum(ratio, axis=0) / np.maximum(offered, 1), np.nan)[_SETTLED_FRAMES:]
    count = len(flown)
    low, high = chi2.ppf(_BAND, 9 * count) / (9 * count)
    low_nis, high_nis = chi2.ppf(_BAND, 6 * count) / (6 * count)
    return Consistency(
        time_s=flown[0].time_s[_SETTLED_FRAMES:],
        nees=nees / 9.0,
        nis=nis,
        nees_band=(float(low), float(high)),
        nis_band=(float(low_nis), float(high_nis)),
    )


def figures(flown: Sequence[Track]) -> dict[str, float]:
    """Return errors by range, units in the names; across and attitude are lengths of two and three components."""
    settled = slice(_SETTLED_FRAMES, None)
    range_m = np.concatenate([track.range_m[settled] for track in flown])
    seen = np.concatenate([track.error_C[settled] for track in flown])
    error = np.concatenate([track.error[settled] for track in flown])
    far, near = (range_m > _FAR_M[0]) & (range_m < _FAR_M[1]), range_m < _NEAR_M
    inside = range_m < _INSIDE_M
    agreement = consistency(flown)
    return {
        "range_rmse_mm_at_10_m": 1e3 * _rms(seen[far, 3:4]),
        "range_bias_mm_at_10_m": 1e3 * float(seen[far, 3].mean()),
        "range_rmse_mm_inside_5_m": 1e3 * _rms(seen[near, 3:4]),
        "lateral_rmse_mm_at_10_m": 1e3 * _rms(seen[far, 4:6]),
        "lateral_rmse_mm_inside_5_m": 1e3 * _rms(seen[near, 4:6]),
        "miss_vector_rmse_mm_inside_5_m": 1e3 * _rms(error[near, 4:6]),
        "velocity_rmse_mm_s_inside_5_m": 1e3 * _rms(error[near, 6:]),
        "attitude_rmse_deg_inside_10_m": float(np.rad2deg(_rms(seen[inside, :3]))),
        "wrong_minimum_percent": 100.0 * float(np.mean([track.wrong_side[settled].mean() for track in flown])),
        "nees_over_n": float(agreement.nees.mean()),
        "nees_in_band_percent": 100.0 * agreement.nees_inside,
        "nis_over_n": float(np.nanmean(agreement.nis)),
        "nis_in_band_percent": 100.0 * agreement.nis_inside,
        "used_percent": 100.0 * float(np.mean([track.used.mean() for track in flown])),
    }


def _rms(errors: Array) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))
