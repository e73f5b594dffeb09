"""What the hardware is, beside what its sheet says: drawn once a flight, known to the simulator alone.

    R_BC = exp(a) R_BC,nominal,   a ~ N(0, sigma_a^2 I) about body axes; the gyro's R_BI likewise                (1)
    f = f_nominal (1 + N(0, sigma_f^2)),   c = c_nominal + N(0, sigma_c^2)                                       (2)
    p_DL = (1 + dD/D) p_DL,nominal + N(0, sigma_L^2 I),   dD ~ N(0, sigma_D^2)                                   (3)
    I_0 = I_nominal x U(2/(1 + q), 2 q/(1 + q))      brightness bin of ratio q, mean 1                           (4)

The probe's tip stays where its sheet says: only the camera's place relative to it matters, and that is drawn.
The pixel pitch is lithography: exact. Lens distortion is as the sheet's.
"""

from dataclasses import dataclass, replace

import numpy as np

from dockair.calibration import Camera, LedRing, Mounting
from dockair.rotations import Array, exp
from dockair.sim.camera.radiometry import LedParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class AsBuiltParameters:
    """Sheet `as_built`: standard deviations."""

    mounting_angle_sigma_rad: float
    mounting_position_sigma_m: float
    focal_length_sigma: float  #: fraction of the focal length
    principal_point_sigma_px: float
    led_position_sigma_m: float  #: each axis
    ring_diameter_sigma_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AsBuilt:
    """One piece of hardware."""

    camera: Camera
    ring_positions_D: Array  #: (n, 3) LEDs in drogue axes [m]
    led_intensity_w_sr: Array  #: (n,) on each LED's axis
    mounting: Mounting


def draw_as_built(
    camera: Camera,
    ring: LedRing,
    mounting: Mounting,
    parameters: AsBuiltParameters,
    leds: LedParameters,
    rng: np.random.Generator,
) -> AsBuilt:
    """Draw one piece of hardware around its nominal sheets, Eqs. (1) to (4).

    The same numbers are drawn whatever the standard deviations are: setting one to zero leaves the others' draws.
    """
    camera_angle, gyro_angle, camera_shift = rng.standard_normal((3, 3))
    focal, *centre = rng.standard_normal(3)
    diameter = parameters.ring_diameter_sigma_m * rng.standard_normal()
    led_shift = parameters.led_position_sigma_m * rng.standard_normal((ring.count, 3))
    brightness = rng.uniform(size=ring.count)

    c_u, c_v = np.array(camera.principal_point_px) + parameters.principal_point_sigma_px * np.array(centre)
    low, high = 2.0 / (1.0 + leds.bin_ratio), 2.0 * leds.bin_ratio / (1.0 + leds.bin_ratio)
    return AsBuilt(
        camera=replace(
            camera,
            focal_length_m=camera.focal_length_m * (1.0 + parameters.focal_length_sigma * float(focal)),
            principal_point_px=(float(c_u), float(c_v)),
        ),
        ring_positions_D=_frozen(ring.positions_D * (1.0 + diameter / ring.diameter_m) + led_shift),
        led_intensity_w_sr=_frozen(leds.intensity_w_sr * (low + (high - low) * brightness)),
        mounting=Mounting(
            R_BC=_frozen(exp(parameters.mounting_angle_sigma_rad * camera_angle) @ mounting.R_BC),
            p_BC=_frozen(mounting.p_BC + parameters.mounting_position_sigma_m * camera_shift),
            p_BP=mounting.p_BP,
            R_BI=_frozen(exp(parameters.mounting_angle_sigma_rad * gyro_angle) @ mounting.R_BI),
        ),
    )


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array
