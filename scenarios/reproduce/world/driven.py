"""A receiver that moves as it is told, whatever pushes it, and a world in still air around it.

It takes up the commanded velocity and does not turn, so that what hose, reel and coupling do is seen apart from how an
aircraft flies:

    m dv/dt = m g + k m (v_commanded - v) + contact,        -m g carried                                   (1)

with a time constant 1/k of a few physics ticks: a contact force of 5 kN changes its velocity by less than 0.01 m/s.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from dockair.calibration import Mounting
from dockair.clock import Clock
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters, read_sheet
from dockair.rotations import Array, exp
from dockair.sim.air.atmosphere import STANDARD_GRAVITY_M_S2, standard_atmosphere
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.hose.fuel import FuelParameters
from dockair.sim.hose.reel import ReelParameters
from dockair.sim.outlines import TankerParameters
from dockair.sim.world import World, WorldParameters, WorldStart

AIRSPEED_M_S, ALTITUDE_M = 180.0, 6000.0
PHYSICS_HZ = 1000
T = TypeVar("T")


@dataclass(slots=True, eq=False)
class DrivenReceiver:
    """Eq. (1); level unless `pitch_rad` (nose down) says otherwise."""

    pitch_rad: float = 0.0
    mass_kg: float = 9300.0
    inertia_B: Array = field(default_factory=lambda: np.diag([12.9e3, 75.7e3, 85.6e3]))
    airspeed_m_s: float = AIRSPEED_M_S
    angle_of_attack_rad: float = 0.0
    sideslip_rad: float = 0.0
    throttle: float = 0.0
    gain_1_s: float = 100.0

    @property
    def trim_R_WB(self) -> Array:
        """(3, 3) attitude that it keeps."""
        return exp(np.array([0.0, self.pitch_rad, 0.0]))

    def step(self, *, R_WB: Array, v_WB: Array, w_WB_B: Array, command: ReceiverCommand, **_: Any) -> Array:
        """(2, 3) force and moment about the centre of gravity in W, without gravity."""
        up = np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])
        force_W = self.mass_kg * (up + self.gain_1_s * (command.velocity_m_s - v_WB))
        return np.array([force_W, R_WB @ (self.inertia_B @ (-self.gain_1_s * w_WB_B))])


def driven_world(
    p_PD_B: tuple[float, float, float],
    *,
    pitch_rad: float = 0.0,
    dead_from_s: float = np.inf,
    overrides: Mapping[str, Mapping[str, float]] | None = None,
) -> World:
    """World in still air with a driven receiver.

    Args:
        p_PD_B: the drogue's ring centre from the probe's tip at the start [m].
        pitch_rad: of the receiver, positive nose down.
        dead_from_s: time from which the reel is locked.
        overrides: of the sheets' values, by sheet.
    """

    def sheet(name: str, cls: type[T]) -> T:
        return load_parameters(name, cls, (overrides or {}).get(name))

    probe, camera = (np.array(read_sheet("mounting")[key].value) for key in ("probe_tip_m", "camera_position_m"))
    parameters = WorldParameters(
        hose=sheet("hose", HoseParameters),
        drogue=sheet("drogue", DrogueParameters),
        reel=sheet("reel", ReelParameters),
        coupling=sheet("coupling", CouplingParameters),
        fuel=sheet("fuel", FuelParameters),
        tanker=sheet("tanker", TankerParameters),
        mounting=Mounting(R_BC=np.eye(3), p_BC=camera, p_BP=probe),
        air=standard_atmosphere(ALTITUDE_M),
        airspeed_m_s=AIRSPEED_M_S,
        sun_direction_W=np.array([0.0, 0.0, 1.0]),
    )
    start = WorldStart(p_PD_B=np.array(p_PD_B), settle_s=0.0)
    receiver = DrivenReceiver(pitch_rad=pitch_rad)
    return World(parameters, receiver, None, start, Clock(PHYSICS_HZ), lambda time_s: time_s >= dead_from_s)
