"""Whether the bound of a ring is reached: many noisy frames of one pose, each solved from the true pose.

    efficiency = RMSE / bound,    1 when the bound is reached                       (1)

A flat ring seen from the front does not reach it far away: the cost is then flat over both of its attitudes, tilts of
either sign shorten the ring's image, and the solution pays for a tilt with a nearer drogue (bias). No start helps.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.rotations import exp
from dockair.scenarios.design_ring.ranking import Corridor, RingDesign, bound_at


@dataclass(frozen=True, slots=True, kw_only=True)
class Trials:
    """Errors of one node beside the bound."""

    design: RingDesign
    range_m: float
    tilt_rad: float
    trials: int
    failures: int  #: descents that did not converge; not in the figures
    range_bias_m: float
    range_efficiency: float
    lateral_efficiency: float
    attitude_efficiency: float

    def to_dict(self) -> dict[str, Any]:
        """Return it as one JSON object, None where no descent converged."""
        table = asdict(self) | {"ring": self.design.label}
        return {key: None if isinstance(value, float) and np.isnan(value) else value for key, value in table.items()}


def try_ring(
    design: RingDesign,
    corridor: Corridor,
    range_m: float,
    trials: int,
    rng: np.random.Generator,
    tilt_rad: float = 0.0,
) -> Trials:
    """Solve noisy frames of one node; the bound must exist there."""
    bound = bound_at(design, corridor, range_m, tilt_rad)
    points = design.points_D[bound.seen]
    R_CD, p_CD = exp(np.array([0.0, tilt_rad, 0.0])), np.array([range_m, 0.0, 0.0])
    true = corridor.camera.pixels_from_points(points @ R_CD.T + p_CD)
    sigma = np.full(len(points), corridor.sigma_px)
    errors = []
    for _ in range(trials):
        noisy = true + corridor.sigma_px * rng.standard_normal(true.shape)
        end = levenberg_marquardt(lines_of_sight_from_pixels(noisy, points, corridor.camera, sigma), R_CD, p_CD)
        if end.converged:
            errors.append(pose_difference(end.R_CD, end.p_CD, R_CD, p_CD))
    found = np.array(errors) if errors else np.full((1, 6), np.nan)
    square = np.mean(found**2, axis=0)
    return Trials(
        design=design,
        range_m=range_m,
        tilt_rad=tilt_rad,
        trials=trials,
        failures=trials - len(errors),
        range_bias_m=float(found[:, 3].mean()),
        range_efficiency=float(np.sqrt(square[3]) / bound.range_sigma_m),
        lateral_efficiency=float(np.sqrt(square[4:].sum()) / bound.lateral_sigma_m),
        attitude_efficiency=float(np.sqrt(square[:3].sum()) / bound.attitude_sigma_rad),
    )
