"""The reel: holds a tension, within limits of speed and stroke; and the tube that leads the hose inside the pod.

    tau dF/dt = T_s + k (T_s - T) - F                                                                    (1)
    F_hose    = F g(v) + F_b b(v) - d v + max(0, S - d_s v min(1, S/F_0)),   S = max(0, F_0 - k_s q)     (2)

F is the motor's pull on the hose (positive winds in), T the hose's tension at the exit, T_s the set-point. g falls from
1 to 0 as the winding speed v comes within a band of the take-up limit; b rises from 0 to 1 beyond the pay-out limit: a
brake. The last term is the outer stop's buffer, with F_0 such that the hose rests on it at q = 0, its full trail; S is
its spring's push. It touches nothing from q = F_0/k_s on, and its damper takes hold as the spring is pressed.

The set-point is a fraction of the static tension T_0 at full trail, but never more than lets the hose run out again by
itself after the receiver has left, all of the reel's range being wound in, with a force F_m over:

    T_s       = min(f T_0, (T_r cos(theta_r) + k T_r - F_m) / (1 + k))                                   (5)

T_r and theta_r being tension and angle to the pod's axis at the exit, at rest, of a hose so much shorter. What winding
in takes from the tension goes by the hose's weight and not with the square of the speed, so that the second bounds the
set-point in slow flight, of light drogues and of heavy hoses. With T_s equal to T_0 no hose would run out.

A dead reel is a drum that is locked: where it was, q_l, it holds the tension T_l it had, and gives way only as far as
the hose stretches between drum and drogue, its own inertia taking no part,

    F_hose    = T_l + k_l (q_l - q) - d_l v                                                              (3)

Inside the pod the hose lies straight in a tube. A link that is half drawn in, a length s of its l, must turn the hose
at the exit and not at its own front joint: with the outer hose at an angle theta to the pod's axis, its own angle has
to be (1 - s/l) theta. Under a tension T a torsion spring against the axis does precisely that:

    k_t(s) = T l (s/l) / (1 - s/l)                                                                       (4)

capped where it is as stiff as the tube. So the drogue moves smoothly while joint after joint passes the exit.

Not modelled: the drum's changing diameter, friction of the hose in the tube, slack on the drum; stretch of the hose
but for Eq. (3); a brake that slips. The reel acts along the pod's axis, so that it balances T cos(theta) of the hose's
tension, 2 per cent less than T at the usual 12 degrees; the motor is ruled by T, as a load cell on the hose is.
Sources: RflySim/RflySimAAR (gain); limits in assets/parameters/reel.toml; Eq. (4) derived from the link's balance.
"""

from dataclasses import dataclass

import numpy as np

from dockair.errors import DockairError
from dockair.kernels import njit
from dockair.messages import Light
from dockair.rotations import Array
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2
from dockair.sim.hose.chain import HoseParameters
from dockair.sim.hose.rest import RestShape


@dataclass(frozen=True, slots=True, kw_only=True)
class ReelParameters:
    """assets/parameters/reel.toml."""

    set_point_fraction: float
    run_out_force_n: float
    tension_gain: float
    response_time_s: float
    refuelling_from_m: float
    inner_limit_m: float
    range_m: float
    take_up_speed_m_s: float
    pay_out_speed_m_s: float
    speed_band_m_s: float
    brake_force_n: float
    drum_mass_kg: float
    drum_damping_n_s_m: float
    buffer_stiffness_n_m: float
    buffer_damping_n_s_m: float
    buffer_travel_m: float
    lock_stiffness_n_m: float
    lock_damping_n_s_m: float
    stop_time_constant_s: float
    guide_stiffness_n_m2: float  #: per metre of hose
    guide_damping_ratio: float


def reel_light(position_m: float, known_dead: bool, parameters: ReelParameters) -> Light:
    """Return the light for a length of hose wound in [m]: what the pod shows, and its fuel valve goes by."""
    if known_dead:
        return Light.RED
    if position_m < parameters.refuelling_from_m:
        return Light.AMBER
    return Light.GREEN if position_m <= parameters.inner_limit_m else Light.FLASHING_AMBER


class Reel:
    """Motor of the reel, Eqs. (1) to (3).

    Args:
        parameters: the reel's sheet.
        static_root_tension_n: T_0, tension at the exit at rest at full trail.
        static_pull_n: T_0 cos(theta_0), what of it pulls along the pod's axis.
        set_point_n: T_s, of `set_point_n`.
        step_s: physics step.

    Raises:
        DockairError: a refuelling range that does not lie within the reel's.
    """

    def __init__(
        self,
        parameters: ReelParameters,
        *,
        static_root_tension_n: float,
        static_pull_n: float,
        set_point_n: float,
        step_s: float,
    ) -> None:
        _check_limits(parameters)
        self._parameters, self.set_point_n = parameters, set_point_n
        self._blend = float(1.0 - np.exp(-step_s / parameters.response_time_s))
        self.motor_force_n = self._wanted(static_root_tension_n)
        self._buffer_preload_n = static_pull_n - self.motor_force_n
        self._held: tuple[float, float] | None = None  # position and tension at which the drum locked

    @property
    def locked(self) -> bool:
        """Whether the drum stood at the last step."""
        return self._held is not None

    def step(self, tension_n: float, position_m: float, rate_m_s: float, locked: bool = False) -> float:
        """Advance by one tick; return the force on the hose [N], positive winds in.

        Args:
            tension_n: at the exit.
            position_m: wound in, 0 at full trail.
            rate_m_s: of winding, positive in.
            locked: the reel is dead. When it comes to life again its motor begins with the pull that the lock held.
        """
        if locked:
            force = self._locked(tension_n, position_m, rate_m_s)
            self.motor_force_n = max(force - self._buffer(position_m, rate_m_s), 0.0)
            return force
        p, self._held = self._parameters, None
        motor = self.motor_force_n + self._blend * (self._wanted(tension_n) - self.motor_force_n)  # Eq. (1)
        self.motor_force_n = motor
        drive, braking = p.take_up_speed_m_s - rate_m_s, -rate_m_s - p.pay_out_speed_m_s
        if drive < p.speed_band_m_s:
            motor *= max(drive / p.speed_band_m_s, 0.0)
        if braking > 0.0:
            motor += p.brake_force_n * min(braking / p.speed_band_m_s, 1.0)
        return motor - p.drum_damping_n_s_m * rate_m_s + self._buffer(position_m, rate_m_s)  # Eq. (2)

    def _buffer(self, position_m: float, rate_m_s: float) -> float:
        """Last term of Eq. (2)."""
        p, preload = self._parameters, self._buffer_preload_n
        spring = preload - p.buffer_stiffness_n_m * position_m
        if spring <= 0.0:
            return 0.0
        push = spring - p.buffer_damping_n_s_m * rate_m_s * min(1.0, spring / preload)
        return 0.0 if push < 0.0 else push

    def _locked(self, tension_n: float, position_m: float, rate_m_s: float) -> float:
        p = self._parameters
        if self._held is None:
            self._held = position_m, tension_n
        held_m, held_n = self._held
        return held_n + p.lock_stiffness_n_m * (held_m - position_m) - p.lock_damping_n_s_m * rate_m_s  # Eq. (3)

    def _wanted(self, tension_n: float) -> float:
        """Motor's pull asked for; it cannot push the hose out."""
        pull = self.set_point_n + self._parameters.tension_gain * (self.set_point_n - tension_n)
        return 0.0 if pull < 0.0 else pull


def set_point_n(parameters: ReelParameters, full_trail: RestShape, wound_in: RestShape) -> float:
    """Tension that the reel holds [N], Eq. (5).

    Args:
        parameters: the reel's sheet.
        full_trail: the hose at rest.
        wound_in: the same with the reel's whole range wound in.
    """
    p, tension_n, cosine = parameters, wound_in.root_tension_n, float(wound_in.t_W[0, 0])
    runs_out_n = (tension_n * cosine + p.tension_gain * tension_n - p.run_out_force_n) / (1.0 + p.tension_gain)
    return max(min(p.set_point_fraction * full_trail.root_tension_n, runs_out_n), 0.0)


def _check_limits(parameters: ReelParameters) -> None:
    p = parameters
    if not p.refuelling_from_m < p.inner_limit_m:
        where, expected = "parameters.reel.inner_limit_m", f"more than refuelling_from_m = {p.refuelling_from_m}"
        raise DockairError(where, expected=expected, got=p.inner_limit_m)
    if not p.inner_limit_m <= p.range_m:
        where, expected = "parameters.reel.range_m", f"at least inner_limit_m = {p.inner_limit_m}"
        raise DockairError(where, expected=expected, got=p.range_m)


def guide_coefficients(hose: HoseParameters, reel: ReelParameters, static_root_tension_n: float) -> Array:
    """(6,) vector that `guide_loads` needs: link length and mass, T l, tube stiffness and damping, damping ratio."""
    length, mass, ratio = hose.link_length_m, hose.link_mass_kg, reel.guide_damping_ratio
    stiffness = reel.guide_stiffness_n_m2 * length
    damping = 2.0 * ratio * np.sqrt(stiffness * mass)
    k = np.array([length, mass, static_root_tension_n * length, stiffness, damping, ratio])
    k.setflags(write=False)
    return k


@njit(cache=True)
def guide_loads(position: Array, R: Array, v: Array, w: Array, drawn_in: float, k: Array) -> Array:
    """What the tube in the pod does to the hose's links, Eq. (4).

    Args:
        position: (n, 3) the links' middles in W [m].
        R: (n, 3, 3) their axes in W, x along the link toward the tanker.
        v: (n, 3) velocities of the middles in W [m/s].
        w: (n, 3) angular velocities in W [rad/s].
        drawn_in: length of hose inside the pod [m].
        k: vector of `guide_coefficients`.

    Returns:
        (n, 6) force [N] and moment about the middle [N m], in W.
    """
    wrench = np.zeros((position.shape[0], 6))
    add_guide_loads(position, R, v, w, drawn_in, k, wrench)
    return wrench


@njit(cache=True)
def add_guide_loads(position: Array, R: Array, v: Array, w: Array, drawn_in: float, k: Array, wrench: Array) -> None:
    """Add `guide_loads` to an array (n, 6); what else the other arrays hold beyond n rows is not read."""
    n = wrench.shape[0]
    length, mass, tension_length, stiffness, damping, ratio = k[0], k[1], k[2], k[3], k[4], k[5]
    stiffest = stiffness * length * length
    inertia = mass * length * length / 3.0
    for i in range(n):
        s = min((drawn_in - i * length) / length, 1.0)
        if s <= 0.0:
            break
        t = R[i, :, 0]
        torsion = stiffest
        if tension_length * s < stiffest * (1.0 - s):
            torsion = tension_length * s / (1.0 - s)  # Eq. (4)
        turning = 2.0 * ratio * np.sqrt(torsion * inertia)
        # t x e_x turns the link onto the tube's axis; twist about x has no joint and no load
        wrench[i, 4] += torsion * t[2] - turning * w[i, 1]
        wrench[i, 5] += -torsion * t[1] - turning * w[i, 2]
        wrench[i, 2] += s * mass * STANDARD_GRAVITY_M_S2  # the tube carries what lies in it
        wrench[i, 4] += -0.5 * (1.0 - s) * length * t[0] * s * mass * STANDARD_GRAVITY_M_S2
        if i > 0:  # joint i, at the rear end of link i - 1, is held to the axis
            j = i - 1
            arm = -0.5 * length * R[j, :, 0]
            velocity = v[j] + np.cross(w[j], arm)
            force = np.zeros(3)
            for axis in (1, 2):
                force[axis] = -s * (stiffness * (position[j, axis] + arm[axis]) + damping * velocity[axis])
            wrench[j, :3] += force
            wrench[j, 3:] += np.cross(arm, force)
