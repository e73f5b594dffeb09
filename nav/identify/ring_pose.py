"""The pose of a ring of eight LEDs by least squares, and which candidates are on it: the kernels of `perspective`.

With x_s = a cos 45 s + b sin 45 s a slot's place from the centre and w = (w_u, w_v) its image, focal length 1, the
derivatives of the image of X_s = p + x_s by a shift of p and a small turn of a and b, camera axes, are

    dw_u = g_u . dp + (x_s x g_u) . dphi,   g_u = -(w_u, 1, 0)/X_x,   g_v = -(w_v, 0, 1)/X_x           (1)

Cost: `fit_members` solves for the pose at most 16 times, each from two starts by `_ITERATIONS` steps at most (four of
eight LEDs dropped, a look about, twice, then five dropped), and seldom more than three times.
"""

import numpy as np

from dockair.kernels import njit

SLOTS = 8
_ANGLE = 2.0 * np.pi * np.arange(SLOTS) / SLOTS
_COS, _SIN = np.cos(_ANGLE), np.sin(_ANGLE)
_ITERATIONS = 15  # of Levenberg-Marquardt
_DAMPING = 1e-3  # relative, at the start; a frontal ring leaves its tilt undetermined to first order
_MOST_DAMPING = 1e6  # beyond it a step is too small to matter
_CONVERGED = 1e-6  # relative fall of the squared residuals below which a step is the last
_FIRST_LOOK = 3.0  # tolerances within which the first fit takes candidates up: it knows the other slots less well
_LEAST_DEPTH = 1e-6  # of a slot, in radii: one behind the camera has an image far off instead of a mirrored one


@njit(cache=True)
def project(pose, image):  # type: ignore[no-untyped-def]
    """Images (9, 2) of the slots and the centre, focal length 1, into `image`. Rows of pose: p, a, b."""
    for s in range(SLOTS + 1):
        c, d = (_COS[s], _SIN[s]) if s < SLOTS else (0.0, 0.0)
        depth = max(pose[0, 0] + c * pose[1, 0] + d * pose[2, 0], _LEAST_DEPTH)
        image[s, 0] = -(pose[0, 1] + c * pose[1, 1] + d * pose[2, 1]) / depth
        image[s, 1] = -(pose[0, 2] + c * pose[1, 2] + d * pose[2, 2]) / depth


@njit(cache=True)
def _solve(N, b):  # type: ignore[no-untyped-def]
    """Put the solution of N x = b into b (n, m); of the symmetric N (n, n) the upper triangle is read, and spoilt."""
    # loops, here and below, because slices of arrays this small cost more than the sums they hold
    n, m = b.shape
    for k in range(n):
        pivot = max(N[k, k], 1e-300)
        for i in range(k + 1, n):
            factor = N[k, i] / pivot
            for j in range(i, n):
                N[i, j] -= factor * N[k, j]
            for j in range(m):
                b[i, j] -= factor * b[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(m):
            for i in range(k + 1, n):
                b[k, j] -= N[k, i] * b[i, j]
            b[k, j] /= max(N[k, k], 1e-300)


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
                for j in range(i, 3):
                    N[i, j] += row[i] * row[j]
                for j in range(2):
                    b[i, j] += row[i] * points[candidate[s], j]
    _solve(N, b)
    return b


@njit(cache=True)
def orthonormalise(pose):  # type: ignore[no-untyped-def]
    """Make rows a and b unit vectors, b perpendicular to a, in place."""
    length = np.sqrt(pose[1, 0] ** 2 + pose[1, 1] ** 2 + pose[1, 2] ** 2)
    for i in range(3):
        pose[1, i] /= length
    along = pose[1, 0] * pose[2, 0] + pose[1, 1] * pose[2, 1] + pose[1, 2] * pose[2, 2]
    for i in range(3):
        pose[2, i] -= along * pose[1, i]
    length = np.sqrt(pose[2, 0] ** 2 + pose[2, 1] ** 2 + pose[2, 2] ** 2)
    for i in range(3):
        pose[2, i] /= length


@njit(cache=True)
def _start(points, candidate, pose):  # type: ignore[no-untyped-def]
    """One of the two poses whose projection along the camera's axis is the candidates' affine octagon."""
    affine = _affine(points, candidate)
    aa, bb, ab = 0.0, 0.0, 0.0
    for i in range(2):
        aa += affine[1, i] * affine[1, i]
        bb += affine[2, i] * affine[2, i]
        ab += affine[1, i] * affine[2, i]
    scale2 = 0.5 * (aa + bb + np.sqrt((aa - bb) ** 2 + 4.0 * ab * ab))
    scale = np.sqrt(scale2)
    depth_a, depth_b = np.sqrt(max(1.0 - aa / scale2, 0.0)), np.sqrt(max(1.0 - bb / scale2, 0.0))
    if ab > 0.0:  # a and b are perpendicular: their depths' product is minus their images' product
        depth_b = -depth_b
    pose[0, 0], pose[1, 0], pose[2, 0] = 1.0 / scale, depth_a, depth_b
    for row in range(3):
        for i in range(2):
            pose[row, i + 1] = -affine[row, i] / scale
    orthonormalise(pose)


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
def normal_equations(points, candidate, pose, image, N, g):  # type: ignore[no-untyped-def]
    """J'J, its upper triangle, into N (6, 6) and J'r into g (6, 1), of Eq. (1)."""
    N[:] = 0.0
    g[:] = 0.0
    J = np.zeros(6)
    for s in range(SLOTS):
        if candidate[s] < 0:
            continue
        c, d = _COS[s], _SIN[s]
        x, y, z = c * pose[1, 0] + d * pose[2, 0], c * pose[1, 1] + d * pose[2, 1], c * pose[1, 2] + d * pose[2, 2]
        inverse = -1.0 / max(pose[0, 0] + x, _LEAST_DEPTH)
        for axis in range(2):
            w = image[s, axis]
            g_x, g_y, g_z = w * inverse, (inverse if axis == 0 else 0.0), (inverse if axis == 1 else 0.0)
            J[0], J[1], J[2] = g_x, g_y, g_z
            J[3], J[4], J[5] = y * g_z - z * g_y, z * g_x - x * g_z, x * g_y - y * g_x
            residual = points[candidate[s], axis] - w
            for i in range(6):
                g[i, 0] += J[i] * residual
                for j in range(i, 6):
                    N[i, j] += J[i] * J[j]


@njit(cache=True)
def _refine(points, candidate, pose):  # type: ignore[no-untyped-def]
    """Levenberg-Marquardt on the pose, in place; squared residuals."""
    image, trial_image, trial = np.empty((SLOTS + 1, 2)), np.empty((SLOTS + 1, 2)), np.empty((3, 3))
    N, step = np.empty((6, 6)), np.empty((6, 1))
    project(pose, image)
    squares, damping = _squares(points, candidate, image), _DAMPING
    for _ in range(_ITERATIONS):
        normal_equations(points, candidate, pose, image, N, step)
        for k in range(6):
            N[k, k] = N[k, k] * (1.0 + damping) + 1e-15
        _solve(N, step)
        for i in range(3):
            trial[0, i] = pose[0, i] + step[i, 0]
        x, y, z = step[3, 0], step[4, 0], step[5, 0]
        for k in (1, 2):
            trial[k, 0] = pose[k, 0] + y * pose[k, 2] - z * pose[k, 1]
            trial[k, 1] = pose[k, 1] + z * pose[k, 0] - x * pose[k, 2]
            trial[k, 2] = pose[k, 2] + x * pose[k, 1] - y * pose[k, 0]
        orthonormalise(trial)
        project(trial, trial_image)
        trial_squares = _squares(points, candidate, trial_image)
        if trial_squares < squares and trial[0, 0] > 1.0:
            done = squares - trial_squares < _CONVERGED * squares
            pose[:], squares = trial, trial_squares
            image, trial_image = trial_image, image
            damping *= 0.1
            if done:
                break
        else:
            damping *= 10.0
            if damping > _MOST_DAMPING:
                break
    return squares


@njit(cache=True)
def _mirrored(pose):  # type: ignore[no-untyped-def]
    """The other pose with nearly the same image: a and b with their parts along the line of sight turned round."""
    other = pose.copy()
    ray = pose[0] / np.sqrt(pose[0, 0] ** 2 + pose[0, 1] ** 2 + pose[0, 2] ** 2)
    for k in (1, 2):
        other[k] -= 2.0 * (pose[k, 0] * ray[0] + pose[k, 1] * ray[1] + pose[k, 2] * ray[2]) * ray
    return other


@njit(cache=True)
def facing(pose):  # type: ignore[no-untyped-def]
    """Cosine of the tilt against the camera's axis."""
    return pose[1, 1] * pose[2, 2] - pose[1, 2] * pose[2, 1]


@njit(cache=True)
def _best_pose(points, candidate, min_facing):  # type: ignore[no-untyped-def]
    pose = np.empty((3, 3))
    _start(points, candidate, pose)
    squares = _refine(points, candidate, pose)
    other = _mirrored(pose)
    other_squares = _refine(points, candidate, other)
    faces, other_faces = facing(pose) >= min_facing, facing(other) >= min_facing
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
    image = np.empty((SLOTS + 1, 2))
    while True:
        limit = np.sqrt(tolerance**2 + (tolerance_per_radius / pose[0, 0]) ** 2)
        project(pose, image)
        worst, largest = -1, limit
        for s in range(SLOTS):
            if candidate[s] >= 0:
                d = np.sqrt(_distance2(points, candidate[s], image, s))
                if d > largest:
                    worst, largest = s, d
        if worst < 0 or (candidate >= 0).sum() <= 3:
            return candidate, pose, squares, limit, image
        candidate[worst] = -1
        pose, squares = _best_pose(points, candidate, min_facing)


@njit(cache=True)
def _members(points, first_candidate, tolerance, tolerance_per_radius, min_facing):  # type: ignore[no-untyped-def]
    """Candidates (8,), pose (3, 3), squared residuals, largest residual allowed, image (9, 2): focal length 1."""
    candidate = first_candidate.copy()
    pose, squares = _best_pose(points, candidate, min_facing)
    for look in (_FIRST_LOOK, 1.0):
        candidate, pose, squares, limit, image = _drop_outliers(
            points, candidate, pose, squares, look * tolerance, look * tolerance_per_radius, min_facing
        )
        if (candidate >= 0).sum() <= 3:
            break
        collected = _collect(points, image, limit)
        if (collected != candidate).any() and (collected >= 0).sum() >= 4:
            candidate = collected
            pose, squares = _best_pose(points, candidate, min_facing)
    return _drop_outliers(points, candidate, pose, squares, tolerance, tolerance_per_radius, min_facing)


@njit(cache=True)
def fit_members(  # type: ignore[no-untyped-def]
    points_px, first_candidate, focal_px, middle_px, tolerance_px, tolerance_per_radius, min_facing
):
    """The pose of a ring, and the candidates that are on it.

    Args:
        points_px: (n, 2) all candidates.
        first_candidate: (8,) which of them is in each slot at first, -1 for none.
        focal_px: focal length.
        middle_px: principal point.
        tolerance_px: largest residual; to it comes, root of the sum of squares,
        tolerance_per_radius: for the LEDs' own position errors [px/px].
        min_facing: cosine of the largest tilt, as of `facing`.

    Returns:
        candidates (8,), pose (3, 3), image (9, 2) of the slots and the centre [px], root of the squared residuals over
        the degrees of freedom and largest residual allowed [px].
    """
    points = np.empty(points_px.shape)
    for k in range(len(points)):
        points[k, 0] = (points_px[k, 0] - middle_px[0]) / focal_px
        points[k, 1] = (points_px[k, 1] - middle_px[1]) / focal_px
    candidate, pose, squares, limit, image = _members(
        points, first_candidate, tolerance_px / focal_px, tolerance_per_radius, min_facing
    )
    for s in range(SLOTS + 1):
        image[s, 0] = image[s, 0] * focal_px + middle_px[0]
        image[s, 1] = image[s, 1] * focal_px + middle_px[1]
    freedom = 2 * (candidate >= 0).sum() - 6
    rms = np.sqrt(squares / freedom) if freedom > 0 else 0.0
    return candidate, pose, image, rms * focal_px, limit * focal_px
