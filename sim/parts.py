"""What a world is made of: the sheets and the flight condition, the receiver, the air's motion, the start."""

from dataclasses import dataclass
from functools import cache
from typing import Protocol, runtime_checkable

import numpy as np

from dockair.calibration import Mounting
from dockair.messages import ReceiverCommand
from dockair.rotations import Array
from dockair.sim.air.atmosphere import Air
from dockair.sim.air.motion import AirState
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.hose.fuel import FuelParameters
from dockair.sim.hose.reel import ReelParameters
from dockair.sim.outlines import TankerParameters
from dockair.sim.scene import SceneParameters


class Airframe(Protocol):
    """What the world needs of the receiver: `dockair.sim.aircraft.receiver.Receiver`."""

    @property
    def mass_kg(self) -> float:
        """Mass [kg]."""
        ...

    @property
    def inertia_B(self) -> Array:
        """(3, 3) about the centre of gravity [kg m^2]."""
        ...

    @property
    def trim_R_WB(self) -> Array:
        """(3, 3) attitude in trimmed level flight."""
        ...

    @property
    def airspeed_m_s(self) -> float:
        """At the last step [m/s]."""
        ...

    @property
    def angle_of_attack_rad(self) -> float:
        """At the last step."""
        ...

    @property
    def sideslip_rad(self) -> float:
        """At the last step."""
        ...

    @property
    def throttle(self) -> float:
        """Commanded fraction of the thrust range."""
        ...

    def step(
        self,
        *,
        R_WB: Array,
        v_WB: Array,
        w_WB_B: Array,
        air_velocity_W: Array,
        air_rotation_B: Array,
        specific_force_B: Array,
        command: ReceiverCommand,
    ) -> Array:
        """(2, 3) force and moment about the centre of gravity in W, without gravity.

        The arrays handed in are the world's own and move on with it: whoever keeps one copies it.
        """
        ...


@runtime_checkable
class FlyingAirframe(Airframe, Protocol):
    """One that has to be trimmed in the air it flies in; others are held up by something else."""

    def trim_in(self, downwash_m_s: float, pitching_air_rad_s: float) -> None:
        """Begin anew, trimmed in air that sinks and turns about the left axis so fast; `trim_R_WB` is the attitude."""
        ...


class AirAround(Protocol):
    """What the world needs of the air's motion: `dockair.sim.air.motion.AirMotion`."""

    def step(self) -> None:
        """Advance by one tick."""
        ...

    def at(self, tow_places_W: Array, R_WB: Array, p_WB: Array, R_WT: Array, p_WT: Array) -> AirState:
        """The air's motion at the tow's bodies and about the receiver, beyond the undisturbed wind."""
        ...

    def steady(self) -> "AirAround":
        """Its part that stays: the wake."""
        ...


@cache
def still_air(bodies: int) -> AirState:
    """Air that does not move at so many bodies of the tow, nor at the receiver."""
    places, nowhere = np.zeros((bodies, 3)), np.zeros(3)
    for array in (places, nowhere):
        array.setflags(write=False)
    return AirState(tow_W=places, receiver_W=nowhere, receiver_rotation_B=nowhere)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WorldParameters:
    """The sheets and the flight condition."""

    hose: HoseParameters
    drogue: DrogueParameters
    reel: ReelParameters
    coupling: CouplingParameters
    fuel: FuelParameters
    tanker: TankerParameters
    mounting: Mounting
    air: Air
    airspeed_m_s: float
    sun_direction_W: Array  #: (3,) from the scene to the Sun
    receiver_outline: str = "fighter"  #: name of what the receiver looks like


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WorldStart:
    """Where the flight begins."""

    p_PD_B: Array  #: (3,) the drogue's mean ring centre from the probe's tip, body axes of the trimmed receiver [m]
    settle_s: float  #: how long hose and gusts run before


def scene_of(parameters: WorldParameters, receiver: Airframe, step_s: float) -> SceneParameters:
    """Return what of a world is in its scene."""
    p = parameters
    return SceneParameters(
        hose=p.hose,
        drogue=p.drogue,
        reel=p.reel,
        coupling=p.coupling,
        tanker=p.tanker,
        mounting=p.mounting,
        receiver_mass_kg=receiver.mass_kg,
        receiver_inertia_B=np.asarray(receiver.inertia_B),
        sun_direction_W=p.sun_direction_W,
        step_s=step_s,
        receiver_outline=p.receiver_outline,
    )
