"""What a frame shows of what is believed: the belief, and the pose and LEDs seen by a camera that is a little off.

With c = p_CD_B from the camera to the ring's centre, the camera turned by k_1, misplaced by k_2, of scale 1 + k_3
(focal length, ring's diameter), the pose that it shows is off from the true one

    phi_seen = phi - k_1,   p_seen = p - k_1 x c - k_2 - k_3 c                                        (1)

and each LED is off its place in the ring's plane by d. A pose solved with the LEDs taken to be in place is off by

    J d,   J = (H'H)^-1 H' H_d                                                                        (2)

Not modelled: LEDs out of the ring's plane, which are seen at the sine of the tilt; errors of the lens's distortion;
that a focal length which is off, unlike a diameter, moves the range alone: at its tolerance Eq. (1) takes the place
across for off by another 0.25 mm half a metre from the axis, beside 2 mm of the camera's own.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dockair.calibration import Camera, Mounting
from dockair.kernels import njit
from dockair.nav.belief_frame import Seen
from dockair.nav.belief_motion import CALIBRATION, RING, B, S, V
from dockair.nav.pose.measurement import LinesOfSight
from dockair.nav.pose.prior import PosePrior
from dockair.rotations import Array

_TILT_FLOOR = 1e-9  # of the largest information: below it a pose is not determined, and the LEDs' places move nothing


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """One Gaussian."""

    R_BD: Array  #: (3, 3)
    x: Array  #: (8, 3) rows of `belief_motion`: p_ID, v_ID, swing, its rate, gyro's bias, formation, turn to rest, gust
    P: Array  #: (50, 50) of the errors
    log_weight: float = 0.0
    ring: Array = field(default_factory=lambda: np.zeros(RING.stop - RING.start))
    #: (16,) how far each LED is off its place in the ring's plane [m]

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
    M: Array  #: (6, 50) its errors (phi, delta) in camera axes, per error of the belief
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
    larger: Array = field(init=False)  #: (16,) places of LEDs in a ring that is larger, of length one
    but_size: Array = field(init=False)  #: (16, 16) takes that away from places of LEDs

    def __post_init__(self) -> None:
        radii = self.points_D[:, 1:].ravel()
        larger = radii / np.linalg.norm(radii)
        object.__setattr__(self, "larger", larger)
        object.__setattr__(self, "but_size", np.eye(len(larger)) - np.outer(larger, larger))

    def apparent(self, belief: Belief, *, solved: bool = False) -> Apparent:
        """Return the pose that a frame would show, with how it depends on the errors of a belief.

        Args:
            belief: what is believed.
            solved: the pose that is found of a frame with the LEDs taken to be where the sheet says.
        """
        p_CD_B = belief.p_ID + self.mounting.p_BI - self.mounting.p_BC
        R_CD, p_CD, M, covariance = _seen(self.mounting.R_BC, belief.R_BD, p_CD_B, belief.P, CALIBRATION.start)
        if solved:
            M[:, RING] = ring_sensitivity(R_CD, p_CD, self.points_D)
            covariance = M @ belief.P @ M.T
            covariance = 0.5 * (covariance + covariance.T)
        return Apparent(R_CD=R_CD, p_CD=p_CD, M=M, covariance=covariance)

    def shown(self, belief: Belief, sight: LinesOfSight) -> tuple[Seen, Array]:
        """Return what the LEDs of a frame should show, and (6 + 2n, 50) its errors per error of the belief."""
        seen = self.apparent(belief)
        numbers, M, C = _with_leds(seen.M, seen.covariance, belief.P, self.points_D, sight.points_D, RING.start)
        return Seen(R_CD=seen.R_CD, p_CD=seen.p_CD, points_D=self.led_points_D(belief)[numbers], C=C), M

    def led_points_D(self, belief: Belief) -> Array:
        """(8, 3) places of the LEDs that are believed [m]."""
        points_D = self.points_D.copy()
        points_D[:, 1:] += belief.ring.reshape(-1, 2)
        return points_D

    def led_pixels(self, belief: Belief, seen: Apparent, camera: Camera) -> tuple[Array, Array]:
        """Where the LEDs should be seen.

        Args:
            belief: what is believed.
            seen: the pose that a frame would show of it.
            camera: how pixels follow from places.

        Returns:
            (8, 2) pixels, NaN behind the camera; (8,) standard deviation of each in its worst direction [px], without
            the centroid's noise, the lens's distortion neglected.
        """
        places_D = self.led_points_D(belief)
        ab, sigma = _leds_seen(places_D, seen.R_CD, seen.p_CD, seen.M, belief.P, CALIBRATION.start, RING.start)
        return camera.pixels_from_slopes(ab), camera.focal_length_px * sigma


@njit(cache=True, error_model="numpy")
def _seen(R_BC: Array, R_BD: Array, p_CD_B: Array, P: Array, turn: int) -> tuple[Array, Array, Array, Array]:
    """R_CD, p_CD, M (6, 50) and M P M' of Eq. (1); `turn` is the calibration's first column.

    Columns come as arguments: the compiler's cache would not see it when they changed in another file.
    """
    R_CD, p_CD, M, MP, covariance = (
        np.zeros((3, 3)),
        np.zeros(3),
        np.zeros((6, len(P))),
        np.zeros((6, 13)),
        np.empty((6, 6)),
    )
    x, y, z = p_CD_B[0], p_CD_B[1], p_CD_B[2]
    for i in range(3):
        u, v, w = R_BC[0, i], R_BC[1, i], R_BC[2, i]  # axis i of the camera
        for j in range(3):
            R_CD[i, j] = u * R_BD[0, j] + v * R_BD[1, j] + w * R_BD[2, j]
            M[i, j] = M[3 + i, 3 + j] = R_BC[j, i]
            M[i, turn + j] = M[3 + i, turn + 3 + j] = -R_BC[j, i]
        p_CD[i] = u * x + v * y + w * z
        M[3 + i, turn], M[3 + i, turn + 1], M[3 + i, turn + 2] = v * z - w * y, w * x - u * z, u * y - v * x
        M[3 + i, turn + 6] = -p_CD[i]
    for i in range(6):
        for a in range(13):  # columns of M that are not zero: phi, delta, calibration
            column = a if a < 6 else turn + a - 6
            for b in range(13):
                row = b if b < 6 else turn + b - 6
                MP[i, a] += M[i, row] * P[row, column]
        for j in range(i + 1):
            covariance[i, j] = 0.0
            for a in range(13):
                covariance[i, j] += MP[i, a] * M[j, a if a < 6 else turn + a - 6]
            covariance[j, i] = covariance[i, j]
    return R_CD, p_CD, M, covariance


@njit(cache=True, error_model="numpy")
def _with_leds(
    M_pose: Array, covariance: Array, P: Array, ring: Array, points: Array, first: int
) -> tuple[NDArray[np.int64], Array, Array]:
    """Numbers (n,) of LEDs at points (n, 3) of a ring (8, 3), M (6 + 2n, 50) of pose and LEDs, M P M'."""
    n = len(points)
    numbers, M, C = np.empty(n, np.int64), np.zeros((6 + 2 * n, len(P))), np.empty((6 + 2 * n, 6 + 2 * n))
    place = np.empty(2 * n, np.int64)
    M[:6], C[:6, :6] = M_pose, covariance
    for k in range(n):
        nearest = np.inf
        for m in range(len(ring)):
            apart2 = ((points[k] - ring[m]) ** 2).sum()
            if apart2 < nearest:
                nearest, numbers[k] = apart2, m
        place[2 * k], place[2 * k + 1] = first + 2 * numbers[k], first + 2 * numbers[k] + 1
    for i in range(2 * n):
        M[6 + i, place[i]] = 1.0
        for j in range(6):
            C[j, 6 + i] = 0.0
            for m in range(len(P)):
                C[j, 6 + i] += M_pose[j, m] * P[m, place[i]]
            C[6 + i, j] = C[j, 6 + i]
        for j in range(2 * n):
            C[6 + i, 6 + j] = P[place[i], place[j]]
    return numbers, M, C


@njit(cache=True, error_model="numpy")
def _take(P: Array, columns: NDArray[np.int64], first: int, stop: int, Q: Array) -> None:
    """Put what the columns first to stop - 1 of those chosen have in P with all before them into Q (15, 15)."""
    for b in range(first, stop):
        for c in range(b + 1):
            Q[b, c], Q[c, b] = P[columns[b], columns[c]], P[columns[c], columns[b]]


@njit(cache=True, error_model="numpy")
def _led_variances(a: Array, R_CD: Array, p_CD: Array, M: Array, P: Array, turn: int, ring: int) -> Array:
    """(n,) largest variance of the image, focal length 1, of LEDs at a (n, 3) from the ring's centre, NaN behind."""
    columns, m, Q = np.empty(15, np.int64), np.empty((6, 13)), np.empty((15, 15))
    H, HP, out = np.empty((2, 15)), np.empty((2, 15)), np.full(len(a), np.nan)
    for c in range(13):  # columns of M that are not zero; the LED's own follow
        columns[c] = c if c < 6 else turn + c - 6
        for i in range(6):
            m[i, c] = M[i, columns[c]]
    _take(P, columns, 0, 13, Q)
    for k in range(len(a)):
        x, y, z = a[k, 0] + p_CD[0], a[k, 1] + p_CD[1], a[k, 2] + p_CD[2]
        if not x > 0.0:
            continue
        columns[13], columns[14] = ring + 2 * k, ring + 2 * k + 1
        _take(P, columns, 13, 15, Q)
        for i in range(2):
            g0, g1, g2 = (y if i == 0 else z) / x**2, (-1.0 / x if i == 0 else 0.0), (-1.0 / x if i == 1 else 0.0)
            t0, t1, t2 = g2 * a[k, 1] - g1 * a[k, 2], g0 * a[k, 2] - g2 * a[k, 0], g1 * a[k, 0] - g0 * a[k, 1]
            for c in range(13):
                H[i, c] = t0 * m[0, c] + t1 * m[1, c] + t2 * m[2, c] + g0 * m[3, c] + g1 * m[4, c] + g2 * m[5, c]
            for c in range(2):
                H[i, 13 + c] = g0 * R_CD[0, 1 + c] + g1 * R_CD[1, 1 + c] + g2 * R_CD[2, 1 + c]
        HP[:] = 0.0
        uu, uv, vv = 0.0, 0.0, 0.0
        for b in range(15):
            for c in range(15):
                HP[0, c] += H[0, b] * Q[b, c]
                HP[1, c] += H[1, b] * Q[b, c]
        for c in range(15):
            uu += HP[0, c] * H[0, c]
            uv += HP[0, c] * H[1, c]
            vv += HP[1, c] * H[1, c]
        out[k] = 0.5 * (uu + vv) + np.sqrt(0.25 * (uu - vv) ** 2 + uv**2)  # eigenvalue
    return out


@njit(cache=True, error_model="numpy")
def _leds_seen(
    places_D: Array, R_CD: Array, p_CD: Array, M: Array, P: Array, turn: int, ring: int
) -> tuple[Array, Array]:
    """(n, 2) images (-y/x, -z/x) of LEDs at (n, 3), NaN behind the camera, and (n,) the roots of `_led_variances`."""
    a, ab = np.dot(places_D, R_CD.T), np.full((len(places_D), 2), np.nan)
    for k in range(len(a)):
        x = a[k, 0] + p_CD[0]
        if x > 0.0:
            ab[k, 0], ab[k, 1] = -(a[k, 1] + p_CD[1]) / x, -(a[k, 2] + p_CD[2]) / x
    return ab, np.sqrt(_led_variances(a, R_CD, p_CD, M, P, turn, ring))


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
