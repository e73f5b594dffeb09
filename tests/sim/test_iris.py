"""The iris: far diffraction of circles and polygons, and the spikes that straight edges make of it."""

import numpy as np
import pytest
from scipy.special import j0, j1

from dockair.messages import Window
from dockair.sim.camera.coarse_grid import CoarseGrid, nodes_around
from dockair.sim.camera.iris import Iris, Spikes, _spike

SUN_PX = 13.5


def _iris(blades: int, angle_rad: float = 0.2) -> Iris:
    return Iris(blades=blades, angle_rad=angle_rad)


def _transform(iris: Iris, q: np.ndarray) -> np.ndarray:
    """Fourier transform of a polygon of inscribed radius 1 at wave vectors q (n, 2): exact, from its corners."""
    turn = np.pi / iris.blades
    angle = iris.angle_rad + turn * (2.0 * np.arange(iris.blades) + 1.0)
    corners = np.column_stack([np.cos(angle), np.sin(angle)]) / np.cos(turn)
    total = np.zeros(len(q), dtype=complex)
    for a, b in zip(np.roll(corners, 1, axis=0), corners, strict=True):
        edge, middle = b - a, 0.5 * (a + b)
        outward = np.array([edge[1], -edge[0]])  # times the edge's length
        total += (q @ outward) * np.exp(-1j * (q @ middle)) * np.sinc((q @ edge) / (2.0 * np.pi))
    return 1j * total / (q**2).sum(axis=1)


def test_the_tail_of_a_round_irises_light_is_the_airy_patterns() -> None:
    """1 - encircled energy = J0^2 + J1^2 in v = pi r/(lambda N); over a ring of the pattern it goes to 2/(pi v)."""
    Q = _iris(0).wing_px(850e-9, 8.0, 5.5e-6)
    v = np.linspace(300.0, 300.0 + 2.0 * np.pi, 400)
    r_px = v * 850e-9 * 8.0 / (np.pi * 5.5e-6)
    assert np.mean((j0(v) ** 2 + j1(v) ** 2) * r_px) == pytest.approx(Q, rel=2e-3)


@pytest.mark.parametrize("blades", [3, 5, 6, 8])
def test_the_tail_of_a_polygons_light_is_its_perimeter_over_its_area(blades: int) -> None:
    """|F|^2 of the exact transform, ring by ring, against Q; and nearly all of it lies along the edges' normals."""
    iris = _iris(blades)
    angle = 2.0 * np.pi * (np.arange(20_000) + 0.5) / 20_000
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    # the cosine from the nearest spike says whether a direction lies within 5 degrees of one
    along = (ring @ iris.spikes.T).max(axis=1) > np.cos(np.deg2rad(5.0))
    shares, gathered = [], np.zeros(2)
    for q in np.linspace(200.0, 212.0, 25):
        power = np.abs(_transform(iris, q * ring)) ** 2
        # density in q is |F|^2/(4 pi^2 A); beyond q lies Q'/q if a ring of width dq holds Q'/q^2 dq
        shares.append(power.mean() * 2.0 * np.pi * q**3 / (4.0 * np.pi**2 * iris.area_factor))
        gathered += power[along].sum(), power.sum()
    perimeter, area = 2.0 * iris.area_factor, iris.area_factor  # of a polygon of inscribed radius 1
    assert np.mean(shares) == pytest.approx(perimeter / (np.pi * area), rel=0.01)
    assert gathered[0] / gathered[1] > 0.95
    # in pixels: q = 2 pi r/(lambda f), inscribed radius that of f/8 with the circle's area
    Q = perimeter / (np.pi * area) * 850e-9 * 16e-3 / (2.0 * np.pi * iris.inscribed_radius(1e-3) * 5.5e-6)
    assert iris.wing_px(850e-9, 8.0, 5.5e-6) == pytest.approx(Q, rel=1e-12)


@pytest.mark.parametrize(("blades", "count"), [(0, 0), (3, 6), (5, 10), (6, 6), (7, 14), (8, 8)])
def test_an_even_number_of_blades_makes_as_many_spikes_an_odd_one_twice_as_many(blades: int, count: int) -> None:
    spikes = _iris(blades).spikes
    assert len(spikes) == count
    assert len({(round(x, 6), round(y, 6)) for x, y in spikes}) == count


@pytest.mark.parametrize("blades", [0, 3, 6, 9])
def test_an_iris_has_the_area_of_the_circle_it_stands_for(blades: int) -> None:
    iris = _iris(blades)
    a = iris.inscribed_radius(2.5)
    n = blades or 100_000
    angle = 2.0 * np.pi * np.arange(n + 1) / n
    corner = a / np.cos(np.pi / n)
    shoelace = 0.5 * corner**2 * np.sum(np.sin(np.diff(angle)))
    assert shoelace == pytest.approx(np.pi * 2.5**2, rel=1e-6)


@pytest.mark.parametrize(("along", "fan"), [(30.0, 0.0), (200.0, 0.0), (200.0, 0.02), (1500.0, 0.02)])
def test_across_a_spike_its_light_is_the_closed_form_and_its_width_the_suns_and_the_fans(
    along: float, fan: float
) -> None:
    t = np.linspace(-150.0, 150.0, 30_001)
    profile = np.array([_spike(along, x, SUN_PX, fan) for x in t])
    light = np.trapezoid(profile, t)
    assert light == pytest.approx(along / SUN_PX**2 * (1.0 + (along / SUN_PX) ** 2) ** -1.5, rel=1e-4)
    variance = np.trapezoid(profile * t**2, t) / light
    assert variance == pytest.approx(SUN_PX**2 / 4.0 + (fan * along) ** 2, rel=1e-3)


def test_far_out_a_spike_falls_as_the_inverse_square() -> None:
    near, far = _spike(1000.0, 0.0, SUN_PX, 0.0), _spike(2000.0, 0.0, SUN_PX, 0.0)
    assert near / far == pytest.approx(4.0, rel=1e-3)


@pytest.mark.parametrize(
    ("blades", "angle_rad", "fan"), [(6, 0.2, 0.0), (5, 0.7, 0.01), (4, np.pi / 4, 0.1), (3, 0.0, 0.03)]
)
def test_every_node_has_the_sum_of_all_spikes_and_none_is_passed_over(
    blades: int, angle_rad: float, fan: float
) -> None:
    """The kernel walks along each spike; here Eqs. (2) and (3) are taken at all nodes."""
    iris = _iris(blades, angle_rad)
    first, shape = nodes_around(Window(0, 1088, 0, 2048))
    values = np.zeros(shape, dtype=np.float32)
    Spikes(iris, 0.0125, SUN_PX, fan).add_to_grid(values, first, (703.3, 402.7), 1e9)
    v, u = 8.0 * np.indices(shape) - np.array([402.7, 703.3])[:, None, None]
    law = np.zeros(shape)
    for x, y in iris.spikes:
        s, t = np.maximum(u * x + v * y, 0.0), v * x - u * y
        z = np.sqrt(7.0 * (SUN_PX**2 / 4.0 + (fan * s) ** 2))
        across = 15.0 / 16.0 / z * np.maximum(1.0 - (t / z) ** 2, 0.0) ** 2
        law += 0.0125e9 / len(iris.spikes) * s / SUN_PX**2 * (1.0 + (s / SUN_PX) ** 2) ** -1.5 * across
    assert np.allclose(values, law, rtol=1e-5, atol=1e-7 * law.max())


@pytest.mark.parametrize("blades", [4, 5, 6])
def test_the_spikes_light_on_a_wide_plane_is_their_share(blades: int) -> None:
    iris, half = _iris(blades), 600
    values = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.float32)
    Spikes(iris, 0.0125, SUN_PX, 0.01).add_to_grid(values, (-half, -half), (3.3, -2.2), 1e9)
    edge = 8.0 * half / np.abs(iris.spikes).max(axis=1)  # where each spike leaves the square
    inside = 1.0 - np.mean((1.0 + (edge / SUN_PX) ** 2) ** -0.5)
    assert 64.0 * values.sum(dtype=float) == pytest.approx(0.0125e9 * inside, rel=0.01)
    assert inside < 0.998  # what has left is counted


def test_on_the_grid_a_spike_is_within_an_eighth_of_its_middle() -> None:
    iris = _iris(6)
    first, shape = nodes_around(Window(0, 1088, 0, 2048))
    values = np.zeros(shape, dtype=np.float32)
    Spikes(iris, 6.0, SUN_PX, 0.0).add_to_grid(values, first, (703.3, 402.7), 1.0)
    grid = CoarseGrid(values, first)
    x, y = iris.spikes[0]
    for along in (60.0, 150.0, 400.0):
        s, t = (m.ravel() for m in np.meshgrid(along + np.linspace(-16, 16, 65), np.linspace(-24, 24, 97)))
        got = grid.at(np.column_stack([703.3 + s * x - t * y, 402.7 + s * y + t * x]))
        law = np.array([_spike(a, b, SUN_PX, 0.0) for a, b in zip(s, t, strict=True)])
        assert np.abs(got - law).max() < 0.125 * law.max()


def test_a_windows_spikes_are_the_full_frames_bit_for_bit() -> None:
    spikes = Spikes(_iris(5), 0.01, SUN_PX, 0.01)

    def nodes(window: Window) -> tuple[np.ndarray, tuple[int, int]]:
        first, shape = nodes_around(window)
        values = np.full(shape, 0.1, dtype=np.float32)
        spikes.add_to_grid(values, first, (703.3, 402.7), 1e9)
        return values, first

    full, _ = nodes(Window(0, 1088, 0, 2048))
    rng = np.random.default_rng(6)
    for _ in range(150):
        r, c = int(rng.integers(0, 1000)), int(rng.integers(0, 1900))
        part, (i, j) = nodes(Window(r, r + int(rng.integers(1, 88)), c, c + int(rng.integers(1, 148))))
        assert np.array_equal(part, full[i : i + part.shape[0], j : j + part.shape[1]])


def test_an_leds_spikes_stay_below_a_grey_level_outside_its_blob() -> None:
    """The module's number: 5e4 e-, f/8, six blades, 6 px from the middle; 53 e- make a grey level of eight bits."""
    iris = _iris(6)
    per_length = 5e4 * iris.wing_px(850e-9, 8.0, 5.5e-6) / (len(iris.spikes) * 6.0**2)
    side_m = 2.0 * iris.inscribed_radius(1e-3) * np.tan(np.pi / 6.0)
    width_px = 850e-9 * 16e-3 / side_m / 5.5e-6  # height of sinc^2 times this is its integral
    assert per_length == pytest.approx(60.0, rel=0.03)
    assert per_length / width_px == pytest.approx(27.0, rel=0.05)
    assert per_length / width_px < 53.0
