"""Where light falls on the pixels: the point spread function, integrated over each pixel and splatted.

Diffraction by a round aperture is taken as three Gaussians, with scale q = wavelength x f-number:

    PSF(r) = Sum_k w_k N(r; s_k),   s_k^2 = (a_k q)^2 + d^2 + b^2/16 + c^2/12                                    (1)
    b = (f^2/N) |1/x - 1/x_focus|       diameter of the defocused disc                                           (2)
    c = f x die / x                     side of the die's image

d is the spread of charge in the silicon; each blur but diffraction's enters through its variance alone.
A pixel takes the difference of two error functions in each direction and for each k.

The mixture's encircled energy is within 2.0 % of the Airy pattern's at every radius (fit out to 8 q); the brightest
pixel of a blob is within 2 % (f/8, in focus). Its far wings are Gaussian beyond 15 q where the true ones fall as r^-3:
where an LED is more than 100 times over full well, its blob is too small by a fraction of a pixel.
Not modelled: aberrations, spikes of the iris, motion smear.
Source: Born & Wolf, Principles of Optics, section 8.5.2 (Airy pattern); variance of a uniform disc b^2/16 an axis.
"""

import math

import numpy as np
from numba import njit

from dockair.calibration import Camera
from dockair.rotations import Array
from dockair.sim.camera.radiometry import CameraParameters

#: Gaussian mixture of the Airy pattern: least squares of the encircled energy 1 - J0^2(pi x) - J1^2(pi x), x = r/q.
AIRY_WEIGHTS: Array = np.array([0.8184, 0.1287, 0.0529])
AIRY_SIGMAS: Array = np.array([0.3898, 1.5343, 6.4933])
_REACH_SIGMAS = 5.0  # of the widest part; 6e-7 of its energy lies beyond


def psf_sigmas_px(parameters: CameraParameters, camera: Camera, wavelength_m: float, x: Array, size_m: float) -> Array:
    """(n, 3) standard deviations [px] of the mixture's parts for sources at depths x (n,) [m], Eqs. (1) and (2).

    Args:
        parameters: f-number, focus, diffusion.
        camera: focal length and pixel.
        wavelength_m: of the light.
        x: depth of each source along the lens's axis; infinity for the Sun.
        size_m: side of the source, 0 for a point.
    """
    f, p = camera.focal_length_m, camera.pixel_pitch_m
    inverse = 1.0 / np.asarray(x, dtype=float)
    defocus = f**2 / parameters.f_number * np.abs(inverse - 1.0 / parameters.focus_distance_m) / p
    die = f * size_m * inverse / p
    blur = parameters.diffusion_px**2 + defocus**2 / 16.0 + die**2 / 12.0
    diffraction = AIRY_SIGMAS * wavelength_m * parameters.f_number / p
    return np.asarray(np.sqrt(diffraction**2 + blur[:, None]))


@njit(cache=True)
def splat(
    image: Array,
    row_start: int,
    column_start: int,
    pixels: Array,
    electrons: Array,
    sigmas: Array,
    weights: Array,
    reach_sigmas: float,
) -> None:
    """Add blobs to an image in place.

    Args:
        image: (rows, columns) expected electrons of the window.
        row_start: first row of the window on the sensor.
        column_start: its first column.
        pixels: (n, 2) true positions (u, v) on the sensor.
        electrons: (n,) of each whole blob.
        sigmas: (n, k) of the parts of the mixture [px].
        weights: (k,) of the parts.
        reach_sigmas: half-width of the splat in units of each part's sigma.
    """
    rows, columns = image.shape
    for i in range(pixels.shape[0]):
        u, v = pixels[i, 0] - column_start, pixels[i, 1] - row_start
        for k in range(weights.shape[0]):
            scale = 1.0 / (sigmas[i, k] * math.sqrt(2.0))
            reach = math.ceil(reach_sigmas * sigmas[i, k]) + 1
            r0, r1 = max(0, math.floor(v - reach)), min(rows, math.ceil(v + reach) + 1)
            c0, c1 = max(0, math.floor(u - reach)), min(columns, math.ceil(u + reach) + 1)
            if r0 >= r1 or c0 >= c1:
                continue
            across = np.empty(c1 - c0)
            for c in range(c0, c1):
                across[c - c0] = 0.5 * (math.erf((c + 0.5 - u) * scale) - math.erf((c - 0.5 - u) * scale))
            for r in range(r0, r1):
                down = 0.5 * (math.erf((r + 0.5 - v) * scale) - math.erf((r - 0.5 - v) * scale))
                amount = electrons[i] * weights[k] * down
                for c in range(c0, c1):
                    image[r, c] += amount * across[c - c0]


def add_blobs(image: Array, start: tuple[int, int], pixels: Array, electrons: Array, sigmas_px: Array) -> None:
    """Add point sources to expected electrons, in place.

    Args:
        image: (rows, columns) of the window.
        start: (row, column) of the window's first pixel.
        pixels: (n, 2) true (u, v); any that lie far outside add nothing.
        electrons: (n,) of each whole blob.
        sigmas_px: (n, 3) of `psf_sigmas_px`.
    """
    splat(image, start[0], start[1], pixels, electrons, sigmas_px, AIRY_WEIGHTS, _REACH_SIGMAS)
