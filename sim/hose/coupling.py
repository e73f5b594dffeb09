"""When the coupling takes the probe and when it lets go.

Within capture distance of the coupling point:

    READY   -> LATCHED   angle between probe and drogue axis and closing speed within limits
    READY   -> BARRED    the tip came in too fast: it bounces, and does not latch in the rebound
    LATCHED -> BARRED    the pull out of the coupling exceeds the release force (soft disconnect)
    BARRED  -> READY     the tip has left by the re-arm distance

Why the release force of 1.9 kN is reached: at rest the hose carries the drogue's drag (1.7 kN) by itself and the
coupling feels nothing; held within the reel's stroke it is pushed with some 100-200 N, the reel's set-point being below
the static tension, less what the receiver's bow wave takes off the drag (some 120 N). A receiver that backs off at
1 m/s takes the hose out against its outer stop; there all further pull goes through the coupling, over and above the
drogue's drag: it lets go 20 ms after the hose has met the buffer, the root then carrying 4.1 kN.

Not modelled: the toggles' friction, wear, a coupling that fails to let go.
Source of the limits: assets/parameters/coupling.toml.
"""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from dockair.errors import DockairError
from dockair.sim.truth import Truth
from dockair.vectors import cross


@dataclass(frozen=True, slots=True, kw_only=True)
class CouplingParameters:
    """assets/parameters/coupling.toml.

    Raises:
        DockairError: a probe that does not fit the bore, or that the latches never take.
    """

    depth_m: float
    capture_distance_m: float
    angle_limit_rad: float
    closing_speed_min_m_s: float
    closing_speed_max_m_s: float
    release_force_n: float
    rearm_distance_m: float
    latch_time_constant_s: float
    latch_damping_ratio: float
    socket_radius_m: float
    socket_wall_m: float
    stop_gap_m: float
    probe_tip_radius_m: float
    probe_boom_radius_m: float
    probe_boom_length_m: float
    probe_reflectance: float

    def __post_init__(self) -> None:
        """Refuse a probe whose tip is not its foremost point or too thick for the bore, and latches that take none."""
        if not self.probe_boom_radius_m <= self.probe_tip_radius_m:
            expected = f"at most coupling.probe_tip_radius_m = {self.probe_tip_radius_m}"
            raise DockairError("coupling.probe_boom_radius_m", expected=expected, got=self.probe_boom_radius_m)
        if not self.probe_tip_radius_m < self.socket_radius_m:
            expected = f"less than coupling.socket_radius_m = {self.socket_radius_m}, or no tip gets in"
            raise DockairError("coupling.probe_tip_radius_m", expected=expected, got=self.probe_tip_radius_m)
        if not self.closing_speed_min_m_s < self.closing_speed_max_m_s:
            expected = f"more than coupling.closing_speed_min_m_s = {self.closing_speed_min_m_s}, or no probe is taken"
            raise DockairError("coupling.closing_speed_max_m_s", expected=expected, got=self.closing_speed_max_m_s)
        resting_m = math.hypot(self.socket_radius_m - self.probe_tip_radius_m, self.stop_gap_m)
        if not resting_m <= self.capture_distance_m:
            at_rest = "as far off as a nozzle may rest on the bore's bottom (socket_radius_m, stop_gap_m)"
            expected = f"at least {math.ceil(1e4 * resting_m) / 1e4} m, {at_rest}"
            raise DockairError("coupling.capture_distance_m", expected=expected, got=self.capture_distance_m)


class CouplingState(Enum):
    """What the coupling does."""

    READY = "ready"
    LATCHED = "latched"
    BARRED = "barred"  #: until the tip has left


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbeInCoupling:
    """Where the probe is, seen from the coupling."""

    distance_m: float  #: tip to coupling point
    angle_rad: float  #: between the axes of probe and drogue
    closing_speed_m_s: float  #: of the tip into the coupling, along the drogue's axis
    pull_n: float  #: with which the held probe is drawn out of the coupling, along the drogue's axis


def stays(state: CouplingState, distance_m: float, pull_n: float, parameters: CouplingParameters) -> bool:
    """Whether distance and pull alone say that `next_coupling_state` is this one: at most ticks they do."""
    if state is CouplingState.LATCHED:
        return pull_n <= parameters.release_force_n
    return state is CouplingState.READY and distance_m > parameters.capture_distance_m


def next_coupling_state(state: CouplingState, probe: ProbeInCoupling, parameters: CouplingParameters) -> CouplingState:
    """State after this tick."""
    if state is CouplingState.LATCHED:
        return CouplingState.BARRED if probe.pull_n > parameters.release_force_n else state
    if state is CouplingState.BARRED:
        return CouplingState.READY if probe.distance_m > parameters.rearm_distance_m else state
    if probe.distance_m > parameters.capture_distance_m:
        return state
    if probe.closing_speed_m_s > parameters.closing_speed_max_m_s:
        return CouplingState.BARRED
    inward = probe.closing_speed_m_s >= parameters.closing_speed_min_m_s
    aligned = probe.angle_rad <= parameters.angle_limit_rad
    return CouplingState.LATCHED if inward and aligned else state


def probe_in_coupling(truth: Truth, pull_n: float, parameters: CouplingParameters) -> ProbeInCoupling:
    """Return where the probe is, of the world's state and the force the coupling bears."""
    p_DP = truth.p_DP
    p_KP = p_DP - np.array([parameters.depth_m, 0.0, 0.0])
    v_DP_D = truth.R_WD.T @ (truth.v_WP - truth.v_WD) - cross(truth.w_WD_D, p_DP)
    cosine = float(truth.R_WB[:, 0] @ truth.R_WD[:, 0])
    return ProbeInCoupling(
        distance_m=float(np.sqrt(p_KP @ p_KP)),
        angle_rad=float(np.arccos(min(max(cosine, -1.0), 1.0))),
        closing_speed_m_s=float(v_DP_D[0]),
        pull_n=pull_n,
    )
