"""The complete state of the world at one tick. It goes to the log and to the referee, never to `nav`."""

from dataclasses import dataclass

from dockair.rotations import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """Copies, not views: a Truth stays true after the world has moved on. Frames as in docs/notation.md."""

    tick: int
    time_s: float
    R_WB: Array  #: (3, 3) receiver attitude
    p_WB: Array  #: (3,) receiver centre of gravity [m]
    v_WB: Array  #: (3,) its velocity in W [m/s] (relative to the tanker's trim motion)
    w_WB_B: Array  #: (3,) receiver angular velocity in B [rad/s]
    alpha_WB_B: Array  #: (3,) receiver angular acceleration in B [rad/s^2], over the tick that has just ended
    a_WB: Array  #: (3,) acceleration of the centre of gravity in W [m/s^2], gravity's part included; likewise
    specific_force_B: Array  #: (3,) the same less gravity, in B [m/s^2]: what an accelerometer there feels
    p_WP: Array  #: (3,) probe tip [m]
    v_WP: Array  #: (3,) its velocity [m/s]
    R_WD: Array  #: (3, 3) drogue attitude
    p_WD: Array  #: (3,) centre of the LED ring [m]
    v_WD: Array  #: (3,) its velocity [m/s]
    w_WD_D: Array  #: (3,) drogue angular velocity in D [rad/s]
    p_WH: Array  #: (links + 1, 3) hose joints from the reel to the drogue [m]
    R_WT: Array  #: (3, 3) tanker attitude
    p_WT: Array  #: (3,) tanker [m]
    reel_position_m: float  #: hose wound in from full trail, 0 at the outer stop
    reel_rate_m_s: float
    root_tension_n: float  #: hose tension at the pod's exit
    drogue_tension_n: float  #: hose tension where the drogue begins
    gust_B_m_s: Array  #: (3,) gust at the receiver, W axes
    gust_D_m_s: Array  #: (3,) gust at the drogue, W axes
    airspeed_m_s: float  #: of the receiver
    angle_of_attack_rad: float
    sideslip_rad: float
    throttle: float  #: commanded fraction of the thrust range
    latched: bool  #: the probe is held by the coupling
    coupling_force_n: float  #: pull on the probe by the coupling, 0 when not latched
    probe_touches_drogue: bool  #: any contact of the probe with basket or coupling at this tick
    receiver_touches: str  #: name of what the receiver (other than its probe) touches, "" for nothing

    @property
    def p_PD_B(self) -> Array:
        """(3,) ring centre from the probe's tip, body axes [m]."""
        return self.R_WB.T @ (self.p_WD - self.p_WP)

    @property
    def p_DP(self) -> Array:
        """(3,) probe tip from the ring centre, drogue axes [m]; x < 0 while the probe is still aft of the rim."""
        return self.R_WD.T @ (self.p_WP - self.p_WD)
