"""A world with a receiver on rails, for tests that are not about the receiver's flying."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

from dockair.calibration import Mounting
from dockair.clock import Clock
from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.air.motion import AirMotion
from dockair.sim.aircraft.tanker import TankerPath, TankerPathParameters
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.hose.fuel import FuelParameters
from dockair.sim.hose.reel import ReelParameters
from dockair.sim.outlines import TankerParameters
from dockair.sim.world import World, WorldParameters, WorldStart

settings.register_profile("dockair", deadline=None, derandomize=True)  # the same on any day, however busy the machine
settings.load_profile("dockair")

SHEETS: dict[str, type[Any]] = {
    "hose": HoseParameters,
    "drogue": DrogueParameters,
    "reel": ReelParameters,
    "coupling": CouplingParameters,
    "fuel": FuelParameters,
    "tanker": TankerParameters,
}


@dataclass
class ReceiverOnRails:
    """Takes up the commanded velocity within 17 ms and does not turn, whatever pushes it; no air."""

    mass_kg: float = 9300.0
    inertia_B: Array = field(
        default_factory=lambda: np.array([[12874.0, 0.0, 1331.0], [0.0, 75674.0, 0.0], [1331.0, 0.0, 85552.0]])
    )
    trim_R_WB: Array = field(default_factory=lambda: np.eye(3))
    airspeed_m_s: float = 180.0
    angle_of_attack_rad: float = 0.0
    sideslip_rad: float = 0.0
    throttle: float = 0.5
    gain_1_s: float = 60.0
    force_W: Array = field(default_factory=lambda: np.zeros(3))  #: last force returned

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
        self.specific_force_B = specific_force_B
        self.air_velocity_W, self.air_rotation_B = air_velocity_W, air_rotation_B
        self.force_W = self.mass_kg * (np.array([0.0, 0.0, 9.80665]) + self.gain_1_s * (command.velocity_m_s - v_WB))
        return np.array([self.force_W, R_WB @ (self.inertia_B @ (-self.gain_1_s * w_WB_B))])


def make_world(
    *,
    receiver: Any = None,
    gusts: Any = None,
    airspeed_m_s: float = 180.0,
    altitude_m: float = 6000.0,
    p_PD_B: tuple[float, float, float] = (4.0, 0.0, 0.0),
    settle_s: float = 0.0,
    rate_hz: int = 1000,
    reel_locked: Callable[[float], bool] | None = None,
    reel_known_dead: Callable[[float], bool] | None = None,
    tanker_path: Any = None,
    **overrides: dict[str, float],
) -> World:
    """A world from the sheets; `overrides` by sheet."""
    sheets = {name: load_parameters(name, cls, overrides.get(name)) for name, cls in SHEETS.items()}
    parameters = WorldParameters(
        **sheets,
        mounting=Mounting(R_BC=np.eye(3), p_BC=np.array([3.3, -0.45, 0.75]), p_BP=np.array([6.0, -0.9, 0.6])),
        air=standard_atmosphere(altitude_m),
        airspeed_m_s=airspeed_m_s,
        sun_direction_W=np.array([0.0, 0.0, 1.0]),
    )
    start = WorldStart(p_PD_B=np.array(p_PD_B), settle_s=settle_s)
    points_B = np.zeros((1, 3))
    air = None if gusts is None else AirMotion(gusts, exit_T=sheets["tanker"].exit_m, receiver_points_B=points_B)
    path = tanker_path
    if isinstance(tanker_path, TankerPathParameters):
        path = TankerPath(tanker_path, airspeed_m_s, -sheets["tanker"].exit_m)
    clock, rails = Clock(rate_hz), receiver or ReceiverOnRails()
    return World(parameters, rails, air, start, clock, reel_locked, path, reel_known_dead)


@pytest.fixture(name="make_world")
def _make_world() -> Callable[..., World]:
    return make_world


@pytest.fixture
def receiver_on_rails() -> type[ReceiverOnRails]:
    return ReceiverOnRails
