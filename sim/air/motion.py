"""The air's motion beyond the undisturbed wind, joined of gusts, wake and bow wave, each of them optional.

    tow:        gusts + discrete gusts + wake + bow wave, at each body's own place
    receiver:   gusts + discrete gusts + wake, at sample points r over the airframe, fitted by least squares

    v(r) = v_0 + G r                                                                                     (1)
    w_eq = (dv_z/dy, -dv_z/dx, dv_y/dx)                                                                  (2)

Air that turns as a solid with w_eq has the gradients of Eq. (2): those that a wing (up-flow across the span), a tail
(up-flow along the fuselage) and a fin (side-flow along it) feel, as if the aircraft turned the other way. v_0 is the
fit's value at the centre of gravity. The rolling gust, to which the frozen field has no place across the path, is added
about x.

Gusts stand in path axes F: origin at the hose's exit, x along the tanker's heading, level. In a turn the field turns
with the tanker, which the bodies are too close to each other to notice (40 m, at 1.4 deg/s and 180 m/s: 0.3 deg).
The wake's circulation follows the tanker's lift, L/(m g) = cos(climb)/cos(bank), as that of a steady turn or descent.

Not modelled: gradients along the vertical; the wake's effect on the gusts; the receiver's on the tanker.
"""

from typing import NamedTuple, Protocol

import numpy as np

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.rotations import Array
from dockair.sim.air.bow_wave import write_bow_wave_velocity
from dockair.sim.air.wake import write_wake_velocity

_ROUNDING = 1e-12  # of the largest singular value: below it one is 0
_FLAT = 1e-6  # of the design's largest singular value: below it the sample points are taken to lie in one plane


class FrozenGusts(Protocol):
    """What is needed of discrete gusts: `dockair.sim.air.discrete_gust.DiscreteGusts`."""

    def step(self) -> None:
        """Advance by one tick."""
        ...

    def velocity(self, x: Array) -> Array:
        """(n, 3) gust in path axes F at places x (n,)."""
        ...


class GustField(FrozenGusts, Protocol):
    """What is needed of turbulence: `dockair.sim.air.turbulence.DrydenField`."""

    def write_gusts(self, x: Array, rolling_x: float, gusts: Array) -> float:
        """Write `velocity` into an array that is there already (n, 3); return the rolling gust at a place [rad/s]."""
        ...


class AirState(NamedTuple):
    """What the bodies feel of the air's motion, beyond the undisturbed wind."""

    tow_W: Array  #: (n, 3) at the links and the drogue, W axes [m/s]
    receiver_W: Array  #: (3,) at the receiver's centre of gravity, W axes [m/s]
    receiver_rotation_B: Array  #: (3,) turning of the air about the receiver, body axes [rad/s]


class AirMotion:
    """The sources of the air's motion; remembers the gusts.

    Args:
        gusts: turbulence, or None.
        discrete: discrete gusts, or None.
        wake: table of `wake_coefficients`, or None.
        bow_wave: vector of `bow_wave_coefficients`, or None.
        exit_T: (3,) the hose's exit in the tanker's axes [m].
        receiver_points_B: (m, 3) sample points over the receiver, body axes [m]. Along an axis on which all of them
            stand at one place gradients are 0: a single point gives none.

    Raises:
        DockairError: no sample point.
    """

    def __init__(
        self,
        gusts: GustField | None = None,
        discrete: FrozenGusts | None = None,
        wake: Array | None = None,
        bow_wave: Array | None = None,
        *,
        exit_T: Array,
        receiver_points_B: Array,
    ) -> None:
        points = np.ascontiguousarray(receiver_points_B, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
            raise DockairError("gust_points_m", expected="one or more points (x, y, z)", got=receiver_points_B)
        self._gusts, self._discrete, self._wake, self._bow_wave = gusts, discrete, wake, bow_wave
        self._exit_T, self._points_B = np.array(exit_T, dtype=float), points
        self._fit = _least_squares(points)
        self._room: tuple[Array, ...] = (np.zeros((0, 3)),)  # for the places; written anew whenever they are asked for
        self._still = gusts is None and discrete is None and wake is None and bow_wave is None
        self._tables = (np.empty((0, 7)) if wake is None else wake), (np.empty(0) if bow_wave is None else bow_wave)

    def step(self) -> None:
        """Advance by one tick."""
        for source in (self._gusts, self._discrete):
            if source is not None:
                source.step()

    def at(self, tow_places_W: Array, R_WB: Array, p_WB: Array, R_WT: Array, p_WT: Array) -> AirState:
        """Return the air's motion at the tow and about the receiver, now.

        Args:
            tow_places_W: (n, 3) places of links and drogue in W [m].
            R_WB: (3, 3) attitude of the receiver.
            p_WB: (3,) its centre of gravity [m].
            R_WT: (3, 3) attitude of the tanker.
            p_WT: (3,) its reference point [m].
        """
        n = len(tow_places_W)
        if self._still:
            return AirState(tow_W=np.zeros((n, 3)), receiver_W=np.zeros(3), receiver_rotation_B=np.zeros(3))
        if len(self._room[0]) != n:
            self._make_room(n)
        tow_B, bow_B, places_T, wake_T, gust_F, x_F = self._room
        x = _places(tow_places_W, self._points_B, R_WB, p_WB, R_WT, p_WT, self._exit_T, x_F, places_T, tow_B)
        rolling = 0.0 if self._gusts is None else self._gusts.write_gusts(x_F, x, gust_F)
        if self._discrete is not None:
            gust_F = gust_F + self._discrete.velocity(x_F)
        air = np.empty((n + 2, 3))
        _join(gust_F, *self._tables, places_T, wake_T, tow_B, bow_B, R_WB, R_WT, self._fit, rolling, air)
        return AirState(air[:n], air[n], air[n + 1])

    def steady(self) -> "AirMotion":
        """The wake alone: what of the air's motion stays while gusts pass, about a receiver that keeps its place."""
        return AirMotion(wake=self._wake, exit_T=self._exit_T, receiver_points_B=self._points_B)

    def _make_room(self, n: int) -> None:
        """Room for the tow's places in B and the bow wave there; all places in T, wake and gusts there, x along F."""
        m = n + len(self._points_B)
        self._room = (*np.zeros((2, n, 3)), *np.zeros((3, m, 3)), np.zeros(m))


def _least_squares(points_B: Array) -> Array:
    """(4, m) what v_0 and the rows of G in Eq. (1) are of the points' velocities."""
    ones, mean = np.ones((len(points_B), 1)), points_B.mean(axis=0)
    _, spreads, axes = np.linalg.svd(points_B - mean)
    flattest = _FLAT * np.linalg.norm(np.hstack([ones, points_B]), 2)
    across = axes[np.count_nonzero(spreads > flattest) :]
    # along these all points stand at one place, from which the least squares of least norm would make a gradient
    within = points_B - points_B @ across.T @ across
    return np.ascontiguousarray(np.linalg.pinv(np.hstack([ones, within]), rcond=_ROUNDING))


@njit(cache=True)
def _places(tow_W, points_B, R_WB, p_WB, R_WT, p_WT, exit_T, x_F, places_T, tow_B):  # type: ignore[no-untyped-def]
    """Write places of tow and sample points: x along F; all in T; the tow's in B. Return the receiver's x."""
    n, m = tow_W.shape[0], points_B.shape[0]
    level = np.sqrt(R_WT[0, 0] ** 2 + R_WT[1, 0] ** 2)
    ahead_x, ahead_y = R_WT[0, 0] / level, R_WT[1, 0] / level
    exit_x = p_WT[0] + R_WT[0, 0] * exit_T[0] + R_WT[0, 1] * exit_T[1] + R_WT[0, 2] * exit_T[2]
    exit_y = p_WT[1] + R_WT[1, 0] * exit_T[0] + R_WT[1, 1] * exit_T[1] + R_WT[1, 2] * exit_T[2]
    p = np.empty(3)
    for i in range(n + m):
        for axis in range(3):
            if i < n:
                p[axis] = tow_W[i, axis]
            else:
                r = points_B[i - n]
                p[axis] = p_WB[axis] + R_WB[axis, 0] * r[0] + R_WB[axis, 1] * r[1] + R_WB[axis, 2] * r[2]
        x_F[i] = ahead_x * (p[0] - exit_x) + ahead_y * (p[1] - exit_y)
        x, y, z = p[0] - p_WT[0], p[1] - p_WT[1], p[2] - p_WT[2]
        for axis in range(3):
            places_T[i, axis] = R_WT[0, axis] * x + R_WT[1, axis] * y + R_WT[2, axis] * z
        if i < n:
            x, y, z = p[0] - p_WB[0], p[1] - p_WB[1], p[2] - p_WB[2]
            for axis in range(3):
                tow_B[i, axis] = R_WB[0, axis] * x + R_WB[1, axis] * y + R_WB[2, axis] * z
    return ahead_x * (p_WB[0] - exit_x) + ahead_y * (p_WB[1] - exit_y)


@njit(cache=True)
def _join(gust_F, wake, bow, places_T, wake_T, tow_B, bow_B, R_WB, R_WT, fit, rolling, out):  # type: ignore[no-untyped-def]
    """Write air at the tow (n, 3) and at the receiver's centre of gravity in W, its turning about the receiver in B.

    Tables of wake and bow wave that are empty are of none; `wake_T` and `bow_B` are room for what they do.
    """
    write_wake_velocity(places_T, wake, wake_T)
    if len(bow) > 0:
        write_bow_wave_velocity(tow_B, bow, bow_B)
    m = fit.shape[1]
    n = gust_F.shape[0] - m
    level = np.sqrt(R_WT[0, 0] ** 2 + R_WT[1, 0] ** 2)
    ahead_x, ahead_y = R_WT[0, 0] / level, R_WT[1, 0] / level
    load = level * level / R_WT[2, 2]  # cos(climb)/cos(bank)
    linear, v = np.zeros((4, 3)), np.empty(3)
    for i in range(n + m):
        v[0] = ahead_x * gust_F[i, 0] - ahead_y * gust_F[i, 1]
        v[1] = ahead_y * gust_F[i, 0] + ahead_x * gust_F[i, 1]
        v[2] = gust_F[i, 2]
        for axis in range(3):
            for other in range(3):
                v[axis] += load * R_WT[axis, other] * wake_T[i, other]
                if i < n:
                    v[axis] += R_WB[axis, other] * bow_B[i, other]
        for axis in range(3):
            if i < n:
                out[i, axis] = v[axis]
            else:
                for row in range(4):
                    linear[row, axis] += fit[row, i - n] * v[axis]  # gradients along B's axes of velocities in W
    for axis in range(3):
        out[n, axis], out[n + 1, axis] = linear[0, axis], 0.0
    for axis in range(3):  # Eq. (2); the velocities are in W, their components along B's y and z are wanted
        out[n + 1, 0] += R_WB[axis, 2] * linear[2, axis]
        out[n + 1, 1] -= R_WB[axis, 2] * linear[1, axis]
        out[n + 1, 2] += R_WB[axis, 1] * linear[1, axis]
    out[n + 1, 0] += rolling
