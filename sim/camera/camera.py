"""The near-infrared camera: one exposure of the world, from radiance to the message that leaves the camera.

    background (sky, scene, haze) + stray light + Sun's disc + point sources ► expected electrons
    expected electrons ► electronics ► pixels ► exposure control ► exposure of the next frame

Point sources are LEDs, glints of the Sun, reflections of the LEDs and compact ghosts, each spread by `optics`, and
smeared over the exposure by the motion of what they sit on. The image of an LED is hidden when something lies between
it and the lens; then it is absent, as are LEDs outside the picture.

Time: `expose` is called with the world at the middle of the exposure; the frame arrives `latency_s` later.
"""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.errors import DockairError
from dockair.messages import CameraFrame, Window
from dockair.rotations import Array
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera import sheets
from dockair.sim.camera.background import Background
from dockair.sim.camera.electronics import digitise, output_gain
from dockair.sim.camera.exposure import ExposureControl
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.camera.glare import Glare
from dockair.sim.camera.glints import Mirrors, find_glints
from dockair.sim.camera.led_reflections import find_led_reflections
from dockair.sim.camera.occlusion import hidden
from dockair.sim.camera.optics import PointSpread
from dockair.sim.camera.radiometry import led_electrons, responses
from dockair.sim.camera.readout import latency_s, transfer_jitter_s
from dockair.sim.camera.sky import Sky
from dockair.sim.camera.sun_view import SunView
from dockair.sim.faults import Faults
