"""The exact image of a tilted ring of eight LEDs, fitted to candidates.

A ring of unit radius at p, spanned by two perpendicular unit vectors a, b (its y and z axis in camera axes):

    X_s = p + a cos 45 s + b sin 45 s,   u = c_u - f X_y/X_x,   v = c_v - f X_z/X_x         (1)

Six unknowns, like the affine octagon's, but exact: four LEDs leave two equations to check, eight leave ten. It is
fitted by Levenberg-Marquardt, and again from that fit mirrored along the line of sight, which parallel projection
cannot tell from it; the better one counts. Candidates off the fit by more than the tolerance are dropped, the worst
first, and candidates on it are taken up.

The pose serves identification alone (range in radii, attitude up to noise); `nav/pose` estimates the real one.
Not modelled: LEDs out of plane, distortion (give undistorted pixels).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dockair.rotations import Array

SLOTS = 8
_ANGLE = 2.0 * np.pi * np.arange(SLOTS) / SLOTS
_COS, _SIN = np.cos(_ANGLE), np.sin(_ANGLE)
_ITERATIONS = 15  # of Levenberg-Marquardt
_DAMPING = 1e-3  # relative, at the start; a frontal ring leaves its tilt undetermined to first order
_CONVERGED = 1e-6  # relative fall of the squared residuals below which a step is the last
_FIRST_LOOK = 3.0  # tolerances within which the first fit takes candidates up: it knows the other slots less well


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingFit:
    """Eq. (1) fitted to some candidates."""

    candidate: NDArray[np.int64]  #: (8,) in each slot, -1 for none
    slots_px: Array  #: (8, 2) image of every slot, seen or not
    centre_px: Array  #: (2,) image of the ring's centre
    radius_px: float  #: f over the centre's depth: the radius of the ring's image if it were frontal
    tilt_rad: float  #: between the ring's axis and the camera's
    tolerance_px: float  #: largest residual allowed
    pose: Array  #: (3, 3) rows p, a, b of Eq. (1), in radii
    focal_length_px: float
    principal_point_px: tuple[float, float]
    rms_px: float  #: root of the squared residuals over the degrees of freedom; 0 when there are none

    @property
    def count(self) -> int:
        """Number of LEDs."""
        return int(np.count_nonzero(self.candidate >= 0))

    def image_px(self, angle_rad: Array) -> Array:
        """(n, 2) image of the ring's points at angles (n,), slot s standing at 45 s."""
        X = self.pose[0] + np.column_stack([np.cos(angle_rad), np.sin(angle_rad)]) @ self.pose[1:]
        return np.asarray(np.array(self.principal_point_px) - self.focal_length_px * X[:, 1:] / X[:, :1])


def fit_ring(
    points: Array,
    candidate: NDArray[np.int64],
    focal_length_px: float,
    principal_point_px: tuple[float, float],
    *,
    tolerance_px: float,
    tolerance_per_radius: float,
    max_tilt_rad: float = np.pi,
) -> RingFit:
    """Fit Eq. (1).

    Args:
        points: (n, 2) candidates, undistorted [px].
        candidate: (8,) which of them is in each slot, -1 for none; at least three.
        focal_length_px: of the camera, as the next.
        principal_point_px: (u, v).
        tolerance_px: largest residual; to it comes, root of the sum of squares,
        tolerance_per_radius: for the LEDs' own position errors [px/px].
        max_tilt_rad: of the two poses one beyond it gives way.
    """
    cu, cv = principal_point_px
    relative = np.ascontiguousarray(points - np.array([cu, cv])) / focal_length_px
    chosen, pose, squares, tolerance = _fit_ring(
        relative, candidate, tolerance_px / focal_length_px, tolerance_per_radius, float(np.cos(max_tilt_rad))
    )
    image = _project(pose) * focal_length_px + np.array([cu, cv])
    freedom = 2 * int(np.count_nonzero(chosen >= 0)) - 6
    return RingFit(
        candidate=chosen,
        slots_px=image[:SLOTS],
        centre_px=image[SLOTS],
        radius_px=float(focal_length_px / pose[0, 0]),
        tilt_rad=float(np.arccos(np.clip(_facing(pose), -1.0, 1.0))),
        tolerance_px=float(tolerance * focal_length_px),
        pose=pose,
        focal_length_px=focal_length_px,
        principal_point_px=principal_point_px,
        rms_px=float(np.sqrt(squares / freedom) * focal_length_px) if freedom > 0 else 0.0,
    )


@njit(cache=True)
def _project(pose):  # type: ignore[no-untyped-def]
    """(9, 2) images of the slots and the centre, focal length 1. Rows of pose: p, a, b."""
    image = np.empty((SLOTS + 1, 2))
    for s in range(SLOTS + 1):
        c, d = (_COS[s], _SIN[s]) if s < SLOTS else (0.0, 0.0)
        depth = max(pose[0, 0] + c * pose[1, 0] + d * pose[2, 0], 1e-6)
        image[s, 0] = -(pose[0, 1] + c * pose[1, 1] + d * pose[2, 1]) / depth
        image[s, 1] = -(pose[0, 2] + c * pose[1, 2] + d * pose[2, 2]) / depth
    return image


@njit(cache=True)
def _solve(N, b):  # type: ignore[no-untyped-def]
    """Solution (n, m) of N x = b, N (n, n) symmetric positive definite, by elimination in place."""
    # loops, here and below, because slices of arrays this small cost more than the sums they hold
    n, m = b.shape
    for k in range(n):
        pivot = max(N[k, k], 1e-300)
        for i in range(k + 1, n):
            factor = N[i, k] / pivot
            for j in range(k, n):
                N[i, j] -= factor * N[k, j]
            for j in range(m):
                b[i, j] -= factor * b[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(m):
            for i in range(k + 1, n):
                b[k, j] -= N[k, i] * b[i, j]
            b[k, j] /= max(N[k, k], 1e-300)
    return b


@njit(cache=True)
def _affine(points, candidate):  # type: ignore[no-untyped-def]
    """(3, 2) centre and the images of the ring's two axes by least squares, parallel projection."""
    N = np.zeros((3, 3))
    b = np.zeros((3, 2))
    row = np.ones(3)
    for s in range(SLOTS):
        if candidate[s] >= 0:
            row[1], row[2] = _COS[s], _SIN[s]
            for i in range(3):
                for j in range(3):
                    N[i, j] += row[i] * row[j]
                for j in range(2):
                    b[i, j] += row[i] * points[candidate[s], j]
    return _solve(N, b)


@njit(cache=True)
def _orthonormalise(pose):  # type: ignore[no-untyped-def]
    """Make rows a and b unit vectors, b perpendicular to a, in place."""
    pose[1] /= np.sqrt(pose[1, 0] ** 2 + pose[1, 1] ** 2 + pose[1, 2] ** 2)
    pose[2] -= (pose[1, 0] * pose[2, 0] + pose[1, 1] * pose[2, 1] + pose[1, 2] * pose[2, 2]) * pose[1]
    pose[2] /= np.sqrt(pose[2, 0] ** 2 + pose[2, 1] ** 2 + pose[2, 2] ** 2)


@njit(cache=True)
def _start_pose(affine):  # type: ignore[no-untyped-def]
    """One of the two poses whose projection along the camera's axis is the affine octagon."""
    aa, bb, ab = (affine[1] ** 2).sum(), (affine[2] ** 2).sum(), (affine[1] * affine[2]).sum()
    scale2 = 0.5 * (aa + bb + np.sqrt((aa - bb) ** 2 + 4.0 * ab * ab))
    scale = np.sqrt(scale2)
    depth_a, depth_b = np.sqrt(max(1.0 - aa / scale2, 0.0)), np.sqrt(max(1.0 - bb / scale2, 0.0))
    if ab > 0.0:  # a and b are perpendicular: their depths' product is minus their images' product
        depth_b = -depth_b
    pose = np.empty((3, 3))
    pose[0, 0] = 1.0 / scale
    pose[0, 1:] = -affine[0] / scale
    pose[1, 0], pose[2, 0] = depth_a, depth_b
    pose[1, 1:] = -affine[1] / scale
    pose[2, 1:] = -affine[2] / scale
    _orthonormalise(pose)
    return pose


@njit(cache=True)
def _distance2(points, k, image, s):  # type: ignore[no-untyped-def]
    return (points[k, 0] - image[s, 0]) ** 2 + (points[k, 1] - image[s, 1]) ** 2


@njit(cache=True)
def _squares(points, candidate, image):  # type: ignore[no-untyped-def]
    """Sum of squared residuals."""
    total = 0.0
    for s in range(SLOTS):
        if candidate[s] >= 0:
            total += _distance2(points, candidate[s], image, s)
    return total


@njit(cache=True)
def _normal_equations(points, candidate, pose, image):  # type: ignore[no-untyped-def]
    """J'J (6, 6) and J'r (6, 1) of the shift of p and the rotation of a and b, camera axes."""
    N = np.zeros((6, 6))
    g = np.zeros((6, 1))
    J = np.empty(6)
    dX = np.zeros((3, 6))
    for s in range(SLOTS):
        if candidate[s] < 0:
            continue
        c, d = _COS[s], _SIN[s]
        x, y, z = c * pose[1, 0] + d * pose[2, 0], c * pose[1, 1] + d * pose[2, 1], c * pose[1, 2] + d * pose[2, 2]
        depth = max(pose[0, 0] + x, 1e-6)
        dX[0, 0] = dX[1, 1] = dX[2, 2] = 1.0
        dX[0, 4], dX[0, 5] = z, -y  # rotation vector x (x, y, z)
        dX[1, 3], dX[1, 5] = -z, x
        dX[2, 3], dX[2, 4] = y, -x
        for axis in range(2):
            residual = points[candidate[s], axis] - image[s, axis]
            for i in range(6):
                J[i] = -(dX[axis + 1, i] + image[s, axis] * dX[0, i]) / depth
            for i in range(6):
                g[i, 0] += J[i] * residual
                for j in range(6):
                    N[i, j] += J[i] * J[j]
    return N, g


@njit(cache=True)
def _refine(points, candidate, pose):  # type: ignore[no-untyped-def]
    """Levenberg-Marquardt; pose and squared residuals."""
    image = _project(pose)
    squares = _squares(points, candidate, image)
    damping = _DAMPING
    for _ in range(_ITERATIONS):
        N, g = _normal_equations(points, candidate, pose, image)
        for k in range(6):
            N[k, k] *= 1.0 + damping
            N[k, k] += 1e-15
        step = _solve(N, g)[:, 0]
        trial = pose.copy()
        trial[0] += step[:3]
        for k in (1, 2):
            trial[k, 0] += step[4] * pose[k, 2] - step[5] * pose[k, 1]
            trial[k, 1] += step[5] * pose[k, 0] - step[3] * pose[k, 2]
            trial[k, 2] += step[3] * pose[k, 1] - step[4] * pose[k, 0]
        _orthonormalise(trial)
        trial_image = _project(trial)
        trial_squares = _squares(points, candidate, trial_image)
        if trial_squares < squares and trial[0, 0] > 1.0:
            done = squares - trial_squares < _CONVERGED * squares
            pose, image, squares = trial, trial_image, trial_squares
            damping *= 0.1
            if done:
                break
        else:
            damping *= 10.0
            if damping > 1e6:
                break
    return pose, squares


@njit(cache=True)
def _mirrored(pose):  # type: ignore[no-untyped-def]
    """The other pose with nearly the same image: a and b with their parts along the line of sight turned round."""
    other = pose.copy()
    ray = pose[0] / np.sqrt(pose[0, 0] ** 2 + pose[0, 1] ** 2 + pose[0, 2] ** 2)
    for k in (1, 2):
        other[k] -= 2.0 * (pose[k, 0] * ray[0] + pose[k, 1] * ray[1] + pose[k, 2] * ray[2]) * ray
    return other


@njit(cache=True)
def _facing(pose):  # type: ignore[no-untyped-def]
    """Cosine of the tilt against the camera's axis."""
    return pose[1, 1] * pose[2, 2] - pose[1, 2] * pose[2, 1]


@njit(cache=True)
def _best_pose(points, candidate, min_facing):  # type: ignore[no-untyped-def]
    pose, squares = _refine(points, candidate, _start_pose(_affine(points, candidate)))
    other, other_squares = _refine(points, candidate, _mirrored(pose))
    faces, other_faces = _facing(pose) >= min_facing, _facing(other) >= min_facing
    if other_squares < squares if faces == other_faces else other_faces:
        return other, other_squares
    return pose, squares


@njit(cache=True)
def _collect(points, image, tolerance):  # type: ignore[no-untyped-def]
    """The nearest candidate of each slot inside the tolerance."""
    candidate = np.full(SLOTS, -1, np.int64)
    for s in range(SLOTS):
        best = tolerance * tolerance
        for k in range(len(points)):
            d = _distance2(points, k, image, s)
            if d < best:
                best = d
                candidate[s] = k
    return candidate


@njit(cache=True)
def _drop_outliers(  # type: ignore[no-untyped-def]
    points, candidate, pose, squares, tolerance, tolerance_per_radius, min_facing
):
    """Without the worst candidate, and again, until all are inside the tolerance or three are left."""
    while True:
        limit = np.sqrt(tolerance**2 + (tolerance_per_radius / pose[0, 0]) ** 2)
        image = _project(pose)
        worst, largest = -1, limit
        for s in range(SLOTS):
            if candidate[s] >= 0:
                d = np.sqrt(_distance2(points, candidate[s], image, s))
                if d > largest:
                    worst, largest = s, d
        if worst < 0 or (candidate >= 0).sum() <= 3:
            return candidate, pose, squares, limit
        candidate[worst] = -1
        pose, squares = _best_pose(points, candidate, min_facing)


@njit(cache=True)
def _fit_ring(points, first_candidate, tolerance, tolerance_per_radius, min_facing):  # type: ignore[no-untyped-def]
    candidate = first_candidate.copy()
    pose, squares = _best_pose(points, candidate, min_facing)
    for look in (_FIRST_LOOK, 1.0):
        candidate, pose, squares, limit = _drop_outliers(
            points, candidate, pose, squares, look * tolerance, look * tolerance_per_radius, min_facing
        )
        if (candidate >= 0).sum() <= 3:
            break
        collected = _collect(points, _project(pose), limit)
        if (collected != candidate).any() and (collected >= 0).sum() >= 4:
            candidate = collected
            pose, squares = _best_pose(points, candidate, min_facing)
    return _drop_outliers(points, candidate, pose, squares, tolerance, tolerance_per_radius, min_facing)
