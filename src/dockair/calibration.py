"""Nominal calibration sheets: what the navigation is told about its own hardware.

Pinhole, camera axes x forward (boresight), y left, z up; pixel (0, 0) is the centre of the top left pixel:

    u = c_u - f y/x,    v = c_v - f z/x      (f in pixels)                    [Yoon 2018, eqs 41-44]

Distortion is Brown-Conrady on (a, b) = (-y/x, -z/x), coefficients k1, k2, p1, p2, k3 in OpenCV's order:

    r2 = a^2 + b^2,  s = 1 + k1 r2 + k2 r2^2 + k3 r2^3
    a' = a s + 2 p1 a b + p2 (r2 + 2 a^2),   b' = b s + p1 (r2 + 2 b^2) + 2 p2 a b          (1)

The simulator draws *as-built* values around these; they are other objects and never reach `nav`.
"""

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from dockair.errors import DockairError, keep_tuples
from dockair.messages import Window
from dockair.rotations import Array

_PRINCIPAL_POINT_OFF = 0.25  # of width and height, in a sheet; a camera made by code may count pixels from anywhere
_RAYS, _RAY_OFF_PX = 9, 1e-3  # a side of the pixels that are asked for their rays, and how far off they may come back
_INVERSE_DISTORTION_ITERATIONS = 20  # fixed point; contracts by about 0.1 a step for lenses of this class


def _from_toml(cls: type[Any], path: str | Path) -> Any:
    path = Path(path)
    if not os.path.isfile(path):  # Path.is_file raises where a name is too long, until Python 3.14
        raise DockairError(str(path), expected="a calibration file", got="no such file")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8-sig"))  # some editors begin a file with a byte order mark
    except OSError as error:
        raise DockairError(str(path), expected="a file that can be read", got=str(error.strerror)) from None
    except ValueError as error:  # no TOML, or not even UTF-8
        raise DockairError(str(path), expected="TOML", got=str(error)) from None
    names = [f.name for f in fields(cls)]
    unknown = sorted(set(table) - set(names))
    if unknown:
        raise DockairError(f"{path}: {unknown[0]}", expected="a known key", got=unknown[0], exists=names)
    for name in names:
        if name not in table and name not in cls.OPTIONAL:
            raise DockairError(f"{path}: {name}", expected=_limits_in_words(cls, name), got="no such key", exists=names)
    try:
        return cls(**{k: tuple(v) if isinstance(v, list) else v for k, v in table.items()})
    except DockairError as error:
        name = error.where.partition(".")[2]
        raise DockairError(f"{path}: {name}", expected=error.expected, got=table[name]) from None


def _limits_in_words(cls: type[Any], name: str) -> str:
    if name not in cls.LIMITS:
        return "its numbers"
    low, high, unit = cls.LIMITS[name]
    return f"a {'whole ' if _is_whole(cls, name) else ''}number from {low:g} to {high:g} {unit}"


def _is_whole(cls: type[Any], name: str) -> bool:
    return isinstance(next(f.default for f in fields(cls) if f.name == name), int)


def _check_limits(sheet: Any, where: str) -> None:
    """Refuse a number outside its limits, which a wrong unit usually is, and what is no number."""
    for name, (low, high, _) in sheet.LIMITS.items():
        value = getattr(sheet, name)
        kinds = (int, np.integer) if _is_whole(type(sheet), name) else (int, float, np.integer, np.floating)
        if isinstance(value, bool) or not isinstance(value, kinds) or not low <= value <= high:
            raise DockairError(f"{where}.{name}", expected=_limits_in_words(type(sheet), name), got=value)


def _check_vector(value: Any, count: int, bound: float, where: str, words: str) -> None:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (count,) or not (np.abs(array) <= bound).all():
        raise DockairError(where, expected=f"{words}, none beyond {bound:g}", got=value)


@dataclass(frozen=True, slots=True)
class Camera:
    """Pinhole with Brown-Conrady distortion. Defaults: CMV2000 sensor, 16 mm lens [Yoon 2018, tables 4-5]."""

    focal_length_m: float = 0.016
    pixel_pitch_m: float = 5.5e-6
    width_px: int = 2048
    height_px: int = 1088
    principal_point_px: tuple[float, float] = (1023.5, 543.5)
    distortion: tuple[float, float, float, float, float] | None = None  #: k1, k2, p1, p2, k3

    LIMITS: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "focal_length_m": (1e-3, 1.0, "m"),
        "pixel_pitch_m": (1e-6, 50e-6, "m"),
        "width_px": (16, 16384, "px"),
        "height_px": (16, 16384, "px"),
    }
    OPTIONAL: ClassVar[tuple[str, ...]] = ("distortion",)

    def __post_init__(self) -> None:
        _check_limits(self, "camera")
        bound = 2.0 * max(self.width_px, self.height_px)
        _check_vector(self.principal_point_px, 2, bound, "camera.principal_point_px", "2 numbers [px]")
        if self.distortion is not None:
            _check_vector(self.distortion, 5, 10.0, "camera.distortion", "5 numbers k1, k2, p1, p2, k3")
            self._check_rays()
        keep_tuples(self)

    def _check_rays(self) -> None:
        """Each pixel's ray is found: a lens that distorts much folds the picture over, or the steps to it run away."""
        u, v = np.meshgrid(np.linspace(0, self.width_px - 1, _RAYS), np.linspace(0, self.height_px - 1, _RAYS))
        pixels = np.column_stack([u.ravel(), v.ravel()])
        with np.errstate(all="ignore"):  # what runs away is not equal
            again = self.pixels_from_points(self.rays_from_pixels(pixels))
        if not np.allclose(again, pixels, rtol=0.0, atol=_RAY_OFF_PX):
            expected = "a lens that distorts by less: of this one not every pixel's direction is found"
            raise DockairError("camera.distortion", expected=expected, got=self.distortion)

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read the sheet from a TOML file whose keys are the fields, all of them but those of OPTIONAL.

        Raises:
            DockairError: a file that is no such sheet, or a principal point far off the sensor's middle: a wrong unit.
        """
        camera: Self = _from_toml(cls, path)
        size = np.array([camera.width_px, camera.height_px])
        middle, bound = 0.5 * (size - 1), _PRINCIPAL_POINT_OFF * size
        if (np.abs(np.array(camera.principal_point_px) - middle) > bound).any():
            (u, v), (u_end, v_end) = middle - bound, middle + bound
            expected = f"u from {u:g} to {u_end:g} px, v from {v:g} to {v_end:g} px, around the sensor's middle"
            got = list(camera.principal_point_px)
            raise DockairError(f"{path}: principal_point_px", expected=expected, got=got)
        return camera

    @property
    def focal_length_px(self) -> float:
        """Focal length in pixels."""
        return self.focal_length_m / self.pixel_pitch_m

    @property
    def full_window(self) -> Window:
        """The window that is the whole sensor."""
        return Window(0, self.height_px, 0, self.width_px)

    def pixels_from_points(self, p_C: Array) -> Array:
        """(n, 2) pixels (u, v) of points p_C (n, 3) [m] in camera axes; NaN where x <= 0 (behind the camera)."""
        p_C = np.asarray(p_C, dtype=float).reshape(-1, 3)
        x = p_C[:, :1]
        return self.pixels_from_slopes(-p_C[:, 1:] / np.where(x > 0.0, x, np.nan))

    def pixels_from_slopes(self, ab: Array) -> Array:
        """(n, 2) pixels (u, v) of points whose (-y/x, -z/x) in camera axes is ab (n, 2)."""
        if self.distortion is not None:
            ab = _distort(ab, self.distortion)
        return np.asarray(self.focal_length_px * ab + self.principal_point_px)

    def rays_from_pixels(self, pixels: Array) -> Array:
        """(n, 3) unit vectors in camera axes toward pixels (n, 2) (u, v)."""
        pixels = np.asarray(pixels, dtype=float).reshape(-1, 2)
        ab = (pixels - np.array(self.principal_point_px)) / self.focal_length_px
        if self.distortion is not None:
            target = ab
            for _ in range(_INVERSE_DISTORTION_ITERATIONS):
                ab = ab + target - _distort(ab, self.distortion)
        rays = np.column_stack([np.ones(len(ab)), -ab])
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _distort(ab: Array, coefficients: tuple[float, ...]) -> Array:
    k1, k2, p1, p2, k3 = coefficients  # Eq. (1)
    a, b = ab[:, 0], ab[:, 1]
    r2 = a * a + b * b
    s = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    out: Array = np.empty_like(ab)
    out[:, 0] = a * s + 2 * p1 * a * b + p2 * (r2 + 2 * a * a)
    out[:, 1] = b * s + p1 * (r2 + 2 * b * b) + 2 * p2 * a * b
    return out


@dataclass(frozen=True, slots=True)
class LedRing:
    """LEDs on the drogue's rim: in the drogue's y-z plane, LED k at 45 deg k from +y toward +z, shining aft (-x).

    Two optional keys are a code that tells the numbering from the image: LEDs off their even places, or LEDs driven
    brighter or dimmer than the others.
    """

    diameter_m: float = 0.5
    count: int = 8
    angles_deg: tuple[float, ...] | None = None  #: (count,) each within 0.4 spacings of its even place, from +y
    brightness: tuple[float, ...] | None = None  #: (count,) intensity over that of the LEDs' own sheet

    LIMITS: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "diameter_m": (0.05, 5.0, "m"),
        "count": (3, 64, "LEDs"),
    }
    OPTIONAL: ClassVar[tuple[str, ...]] = ("angles_deg", "brightness")

    def __post_init__(self) -> None:
        _check_limits(self, "ring")
        if self.angles_deg is not None:
            _check_vector(self.angles_deg, self.count, 400.0, "ring.angles_deg", f"{self.count} angles [deg]")
            spacing = 360.0 / self.count
            if not (np.abs(np.array(self.angles_deg) - spacing * np.arange(self.count)) <= 0.4 * spacing).all():
                words = f"LED k within {0.4 * spacing:g} deg of {spacing:g} k deg"
                raise DockairError("ring.angles_deg", expected=words, got=self.angles_deg)
        if self.brightness is not None:
            _check_vector(self.brightness, self.count, 1e6, "ring.brightness", f"{self.count} relative brightnesses")
            if not (np.array(self.brightness) > 0.0).all():
                raise DockairError("ring.brightness", expected="numbers above 0", got=self.brightness)

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read the sheet from a TOML file whose keys are the fields, all of them but those of OPTIONAL."""
        return _from_toml(cls, path)  # type: ignore[no-any-return]

    @property
    def angles_rad(self) -> Array:
        """(count,) angle of each LED from +y toward +z."""
        if self.angles_deg is not None:
            return np.asarray(np.deg2rad(np.array(self.angles_deg, dtype=float)))
        return np.asarray(2.0 * np.pi * np.arange(self.count) / self.count)

    @property
    def relative_brightness(self) -> Array:
        """(count,) intensity of each LED over that of the LEDs' own sheet."""
        return np.ones(self.count) if self.brightness is None else np.array(self.brightness, dtype=float)

    @property
    def positions_D(self) -> Array:
        """(count, 3) LED positions in drogue axes [m]."""
        angle: Array = self.angles_rad
        radius = 0.5 * self.diameter_m
        return np.column_stack([np.zeros(self.count), radius * np.cos(angle), radius * np.sin(angle)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mounting:
    """Where things sit on the receiver, in body axes B (origin at the centre of gravity)."""

    R_BC: Array  #: (3, 3) camera axes in body axes
    p_BC: Array  #: (3,) camera [m]
    p_BP: Array  #: (3,) probe tip [m]
    R_BI: Array = field(default_factory=lambda: np.eye(3))  #: (3, 3) IMU axes in body axes
    p_BI: Array = field(default_factory=lambda: np.zeros(3))  #: (3,) IMU [m]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StartGeometry:
    """Nominal pre-contact geometry and how far it may be off: all that the navigation knows before its first frame.

    The arrays are read-only, in a flight as in its replay: a navigator that counts on from one has to copy it.
    """

    p_PD_B: Array  #: (3,) drogue ring centre from the probe's tip, body axes [m]
    sigma_p_m: Array  #: (3,) its standard deviation, body axes [m]
    R_BD: Array  #: (3, 3) drogue axes in body axes
    sigma_R_rad: Array  #: (3,) standard deviation of the attitude that it returns to, about each axis

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self)):
            array = np.array(getattr(self, name), dtype=float)
            array.setflags(write=False)
            object.__setattr__(self, name, array)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GyroSheet:
    """The data sheet of the gyros, and of the accelerometers beside them."""

    rate_hz: int
    noise_density_rad_s_rthz: float
    bias_sigma_rad_s: float  #: when switched on
    bias_walk_rad_s_rts: float = 0.0  #: rate random walk and bias instability together
    scale_factor_sigma: float = 0.0  #: with the misalignment of the axes
    range_rad_s: float = float("inf")  #: of each axis
    accelerometer_noise_density_m_s2_rthz: float = 0.0
    accelerometer_bias_sigma_m_s2: float = 0.0  #: when switched on
    accelerometer_range_m_s2: float = float("inf")  #: of each axis


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NavigationSheets:
    """Everything the navigation is given at construction; there is no other way in but the messages of `messages`."""

    camera: Camera
    ring: LedRing
    mounting: Mounting
    start: StartGeometry
    gyro: GyroSheet
    camera_rate_hz: int
    control_rate_hz: int
    coupling_depth_m: float  #: from the ring's plane forward to where the probe's tip latches, along the drogue's x
