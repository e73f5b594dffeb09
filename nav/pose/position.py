"""Position of the drogue when its attitude is known from elsewhere: gyro and hose know it better than a far ring does.

The cost of `model` is minimised over p_CD alone, R_CD = R held. With N = H'WH at the end, in blocks (phi, delta), the
attitude's own error phi of covariance P goes into the position by what the LEDs would have answered to it:

    K = N_dd^-1 N_dp,     cov(delta) = N_dd^-1 + K P K',     cov(delta, phi) = -K P                       (1)

Foreshortening goes with the square of a tilt, so P counts to second order too: a ring believed frontal within 3 degrees
about both axes is in the mean tilted, seen shorter by 0.14 %, and would be placed as much too far. With a_i a_i'
summing to P and S_ij the second difference of the position along a_i and a_j,

    E(delta) = Sum_i S_ii / 2,     cov(delta) has Sum_ij S_ij S_ij' / 2 more                              (2)

There is one minimum, no mirror image, and no bias of the range from noise; LEDs on a line are no difficulty. Where the
image knows the tilt better than P, `solve_pose` with an `AttitudePrior` weighs both.
"""

from dataclasses import replace

import numpy as np

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.nav.pose.descent import descend
from dockair.nav.pose.estimate import PoseEstimate, PoseOptions, PoseStatus, estimate_of, no_pose
from dockair.nav.pose.levenberg_marquardt import LEVENBERG_MARQUARDT
from dockair.nav.pose.measurement import LinesOfSight, measure
from dockair.nav.pose.planar import position_for_attitude
from dockair.rotations import Array, exp

_LEAST_LEDS = 2
_DEFAULT = PoseOptions()


def solve_position(
    pixels: Array,
    points_D: Array,
    camera: Camera,
    R_CD: Array,
    *,
    attitude_covariance: Array,
    sigma_px: float | Array = 0.1,
    options: PoseOptions = _DEFAULT,
) -> PoseEstimate:
    """Return the position that best explains the LEDs' pixels under a known attitude; covariance by Eqs (1) and (2).

    Args:
        pixels: (n, 2) pixels (u, v); a row with NaN is an LED that was not seen. Two are enough.
        points_D: (n, 3) the same LEDs in drogue axes [m].
        camera: calibration, distortion included.
        R_CD: (3, 3) the attitude.
        attitude_covariance: (3, 3) of phi in camera axes [rad^2], independent of this frame; zeros for none.
        sigma_px: standard deviation of a pixel coordinate, one for all or (n,).
        options: residuals, weight and loss.

    Raises:
        DockairError: wrong shapes, numbers that are not finite, sigma not positive.
    """
    sight, seen, apart = measure(pixels, points_D, camera, sigma_px, residuals=options.residuals, weight=options.weight)
    R, P = np.ascontiguousarray(R_CD, dtype=float), np.ascontiguousarray(attitude_covariance, dtype=float)
    for name, value in (("R_CD", R), ("attitude_covariance", P)):
        if value.shape != (3, 3) or not np.isfinite(value).all():
            raise DockairError(name, expected="an array (3, 3) of finite numbers", got=value.shape)
    if apart < _LEAST_LEDS:
        return no_pose(PoseStatus.TOO_FEW_LEDS, len(seen))
    settings = replace(LEVENBERG_MARQUARDT, huber_sigma=options.huber_sigma)
    start = position_for_attitude(sight.rays, sight.points_D, R)
    end = descend(sight, R, start, settings, hold_attitude=True)
    if end.converged:
        shift, more = _second_order(sight, R, P)
        covariance = _first_order(end.information, P)
        covariance[3:, 3:] += more
        end = replace(end, R_CD=R, p_CD=end.p_CD + shift, covariance=covariance)
    return estimate_of(end, sight, seen)


def _first_order(information: Array, P: Array) -> Array:
    """(6, 6) Eq. (1)."""
    inverse = np.linalg.inv(information[3:, 3:])
    K = inverse @ information[3:, :3]
    return np.block([[P, -P @ K.T], [-K @ P, inverse + K @ P @ K.T]])


def _second_order(sight: LinesOfSight, R: Array, P: Array) -> tuple[Array, Array]:
    """(3,) and (3, 3) Eq. (2)."""
    if not P.any():
        return np.zeros(3), np.zeros((3, 3))
    values, vectors = np.linalg.eigh(P)
    steps = (vectors * np.sqrt(np.maximum(values, 0.0))).T

    def position(phi: Array) -> Array:
        return position_for_attitude(sight.rays, sight.points_D, exp(phi) @ R)

    middle, plus = position(np.zeros(3)), [position(step) for step in steps]
    S = np.empty((3, 3, 3))
    for i in range(3):
        S[i, i] = plus[i] + position(-steps[i]) - 2.0 * middle
        for j in range(i):
            S[i, j] = S[j, i] = position(steps[i] + steps[j]) - plus[i] - plus[j] + middle
    return 0.5 * np.einsum("iik->k", S), 0.5 * np.einsum("ijk,ijl->kl", S, S)
