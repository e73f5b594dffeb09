"""Dilution of precision of landmark vision: navigation error per metre of error on the focal plane.

A body at P_u with attitude (alpha, beta, gamma) = roll, pitch, yaw sees landmark i at

    s = R_BC' R_NB' (P_i - P_u),   R_NB = R_z(gamma) R_y(beta) R_x(alpha)         [Kim & Hwang 2014, eqs 2, 3]
    u = f y/x,   v = f z/x                         (x, y, z) = s                   [Kim & Hwang 2014, eq 1]

With G = d(u, v)/ds and b = R_NB' (P_i - P_u), the line in body axes, the exact rows of landmark i are

    H_i = G R_BC' [ -R_NB',  [b x] E ],   E = [e_x, R_x' e_y, R_x' R_y' e_z]       (1)

since the body turns by E (d alpha, d beta, d gamma) in its own axes. Stacked, dm = H dx (25) and

    D = (H'H)^-1,   DOP^2 = tr D,   PDOP^2 = D_11 + D_22 + D_33,   ADOP^2 = D_44 + D_55 + D_66    (27), (30), (31)

PDOP is in metres per metre of focal-plane error, ADOP in radians per metre; DOP adds the squares of both, so that its
value hangs on the unit of length. The other way round, for the landmarks' frame N seen from the camera, R_CN <-
exp(phi) R_CN and p_CN <- p_CN + delta:

    H_i = G [ I, -[R_CN P_i x] ]                                                   (2)

In a plane, with psi = arctan(u/f) and R the distance,

    d psi = sin(gamma + psi)/R dx - cos(gamma + psi)/R dy - d gamma,   du = f/cos^2(psi) d psi       (3), (32)

The source linearises by hand, with slips in (4)-(24); nothing of that is used here. Signs are the source's: u and v
grow with y and z, axes N and B are any right-handed ones. The camera sits in the body's origin.

Not modelled: landmarks known inexactly, unlike or correlated errors (`bound` has sigmas), second-order effects.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.rotations import Array, matrix_from_yaw_pitch_roll

_SINGULAR = 1e-12  # smallest over largest singular value of H with unit columns: no more than rounding leaves
_ROTATION_TOLERANCE = 1e-6  # of R'R from the identity; nine printed digits pass, a matrix of degrees does not


class DopStatus(Enum):
    """Whether there is a dilution of precision; every one but SOLVED carries NaN."""

    SOLVED = "solved"
    TOO_FEW_LANDMARKS = "too few landmarks"
    BEHIND_CAMERA = "behind the camera"
    OFF_SENSOR = "off the sensor"
    SINGULAR = "singular"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Dop:
    """Dilution of precision of one geometry; the state is position first, then attitude, as in the source."""

    status: DopStatus
    dop: float  #: of both together, eq (27)
    pdop: float  #: metres per metre, eq (30)
    adop: float  #: radians per metre, eq (31)
    jacobian: Array  #: (2n, 6) H, rows u_1, v_1, u_2, ...; NaN for a landmark behind the camera. In plane (n, 3)
    covariance: Array  #: (6, 6) D for one metre of error; times sigma_m^2 the covariance of the state. In plane (3, 3)
    landmarks_in_camera: "Dop | None" = None  #: the same told the other way round, Eq. (2): state (delta, phi)

    @property
    def information(self) -> Array:
        """(n, 6, 6) H_i'H_i of each landmark, for `best_subset`."""
        size = self.jacobian.shape[1]
        rows = self.jacobian.reshape(-1, size // 3, size)
        return np.asarray(np.einsum("nri,nrj->nij", rows, rows))

    @property
    def position(self) -> slice:
        """Where the position stands in the state."""
        return slice(0, self.jacobian.shape[1] // 3 + 1)

    @property
    def attitude(self) -> slice:
        """Where the attitude stands in the state."""
        return slice(self.jacobian.shape[1] // 3 + 1, self.jacobian.shape[1])


def dilution_of_precision(
    landmarks_N: Array,
    position_N: Array,
    roll_pitch_yaw_rad: Array,
    focal_length_m: float,
    R_BC: Array | None = None,
) -> Dop:
    """Return DOP, PDOP and ADOP from the exact Jacobian of [Kim & Hwang 2014, eqs 1-3], Eq. (1).

    Args:
        landmarks_N: (n, 3) landmarks in navigation axes [m]; for the LEDs of a drogue N is the drogue.
        position_N: (3,) body, which is the camera, in navigation axes [m].
        roll_pitch_yaw_rad: (3,) attitude; with a pitch of a quarter turn roll and yaw are one, which is SINGULAR.
        focal_length_m: focal length [m].
        R_BC: (3, 3) camera axes in body axes; the identity by default.

    Raises:
        DockairError: wrong shapes, numbers that are not finite, R_BC no rotation, focal length not positive.
    """
    landmarks, position = _finite(landmarks_N, "landmarks_N", (-1, 3)), _finite(position_N, "position_N", (3,))
    roll, pitch, yaw = _finite(roll_pitch_yaw_rad, "roll_pitch_yaw_rad", (3,))
    R_CB = np.eye(3) if R_BC is None else _rotation(R_BC, "R_BC").T
    R_BN = matrix_from_yaw_pitch_roll(yaw, pitch, roll).T
    R_CN = R_CB @ R_BN
    with np.errstate(all="ignore"):  # what overflows has no rank and is told by the status
        b = (landmarks - position) @ R_BN.T
        G = _image_rate(b @ R_CB.T, _focal_length(focal_length_m))
        in_front = np.isfinite(G[:, 0, 1])
        reverse = _solve(_rows(G, G @ -_crosses(landmarks @ R_CN.T)), 3, in_front)  # Eq. (2)
        turn = G @ R_CB @ _crosses(b) @ _euler_rate(roll, pitch)
        return _solve(_rows(G @ -R_CN, turn), 3, in_front, reverse)  # Eq. (1)


def dilution_of_precision_in_plane(landmarks_N: Array, position_N: Array, yaw_rad: float, focal_length_m: float) -> Dop:
    """Return the dilution for a body that moves and turns in a plane, Eq. (3): state (x, y, gamma), measured u alone.

    Args:
        landmarks_N: (n, 2) landmarks [m].
        position_N: (2,) body [m].
        yaw_rad: gamma, its heading from x toward y.
        focal_length_m: focal length [m].

    Raises:
        DockairError: wrong shapes, numbers that are not finite, focal length not positive.
    """
    landmarks, position = _finite(landmarks_N, "landmarks_N", (-1, 2)), _finite(position_N, "position_N", (2,))
    gamma, f = float(_finite(yaw_rad, "yaw_rad", ())), _focal_length(focal_length_m)
    with np.errstate(all="ignore"):
        dx, dy = (landmarks - position).T
        R, bearing = np.hypot(dx, dy), np.arctan2(dy, dx)  # gamma + psi
        cosine = np.cos(bearing - gamma)
        rows = np.column_stack([np.sin(bearing) / R, -np.cos(bearing) / R, -np.ones(len(R))])
        in_front = (R > 0.0) & (cosine > 0.0)
        return _solve(rows * (f / np.where(in_front, cosine, np.nan) ** 2)[:, None], 2, in_front)


def _finite(value: Array | float, where: str, shape: tuple[int, ...]) -> Array:
    """Return the array; -1 in the shape is any count."""
    words = "a number" if shape == () else "an array (" + ", ".join("n" if k < 0 else str(k) for k in shape) + ")"
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise DockairError(where, expected=f"{words} of finite numbers", got=value) from None
    fits = array.ndim == len(shape) and all(k in (-1, size) for k, size in zip(shape, array.shape, strict=True))
    if not fits or not np.isfinite(array).all():
        raise DockairError(where, expected=f"{words} of finite numbers", got=value if array.size < 7 else array.shape)
    return array


def _focal_length(value: float) -> float:
    focal_length = float(_finite(value, "focal_length_m", ()))
    if not focal_length > 0.0:
        raise DockairError("focal_length_m", expected="a number > 0", got=value)
    return focal_length


def _rotation(value: Array, where: str) -> Array:
    R = _finite(value, where, (3, 3))
    if not (np.abs(R.T @ R - np.eye(3)) < _ROTATION_TOLERANCE).all() or np.linalg.det(R) < 0.0:
        raise DockairError(where, expected="a rotation matrix (3, 3)", got=R.tolist())
    return R


def _image_rate(s: Array, f: float) -> Array:
    """(n, 2, 3) G = d(u, v)/ds; NaN behind the camera."""
    x = np.where(s[:, 0] > 0.0, s[:, 0], np.nan)
    G = np.zeros((len(s), 2, 3))
    G[:, 0, 1] = G[:, 1, 2] = f / x
    G[:, :, 0] = -f * s[:, 1:] / (x * x)[:, None]
    return G


def _crosses(v: Array) -> Array:
    """(n, 3, 3) matrices of v_i x ( . )."""
    K = np.zeros((len(v), 3, 3))
    K[:, 2, 1], K[:, 0, 2], K[:, 1, 0] = v.T
    K[:, 1, 2], K[:, 2, 0], K[:, 0, 1] = -v.T
    return K


def _rows(by_position: Array, by_attitude: Array) -> Array:
    """(2n, 6) of two (n, 2, 3)."""
    return np.concatenate([by_position, by_attitude], axis=2).reshape(-1, 6)


def _euler_rate(roll: float, pitch: float) -> Array:
    """(3, 3) E of Eq. (1)."""
    ca, sa, cb, sb = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([[1.0, 0.0, -sb], [0.0, ca, sa * cb], [0.0, -sa, ca * cb]])


def _solve(H: Array, positions: int, in_front: NDArray[np.bool_], reverse: Dop | None = None) -> Dop:
    """Return D by singular values of H with its columns at unit length: metres and radians weigh alike."""
    size = H.shape[1]
    status, D = DopStatus.SINGULAR, np.full((size, size), np.nan)
    length = np.sqrt((H**2).sum(axis=0))
    if len(in_front) < 3:
        status = DopStatus.TOO_FEW_LANDMARKS
    elif not in_front.all():
        status = DopStatus.BEHIND_CAMERA
    elif (length > 0.0).all() and np.isfinite(length).all():
        _, singular, Vt = np.linalg.svd(H / length, full_matrices=False)
        if singular[-1] > _SINGULAR * singular[0]:
            root = Vt.T / singular / length[:, None]
            if np.isfinite(root @ root.T).all():
                status, D = DopStatus.SOLVED, root @ root.T
    variance = np.diag(D)
    return Dop(
        status=status,
        dop=float(np.sqrt(variance.sum())),
        pdop=float(np.sqrt(variance[:positions].sum())),
        adop=float(np.sqrt(variance[positions:].sum())),
        jacobian=H,
        covariance=D,
        landmarks_in_camera=reverse,
    )
