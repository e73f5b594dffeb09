"""Trims and gains of the flight control between straight flight and turns, level.

They are found where the bank of a level turn, tan(bank) = V r / g, is a multiple of `NODE_RAD`, when first needed, and
are linear in that bank between; attitudes are roll, pitch and yaw (about z, y, x in turn). Between the last node that
the airframe can fly and the next, which thrust or lift do not reach, the line of the cell before is carried on: a turn
just below that limit still has trim and gains, and so has the little by which a path overshoots it. Farther on, where a
receiver turns that has fallen behind, those of the last turn that had some are kept: what comes of it is the flight's.
Slopes of the path turn the axes and add their part of the weight to the thrust; the gains are those of level flight.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, Air
from dockair.sim.aircraft.airframe import AirframeData
from dockair.sim.aircraft.linear_model import INPUTS, STATES, LinearModel, linear_model
from dockair.sim.aircraft.regulator import FOLLOWED, Gains, Swing, Tolerances, design, tip_velocity
from dockair.sim.aircraft.trim import Trim, steady_trim

NODE_RAD = float(np.radians(5.0))

_MEMORY = np.dtype(
    [
        ("trim", float, 10),
        ("A", float, (STATES, STATES)),
        ("C", float, (3, STATES)),
        ("K", float, (INPUTS, STATES + 6)),
        ("K_busy", float, (INPUTS, STATES + 6)),
        ("K_followed", float, (INPUTS, FOLLOWED)),
        ("K_command", float, (INPUTS, 9)),
        ("gust_from_residual", float, (3, 3)),
    ]
)
#: In `Row.trim`.
ATTITUDE_0, RATE_0, SURFACES_0, THRUST_0 = slice(0, 3), slice(3, 6), slice(6, 9), 9


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """Trim and gains at one turn rate."""

    trim: Array  #: (10,) roll, pitch and yaw, rates, surfaces, thrust per mass
    A: Array  #: (13, 13)
    C: Array  #: (3, 13)
    K: Array  #: (4, 19)
    K_busy: Array  #: (4, 19)
    K_followed: Array  #: (4, 16)
    K_command: Array  #: (4, 9)
    gust_from_residual: Array  #: (3, 3)
    memory: NDArray[np.void]  #: () all of these, for `control_law`

    @classmethod
    def of(cls, flat: Array) -> "Row":
        """Name the parts of one array."""
        memory: NDArray[np.void] = flat.view(_MEMORY).reshape(())
        return cls(**{name: memory[name] for name in _MEMORY.names or ()}, memory=memory)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Design:
    """What the gains are designed with."""

    point_B: Array  #: (3,) the probe's tip from the centre of gravity [m]
    feedback: Tolerances
    busy: Tolerances
    following: Tolerances
    gust_1_s: float
    swing: Swing


class GainSchedule:
    """Trim and gains by turn rate.

    Args:
        airframe: the on-board model.
        air: of the flight's altitude.
        trim: straight and level.
        wanted: what to design with.
    """

    def __init__(self, airframe: AirframeData, air: Air, trim: Trim, wanted: Design) -> None:
        self._airframe, self._air, self._wanted = airframe, air, wanted
        self._airspeed_m_s = trim.airspeed_m_s
        self._rows: dict[int, Array] = {}
        self._ends: dict[int, Array] = {}  # outer nodes of cells, flyable or carried on to
        self._refused: dict[int, DockairError] = {}  # nodes that cannot be flown: asked for at every tick
        self.model, self.gains, self._rows[0] = self._designed(trim)  #: of straight flight
        self._at, self._row = 0.0, Row.of(self._rows[0])

    def at(self, turn_rate_rad_s: float) -> Row:
        """Trim and gains at a turn rate, positive to the left.

        Raises:
            DockairError: the airframe cannot turn as fast as at the last node before.
        """
        if turn_rate_rad_s != self._at:
            place = np.arctan(turn_rate_rad_s * self._airspeed_m_s / STANDARD_GRAVITY_M_S2) / NODE_RAD
            low = int(np.floor(place))
            share = place - low
            if not share:
                flat = self._node(low)
            elif place > 0.0:
                flat = (1.0 - share) * self._node(low) + share * self._end(low + 1)
            else:
                flat = (1.0 - share) * self._end(low) + share * self._node(low + 1)
            self._at, self._row = turn_rate_rad_s, Row.of(flat)
        return self._row

    def nearest(self, turn_rate_rad_s: float) -> Row:
        """As `at`; of a turn that the airframe cannot fly, the row that was asked for before."""
        try:
            return self.at(turn_rate_rad_s)
        except DockairError:
            return self._row

    def _end(self, i: int) -> Array:
        """Node i, or where it cannot be flown the end of the line through the two before it."""
        if i not in self._ends:
            try:
                self._ends[i] = self._node(i)
            except DockairError:
                outward = 1 if i > 0 else -1
                if i == outward:  # there is but one before it
                    raise
                self._ends[i] = 2.0 * self._node(i - outward) - self._node(i - 2 * outward)
        return self._ends[i]

    def _node(self, i: int) -> Array:
        if i in self._refused:
            raise self._refused[i].with_traceback(None)  # which would grow from tick to tick
        if i not in self._rows:
            turn_rate = STANDARD_GRAVITY_M_S2 * float(np.tan(i * NODE_RAD)) / self._airspeed_m_s
            try:
                trim = steady_trim(self._airframe, self._airspeed_m_s, self._air, turn_rate_rad_s=turn_rate)
            except DockairError as error:
                self._refused[i] = error
                raise
            self._rows[i] = self._designed(trim)[2]
        return self._rows[i]

    def _designed(self, trim: Trim) -> tuple[LinearModel, Gains, Array]:
        wanted, model = self._wanted, linear_model(self._airframe, trim)
        gains = design(
            model,
            tip_velocity(trim.R_WB, wanted.point_B),
            wanted.feedback,
            wanted.busy,
            wanted.following,
            wanted.gust_1_s,
            wanted.swing,
        )
        # airspeed beyond the inertial one gives the gust along the path, the accelerometers the two across
        gust = np.linalg.inv(np.vstack([[1.0, 0.0, 0.0], model.F_gust[1:]]))
        at_trim = [roll_pitch_yaw(trim.R_WB), trim.w_WB_B, trim.surfaces_rad, [trim.thrust_n / self._airframe.mass_kg]]
        matrices = (model.A, gains.C, gains.K, gains.K_busy, gains.K_followed, gains.K_command, gust)
        return model, gains, np.concatenate([*at_trim, *(matrix.ravel() for matrix in matrices)])


def roll_pitch_yaw(R: Array) -> Array:
    """(3,) angles about x, y, z of R = R_z R_y R_x [rad]."""
    return np.array([np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0]), np.arctan2(R[1, 0], R[0, 0])])
