"""The tanker's wake against closed forms, Biot and Savart's integral, and what every such field must be."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad_vec

from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.air.wake import WakeParameters, circulation_m2_s, wake_coefficients, wake_velocity

MASS, SPAN, V = 80e3, 40.0, 180.0
AIR = standard_atmosphere(6000.0)
INVISCID = replace(AIR, kinematic_viscosity_m2_s=0.0)
SHEET = load_parameters("wake", WakeParameters)
ALONE = replace(SHEET, bound_m=np.zeros(3), tail_circulation_fraction=0.0)  # the wing's horseshoe at the origin
THIN = replace(ALONE, core_fraction=1e-7, core_growth=0.0)
HALF = np.pi / 8.0 * SPAN  # the legs' distance from the axis
FAR_BEHIND = -1e7
PAGE = Path(__file__).parents[2] / "docs" / "models" / "wake.md"


def table(parameters: WakeParameters) -> np.ndarray:
    """Without growth of the cores also without viscosity."""
    air = AIR if parameters.core_growth > 0.0 else INVISCID
    return wake_coefficients(parameters, mass_kg=MASS, span_m=SPAN, airspeed_m_s=V, air=air)


def at(parameters: WakeParameters, *points: tuple[float, float, float]) -> np.ndarray:
    return wake_velocity(np.array(points, dtype=float), table(parameters))


def gamma(parameters: WakeParameters = ALONE) -> float:
    return circulation_m2_s(parameters, MASS, SPAN, V, AIR)


def gradient(parameters: WakeParameters, point: np.ndarray, step: float = 1e-4) -> np.ndarray:
    """(3, 3) dv_i/dx_j by central differences."""
    ahead, behind = at(parameters, *(point + step * np.eye(3))), at(parameters, *(point - step * np.eye(3)))
    return (ahead - behind).T / (2.0 * step)


def test_the_circulation_carries_the_tanker() -> None:
    assert AIR.density_kg_m3 * V * gamma() * 2.0 * HALF == pytest.approx(MASS * 9.80665, rel=1e-12)


def test_wing_and_tail_carry_the_tanker_together() -> None:
    """The lift is the momentum that the legs give to the air: rho V times the sum of Gamma times their distance."""
    k = table(SHEET)
    assert k[-1, 4] < 0.0 < k[0, 4]
    lift = AIR.density_kg_m3 * V * np.sum(4.0 * np.pi * k[:, 4] * 2.0 * k[:, 3])
    assert lift == pytest.approx(MASS * 9.80665, rel=1e-12)


def test_a_worked_example_of_a_tanker_at_120_m_s_and_3000_m() -> None:
    """80 t, 40 m: 229 m^2/s, and 4.6 m/s down between the legs far behind, worked by other hands."""
    air = replace(standard_atmosphere(3000.0), kinematic_viscosity_m2_s=0.0)
    assert circulation_m2_s(ALONE, MASS, SPAN, 120.0, air) == pytest.approx(229.0, abs=0.5)
    k = wake_coefficients(THIN, mass_kg=MASS, span_m=SPAN, airspeed_m_s=120.0, air=air)
    assert wake_velocity(np.array([[FAR_BEHIND, 0.0, 0.0]]), k)[0, 2] == pytest.approx(-4.6, abs=0.05)


@pytest.mark.parametrize("behind_m", [0.5, 5.0, 34.0, 400.0])
def test_downwash_on_the_axis_is_the_closed_form_at_every_distance_behind_the_bound_vortex(behind_m: float) -> None:
    expected = -gamma() / (2.0 * np.pi * HALF) * (1.0 + np.hypot(behind_m, HALF) / behind_m)
    np.testing.assert_allclose(at(THIN, (-behind_m, 0.0, 0.0))[0], [0.0, 0.0, expected], rtol=1e-9, atol=1e-12)


def test_ahead_of_the_wing_the_air_rises_as_the_closed_form_says() -> None:
    expected = gamma() / (2.0 * np.pi * HALF) * (np.hypot(20.0, HALF) / 20.0 - 1.0)
    np.testing.assert_allclose(at(THIN, (20.0, 0.0, 0.0))[0], [0.0, 0.0, expected], rtol=1e-9, atol=1e-12)


def test_far_behind_each_leg_is_a_hallock_burnham_vortex() -> None:
    """Through one core and out of it; the other leg is a vortex of the same kind, turning the other way."""
    young = replace(ALONE, core_growth=0.0)
    core_2, points = (
        (0.035 * SPAN) ** 2,
        [(FAR_BEHIND, HALF + y, z) for y in (-8.0, -1.0, 0.0, 2.0) for z in (0.0, 1.4)],
    )
    expected = []
    for _, y, z in points:
        v = np.zeros(2)
        for place, sense in ((HALF, 1.0), (-HALF, -1.0)):
            r_2 = (y - place) ** 2 + z**2
            v += sense * gamma() / (2.0 * np.pi) * np.array([-z, y - place]) / (r_2 + core_2)
        expected.append([0.0, *v])
    np.testing.assert_allclose(at(young, *points), expected, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize(("growth", "eddy"), [(0.06, 0.06), (6.5e-5, 6.5e-5 + 2.4168e-5 / 210.30)])
def test_the_core_grows_with_age_by_squires_law_and_with_the_peers_constant_to_the_peers_core(
    growth: float, eddy: float
) -> None:
    """RflySimAAR: r_c = 2.24 sqrt(0.06 Gamma t); its 2.24 is sqrt(4 x 1.25643) rounded. One leg alone: the other is
    25 km away, the bound vortex turns the air about y only."""
    grown, wide = replace(ALONE, core_fraction=1e-12, core_growth=growth), 1e3
    k = wake_coefficients(grown, mass_kg=wide * MASS, span_m=wide * SPAN, airspeed_m_s=V, air=AIR)
    for age_s in (0.1, 0.19, 2.0):
        behind, r = V * age_s, 0.4
        swirl = -wake_velocity(np.array([[-behind, wide * HALF, r]]), k)[0, 1]
        whole = gamma() / (4.0 * np.pi) * (1.0 + behind / np.hypot(behind, r))
        core = np.sqrt(whole * r / swirl - r * r)
        assert core == pytest.approx(2.24 * np.sqrt(eddy * gamma() * age_s), rel=2e-3)


def test_ahead_of_the_wing_no_core_has_grown() -> None:
    points = np.array([[x, HALF + y, 0.4] for x in (0.5, 3.0, 20.0) for y in (-0.3, 0.0, 1.0)])
    young, old = (table(replace(ALONE, core_growth=growth)) for growth in (0.0, 0.06))
    np.testing.assert_allclose(wake_velocity(points, old), wake_velocity(points, young), rtol=1e-12)


def test_the_bound_vortex_keeps_its_young_core() -> None:
    """Just above its middle, within the core, the legs' part being the half of theirs far behind."""
    z, core = 0.2, 0.035 * SPAN
    bound = gamma() / (2.0 * np.pi) * z / (z * z + core * core) * HALF / np.hypot(HALF, z)
    assert at(ALONE, (0.0, 0.0, z))[0, 0] == pytest.approx(-bound, rel=1e-9)  # against the stream above


def test_the_tailplanes_core_is_in_proportion_to_its_own_span() -> None:
    """Its legs stand pi/4 of its span apart, as the wing's do."""
    z, half, x, height = 0.2, 0.5 * SHEET.tail_vortex_span_m, SHEET.tail_bound_m[0], SHEET.tail_bound_m[2]
    core = 0.035 * SHEET.tail_vortex_span_m * 4.0 / np.pi
    strength = SHEET.tail_circulation_fraction * gamma(SHEET) / (2.0 * np.pi)
    bound = strength * z / (z * z + core * core) * half / np.hypot(half, z)
    tail = wake_velocity(np.array([[x, 0.0, height + z]]), table(SHEET)[-1:])
    assert tail[0, 0] == pytest.approx(-bound, rel=1e-9)


def test_the_tailplanes_core_grows_with_the_strength_of_its_vortex_whichever_way_it_turns() -> None:
    """One leg nearly alone: the other is 400 m away."""
    wide = replace(SHEET, core_fraction=1e-12, core_growth=0.06, tail_vortex_span_m=400.0)
    (x, _, z), r, behind = SHEET.tail_bound_m, 0.4, 0.19 * V
    strength = -SHEET.tail_circulation_fraction * gamma(wide)
    swirl = wake_velocity(np.array([[x - behind, 200.0, z + r]]), table(wide)[-1:])[0, 1]
    whole = strength / (4.0 * np.pi) * (1.0 + behind / np.hypot(behind, r))
    core = np.sqrt(whole * r / swirl - r * r)
    assert core == pytest.approx(2.24 * np.sqrt(0.06 * strength * 0.19), rel=2e-3)


def _biot_savart(point: np.ndarray, half: float) -> np.ndarray:
    """Velocity of a singular horseshoe of circulation 1 by quadrature: in along the left leg, out along the right."""

    def element(place: np.ndarray, direction: np.ndarray) -> np.ndarray:
        r = point - place
        return np.cross(direction, r) / (4.0 * np.pi * np.linalg.norm(r) ** 3)

    forward, right = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
    legs = ((half, forward), (-half, -forward))
    total = quad_vec(lambda y: element(np.array([0.0, y, 0.0]), right), -half, half, epsabs=1e-12)[0]
    for y, direction in legs:
        total += quad_vec(
            lambda s, y=y, d=direction: element(np.array([-s, y, 0.0]), d), 0.0, np.inf, epsabs=1e-12, epsrel=1e-10
        )[0]
    return np.asarray(total)


def test_without_cores_the_field_is_the_integral_of_biot_and_savart() -> None:
    rng = np.random.default_rng(3)
    for point in rng.uniform([-60.0, -30.0, -15.0], [20.0, 30.0, 15.0], (12, 3)):
        np.testing.assert_allclose(at(THIN, point)[0], gamma() * _biot_savart(point, HALF), rtol=1e-7, atol=1e-9)


def test_left_and_right_are_mirror_images() -> None:
    points = np.random.default_rng(1).uniform(-50.0, 50.0, (200, 3))
    mirrored = points * [1.0, -1.0, 1.0]
    k = table(replace(SHEET, filaments=3))
    np.testing.assert_allclose(wake_velocity(mirrored, k), wake_velocity(points, k) * [1.0, -1.0, 1.0], atol=1e-12)


def test_air_neither_comes_nor_goes_anywhere_the_cores_included() -> None:
    rng, fast = np.random.default_rng(2), replace(SHEET, core_growth=0.06, filaments=2)
    points = rng.uniform([-60.0, -25.0, -6.0], [5.0, 25.0, 6.0], (60, 3))
    points[:20, 1:] = [HALF, 0.0] + rng.uniform(-1.0, 1.0, (20, 2))  # within a leg's core
    points[20:30, ::2] = SHEET.bound_m[::2] + rng.uniform(-1.0, 1.0, (10, 2))  # within the bound vortex's
    for point in points:
        slope = gradient(fast, point)
        assert abs(np.trace(slope)) < 1e-6 * np.linalg.norm(slope) + 1e-9


def test_away_from_thin_cores_the_air_does_not_turn() -> None:
    for point in np.array([[-34.0, 0.5, -4.6], [-10.0, 12.0, 3.0], [8.0, -4.0, 2.0], [-50.0, -25.0, -10.0]]):
        slope = gradient(THIN, point)
        np.testing.assert_allclose(slope, slope.T, atol=1e-8)


def test_above_and_below_the_pair_far_behind_velocity_falls_with_the_square_of_the_distance() -> None:
    near, far = at(THIN, (FAR_BEHIND, 0.0, 1000.0), (FAR_BEHIND, 0.0, 2000.0))
    assert near[2] / far[2] == pytest.approx(4.0, rel=1e-3)
    assert near[2] == pytest.approx(-gamma() * HALF / np.pi / 1000.0**2, rel=1e-3)


@pytest.mark.parametrize("filaments", [1, 2, 5, 16])
def test_however_the_sheet_is_divided_it_carries_the_same_lift(filaments: int) -> None:
    k = table(replace(SHEET, filaments=filaments))[:-1]
    assert 8.0 * np.pi * np.sum(k[:, 4] * k[:, 3]) == pytest.approx(gamma(SHEET) * 2.0 * HALF, rel=1e-12)
    assert np.all(k[:, 3] < 0.5 * SPAN) and len(k) == filaments


def test_a_finely_divided_sheet_has_prandtls_elliptic_downwash_and_twice_that_far_behind() -> None:
    """w_i = Gamma/(2 b) at the wing. One rolled-up pair has 8/pi^2 of it: 19 per cent less."""
    w_i = gamma() / (2.0 * SPAN)
    fine = replace(THIN, filaments=4000)
    at_wing, behind = at(fine, (0.0, 0.0, 0.0), (FAR_BEHIND, 0.0, 0.0))[:, 2]
    assert behind == pytest.approx(-2.0 * w_i, rel=0.02)
    assert at_wing == pytest.approx(0.5 * behind, rel=1e-9)
    assert at(THIN, (FAR_BEHIND, 0.0, 0.0))[0, 2] == pytest.approx(-2.0 * w_i * 8.0 / np.pi**2, rel=1e-9)


def test_the_tailplane_lifts_down_and_takes_some_of_the_downwash_away() -> None:
    k, point = table(SHEET), np.array([[-40.0, 0.0, 1.0]])
    x, half = 40.0 + SHEET.tail_bound_m[0], 0.5 * SHEET.tail_vortex_span_m
    up = gamma(SHEET) / 30.0 / (2.0 * np.pi * half) * (1.0 + np.hypot(x, half) / x)
    assert (wake_velocity(point, k) - wake_velocity(point, k[:-1]))[0, 2] == pytest.approx(up, rel=0.02)  # cores' share


def test_the_page_says_what_is_flown_in_the_wings_plane_and_at_the_drogue() -> None:
    """Tailplane, cores and all; the drogue as it hangs in the wake."""
    rows = re.findall(r"^\| (\d+) \| ([\d.]+) m/s \| ([\d.]+) m/s \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert [row[0] for row in rows] == ["1", "4", "16"]
    (x, _, z), drogue = SHEET.bound_m, (-34.74, 0.0, -4.97)
    for filaments, *said in rows:
        down = -at(replace(SHEET, filaments=int(filaments)), (x - 34.0, 0.0, z), drogue)[:, 2]
        np.testing.assert_allclose(down, np.array(said, dtype=float), rtol=0.0, atol=0.006)


def test_on_the_vortices_themselves_the_air_moves_at_finite_speed() -> None:
    (x, _, z), (tail_x, _, tail_z) = SHEET.bound_m, SHEET.tail_bound_m
    tail = 0.5 * SHEET.tail_vortex_span_m
    corners = [(x, HALF, z), (x, -HALF, z), (tail_x, tail, tail_z), (tail_x, -tail, tail_z)]
    points = [(x, 0.0, z), (x - 9.0, -HALF, z), (x + 9.0, HALF, z), *corners]
    velocity = at(SHEET, *points)
    assert np.all(np.abs(velocity) < gamma() / (2.0 * np.pi * 0.035 * SPAN))


def test_a_tanker_that_does_not_fly_is_refused() -> None:
    with pytest.raises(DockairError, match="airspeed_m_s: expected a speed > 0, got 0.0"):
        wake_coefficients(SHEET, mass_kg=MASS, span_m=SPAN, airspeed_m_s=0.0, air=AIR)
