"""The bow wave against the closed forms of the Rankine half-body."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.air.bow_wave import BowWaveParameters, bow_wave_coefficients, bow_wave_velocity

V, R = 180.0, 0.75
PROBE_TIP = np.array([6.0, -0.9, 0.6])
PARAMETERS = BowWaveParameters(radius_m=R, nose_behind_tip_m=1.3, nose_height_m=-0.05)
NOSE = np.array([4.7, 0.0, -0.05])
SOURCE = NOSE - [0.5 * R, 0.0, 0.0]
K = bow_wave_coefficients(PARAMETERS, PROBE_TIP, V)


def at(points: np.ndarray) -> np.ndarray:
    return bow_wave_velocity(np.atleast_2d(np.asarray(points, dtype=float)), K)


def sphere(centre: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Points on a sphere and their outward areas, by Gauss and Legendre in the height, evenly around."""
    z, weight = np.polynomial.legendre.leggauss(60)
    around = np.arange(120) * (2.0 * np.pi / 120)
    flat = np.sqrt(1.0 - z**2)[:, None]
    normal = np.stack([flat * np.cos(around), flat * np.sin(around), np.broadcast_to(z[:, None], (60, 120))], axis=-1)
    area = (radius**2 * weight * 2.0 * np.pi / 120)[:, None, None] * normal
    return (centre + radius * normal).reshape(-1, 3), area.reshape(-1, 3)


def test_the_stream_comes_to_rest_at_the_nose() -> None:
    np.testing.assert_allclose(at(NOSE)[0], [V, 0.0, 0.0], atol=1e-12)  # the stream is (-V, 0, 0)


def test_the_stream_runs_along_the_half_bodys_surface_everywhere() -> None:
    """|r| = (R/2)/cos(theta/2): the total velocity has no part across its meridian."""
    theta = np.linspace(0.05, 3.0, 40)
    r = 0.5 * R / np.cos(0.5 * theta)
    slope = 0.25 * R * np.sin(0.5 * theta) / np.cos(0.5 * theta) ** 2  # dr/dtheta
    for side in (0.0, 1.1, 4.0):
        across = np.array([0.0, np.cos(side), np.sin(side)])
        ahead = np.array([1.0, 0.0, 0.0])
        out, along = np.cos(theta)[:, None] * ahead + np.sin(theta)[:, None] * across, None
        along = -np.sin(theta)[:, None] * ahead + np.cos(theta)[:, None] * across
        normal = r[:, None] * out - slope[:, None] * along
        velocity = at(SOURCE + r[:, None] * out) - [V, 0.0, 0.0]
        np.testing.assert_allclose(np.sum(velocity * normal, axis=1), 0.0, atol=1e-9 * V)
    assert r[-1] * np.sin(theta[-1]) == pytest.approx(R, rel=0.01)


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (0.5, -0.7, 0.4)])
def test_the_volume_that_leaves_the_source_fills_the_body(centre: tuple[float, float, float]) -> None:
    points, area = sphere(SOURCE + np.array(centre), 2.5)
    assert np.sum(at(points) * area) == pytest.approx(np.pi * R**2 * V, rel=1e-10)


def test_where_there_is_no_source_as_much_air_comes_as_goes() -> None:
    points, area = sphere(SOURCE + np.array([0.0, 3.0, 0.0]), 2.0)
    assert abs(np.sum(at(points) * area)) < 1e-9 * V


def test_twice_as_far_the_push_is_a_quarter_and_away_from_the_source() -> None:
    directions = np.random.default_rng(1).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    near, far = at(SOURCE + 1.3 * directions), at(SOURCE + 2.6 * directions)
    np.testing.assert_allclose(near, 4.0 * far, rtol=1e-12)
    np.testing.assert_allclose(near, 0.25 * V * R**2 / 1.3**2 * directions, rtol=1e-12)


def test_inside_the_body_the_push_dies_out_without_a_jump() -> None:
    direction = np.array([0.6, 0.0, 0.8])
    reach = np.array([0.0, 0.1, 0.25, 0.5 * R - 1e-9, 0.5 * R + 1e-9])
    speed = at(SOURCE + reach[:, None] * direction) @ direction
    np.testing.assert_allclose(speed, V * np.array([0.0, 0.1 / (0.5 * R), 0.25 / (0.5 * R), 1.0, 1.0]), rtol=1e-7)


def test_the_push_grows_with_the_bodys_section_and_with_the_speed() -> None:
    point = (NOSE + [0.0, 40.0, 0.0])[None]
    twice = bow_wave_coefficients(replace(PARAMETERS, radius_m=2.0 * R), PROBE_TIP, 3.0 * V)
    assert bow_wave_velocity(point, twice)[0, 1] / at(point)[0, 1] == pytest.approx(12.0, rel=1e-3)  # it moves by R/2


def test_the_noses_place_is_the_probes_less_what_the_sheet_says() -> None:
    """1.0 to 1.5 m behind the tip and 0.8 to 1.2 m beside it, as assumed for a receiver of this class."""
    sheet = load_parameters("bow_wave", BowWaveParameters)
    k = bow_wave_coefficients(sheet, PROBE_TIP, V)
    behind, beside = PROBE_TIP[:2] - k[:2] - [0.5 * sheet.radius_m, 0.0]
    assert 1.0 <= behind <= 1.5 and 0.8 <= -beside <= 1.2


def test_a_receiver_that_does_not_fly_is_refused() -> None:
    with pytest.raises(DockairError, match="airspeed_m_s: expected a speed > 0, got -1.0"):
        bow_wave_coefficients(PARAMETERS, PROBE_TIP, -1.0)
