"""What the hardware is, beside what its sheet says: drawn once a flight, known to the simulator alone.

    R_BC = exp(a) R_BC,nominal,   a ~ N(0, sigma_a^2 I) about body axes; the IMU's R_BI likewise                 (1)
    f = f_nominal (1 + N(0, sigma_f^2)),   c = c_nominal + N(0, sigma_c^2)                                       (2)
    p_DL = (1 + dD/D) p_DL,nominal + N(0, sigma_L^2 I),   dD ~ N(0, sigma_D^2)                                   (3)
    I_0 = b_k I_nominal x U(2/(1 + q), 2 q/(1 + q))      ring sheet's b_k, brightness bin of ratio q, mean 1        (4)
    (k1, k2, p1, p2) = nominal + N(0, (sigma_k1, sigma_k2, sigma_p, sigma_p)^2),   k3 as the sheet's             (5)

The probe's tip and the IMU's place are where their sheets say: only the camera's place relative to the tip matters, and
that is drawn. The pixel pitch is lithography: exact.
Not modelled: errors of one calibration are correlated (k1 with k2 and f, p1 and p2 with c), so that its worst errors
lie outside the calibrated field; here each is drawn by itself, and the corner gets the whole of all.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from dockair.calibration import Camera, LedRing, Mounting
from dockair.errors import DockairError
from dockair.parameters import read_sheet
from dockair.rotations import Array, exp, log
from dockair.sim.camera.radiometry import led_intensity_w_sr
from dockair.sim.camera.sheets import LedParameters

Record = dict[str, float | list[float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class AsBuiltParameters:
    """Sheet `as_built`: standard deviations."""

    mounting_angle_sigma_rad: float
    mounting_position_sigma_m: float
    focal_length_sigma: float  #: fraction of the focal length
    principal_point_sigma_px: float
    led_position_sigma_m: float  #: each axis
    ring_diameter_sigma_m: float
    distortion_k1_sigma: float
    distortion_k2_sigma: float
    distortion_p_sigma: float  #: p1 and p2, each


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AsBuilt:
    """One piece of hardware."""

    camera: Camera
    ring_positions_D: Array  #: (n, 3) LEDs in drogue axes [m]
    led_intensity_w_sr: Array  #: (n,) on each LED's axis
    mounting: Mounting
    differences: Record = field(default_factory=dict)  #: from the nominal sheets; empty if there are none

    def record(self) -> Record:
        """What was drawn, for a flight's log: as built minus nominal, units in the keys, axes as in the sheets."""
        return dict(self.differences)


def require_borne(ring: LedRing, leds: LedParameters) -> None:
    """Refuse a ring with an LED so bright that it takes more current than LEDs bear.

    Raises:
        DockairError: it is one.
    """
    brightest, most_a = float(ring.relative_brightness.max()), read_sheet("leds")["drive_current_a"].high
    if brightest * leds.drive_current_a > most_a:
        expected = f"at most {most_a / leds.drive_current_a:.4g} times sheet leds' LED, which bears {most_a} A"
        raise DockairError("ring.brightness", expected=expected, got=brightest)


def draw_as_built(
    camera: Camera,
    ring: LedRing,
    mounting: Mounting,
    parameters: AsBuiltParameters,
    leds: LedParameters,
    rng: np.random.Generator,
) -> AsBuilt:
    """Draw one piece of hardware around its nominal sheets, Eqs. (1) to (5).

    The same numbers are drawn whatever the standard deviations are: setting one to zero leaves the others' draws.

    Raises:
        DockairError: of `require_borne`; a lens that is drawn to distort so much that it shows no picture.
    """
    require_borne(ring, leds)
    camera_angle, imu_angle, camera_shift = rng.standard_normal((3, 3))
    lens = rng.standard_normal(3)
    diameter = parameters.ring_diameter_sigma_m * rng.standard_normal()
    led_shift = parameters.led_position_sigma_m * rng.standard_normal((ring.count, 3))
    place_in_bin = rng.uniform(size=ring.count)
    distortion = rng.standard_normal(4)  # last: what was there before it keeps its draws

    low, high = 2.0 / (1.0 + leds.bin_ratio), 2.0 * leds.bin_ratio / (1.0 + leds.bin_ratio)
    nominal_w_sr = led_intensity_w_sr(leds) * ring.relative_brightness
    built = AsBuilt(
        camera=_camera(camera, parameters, lens, distortion),
        ring_positions_D=_frozen(ring.positions_D * (1.0 + diameter / ring.diameter_m) + led_shift),
        led_intensity_w_sr=_frozen(nominal_w_sr * (low + (high - low) * place_in_bin)),
        mounting=replace(
            mounting,
            R_BC=_frozen(exp(parameters.mounting_angle_sigma_rad * camera_angle) @ mounting.R_BC),
            p_BC=_frozen(mounting.p_BC + parameters.mounting_position_sigma_m * camera_shift),
            R_BI=_frozen(exp(parameters.mounting_angle_sigma_rad * imu_angle) @ mounting.R_BI),
        ),
    )
    return replace(built, differences=_differences(built, camera, ring, mounting, nominal_w_sr))


def _camera(nominal: Camera, parameters: AsBuiltParameters, lens: Array, distortion: Array) -> Camera:
    """Eqs. (2) and (5), from standard normal draws."""
    c_u, c_v = np.array(nominal.principal_point_px) + parameters.principal_point_sigma_px * lens[1:]
    sigma_k1, sigma_k2, sigma_p = (
        parameters.distortion_k1_sigma,
        parameters.distortion_k2_sigma,
        parameters.distortion_p_sigma,
    )
    error = np.array([sigma_k1, sigma_k2, sigma_p, sigma_p]) * distortion
    k1, k2, p1, p2, k3 = (float(k) for k in np.append(error, 0.0) + _coefficients(nominal))
    try:
        return replace(
            nominal,
            focal_length_m=nominal.focal_length_m * (1.0 + parameters.focal_length_sigma * float(lens[0])),
            principal_point_px=(float(c_u), float(c_v)),
            distortion=(k1, k2, p1, p2, k3) if error.any() else nominal.distortion,
        )
    except DockairError as refusal:
        if refusal.where != "camera.distortion":
            raise
        found = f"every pixel's direction through a lens of {nominal.focal_length_m:g} m is found"
        expected = f"deviations of the lens with which {found} (k1, k2, p1, p2, k3 as drawn)"
        raise DockairError("parameters.as_built", expected=expected, got=refusal.got) from None


def _differences(built: AsBuilt, camera: Camera, ring: LedRing, mounting: Mounting, intensity_w_sr: Array) -> Record:
    differences = {
        "camera_turn_B_rad": log(built.mounting.R_BC @ mounting.R_BC.T),
        "camera_shift_B_m": built.mounting.p_BC - mounting.p_BC,
        "imu_turn_B_rad": log(built.mounting.R_BI @ mounting.R_BI.T),
        "focal_length_m": built.camera.focal_length_m - camera.focal_length_m,
        "principal_point_px": np.subtract(built.camera.principal_point_px, camera.principal_point_px),
        "distortion_k1_k2_p1_p2_k3": _coefficients(built.camera) - _coefficients(camera),
        "led_shift_x_D_m": (built.ring_positions_D - ring.positions_D)[:, 0],
        "led_shift_y_D_m": (built.ring_positions_D - ring.positions_D)[:, 1],
        "led_shift_z_D_m": (built.ring_positions_D - ring.positions_D)[:, 2],
        "led_intensity_w_sr": built.led_intensity_w_sr - intensity_w_sr,
    }
    return {key: np.asarray(value, dtype=float).tolist() for key, value in differences.items()}


def _coefficients(camera: Camera) -> Array:
    return np.array(camera.distortion if camera.distortion is not None else (0.0,) * 5)


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array
