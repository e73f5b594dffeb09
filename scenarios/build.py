"""Makes a scenario's world, sensors and navigation: the only place where as-built and nominal values are both known."""

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dockair.calibration import GyroSheet, Mounting, NavigationSheets, StartGeometry
from dockair.clock import Clock
from dockair.errors import DockairError
from dockair.messages import Navigates
from dockair.parameters import load_parameters
from dockair.rotations import Array, matrix_from_yaw_pitch_roll
from dockair.scenarios.schema import Scenario
from dockair.scenarios.truth_navigation import TruthNavigator
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.air.turbulence import DrydenField, TurbulenceParameters
from dockair.sim.aircraft.receiver import Receiver
from dockair.sim.world import World
from dockair.streams import counter_key, random_stream


@dataclass(frozen=True, slots=True, kw_only=True)
class MountingParameters:
    """Sheet `mounting`."""

    probe_tip_m: Array
    camera_position_m: Array
    camera_yaw_rad: float

    def mounting(self) -> Mounting:
        """Return the nominal mounting; the camera's axis lies in the body's x-y plane."""
        return Mounting(
            R_BC=matrix_from_yaw_pitch_roll(self.camera_yaw_rad, 0.0, 0.0),
            p_BC=self.camera_position_m,
            p_BP=self.probe_tip_m,
        )
