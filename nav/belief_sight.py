"""What a frame shows of what is believed: the belief, and the pose and LEDs seen by a camera that is a little off.

With c = p_CD_B from the camera to the ring's centre, the camera turned by k_1, misplaced by k_2, of scale 1 + k_3
(focal length, ring's diameter), the pose that it shows is off from the true one

    phi_seen = phi - k_1,   p_seen = p - k_1 x c - k_2 - k_3 c                                        (1)

and each LED is off its place in the ring's plane by d. A pose solved with the LEDs taken to be in place is off by

    J d,   J = (H'H)^-1 H' H_d                                                                        (2)

Not modelled: LEDs out of the ring's plane, which are seen at the sine of the tilt; errors of the lens's distortion.
"""

from dataclasses import dataclass

import numpy as np

from dockair.calibration import Camera, Mounting
from dockair.nav.belief_frame import Seen
from dockair.nav.belief_motion import CALIBRATION, ERRORS, RING, B, S, V
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.prior import PosePrior
from dockair.rotations import Array, skew

_TILT_FLOOR = 1e-9  # of the largest information: below it a pose is not determined, and the LEDs' places move nothing


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """One Gaussian."""

    R_BD: Array  #: (3, 3)
    x: Array  #: (6, 3) rows of `belief_motion`: p_ID, v_ID, swing, its rate, the gyro's bias, formation
    P: Array  #: (44, 44) of the errors
    log_weight: float = 0.0

    @property
    def p_ID(self) -> Array:
        """(3,) ring centre from the accelerometers, body axes [m]."""
        return np.asarray(self.x[S])

    @property
    def v_ID(self) -> Array:
        """(3,) its velocity less that of the accelerometers, body axes, not seen from turning axes [m/s]."""
        return np.asarray(self.x[V])

    @property
    def bias(self) -> Array:
        """(3,) of the gyro, body axes [rad/s]."""
        return np.asarray(self.x[B])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Apparent:
    """The pose that a frame would show, Eq. (1)."""

    R_CD: Array  #: (3, 3)
    p_CD: Array  #: (3,) [m]
    M: Array  #: (6, 44) its errors (phi, delta) in camera axes, per error of the belief
    covariance: Array  #: (6, 6)

    @property
    def prior(self) -> PosePrior:
        """As a prior for a frame's pose."""
        return PosePrior(R_CD=self.R_CD, p_CD=self.p_CD, covariance=self.covariance)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sight:
    """How the camera sits and what it looks at."""

    mounting: Mounting
    points_D: Array  #: (8, 3) LEDs of the ring [m]

    def apparent(self, belief: Belief, *, solved: bool = False) -> Apparent:
        """Return the pose that a frame would show, with how it depends on the errors of a belief.

        Args:
            belief: what is believed.
            solved: the pose that is found of a frame with the LEDs taken to be where the sheet says.
        """
        R_CB = self.mounting.R_BC.T
        p_CD_B = belief.p_ID + self.mounting.p_BI - self.mounting.p_BC
        R_CD, p_CD = R_CB @ belief.R_BD, R_CB @ p_CD_B
        M = np.zeros((6, ERRORS))
        M[:3, :3] = M[3:, 3:6] = R_CB
        first = CALIBRATION.start
        M[:3, first : first + 3] = -R_CB
        M[3:, first : first + 3] = R_CB @ skew(p_CD_B)
        M[3:, first + 3 : first + 6] = -R_CB
        M[3:, first + 6] = -p_CD
        if solved:
            M[:, RING] = ring_sensitivity(R_CD, p_CD, self.points_D)
        covariance = M @ belief.P @ M.T
        return Apparent(R_CD=R_CD, p_CD=p_CD, M=M, covariance=0.5 * (covariance + covariance.T))

    def shown(self, belief: Belief, sight: LinesOfSight) -> tuple[Seen, Array]:
        """Return what the LEDs of a frame should show, and (6 + 2n, 44) its errors per error of the belief."""
        apart2 = ((sight.points_D[:, None, :] - self.points_D[None, :, :]) ** 2).sum(axis=2)
        numbers = apart2.argmin(axis=1)
        seen = self.apparent(belief)
        M = np.zeros((6 + 2 * len(numbers), ERRORS))
        M[:6] = seen.M
        rows = 6 + np.arange(2 * len(numbers))
        M[rows, RING.start + (2 * numbers[:, None] + np.arange(2)).ravel()] = 1.0
        C = M @ belief.P @ M.T
        points = np.ascontiguousarray(self.points_D[numbers])
        return Seen(R_CD=seen.R_CD, p_CD=seen.p_CD, points_D=points, C=0.5 * (C + C.T)), M

    def led_pixels(self, belief: Belief, camera: Camera) -> tuple[Array, Array]:
        """Where the LEDs should be seen.

        Returns:
            (8, 2) pixels, NaN behind the camera; (8,) standard deviation of each in its worst direction [px], without
            the centroid's noise, the lens's distortion neglected.
        """
        seen = self.apparent(belief)
        a = self.points_D @ seen.R_CD.T
        pixels = camera.pixels_from_points(a + seen.p_CD)
        x, y, z = np.where(np.isfinite(pixels[:, :1]), a + seen.p_CD, np.nan).T
        G, arm = np.zeros((len(a), 2, 3)), np.zeros((len(a), 3, 3))
        G[:, 0, 0], G[:, 1, 0], G[:, 0, 1] = y / x**2, z / x**2, -1.0 / x
        G[:, 1, 2] = G[:, 0, 1]
        arm[:, 0, 1], arm[:, 0, 2], arm[:, 1, 2] = a[:, 2], -a[:, 1], a[:, 0]
        arm[:, 1, 0], arm[:, 2, 0], arm[:, 2, 1] = -a[:, 2], a[:, 1], -a[:, 0]
        H = (G @ arm) @ seen.M[:3] + G @ seen.M[3:]
        moved = G @ seen.R_CD[:, 1:]
        for k in range(len(a)):
            H[k, :, RING.start + 2 * k : RING.start + 2 * k + 2] += moved[k]
        S = H @ belief.P @ H.transpose(0, 2, 1)
        half, cross = 0.5 * (S[:, 0, 0] - S[:, 1, 1]), S[:, 0, 1]
        largest = 0.5 * (S[:, 0, 0] + S[:, 1, 1]) + np.sqrt(half**2 + cross**2)  # eigenvalue
        return pixels, camera.focal_length_px * np.sqrt(largest)


def ring_sensitivity(R_CD: Array, p_CD: Array, points_D: Array) -> Array:
    """(6, 16) J of Eq. (2): how the pose that explains all LEDs moves with the y and z of each."""
    arm_C = points_D @ R_CD.T
    at_C = arm_C + p_CD
    G = np.zeros((len(points_D), 2, 3))  # of (-y/x, -z/x), the image but for the focal length
    G[:, 0, 0], G[:, 1, 0] = at_C[:, 1] / at_C[:, 0] ** 2, at_C[:, 2] / at_C[:, 0] ** 2
    G[:, 0, 1] = G[:, 1, 2] = -1.0 / at_C[:, 0]
    turn = np.zeros((len(points_D), 3, 3))
    turn[:, 0, 1], turn[:, 0, 2], turn[:, 1, 2] = arm_C[:, 2], -arm_C[:, 1], arm_C[:, 0]
    turn[:, 1, 0], turn[:, 2, 0], turn[:, 2, 1] = -arm_C[:, 2], arm_C[:, 1], -arm_C[:, 0]
    H = np.concatenate([G @ turn, G], axis=2).reshape(-1, 6)
    H_ring = np.zeros((2 * len(points_D), 2 * len(points_D)))
    for k, moved in enumerate(G @ R_CD[:, 1:]):
        H_ring[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = moved
    scale = np.sqrt((H * H).sum(axis=0))
    values, vectors = np.linalg.eigh((H / scale).T @ (H / scale))
    weak = values < _TILT_FLOOR * values[-1]
    inverse = (vectors * np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, values))) @ vectors.T
    return np.asarray(inverse @ (H / scale).T @ H_ring / scale[:, None])
