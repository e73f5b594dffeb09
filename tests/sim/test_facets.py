"""What is spared mirrors nothing: facets and tubes that are left out against all of them."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dockair.rotations import exp
from dockair.sim.camera.facets import facets_that_may_shine
from dockair.sim.camera.lobes import ROW, facet_rows
from dockair.sim.camera.mirrors import METAL, Mirrors, _facet_table, finishes, vector
from dockair.sim.camera.round_mirrors import _is_steep
from dockair.sim.camera.sheets import CameraSheets

SHEETS = CameraSheets.load()
SURFACES = SHEETS.surfaces
VARIANCE = 0.25 * SHEETS.light.sun_angular_radius_rad**2


def _rows(mirrors: Mirrors, which: np.ndarray, data: Any, sun: np.ndarray, eye: np.ndarray) -> np.ndarray:
    limits = (
        math.cos(SURFACES.grazing_rad),
        SURFACES.faintest_glint_m2_sr,
        SURFACES.faintest_radiance,
        SURFACES.patch_step_rad,
    )
    rows, light = np.empty((4000, ROW)), (vector(sun), 0.0, VARIANCE)
    poses = data.geom_xpos, data.geom_xmat
    return rows[: facet_rows(mirrors.facets, which, poses, light, vector(eye), finishes(SURFACES), limits, rows, 0)]


def test_facets_that_are_spared_send_nothing_to_the_lens(make_world: Callable[..., Any]) -> None:
    """Four hundred Suns and eyes around tanker and drogue: the same rows as from all facets that are not averted."""
    world, rng = make_world(), np.random.default_rng(1)
    mirrors, data = Mirrors.of(world.model), world.data
    facets, poses, found, spared = mirrors.facets, (data.geom_xpos, data.geom_xmat), 0, 0
    turns = data.geom_xmat.reshape(-1, 3, 3)[facets.geom]
    n = np.einsum("nij,nj->ni", turns, facets.frame[:, 1])
    p = data.geom_xpos[facets.geom] + np.einsum("nij,nj->ni", turns, facets.frame[:, 0])
    for _ in range(400):
        sun = exp(rng.normal(0.0, 1.0, 3))[:, 0]
        eye = data.body("drogue").xpos + rng.normal(0.0, 6.0, 3)
        toward = np.flatnonzero((n @ sun > 0.0) & (((eye - p) * n).sum(axis=1) > 0.0))
        light, limit = (vector(sun), VARIANCE), SURFACES.faintest_radiance
        which = facets_that_may_shine(facets, poses, light, vector(eye), (0.0, 0.0, 0.0), finishes(SURFACES), limit)
        assert np.isin(which, toward).all() and np.all(np.diff(which) > 0)
        every = _rows(mirrors, toward, data, sun, eye)
        assert np.array_equal(_rows(mirrors, which, data, sun, eye), every)
        found, spared = found + len(every), spared + len(toward) - len(which)
    assert found > 500 and spared > 10000


def _may_shine(lean_rad: float, incidence_rad: float, roughness_rad: float, faintest: float, bend: float = 0.0) -> bool:
    """Of a small, perfect mirror far away, which leans away from the half-way direction across the incidence."""
    facets = _facet_table([(0, METAL, np.vstack([np.zeros(3), np.eye(3)]), (1e-3, 1e-3), (bend / 2e-3, 0.0, 0.0))])
    assert facets.bend[0] == pytest.approx(bend)
    h = np.array([math.cos(lean_rad), math.sin(lean_rad), 0.0])
    up, across = math.cos(incidence_rad) * h, np.array([0.0, 0.0, math.sin(incidence_rad)])
    perfect = replace(SURFACES, metal_reflectance=1.0, metal_share=1.0, metal_roughness_rad=roughness_rad)
    poses, nowhere = (np.zeros((1, 3)), np.eye(3).reshape(1, 9)), (0.0, 0.0, 0.0)
    light, eye = (vector(up + across), VARIANCE), vector(1e6 * (up - across))
    return len(facets_that_may_shine(facets, poses, light, eye, nowhere, finishes(perfect), faintest)) == 1


@pytest.mark.parametrize(("lean_rad", "s"), [(0.0, 0.003), (0.01, 0.003), (0.5, 0.15)])
@pytest.mark.parametrize("incidence_rad", [0.0, 0.9])
def test_a_small_far_facet_is_spared_from_four_times_its_radiance_on(
    lean_rad: float, s: float, incidence_rad: float
) -> None:
    """Beckmann's facets, 1/(8 (h.n)^4 v.n s^2) exp(-tan^2/(2 V)); V is s^2 and the Sun's (a/2)^2/(2 cos i)^2."""
    cos_i, cos_lean = math.cos(incidence_rad), math.cos(lean_rad)
    variance = s**2 + VARIANCE / (2.0 * cos_i) ** 2
    radiance = math.exp(-0.5 * math.tan(lean_rad) ** 2 / variance) / (8.0 * cos_lean**4 * cos_lean * cos_i * s**2)
    assert _may_shine(lean_rad, incidence_rad, s, 3.96 * radiance)
    assert not _may_shine(lean_rad, incidence_rad, s, 4.04 * radiance)


@pytest.mark.parametrize("lean", [0.0, 0.11])
def test_a_curved_facet_may_shine_as_if_it_leaned_by_its_bend_less_and_were_seen_as_flatly(lean: float) -> None:
    bend, s, cos_i = 0.1, 0.003, 0.3
    lacking, lean_rad, variance = max(lean - bend, 0.0), math.atan(lean), s**2 + VARIANCE / (2.0 * cos_i) ** 2
    seen, hn = cos_i * math.cos(lean_rad) - bend, math.cos(lean_rad)
    limit = 4.0 / (8.0 * hn**4 * seen * s**2) * math.exp(-0.5 * lacking**2 / variance)
    assert _may_shine(lean_rad, math.acos(cos_i), s, 0.99 * limit, bend)
    assert not _may_shine(lean_rad, math.acos(cos_i), s, 1.01 * limit, bend)


@pytest.mark.parametrize("incidence_rad", [0.0, 0.9])
def test_a_facet_that_leans_by_more_than_six_sigmas_is_spared_however_faint_a_glint_may_be(
    incidence_rad: float,
) -> None:
    """Those of the surface and of the Sun's disc together."""
    slope = 6.0 * (0.003 + math.sqrt(VARIANCE) / (2.0 * math.cos(incidence_rad)))
    assert _may_shine(math.atan(0.99 * slope), incidence_rad, 0.003, 0.0)
    assert not _may_shine(math.atan(1.01 * slope), incidence_rad, 0.003, 0.0)


def test_a_facets_slopes_differ_from_its_middles_by_no_more_than_its_bend() -> None:
    """By its second fundamental form at its corners, saddles among them."""
    rng = np.random.default_rng(4)
    C, half = rng.normal(0.0, 1.0, (500, 3)), rng.uniform(0.05, 0.5, (500, 2))
    C[:20, [0, 2]] = 0.0
    facets = _facet_table([(0, 0, np.eye(4, 3), (h, k), tuple(c)) for (h, k), c in zip(half, C, strict=True)])
    for sign in (1.0, -1.0):
        x, y = half[:, 0], sign * half[:, 1]
        slope = np.hypot(C[:, 0] * x + C[:, 1] * y, C[:, 1] * x + C[:, 2] * y)
        assert np.all(slope <= facets.bend * (1.0 + 1e-12))


def test_facets_behind_the_lens_are_spared_and_no_other(make_world: Callable[..., Any]) -> None:
    """Two hundred Suns, eyes and axes: of the rows ahead not one is missing, of those well behind few are left."""
    world, rng = make_world(), np.random.default_rng(2)
    mirrors, data = Mirrors.of(world.model), world.data
    poses, ahead_rows, spared = (data.geom_xpos, data.geom_xmat), 0, 0
    for _ in range(200):
        sun, axis = exp(rng.normal(0.0, 1.0, 3))[:, 0], exp(rng.normal(0.0, 1.0, 3))[:, 0]
        eye = data.body("drogue").xpos + rng.normal(0.0, 6.0, 3)
        light, limit = (vector(sun), VARIANCE), SURFACES.faintest_radiance
        every, ahead = (
            facets_that_may_shine(mirrors.facets, poses, light, vector(eye), to, finishes(SURFACES), limit)
            for to in ((0.0, 0.0, 0.0), vector(axis))
        )
        all_rows, rows = (_rows(mirrors, which, data, sun, eye) for which in (every, ahead))
        assert np.array_equal(*(r[(r[:, :3] - eye) @ axis > 0.0] for r in (all_rows, rows)))
        ahead_rows, spared = (
            ahead_rows + int(((rows[:, :3] - eye) @ axis > 0.0).sum()),
            spared + len(every) - len(ahead),
        )
    assert ahead_rows > 100 and spared > 1000


@pytest.mark.parametrize("point", [0.0, 1.0])
@pytest.mark.parametrize("rough", [0.01, 0.12, 1.0])
def test_on_a_tube_that_is_spared_every_facet_would_lean_too_far(point: float, rough: float) -> None:
    """A thousand tubes; 400 points on each that is spared: seven sigmas along the axis, or h.n < 1/2 for `lobes`."""
    rng, spared = np.random.default_rng(3), 0
    for _ in range(1000):
        axis, half, radius = exp(rng.normal(0.0, 1.0, 3))[:, 2], rng.uniform(0.01, 0.3), rng.uniform(0.005, 0.05)
        eye = rng.normal(0.0, 6.0, 3)
        light = rng.normal(0.0, 3.0, 3) if point else exp(rng.normal(0.0, 1.0, 3))[:, 0]
        spread = rough, 0.0
        if not _is_steep(vector(light), point, vector(eye), vector(axis), half + radius, spread):
            continue
        spared += 1
        across = np.cross(axis, rng.normal(0.0, 1.0, (400, 3)))
        n = across / np.linalg.norm(across, axis=1, keepdims=True)
        p = radius * n + rng.uniform(-half, half, (400, 1)) * axis
        s, v = light - point * p, eye - p
        h = s / np.linalg.norm(s, axis=1, keepdims=True) + v / np.linalg.norm(v, axis=1, keepdims=True)
        hn, along = (h * n).sum(axis=1), np.abs(h @ axis)
        too_far = hn < 0.5 * np.linalg.norm(h, axis=1)
        assert (too_far | (along > 7.0 * rough * hn)).all()
    assert spared > 30
