"""Blobs on the pixels against the Airy pattern, integrated in real space, closed forms and conservation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.special import erf, j0, j1

from dockair.calibration import Camera
from dockair.parameters import load_parameters
from dockair.sim.camera.optics import NEAREST_M, PointSpread, _divided
from dockair.sim.camera.point_spread import Spread, airy_px, blur_px, core
from dockair.sim.camera.sheets import LensParameters, SensorParameters

LENS, SENSOR = load_parameters("lens", LensParameters), load_parameters("sensor", SensorParameters)
CAMERA = Camera()
LED_M = 850e-9
DIE_M = 1e-3
FOCUS_M = 10.0
PHASES = [(0.0, 0.0), (0.5, 0.5), (0.25, -0.4), (-0.13, 0.31), (-0.47, -0.03)]
RANGE_AND_ELECTRONS = [(3.0, 1.5e5), (10.0, 1.35e4), (30.0, 1.5e3)]  # 0.02 W/sr at f/8, 20 us


def _spread(f_number: float = 8.0, diffusion_px: float = 0.3, camera: Camera = CAMERA) -> PointSpread:
    lens = replace(LENS, f_number=f_number, focus_distance_m=FOCUS_M)
    return PointSpread(lens, replace(SENSOR, diffusion_px=diffusion_px), camera, LED_M)


def _blob(
    spread: PointSpread,
    at: tuple[float, float],
    electrons: float = 1e5,
    depth_m: float = FOCUS_M,
    size_m: float = 0.0,
    half: int = 60,
) -> np.ndarray:
    """One blob, (0, 0) in the middle of the image."""
    image = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.float32)
    one = np.array([at]), np.array([electrons]), np.array([depth_m])
    spread.splat(image, (-half, -half), *one, size_m, np.zeros((1, 2)))
    return image


def _moments(image: np.ndarray) -> tuple[float, float, float, float]:
    """Sum, mean column, mean row, variance along columns; of an image with (0, 0) in the middle."""
    x = np.arange(image.shape[0]) - image.shape[0] // 2
    columns, rows = image.sum(0, dtype=float), image.sum(1, dtype=float)
    total = columns.sum()
    u = columns @ x / total
    return total, u, rows @ x / total, columns @ (x - u) ** 2 / total


class _Airy:
    """Pixels of the image of a point by the diffraction integral over the pupil, in real space; Born & Wolf 8.8.

    A disc `blur` px wide is a phase of pi blur/(4 q) at the pupil's edge. A pixel collects through a box blurred by the
    charge's spread, a difference of two error functions in each direction, summed over midpoints 1/48 px apart.
    """

    def __init__(self, f_number: float, blur: float = 0.0, diffusion_px: float = 0.0) -> None:
        self.q = airy_px(replace(LENS, f_number=f_number, focus_distance_m=FOCUS_M), CAMERA, LED_M)
        nodes, weights = np.polynomial.legendre.leggauss(64)
        rho = 0.5 * (nodes + 1.0)
        pupil = weights * rho * np.exp(1j * np.pi * blur / (4.0 * self.q) * rho**2)
        self._radii = np.linspace(0.0, 15.0, 6000)
        amplitude = j0(np.pi / self.q * self._radii[:, None] * rho) @ pupil
        self._intensity = np.pi / (4.0 * self.q**2) * np.abs(amplitude) ** 2
        half = 24 + round(48 * 5.0 * diffusion_px)
        self._x = (np.arange(-half, half) + 0.5) / 48
        scale = np.sqrt(2.0) * max(diffusion_px, 1e-9)
        self._share = 0.5 * (erf((self._x + 0.5) / scale) - erf((self._x - 0.5) / scale)) / 48

    def pixel(self, at: tuple[float, float], column: int, row: int) -> float:
        r = np.hypot(column + self._x - at[0], (row + self._x - at[1])[:, None])
        return float(self._share @ np.interp(r, self._radii, self._intensity) @ self._share)

    def around(self, at: tuple[float, float], half: int) -> np.ndarray:
        span = range(-half, half + 1)
        return np.array([[self.pixel(at, column, row) for column in span] for row in span])


@pytest.mark.parametrize("f_number", [1.4, 2.8, 8.0, 16.0])
def test_each_pixel_holds_the_integral_of_the_airy_pattern(f_number: float) -> None:
    """Within 1 % of the peak, without diffusion, which would hide what interpolation costs."""
    spread, airy = _spread(f_number, diffusion_px=0.0), _Airy(f_number)
    for at in [*PHASES, (0.36, 0.33)]:
        image, expected = _blob(spread, at, electrons=1.0), airy.around(at, 2)
        assert image[58:63, 58:63] == pytest.approx(expected, rel=0.0, abs=0.01 * expected.max())


@pytest.mark.parametrize("f_number", [1.4, 2.8, 4.0])
def test_halfway_between_tabulated_positions_a_pixel_is_off_by_half_a_percent_at_most(f_number: float) -> None:
    """A chord for a curve, 1/16 px long in each direction; worst where a sharp image crosses a pixel's edge."""
    spread, airy = _spread(f_number), _Airy(f_number, diffusion_px=0.3)
    for at in [(1 / 32, 1 / 32), (1 / 32, 9 / 32), (15 / 32, 15 / 32), (11 / 32, 7 / 32)]:
        image, expected = _blob(spread, at, electrons=1.0), airy.around(at, 1)
        assert image[59:62, 59:62] == pytest.approx(expected, rel=0.0, abs=0.005 * expected.max())


@pytest.mark.parametrize("f_number,depth_m", [(8.0, 2.0), (8.0, 1.0), (4.0, 2.0), (5.6, 30.0)])
def test_out_of_focus_too_each_pixel_holds_the_diffraction_integral(f_number: float, depth_m: float) -> None:
    lens = replace(LENS, f_number=f_number, focus_distance_m=FOCUS_M, near_infrared_focus_shift_m=0.0)
    blur = float(blur_px(lens, CAMERA, np.array([1.0 / depth_m]))[0])
    at = (0.2, -0.35)
    image = _blob(_spread(f_number, diffusion_px=0.0), at, electrons=1.0, depth_m=depth_m)
    expected = _Airy(f_number, blur).around(at, 4)
    assert image[56:65, 56:65] == pytest.approx(expected, rel=0.0, abs=0.01 * expected.max())


@pytest.mark.parametrize(
    "f_number,depth_m,size_m,at,peak,within_61_px",
    [
        (8.0, 10.0, 0.0, (0.2, -0.3), 0.27439, 0.99260),
        (8.0, 10.0, 1e-3, (0.27, 0.41), 0.23934, 0.99260),
        (2.8, 10.0, 0.0, (0.2, -0.3), 0.48741, 0.99747),
        (16.0, 10.0, 0.0, (0.0, 0.0), 0.11196, 0.98516),
        (8.0, 2.0, 1e-3, (0.1, 0.2), 0.17977, 0.99259),
        (5.6, 3.0, 0.0, (0.1, 0.2), 0.33043, 0.99483),
        (4.0, 1.7, 5e-3, (-0.3, 0.2), 0.01306, 0.99629),
    ],
)
def test_brightest_pixel_and_energy_near_it_are_those_of_galsim(
    f_number: float, depth_m: float, size_m: float, at: tuple[float, float], peak: float, within_61_px: float
) -> None:
    """GalSim 2.8.5: Airy, or OpticalPSF with defocus b/(16 sqrt(3) q) waves, * Gaussian(0.3) * Pixel(s), drawImage."""
    image = _blob(_spread(f_number), at, electrons=1e8, depth_m=depth_m, size_m=size_m, half=30) / 1e8
    assert image.max() == pytest.approx(peak, rel=3e-3)
    assert image.sum(dtype=float) == pytest.approx(within_61_px, abs=3e-4)


def test_the_energy_within_a_radius_is_1_less_j0_squared_less_j1_squared() -> None:
    """Born & Wolf section 8.5.2. Pixels of 1.1 um, 1/6 of q; their box is undone to second order, p - Laplacian/24."""
    camera = Camera(pixel_pitch_m=1.1e-6)
    q = airy_px(replace(LENS, f_number=8.0, focus_distance_m=FOCUS_M), camera, LED_M)
    image = _blob(_spread(8.0, 0.0, camera), (0.0, 0.0), electrons=1e8, half=150).astype(float) / 1e8
    neighbours = image[149, 150:300] + image[151, 150:300] + image[150, 149:299] + image[150, 151:301]
    intensity = image[150, 150:300] - (neighbours - 4.0 * image[150, 150:300]) / 24.0
    r = np.arange(150.0)
    within = CubicSpline(r, 2.0 * np.pi * r * intensity).antiderivative()
    for radius in (2.0, 4.0, 7.56, 12.0, 20.0, 40.0, 75.0, 100.0):
        z = np.pi * radius / q
        assert within(radius) == pytest.approx(1.0 - j0(z) ** 2 - j1(z) ** 2, abs=2e-3)


@pytest.mark.parametrize("f_number", [2.8, 8.0, 16.0])
@pytest.mark.parametrize("depth_m,electrons", RANGE_AND_ELECTRONS)
def test_a_blob_holds_the_electrons_it_was_given(f_number: float, depth_m: float, electrons: float) -> None:
    spread = _spread(f_number)
    for at in PHASES:
        image = _blob(spread, at, electrons=electrons, depth_m=depth_m, size_m=DIE_M, half=80)
        assert _moments(image)[0] == pytest.approx(electrons, rel=1e-5)


@pytest.mark.parametrize("f_number", [8.0, 16.0])
@pytest.mark.parametrize("depth_m,electrons", RANGE_AND_ELECTRONS)
def test_a_blobs_first_moment_is_its_true_position(f_number: float, depth_m: float, electrons: float) -> None:
    """From f/7 on nothing passes the lens at 1 cycle/px, so that pixels cannot bend the centroid."""
    spread = _spread(f_number)
    for at in PHASES:
        _, u, v, _ = _moments(_blob(spread, at, electrons=electrons, depth_m=depth_m, size_m=DIE_M, half=80))
        assert (u, v) == pytest.approx(at, abs=5e-4)


def test_a_fast_lens_bends_the_centroid_by_what_passes_at_one_cycle_per_pixel() -> None:
    """Poisson's sum: the first moment is off by -(1/pi) B sin(2 pi u), B the spectrum at 1 cycle/px less the pixel.

    At f/2.8 in focus B = T exp(-2 pi^2 d^2) = 0.079: 0.025 px a quarter pixel off a centre.
    """
    spread = _spread(2.8)
    g = airy_px(replace(LENS, f_number=2.8, focus_distance_m=FOCUS_M), CAMERA, LED_M)
    B = 2.0 / np.pi * (np.arccos(g) - g * np.sqrt(1.0 - g**2)) * np.exp(-2.0 * (np.pi * 0.3) ** 2)
    assert B / np.pi > 0.02
    for u in np.arange(-7, 8) / 16.0:  # tabulated positions: between them it is interpolated
        got = _moments(_blob(spread, (u, 0.0)))[1] - u
        assert got == pytest.approx(-B / np.pi * np.sin(2.0 * np.pi * u), abs=3e-4)
    between = _moments(_blob(spread, (7.5 / 32.0, 0.0)))[1] - 7.5 / 32.0
    assert between == pytest.approx(-B / np.pi * np.sin(2.0 * np.pi * 7.5 / 32.0), abs=5e-4)


@pytest.mark.parametrize(
    "f_number,depth_m,size_m",
    [(8.0, 2.7, 1e-3), (2.8, 3.3, 1e-3), (1.4, 1.9, 0.0), (4.0, 6.1, 5e-3), (16.0, 1.13, 5e-3)],
)
def test_between_tabulated_depths_a_blob_is_the_one_made_for_its_depth(
    f_number: float, depth_m: float, size_m: float
) -> None:
    """The core made for just that depth, within 0.5 % of the peak."""
    lens = replace(LENS, f_number=f_number, focus_distance_m=FOCUS_M)
    blur = float(blur_px(lens, CAMERA, np.array([1.0 / depth_m]))[0])
    die = CAMERA.focal_length_px * size_m / depth_m
    made = Spread(airy=airy_px(lens, CAMERA, LED_M), diffusion=0.3, blur=abs(blur), die=die)
    A, w = made.wing
    half = made.half_width
    r = np.hypot(*np.mgrid[-half : half + 1, -half : half + 1])
    expected = core(made)[0, 0] + A * (r**2 + w**2) ** -1.5
    image = _blob(_spread(f_number), (0.0, 0.0), electrons=1e7, depth_m=depth_m, size_m=size_m, half=half) / 1e7
    assert image == pytest.approx(expected, rel=0.0, abs=5e-3 * expected.max())


def test_half_the_energy_of_a_wide_disc_lies_within_its_radius_over_root_two() -> None:
    """f/1.4 at 2 m: 13.3 px wide. Diffraction, pixel and diffusion widen that by less than 2 %."""
    image = _blob(_spread(1.4), (0.0, 0.0), depth_m=2.0, half=40)
    fine = np.repeat(np.repeat(image, 8, axis=0), 8, axis=1)
    x = (np.arange(fine.shape[0]) + 0.5) / 8.0 - 40.5
    r = np.hypot(x, x[:, None]).ravel()
    order = np.argsort(r)
    energy = np.cumsum(fine.ravel()[order], dtype=float)
    half_energy_px = r[order][np.searchsorted(energy, 0.5 * energy[-1])]
    disc_px = 0.016**2 / 1.4 * (1.0 / 2.0 - 1.0 / 10.0) / 5.5e-6
    assert half_energy_px == pytest.approx(0.5 * disc_px / np.sqrt(2.0), rel=0.02)


def test_a_near_dies_image_is_a_square_of_its_own_size() -> None:
    """5 mm at 1 m: 14.5 px; summed along columns, half the plateau is reached at the square's edges."""
    image = _blob(_spread(8.0), (0.0, 0.0), depth_m=1.0, size_m=5e-3)
    for profile in (image.sum(0, dtype=float), image.sum(1, dtype=float)):
        edge = np.interp(-0.5 * profile[60], -profile[60:], np.arange(61.0))
        assert 2.0 * edge == pytest.approx(0.016 * 5e-3 / 1.0 / 5.5e-6, abs=0.15)


@pytest.mark.parametrize("depth_m,size_m", [(3.0, 8e-3), (9.0, 0.03)])
def test_a_square_drawn_in_parts_is_the_one_made_in_one_piece(depth_m: float, size_m: float) -> None:
    lens = replace(LENS, f_number=8.0, focus_distance_m=FOCUS_M)
    blur = float(blur_px(lens, CAMERA, np.array([1.0 / depth_m]))[0])
    die = CAMERA.focal_length_px * size_m / depth_m
    made = Spread(airy=airy_px(lens, CAMERA, LED_M), diffusion=0.3, blur=abs(blur), die=die)
    A, w = made.wing
    half = made.half_width
    r = np.hypot(*np.mgrid[-half : half + 1, -half : half + 1])
    expected = core(made)[0, 0] + A * (r**2 + w**2) ** -1.5
    image = _blob(_spread(), (0.0, 0.0), electrons=1e8, depth_m=depth_m, size_m=size_m, half=half) / 1e8
    assert image == pytest.approx(expected, rel=0.0, abs=7e-3 * expected.max())


@pytest.mark.parametrize(("size_m", "side"), [(0.0, 1), (5e-3, 1), (5.01e-3, 2), (8e-3, 2), (0.0101, 4), (0.064, 16)])
def test_no_square_is_cut_larger_than_five_millimetres_nor_smaller_than_need_be(size_m: float, side: int) -> None:
    """By halving: the widest core that there is, is one of 5 mm."""
    assert _divided(size_m) == (side, pytest.approx(size_m / side))


def test_a_large_square_holds_its_electrons_where_it_stands() -> None:
    """64 mm at 6 m, 31 px wide."""
    image = _blob(_spread(), (3.3, -2.1), electrons=1e6, depth_m=6.0, size_m=0.064, half=90)
    assert _moments(image)[:3] == pytest.approx((1e6, 3.3, -2.1), rel=1e-5, abs=5e-4)
    plateau = 1e6 / (0.016 / 5.5e-6 * 0.064 / 6.0) ** 2
    assert image[88, 93 - 11 : 93 + 12] == pytest.approx(plateau, rel=0.02)  # the wings carry 1 % over the edge


@pytest.mark.parametrize("depth_m,size_m", [(3.0, 5e-3), (1.5, 3e-3)])
def test_defocus_and_die_widen_a_blob_by_their_variances(depth_m: float, size_m: float) -> None:
    """b^2/16 and s^2/12; the wings, the same for all, cancel in the difference to the sharp point.

    Not quite: convolved, they gain a part in r^-5, which is left out beyond the core; 3 % of the variance here.
    """
    spread = _spread(4.0)
    sharp, blurred = _blob(spread, (0.0, 0.0)), _blob(spread, (0.0, 0.0), depth_m=depth_m, size_m=size_m)
    blur = 0.016**2 / 4.0 * (1.0 / depth_m - 0.1) * FOCUS_M / (FOCUS_M - 0.016) / 5.5e-6
    die = 0.016 * size_m / depth_m / 5.5e-6
    assert _moments(blurred)[3] - _moments(sharp)[3] == pytest.approx(blur**2 / 16.0 + die**2 / 12.0, rel=0.03)


def test_a_blob_does_not_depend_on_which_others_were_drawn_before() -> None:
    used = _spread()
    for depth_m in (30.0, 2.0, 7.0, 1.1):
        _blob(used, (0.0, 0.0), depth_m=depth_m, size_m=DIE_M)
    assert np.array_equal(
        _blob(used, (0.3, 0.3), depth_m=4.0, size_m=DIE_M), _blob(_spread(), (0.3, 0.3), depth_m=4.0, size_m=DIE_M)
    )


def test_cores_made_ahead_are_those_of_the_depths_around_and_change_no_blob(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a point whose three depths are made to one a step nearer, for which there is nothing left to do."""
    ahead, fresh = _spread(), _spread()
    _blob(ahead, (0.2, 0.1), depth_m=3.0)
    levels = [ahead.work_ahead() for _ in range(3)]
    assert levels == [True, True, False]
    monkeypatch.setattr("dockair.sim.camera.optics.core", None)
    depth_m = 1.0 / (1.0 / 3.0 + 1.0 / ahead._cores[0.0].levels_m)
    nearer = _blob(ahead, (0.2, 0.1), depth_m=depth_m)
    monkeypatch.undo()
    assert np.array_equal(nearer, _blob(fresh, (0.2, 0.1), depth_m=depth_m))


def test_sizes_beyond_those_kept_are_made_again() -> None:
    spread = _spread()
    first = _blob(spread, (0.1, 0.2), size_m=1e-3, depth_m=3.0)
    for size_m in np.linspace(2e-3, 4e-3, 17):
        _blob(spread, (0.1, 0.2), size_m=size_m, depth_m=3.0)
    assert np.array_equal(_blob(spread, (0.1, 0.2), size_m=1e-3, depth_m=3.0), first)


@pytest.mark.parametrize("size_m", [0.0, DIE_M, 0.012])
def test_nearer_than_the_nearest_depth_the_blur_grows_no_more(size_m: float) -> None:
    """Nor do a square's image, and the places of the parts that a large one is cut into."""
    spread = _spread()
    nearest = _blob(spread, (0.0, 0.0), depth_m=NEAREST_M, size_m=size_m)
    assert np.array_equal(_blob(spread, (0.0, 0.0), depth_m=0.2, size_m=size_m), nearest)
    assert not np.array_equal(_blob(spread, (0.0, 0.0), depth_m=0.6, size_m=size_m), nearest)


@pytest.mark.parametrize("f_number", [2.8, 8.0, 16.0])
def test_the_widest_core_is_that_of_the_largest_square_at_the_nearest_depth(f_number: float) -> None:
    """5 mm at 0.5 m; whatever was drawn before."""
    lens, spread = replace(LENS, f_number=f_number, focus_distance_m=FOCUS_M), _spread(f_number)
    blur, die = abs(float(blur_px(lens, CAMERA, np.array([2.0]))[0])), CAMERA.focal_length_px * 0.01
    widest = Spread(airy=airy_px(lens, CAMERA, LED_M), diffusion=0.3, blur=blur, die=die)
    assert spread.widest_px == core(widest).shape[-1] // 2


@pytest.mark.parametrize("f_number", [1.4, 2.8, 8.0, 16.0])
def test_the_suns_edge_is_as_steep_as_a_row_of_points_makes_it(f_number: float) -> None:
    """Points all along a line give the line spread; a Gaussian edge of that slope has sigma = 1/(sqrt(2 pi) slope)."""
    spread = _spread(f_number)
    line = _blob(spread, (0.0, 0.0), electrons=1e6, depth_m=np.inf, half=90).sum(0, dtype=float) / 1e6
    assert spread.edge_sigma_px() == pytest.approx(1.0 / (np.sqrt(2.0 * np.pi) * line[90]), rel=2e-3)
