"""A receiver on the racetrack behind its tanker: its motion, over the samples of its gyro.

It flies rigidly in the tanker's axes: the same path, bank and turns. Its pitch is that of its own trims, of straight
flight and of the steady turn, in between by the square of the turn rate, as its lift goes; gusts shake yaw, pitch and
roll by Gauss-Markov angles, filtered twice so that their rates are finite:

    R_WB = R_WT R_y(pitch) R(shaking),     w = log( R_WB(t)' R_WB(t + dt) ) / dt                          (1)

Not modelled: the receiver's formation keeping (it does not move in the tanker's axes), wind.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from dockair.rotations import Array
from dockair.scenarios.assembly.receiver import airframe
from dockair.scenarios.schema import load_scenario
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.aircraft.tanker import TankerPath, TankerPathParameters
from dockair.sim.aircraft.tanker_motion import TURN, A, P, R
from dockair.sim.aircraft.trim import level_trim, steady_trim

_TURNING_RAD_S = 1e-6  # slower is straight


@dataclass(frozen=True, slots=True, kw_only=True)
class Racetrack:
    """What is flown, and how the air shakes it."""

    duration_s: float = 1800.0
    leg_s: float = 180.0  #: wings level between two turns
    starts_s: float = 120.0
    bank_deg: float = 25.0
    turns_left: bool = True
    rate_hz: float = 100.0  #: of the gyro
    shaking_deg: tuple[float, float, float] = (0.1, 0.2, 0.5)  #: yaw, pitch, roll: rms in light gusts
    shaking_s: float = 1.5  #: for which a gust's shake lasts
    seed: int = 3  #: of the shaking


@dataclass(eq=False)
class Formation:
    """The motion of receiver and tanker; W has the tanker's velocity at the start.

    Args:
        track: what is flown.
    """

    track: Racetrack

    @cached_property
    def time_s(self) -> Array:
        """(n + 1,) of the samples, the start included."""
        return np.arange(round(self.track.duration_s * self.track.rate_hz) + 1) / self.track.rate_hz

    @cached_property
    def tanker(self) -> Array:
        """(n + 1, 26) as `TankerPath.vector` lays it out."""
        t = self.track
        parameters = TankerPathParameters(
            manoeuvre="racetrack",
            starts_s=t.starts_s,
            leg_s=t.leg_s,
            bank_rad=float(np.radians(t.bank_deg)),
            turns_left=t.turns_left,
        )
        path = TankerPath(parameters, load_scenario("default").flight.airspeed_m_s)
        return np.array([path.vector(float(time)) for time in self.time_s])

    @cached_property
    def attitudes_R_WB(self) -> Array:
        """(n + 1, 3, 3), Eq. (1)."""
        rates = self.tanker[:, TURN]
        most = float(np.abs(rates).max())
        level, turning = self._trim_angles_rad(most)
        pitch = level + (turning - level) * (rates / most) ** 2 if most > _TURNING_RAD_S else np.full(rates.size, level)
        nose_up = Rotation.from_euler("y", -pitch[:, None])
        R_WB = Rotation.from_matrix(self.tanker[:, R].reshape(-1, 3, 3)) * nose_up * self._shaking()
        return np.asarray(R_WB.as_matrix())

    @cached_property
    def headings_rad(self) -> Array:
        """(n + 1,) of the body's x axis, not wrapped, from where it points at the start."""
        R_WB = self.attitudes_R_WB
        heading = np.unwrap(np.arctan2(R_WB[:, 1, 0], R_WB[:, 0, 0]))
        return np.asarray(heading - heading[0])

    @cached_property
    def rates_rad_s(self) -> Array:
        """(n, 3) w_WB_B from each sample to the next, Eq. (1)."""
        R_WB = Rotation.from_matrix(self.attitudes_R_WB)
        return np.asarray((R_WB[:-1].inv() * R_WB[1:]).as_rotvec() * self.track.rate_hz)

    @cached_property
    def specific_forces_m_s2(self) -> Array:
        """(n, 3) in body axes: the path's acceleration less gravity."""
        force_W = self.tanker[1:, A] + np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])
        return np.asarray(np.einsum("nji,nj->ni", self.attitudes_R_WB[1:], force_W))

    @cached_property
    def is_turning(self) -> NDArray[np.bool_]:
        """(n + 1,) rolling in and out included."""
        return np.asarray(np.abs(self.tanker[:, TURN]) > _TURNING_RAD_S)

    def tanker_attitude(self, sample: int) -> Array:
        """(3, 3) R_WT."""
        return np.asarray(self.tanker[sample, R].reshape(3, 3))

    @property
    def places_W(self) -> Array:
        """(n + 1, 3) of the tanker [m]."""
        return np.asarray(self.tanker[:, P])

    def _trim_angles_rad(self, turn_rate_rad_s: float) -> tuple[float, float]:
        """Angles of attack in straight flight and in the turn."""
        scenario = load_scenario("default")
        flown = airframe(scenario, {}), scenario.flight.airspeed_m_s, standard_atmosphere(scenario.flight.altitude_m)
        turning = steady_trim(*flown, turn_rate_rad_s=turn_rate_rad_s)
        return level_trim(*flown).alpha_rad, turning.alpha_rad

    def _shaking(self) -> Rotation:
        t, rng = self.track, np.random.default_rng(self.track.seed)
        kept = float(np.exp(-1.0 / (t.rate_hz * t.shaking_s)))
        angles = rng.standard_normal((self.time_s.size, 3))
        for _ in range(2):
            angles = lfilter([1.0 - kept], [1.0, -kept], angles, axis=0)
        # variance of white noise through two equal poles k: (1 - k)^4 (1 + k^2) / (1 - k^2)^3
        rms = np.sqrt((1.0 - kept) ** 4 * (1.0 + kept**2) / (1.0 - kept**2) ** 3)
        return Rotation.from_euler("ZYX", np.radians(t.shaking_deg) * angles / rms)
