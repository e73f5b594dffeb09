"""The image of a point on the pixels: diffraction, defocus, the die's image, diffusion and the pixel, by their spectra.

Lengths in pixels, frequencies in cycles per pixel. The spectrum of what a pixel collects, as a function of where in it
the point's image lies, is the product

    H(fx, fy) = T(f) exp(-2 pi^2 d^2 f^2) sinc(s fx) sinc(s fy) sinc(fx) sinc(fy),   f^2 = fx^2 + fy^2             (1)
    T(f) = (4/pi) Int_0^acos(g) sin^2(a) cos(pi (b/q) g (cos a - g)) da,   g = f q,  0 for g > 1                   (2)
    q = m wavelength N / pitch,    m = x0/(x0 - F)                                                                 (3)
    b = (F/N) (1 - v0/(v + shift)) / pitch,    1/v = 1/F - 1/x,    1/v0 = 1/F - 1/x0                               (4)
    s = F die / (x pitch)                                                                                          (5)

(2) is the transfer function of a round aperture out of focus: the overlap of the pupil with itself, displaced, and the
difference of phase across it; b is the diameter of the geometric disc, (F^2/N) m (1/x - 1/x0) / pitch without a shift.
Disc times Airy has the same second moment, but for b < q it loses six times as much of the peak: 0.31 (b/q)^2 instead
of 0.051 (b/q)^2.

Far from the centre the energy per pixel falls as r^-3, whatever the blurs, since |f| is T's only cusp:

    H = 1 - (4/pi) q f + ...    <=>    A/r^3,    A = q/pi^3                                                        (6)
    W(r) = A (r^2 + w^2)^(-3/2)    <=>    (2 pi A/w) exp(-2 pi w f)                                                (7)

H minus (7) has no cusp and its transform, the core, dies within a few rings: that is tabulated, W is a formula.

Not modelled: aberrations (a real lens at f/1.4 is far from this one), field curvature, the iris's blades, rings beyond
the tenth (the core fades from the fifth on; an LED's line, 30 nm wide, blurs them from the tenth to the twentieth), a
die seen obliquely or rolled, the part in r^-5 that blurs add to the wings (3 % of their variance).
Sources: Hopkins, Proc. R. Soc. A 231 (1955) 91 (2); Born & Wolf, Principles of Optics, sections 8.5.2 and 8.8.2.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_legendre

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.rotations import Array
from dockair.sim.camera.sheets import LensParameters

_PHASES = 16  # tabulated positions per pixel ...
_PHASES_SHARP, _SHARP_PX = 32, 0.2  # ... where lens and diffusion hardly blur the pixel's edges ...
_PHASES_WIDE, _WIDE_PX = 8, 4.0  # ... and where disc and die are wide
_AIRY_SIGMA = 0.4  # of the Airy pattern's core, in units of q
_CORE_RINGS = 10.0  # the core's radius for a sharp point, in units of q ...
_CORE_PX = 6.0  # ... and at least
_WING_PX = 2.0  # least softening w of the wings: sampled at pixel centres they keep their sum to 4e-6
_PERIOD = 4  # of the sampled spectrum, in half-widths of the core
_FAINT = 1e-7  # spectrum that is left out
_RULES = [roots_legendre(n) for n in (24, 48, 96, 192)]  # of (2); n is good for b/q < 2 n - 30
_NODES = 512  # of T's table in f; more where it oscillates


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """What blurs a point's image, in pixels."""

    airy: float  #: q, Eq. (3)
    diffusion: float  #: d
    blur: float  #: b, Eq. (4)
    die: float  #: s, Eq. (5)

    @property
    def wing(self) -> tuple[float, float]:
        """A and w of Eq. (7): the lens's alone, the same for all blurs."""
        return self.airy / math.pi**3, max(_WING_PX, 2.0 * self.airy)

    @property
    def phases(self) -> int:
        """Tabulated positions per pixel."""
        if self.blur + self.die > _WIDE_PX:
            return _PHASES_WIDE
        return _PHASES if math.hypot(self.diffusion, _AIRY_SIGMA * self.airy) > _SHARP_PX else _PHASES_SHARP

    @property
    def margin(self) -> float:
        """How far the core reaches beyond the disc and the die's image."""
        return max(_CORE_PX, _CORE_RINGS * self.airy)

    @property
    def half_width(self) -> int:
        """Radius of the core."""
        return math.ceil(self.margin + 0.5 * self.blur + math.sqrt(0.5) * self.die)


def airy_px(lens: LensParameters, camera: Camera, wavelength_m: float) -> float:
    """Return q [px], Eq. (3); the first dark ring has the radius 1.22 q.

    Raises:
        DockairError: the lens cannot be focused so near.
    """
    if not lens.focus_distance_m > camera.focal_length_m:
        expected = f"more than the camera's focal length, {camera.focal_length_m} m"
        raise DockairError("parameters.lens.focus_distance_m", expected=expected, got=lens.focus_distance_m)
    m = lens.focus_distance_m / (lens.focus_distance_m - camera.focal_length_m)
    return m * wavelength_m * lens.f_number / camera.pixel_pitch_m


def blur_px(lens: LensParameters, camera: Camera, inverse_depth: Array) -> Array:
    """Diameters b [px] of the defocused discs of points at 1/x (n,) [1/m], negative beyond the focus; Eq. (4)."""
    F = camera.focal_length_m
    v = 1.0 / (1.0 / F - np.asarray(inverse_depth, dtype=float))
    v0 = 1.0 / (1.0 / F - 1.0 / lens.focus_distance_m)
    diameter_m = F / lens.f_number * (1.0 - v0 / (v + lens.near_infrared_focus_shift_m))
    return np.asarray(diameter_m / camera.pixel_pitch_m)


def transfer(frequency: Array, airy: float, blur: float) -> Array:
    """T at radial frequencies (n,) [cycles/px], Eq. (2).

    Args:
        frequency: >= 0.
        airy: q [px].
        blur: b [px].
    """
    g = np.minimum(np.asarray(frequency) * airy, 1.0)[:, None]
    top = np.arccos(g)
    abscissae, weights = next((rule for rule in _RULES if blur < (2 * len(rule[0]) - 30) * airy), _RULES[-1])
    a = 0.5 * top * (1.0 + abscissae)
    integrand = np.sin(a) ** 2 * np.cos(math.pi * blur / airy * g * (np.cos(a) - g))
    return np.asarray(4.0 / math.pi * 0.5 * top[:, 0] * (integrand @ weights))


def spectrum(frequency: Array, spread: Spread) -> Array:
    """H (n, n) on the grid fx, fy of one list of frequencies (n,), ascending from 0 [cycles/px]; Eq. (1)."""
    count = _NODES + int(8.0 * math.pi * spread.blur / spread.airy)
    nodes = np.linspace(0.0, min(1.0 / spread.airy, frequency[-1]), count)
    radial = transfer(nodes, spread.airy, spread.blur) * np.exp(-2.0 * (math.pi * spread.diffusion * nodes) ** 2)
    boxes = np.sinc(spread.die * frequency) * np.sinc(frequency)
    radius = np.hypot(frequency[:, None], frequency)
    return np.asarray(np.interp(radius, nodes, radial, right=0.0) * boxes[:, None] * boxes)


def core(spread: Spread) -> NDArray[np.float32]:
    """Return the core, H less W: (p, p, n, n) with p = phases/2 + 1 positions and n = 2 half_width + 1 pixels.

    Element [i, j, half_width + r, half_width + c] belongs to the pixel (r, c) of a point's image (i, j)/phases px below
    and right of the pixel (0, 0). The core fades out toward the radius half_width; with W it holds the energy 1.
    """
    half, phases = spread.half_width, spread.phases
    fine = _core_on_fine_grid(spread)
    at = np.abs(phases * np.arange(-half, half + 1) - np.arange(phases // 2 + 1)[:, None])  # (p, n), into the fine grid
    radius = np.hypot(at[:, None, :, None], at[:, None, :]) / phases
    fade = np.clip((half - radius) / (0.5 * spread.margin), 0.0, 1.0)
    fade *= fade * (3.0 - 2.0 * fade)
    planes = fine[at[:, None, :, None], at[:, None, :]] * fade
    A, w = spread.wing
    missing = 1.0 - 2.0 * math.pi * A / w - planes.sum((2, 3), keepdims=True)
    planes += missing * fade / fade.sum((2, 3), keepdims=True)
    return planes.astype(np.float32)


def _core_on_fine_grid(spread: Spread) -> Array:
    """Transform of H less (7) at x, y = 0, 1/phases, ... half_width + 1/2 px."""
    A, w = spread.wing
    sharp = math.sqrt(-0.5 * math.log(_FAINT)) / (math.pi * max(spread.diffusion, 1e-3))
    highest = max(min(1.0 / spread.airy, sharp), -math.log(_FAINT) / (2.0 * math.pi * w))
    step = 1.0 / (_PERIOD * spread.half_width)
    frequency = step * np.arange(math.ceil(highest / step) + 1)
    wing = 2.0 * math.pi * A / w * np.exp(-2.0 * math.pi * w * np.hypot(frequency[:, None], frequency))
    x = np.arange(spread.phases * spread.half_width + spread.phases // 2 + 1) / spread.phases
    cosines = np.cos(2.0 * math.pi * x[:, None] * frequency) * 2.0 * step
    cosines[:, 0] *= 0.5  # the sum runs over frequencies of both signs
    return np.asarray(cosines @ (spectrum(frequency, spread) - wing) @ cosines.T)
