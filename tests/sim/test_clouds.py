"""Cloud: lobes that keep their energy, the light that comes through, and a field with the statistics asked for."""

import math

import numpy as np
import pytest
from scipy.special import eval_legendre, j0, j1, ndtri

from dockair.sim.camera.clouds import Droplets, Texture, forward_half, lobe, optical_depth

WATER = Droplets(asymmetry=0.86, size_parameter=59.0)
NODE, WEIGHT = np.polynomial.legendre.leggauss(400)


def _texture(key: int) -> Texture:
    return Texture(key=key, cell_m=1000.0, spectral_exponent=5.0 / 3.0)


def _downward(mu_0: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cosines of incidence and of the angle from the Sun, and solid angles: the sky, finest around the Sun."""
    angle, turn = (0.5 * (NODE + 1.0)) ** 3 * np.pi, (np.arange(180) + 0.5) / 180 * 2.0 * np.pi
    solid = 0.5 * WEIGHT * 3.0 * (0.5 * (NODE + 1.0)) ** 2 * np.pi * np.sin(angle) * 2.0 * np.pi / 180
    mu = np.cos(angle)[:, None] * mu_0 + np.sin(angle)[:, None] * math.sqrt(1.0 - mu_0**2) * np.cos(turn)
    cosine, solid = (np.broadcast_to(a[:, None], mu.shape) for a in (np.cos(angle), solid))
    return mu[mu > 0.0], cosine[mu > 0.0], solid[mu > 0.0]


@pytest.mark.parametrize("g", [0.3, 0.74, 0.9])
def test_a_lobes_moments_are_the_powers_of_g(g: float) -> None:
    """The l-th Legendre moment is g^l: mean 1, mean cosine g, and n scatterings in a row make the lobe of g^n."""
    for order in range(9):
        moment = 0.5 * float(WEIGHT @ (lobe(NODE, np.asarray(g)) * eval_legendre(order, NODE)))
        assert moment == pytest.approx(g**order, abs=1e-9)


def test_the_forward_half_of_a_lobe_is_what_lies_within_ninety_degrees() -> None:
    c = 0.5 * (NODE + 1.0)
    for g in (0.1, 0.5, 0.74):
        assert forward_half(g) == pytest.approx(0.25 * float(WEIGHT @ lobe(c, np.asarray(g))), rel=1e-9)


def test_the_two_lobes_together_have_the_droplets_asymmetry() -> None:
    assert np.mean(WATER.lobes) == pytest.approx(WATER.asymmetry, rel=1e-12)


def test_the_diffracted_lobe_is_as_wide_as_the_airy_pattern() -> None:
    """Half the energy within the same angle; nowhere do the encircled energies differ by more than an eighth."""
    x, g = WATER.size_parameter, WATER.lobes[0]
    angle = np.linspace(0.0, 0.3, 3001)
    density = 0.5 * lobe(np.cos(angle), np.asarray(g)) * np.sin(angle)
    lobe_energy = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(angle))])
    airy_energy = 1.0 - j0(x * angle) ** 2 - j1(x * angle) ** 2
    half = [np.interp(0.5, energy[:1001], angle[:1001]) for energy in (lobe_energy, airy_energy)]
    assert half[0] == pytest.approx(half[1], rel=0.02)
    assert np.abs(lobe_energy - airy_energy).max() < 0.125


@pytest.mark.parametrize("depth", [0.05, 0.5, 2.0, 6.0])
def test_the_aureole_has_the_energy_that_diffraction_took_from_the_beam(depth: float) -> None:
    """Int L dOmega/pi over the sphere is exp(-tau/2) - exp(-tau); the mean cosine after m scatterings is g_d^m."""
    near = 0.5 * (NODE + 1.0)
    cosine, solid = np.cos(math.pi * near**3), 3.0 * math.pi**2 * near**2 * np.sin(math.pi * near**3) * WEIGHT
    light = WATER.aureole(np.full(400, depth), np.ones(400), cosine) * solid / math.pi
    orders = 0.5 * depth / (1.0 - math.exp(-0.5 * depth))
    assert light.sum() == pytest.approx(math.exp(-0.5 * depth) - math.exp(-depth), rel=1e-4)
    assert light @ cosine / light.sum() == pytest.approx(WATER.lobes[0] ** orders, rel=1e-6)


@pytest.mark.parametrize("mu_0", [1.0, 0.87, 0.5, 0.17])
@pytest.mark.parametrize("depth", [0.1, 1.0, 4.0, 10.0, 40.0])
def test_what_comes_through_is_the_two_stream_flux_and_no_more_than_came(depth: float, mu_0: float) -> None:
    """To an eighth, the error of putting all light that is scattered more than once into an even glow."""
    mu, cosine, solid = _downward(mu_0)
    tau = np.full(len(mu), depth)
    light = WATER.aureole(tau, mu, cosine) + WATER.diffuse(tau, mu, mu_0, cosine)
    flux = mu_0 * math.exp(-depth / mu_0) + float((light * mu) @ solid) / math.pi
    assert flux <= 1.005 * mu_0
    assert flux == pytest.approx(mu_0 * float(WATER.transmittance(np.asarray(depth))), rel=0.125)


def test_thin_cloud_scatters_once() -> None:
    """tau P/4 mu for each lobe's half of the extinction: the first-order formula, to the order tau."""
    tau, mu, cosine = 1e-4, 0.6, np.array([0.99, 0.8, 0.1])
    depth, mu_view = np.full(3, tau), np.full(3, mu)
    diffracted, refracted = (lobe(cosine, np.asarray(g)) * 0.5 * tau / (4.0 * mu) for g in WATER.lobes)
    assert WATER.aureole(depth, mu_view, cosine) == pytest.approx(diffracted, rel=1e-3)
    assert WATER.diffuse(depth, mu_view, 0.7, cosine) == pytest.approx(refracted, rel=1e-3)


def test_thick_cloud_looks_the_same_all_round_and_hides_the_sun() -> None:
    cosine = np.linspace(-1.0, 1.0, 9)
    depth, mu = np.full(9, 60.0), np.linspace(0.2, 1.0, 9)
    assert WATER.diffuse(depth, mu, 0.5, cosine) == pytest.approx(
        np.full(9, 0.5 / (1.0 + 0.75 * 0.14 * 60.0)), rel=1e-9
    )
    assert WATER.aureole(depth, mu, cosine).max() < 1e-8


def test_the_lobe_is_continuous_where_sight_and_sun_meet_the_layer_alike() -> None:
    mu = np.array([0.5 - 1e-5, 0.5, 0.5 + 1e-5])
    a, b, c = WATER.diffuse(np.full(3, 2.0), mu, 0.5, np.full(3, 0.9))
    assert b == pytest.approx(0.5 * (a + c), rel=1e-6)


@pytest.mark.parametrize("cover", [0.05, 0.5, 0.9])
def test_of_normal_noise_the_cover_is_cloud_of_the_mean_depth(cover: float) -> None:
    noise = ndtri((np.arange(200_000) + 0.5) / 200_000)
    depth = optical_depth(noise, cover, 8.0)
    assert (depth > 0.0).mean() == pytest.approx(cover, abs=1e-5)
    assert depth[depth > 0.0].mean() == pytest.approx(8.0, rel=1e-3)


def test_no_cover_is_no_cloud_and_full_cover_has_no_gap() -> None:
    noise = np.linspace(-3.9, 3.9, 50)
    assert optical_depth(noise, 0.0, 8.0).max() == 0.0
    assert optical_depth(noise, 1.0, 8.0).min() > 0.0


def test_the_field_has_the_cover_that_it_was_asked_for() -> None:
    """Mean over 40 fields 40 cells wide; one field's cover scatters by 0.008: 5 sigma of the mean is 0.006."""
    share = []
    for key in range(40):
        place = np.random.default_rng(key).uniform(-2e4, 2e4, (2, 4000))
        noise = _texture(key).at(*place, np.ones(4000))
        share.append([(optical_depth(noise, cover, 1.0) > 0.0).mean() for cover in (0.2, 0.5, 0.8)])
    assert np.abs(np.mean(share, axis=0) - [0.2, 0.5, 0.8]).max() < 0.01


def test_the_fields_roughness_is_kolmogorovs() -> None:
    """Mean squared difference grows as distance^(2/3) between footprint and cell: exponent 5/3 less 1."""
    texture, rng = _texture(5), np.random.default_rng(6)
    x, y, turn = rng.uniform(-2e5, 2e5, 20_000), rng.uniform(-2e5, 2e5, 20_000), rng.uniform(0.0, 2.0 * np.pi, 20_000)
    fine = np.full(20_000, 0.5)
    here = texture.at(x, y, fine)
    steps = np.array([8.0, 16.0, 32.0, 64.0, 128.0, 256.0])
    square = [np.mean((texture.at(x + s * np.cos(turn), y + s * np.sin(turn), fine) - here) ** 2) for s in steps]
    assert np.polyfit(np.log(steps), np.log(square), 1)[0] == pytest.approx(2.0 / 3.0, abs=0.05)
    assert here.var() == pytest.approx(1.0, abs=0.04)


def test_nothing_finer_than_the_footprint_is_left() -> None:
    """Neighbours 5 m apart: alike to a hundredth of the variance if samples are 100 m apart, less so if 2 m."""
    x, y = np.random.default_rng(7).uniform(-1e5, 1e5, (2, 5000))
    differences = []
    for footprint in (2.0, 100.0):
        a, b = (_texture(8).at(x + step, y, np.full(5000, footprint)) for step in (0.0, 5.0))
        differences.append(np.mean((a - b) ** 2))
    assert differences[1] < 1e-3 < 2e-2 < differences[0]


@pytest.mark.parametrize(
    ("footprint_m", "of_octaves"), [(100.0, (1.0, 1.0, 0.25)), (200.0, (1.0, 0.25)), (350.0, (3.0 / 7.0,)), (600.0, ())]
)
def test_octaves_are_whole_down_to_four_samples_a_lattice_and_gone_at_two(
    footprint_m: float, of_octaves: tuple[float, ...]
) -> None:
    """Lattices of 1000 m/2^k: the variance is that of Eq. (1), w_k linear in between; to 4.5 sqrt(2/4000)."""
    x, y = np.random.default_rng(11).uniform(-1e6, 1e6, (2, 4000))
    gain_2 = 2.0 ** (-2.0 / 3.0)
    wanted = (1.0 - gain_2) * sum(w * w * gain_2**k for k, w in enumerate(of_octaves))
    found = _texture(12).at(x, y, np.full(4000, footprint_m)).var()
    assert found == pytest.approx(wanted, rel=4.5 * math.sqrt(2.0 / 4000.0), abs=0.0)


def test_the_field_is_continuous_across_its_lattice() -> None:
    x = np.array([1000.0, 3000.0, -2000.0])[:, None] + np.array([-1e-6, 1e-6])
    y = np.array([123.0, 0.0, -777.0])[:, None] + np.zeros(2)
    values = _texture(9).at(x.ravel(), y.ravel(), np.full(6, 0.5)).reshape(3, 2)
    assert np.abs(values[:, 1] - values[:, 0]).max() < 1e-5


def test_another_key_is_another_field() -> None:
    """Correlation of 4000 cells' values: 1/sqrt(4000) = 0.016 at 1 sigma."""
    x, y = np.random.default_rng(10).uniform(-1e6, 1e6, (2, 4000))
    a, b, again = (_texture(key).at(x, y, np.ones(4000)) for key in (2**63 + 11, 2**63 + 12, 2**63 + 11))
    assert np.array_equal(a, again)
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.08
