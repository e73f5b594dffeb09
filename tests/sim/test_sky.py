"""The sky: published radiances, the horizon's place, cloud gaps that look like LEDs, haze, night; bits that repeat."""

import gc
import math
import weakref
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import label
from scipy.spatial.transform import Rotation
from scipy.special import ndtri

from dockair.errors import DockairError
from dockair.parameters import load_parameters, read_sheet
from dockair.sim.camera.clouds import optical_depth
from dockair.sim.camera.sheets import SkyParameters
from dockair.sim.camera.sky import Sky
from dockair.sim.camera.sky_radiance import LAYER_NODE_RAD, NODE_RAD, SkyRadiance
from dockair.sim.camera.weather import Weather

SHEET = load_parameters("sky", SkyParameters)
BARE = replace(  # nothing random is left
    SHEET, deck_cover=0.0, ground_contrast=0.0, water_cover=0.0, aerosol_optical_depth=0.0
)
ALTITUDE_M = 6000.0
FOCAL_PX = 16e-3 / 5.5e-6
X, Y = ((2.0 * np.arange(n) + 0.5 - 0.5 * (2 * n - 1)) / FOCAL_PX for n in (1024, 544))  # blocks of 2 x 2 pixels
WHITE_E = 346.0  # f/8, 20 us, 6 km
FULL_SCALE_E = 13_500.0


def _toward(elevation_deg: float, azimuth_deg: float = 0.0) -> np.ndarray:
    """Unit vector; azimuth to the left."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])


def _law(
    weather: Weather | None = None, sun: np.ndarray | None = None, sheet: SkyParameters = SHEET, key: int = 7
) -> SkyRadiance:
    return SkyRadiance(sheet, weather or Weather(), sun, ALTITUDE_M, key)


def _sky(
    weather: Weather | None = None, sun: np.ndarray | None = None, sheet: SkyParameters = SHEET, key: int = 7
) -> Sky:
    return Sky(_law(weather, sun, sheet, key))


def _picture(sky: Sky, R: np.ndarray | None = None, x: np.ndarray = X, y: np.ndarray = Y) -> np.ndarray:
    out = np.full((len(y), len(x)), np.nan, dtype=np.float32)
    sky.fill(out, np.eye(3) if R is None else R, x, y)
    return out


def _directions(n: int, seed: int) -> np.ndarray:
    d = np.random.default_rng(seed).standard_normal((n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def test_zenith_and_horizon_across_from_the_sun_follow_from_the_sheet() -> None:
    """Overhead one air mass, level forty: J (1 - (1 - zenith/J)^40)."""
    zenith, horizon = _sky(sun=_toward(0.0, 90.0), sheet=BARE).radiance(np.array([_toward(90.0), _toward(0.0)]))
    assert zenith == pytest.approx(SHEET.zenith, rel=1e-4)
    j = SHEET.airlight
    assert horizon == pytest.approx(j * (1.0 - (1.0 - SHEET.zenith / j) ** 40), rel=1e-6)
    assert 0.3 * j < horizon < 0.5 * j


def test_along_the_horizon_the_radiance_is_the_cie_clear_skys() -> None:
    """ISO 15469, type 12: 1 + 10 (exp(-3 X) - exp(-3 pi/2)) + 0.45 cos^2 X, coefficients written out here."""
    angle = np.radians([5.0, 30.0, 60.0, 90.0, 120.0, 180.0])
    sky = _sky(sun=_toward(0.0), sheet=BARE)
    got = sky.radiance(np.array([_toward(0.0, a) for a in np.degrees(angle)]))
    wanted = 1.0 + 10.0 * (np.exp(-3.0 * angle) - math.exp(-1.5 * math.pi)) + 0.45 * np.cos(angle) ** 2
    assert got / got[3] == pytest.approx(wanted, rel=1e-6)


def _scattered_once(altitude_m: float) -> tuple[float, float, float]:
    """Zenith, horizon and endless air at 850 nm, 90 degrees from the Sun: one scattering, and light from below.

    Gas: depth by Hansen & Travis times pressure, 3/4 (1 + cos^2), level path sqrt(pi R/2 8 km). Aerosol: 0.1 at the
    ground, falling by 1/e in 2 km, Henyey-Greenstein 0.7. Below: deck and ground send up 0.43 sin 35 degrees.
    """
    um, r_m = 0.85, 6.371e6
    pressure = (1.0 - 2.25577e-5 * altitude_m) ** 5.25588
    gas = 0.008569 * um**-4 * (1.0 + 0.0113 * um**-2 + 0.00013 * um**-4) * pressure
    aerosol = 0.1 * math.exp(-altitude_m / 2000.0)
    across = 0.51 / 1.49**1.5  # of the aerosol's lobe
    below = 0.5 * 0.43 * math.sin(math.radians(35.0))
    zenith = gas * (0.75 / 4.0 + below) + aerosol * (across / 4.0 + 0.2 * below)  # a tenth of the lobe goes back
    gas_level, aerosol_level = (
        depth * math.sqrt(0.5 * math.pi * r_m / scale_m) for depth, scale_m in ((gas, 8000.0), (aerosol, 2000.0))
    )
    depth = gas_level + aerosol_level
    endless = (0.75 * gas_level + across * aerosol_level) / (4.0 * depth) + below
    return zenith, endless * (1.0 - math.exp(-depth)), endless


def test_the_clear_sky_is_what_thin_air_scatters_once_at_6_km() -> None:
    """0.0029 of white overhead, 0.25 endless; at the horizon 0.115, of which the CIE's single air mass leaves 0.83."""
    zenith, horizon, endless = _scattered_once(ALTITUDE_M)
    assert SHEET.zenith == pytest.approx(zenith, rel=0.05)
    assert SHEET.airlight == pytest.approx(endless, rel=0.05)
    assert _sky(sun=_toward(0.0, 90.0), sheet=BARE).radiance(_toward(0.0)[None])[0] == pytest.approx(horizon, rel=0.2)


def test_zenith_and_airlight_of_other_altitudes_are_in_their_ranges() -> None:
    ranges = read_sheet("sky")
    for altitude_m in (0.0, 3000.0, 9000.0, 12000.0):
        zenith, _, endless = _scattered_once(altitude_m)
        assert ranges["zenith"].low < zenith < ranges["zenith"].high
        assert ranges["airlight"].low < endless < ranges["airlight"].high


def test_clear_air_thickens_down_to_the_limb_as_along_a_tangent() -> None:
    """A ray that skims the ground has twice the ground's level mass less what is behind the camera, e^3 at 6 km."""
    dip = math.acos(6.371e6 / (6.371e6 + ALTITUDE_M))
    thin = replace(BARE, zenith=1e-5)
    d = np.array([_toward(math.degrees(e)) for e in (0.0, -1e-9, -0.5 * dip, -0.9999 * dip)])
    level, under, half, skimming = _sky(sun=_toward(0.0, 90.0), sheet=thin).radiance(d)
    assert under == pytest.approx(level, rel=1e-6)
    assert level < half < skimming
    behind = 1.0 / (math.sin(dip) + 0.025 * math.exp(-11.0 * math.sin(dip)))
    b = -math.log(1.0 - 1e-5 / SHEET.airlight)
    wanted = SHEET.airlight * -math.expm1(-b * (80.0 * math.exp(3.0) - behind))
    assert skimming == pytest.approx(wanted, rel=1e-3)


def test_a_zenith_brighter_than_endless_air_is_refused_with_both() -> None:
    with pytest.raises(DockairError, match=r"sky.zenith: expected less than sky.airlight = 0.1, got 0.1"):
        replace(SHEET, zenith=0.1, airlight=0.1)


def test_clear_sky_is_no_brighter_at_the_horizon_than_was_ever_measured() -> None:
    """W/m^2/sr/nm, of 0.286 for white: 0.38 is the highest published."""
    high, low = 0.286 * _sky(sun=_toward(0.0, 90.0)).radiance(np.array([_toward(75.0), _toward(1.0)]))
    assert high < low < 0.38


def test_the_ground_begins_at_the_dip_of_the_horizon() -> None:
    """cos dip = R/(R + h): 2.486 degrees at 6 km. Black ground, clear air: light above, none below."""
    dip = math.degrees(math.acos(6.371e6 / (6.371e6 + ALTITUDE_M)))
    black = replace(BARE, ground_reflectance=0.0)
    edge = _sky(sun=_toward(45.0), sheet=black).radiance(np.array([_toward(-dip + 0.002), _toward(-dip - 0.002)]))
    assert edge[0] > 0.2
    assert edge[1] == 0.0


def test_the_ground_is_lambertian() -> None:
    """0.25 sin 30 degrees, whichever way down."""
    below = _sky(sun=_toward(30.0), sheet=BARE).radiance(np.array([_toward(-90.0), _toward(-20.0, 100.0)]))
    assert below == pytest.approx([0.125, 0.125], rel=1e-12)


def test_a_closed_deck_under_a_high_sun_is_white_by_what_it_reflects() -> None:
    """Of 20 optical depths 1 - 1/(1 + 0.75 0.14 20) = 0.68 on average, and nothing beyond white."""
    closed = replace(BARE, deck_cover=1.0)
    down = np.array([_toward(-60.0 - 30.0 * u, 360.0 * v) for u, v in np.random.default_rng(1).random((4000, 2))])
    seen = _sky(sheet=closed).radiance(down)
    assert seen.mean() == pytest.approx(0.68, abs=0.05)
    assert 0.2 < seen.min() < seen.max() < 1.0


@pytest.mark.parametrize("yaw_pitch_roll_deg", [(0.0, 0.0, 0.0), (6.0, -4.0, 0.0), (-5.0, 3.0, 40.0)])
def test_the_aureole_stands_where_the_pinhole_puts_the_sun(yaw_pitch_roll_deg: tuple[float, float, float]) -> None:
    """To the table's spacing there, 1.2 mrad."""
    R_WC = Rotation.from_euler("ZYX", np.add(yaw_pitch_roll_deg, (20.0, -50.0, 0.0)), degrees=True).as_matrix()
    s_C = R_WC.T @ _toward(50.0, 20.0)
    u, v = (int(np.abs(axis + s / s_C[0]).argmin()) for axis, s in ((X, s_C[1]), (Y, s_C[2])))
    x, y = X[u - 40 : u + 50], Y[v - 50 : v + 40]
    picture = _picture(_sky(sun=_toward(50.0, 20.0)), R_WC, x, y)
    row, column = np.unravel_index(picture.argmax(), picture.shape)
    assert [x[column], y[row]] == pytest.approx([-s_C[1] / s_C[0], -s_C[2] / s_C[0]], abs=1.2e-3)


def test_between_nodes_the_picture_is_the_radiance() -> None:
    """Clear sky without texture, away from the horizon's edge: to the table's error, below a thousandth."""
    sky, R = _sky(sun=_toward(20.0, 30.0), sheet=BARE), Rotation.from_euler("Y", -15.0, degrees=True).as_matrix()
    d = np.stack(np.broadcast_arrays(1.0, -X[None, ::16], -Y[::16, None]), axis=-1) @ R.T
    wanted = sky.radiance(d.reshape(-1, 3)).reshape(34, 64)
    assert _picture(sky, R, X[::16], Y[::16]) == pytest.approx(wanted, rel=1e-3)


def test_a_window_is_the_full_pictures_bit_for_bit() -> None:
    """With broken cloud, camera turned; each window's sky has seen nothing before but smaller windows."""
    weather, sun = Weather(cloud_cover=0.6), _toward(8.0)
    R = Rotation.from_euler("ZYX", (3.0, -2.0, 25.0), degrees=True).as_matrix()
    full = _picture(_sky(weather, sun), R)
    for row, column in ((0, 0), (3, 5), (131, 257), (200, 1), (394, 874)):
        fresh = _sky(weather, sun)
        for rows, columns in ((1, 1), (17, 33), (150, 150)):
            y, x = slice(row, row + rows), slice(column, column + columns)
            assert np.array_equal(_picture(fresh, R, X[x], Y[y]), full[y, x])


def test_the_key_settles_the_clouds_and_nothing_else_does() -> None:
    weather, sun = Weather(cloud_cover=0.5), _toward(10.0)
    first, same, other = (_picture(_sky(weather, sun, key=key), x=X[400:500], y=Y[:100]) for key in (1, 1, 2))
    assert np.array_equal(first, same)
    assert (first != other).mean() > 0.9


def _compact_blobs(picture: np.ndarray, level_e: float) -> int:
    """Count 8-connected spots of 3 to 60 px above a level in electrons."""
    labels, count = label(WHITE_E * picture > level_e, structure=np.ones((3, 3)))
    area_px = 4 * np.bincount(labels.ravel(), minlength=count + 1)[1:]
    return int(((area_px >= 3) & (area_px <= 60)).sum())


def test_a_low_sun_behind_broken_cloud_makes_blobs_like_leds() -> None:
    """The whole field, toward the Sun at 5 degrees: above 60 % of full scale at f/8 and 20 us; a clear sky has none."""
    sun = _toward(5.0, 2.0)
    for key in (3, 4, 5):
        assert _compact_blobs(_picture(_sky(Weather(cloud_cover=0.6), sun, key=key)), 0.6 * FULL_SCALE_E) >= 10
    clear = _picture(_sky(Weather(), sun))
    assert WHITE_E * clear.max() < 0.1 * FULL_SCALE_E


def test_closed_thick_cloud_has_neither_blobs_nor_beam() -> None:
    sun = _toward(5.0, 2.0)
    sky = _sky(Weather(cloud_cover=1.0, cloud_optical_depth=30.0), sun)
    assert _picture(sky).max() < 0.5
    assert sky.beam(sun[None])[0] < 1e-6


def test_without_cloud_and_haze_the_beam_is_whole_above_the_horizon() -> None:
    d = _directions(2000, 11)
    above = d[:, 2] > -math.sin(math.acos(6.371e6 / (6.371e6 + ALTITUDE_M)))
    assert np.array_equal(_sky(sheet=BARE).beam(d), above.astype(float))


def test_the_deck_stops_the_sun_that_stands_between_its_horizon_and_the_grounds() -> None:
    """From 6 km its top at 2 km ends 2.03 degrees below level, the ground 2.49. Air 0.1 (e^-1 - e^-3) thick upright."""
    edge = math.degrees(math.acos((6.371e6 + SHEET.deck_top_m) / (6.371e6 + ALTITUDE_M)))
    azimuth = np.linspace(-180.0, 180.0, 400)
    over, into = (np.array([_toward(-edge + way, a) for a in azimuth]) for way in (0.01, -0.2))
    s = -into[0, 2]
    air = math.exp(-0.1 * (math.exp(-1.0) - math.exp(-3.0)) / (s + 0.025 * math.exp(-11.0 * s)))
    broken = _law()
    assert np.array_equal(broken.beam(over), np.ones(400))
    assert broken.beam(into).max() == pytest.approx(air, rel=1e-9)
    assert (broken.beam(into) < 1e-3).mean() > 0.03
    gap = np.isclose(broken.over(into, np.zeros(3))[:, 1], air, rtol=1e-9)  # as the picture has it
    assert np.array_equal(gap, np.isclose(broken.beam(into), air, rtol=1e-9))
    assert _law(sheet=replace(SHEET, deck_cover=1.0, deck_optical_depth=100.0)).beam(into).max() < 1e-6
    assert np.array_equal(_law(sheet=replace(SHEET, deck_cover=0.0)).beam(into), np.ones(400))


def test_gaps_let_the_whole_beam_through_and_cloud_takes_its_depth() -> None:
    """Overhead: the share of gaps is 1 - cover; where there is cloud, -ln beam has the mean optical depth.

    Mean of 60 skies, each with one look straight up: gaps 1 sigma = 0.065; depths 0.75 of their mean by (2).
    """
    up = np.array([_toward(90.0, 0.0)])
    beams = np.array([_sky(Weather(cloud_cover=0.5, cloud_optical_depth=2.0), key=k).beam(up)[0] for k in range(60)])
    assert (beams == 1.0).mean() == pytest.approx(0.5, abs=0.26)
    assert -np.log(beams[beams < 1.0]).mean() == pytest.approx(2.0, rel=0.6)


def test_where_the_sun_stands_in_a_gap_the_disc_is_bright_and_the_glow_is_low() -> None:
    """Beam and picture are of one cloud: whole beam, no aureole; part of the beam, glow far above the clear sky.

    Within a degree of the Sun 10 times white is what the lobes make of the thinnest cloud in question, tau = 0.36.
    """
    sun, beam, radiance = _toward(12.0), np.empty(0), np.empty(0)
    near = np.array([_toward(12.0 + a, b) for a, b in np.random.default_rng(2).uniform(-0.7, 0.7, (300, 2))])
    for key in range(20):
        sky = _sky(Weather(cloud_cover=0.5, cloud_optical_depth=3.0), sun, key=key)
        beam, radiance = np.append(beam, sky.beam(near)), np.append(radiance, sky.radiance(near))
    gap, veil = beam == 1.0, (beam > 0.1) & (beam < 0.7)
    assert min(gap.sum(), veil.sum()) > 50
    assert radiance[gap].max() < 5.0
    assert radiance[veil].min() > 10.0


def test_the_deck_and_the_ground_hold_structure_of_every_size_that_a_picture_resolves() -> None:
    """Root mean square difference in the lower third, normalised by its mean, at 2, 8, 30 and 100 px."""
    lower = _picture(_sky(sun=_toward(40.0, 120.0)))[400:]
    mean = lower.mean()
    across = [np.sqrt(np.mean((lower[:, lag:] - lower[:, :-lag]) ** 2)) / mean for lag in (1, 4, 15, 50)]
    assert across[0] > 0.05
    assert np.all(np.diff(across) > 0.02)


def test_haze_dims_the_beam_by_koschmieders_law() -> None:
    """Overhead, 10 km of visibility against 100 km: exp(-(3.912/10 - 3.912/100) 0.5 km)."""
    through = _sky(Weather(visibility_m=10e3)).beam(np.array([_toward(90.0)]))[0]
    assert through == pytest.approx(math.exp(-(0.3912 - 0.03912) * 0.5), rel=1e-4)


def test_in_fog_there_is_nothing_but_fog() -> None:
    sun = _toward(30.0, 20.0)
    fog = _sky(Weather(visibility_m=50.0, cloud_cover=0.5), sun)
    picture = _picture(fog)
    assert np.ptp(picture) < 1e-6
    assert picture[0, 0] == pytest.approx(fog.airlight(_toward(0.0)), rel=1e-6)
    assert 0.02 < picture[0, 0] < 0.5
    assert fog.beam(sun[None])[0] < 1e-30


def test_contrast_below_the_horizon_fades_with_visibility() -> None:
    spread = [
        float(_picture(_sky(Weather(visibility_m=v), _toward(40.0, 120.0)), x=X[::8], y=Y[400::8]).std())
        for v in (100e3, 30e3, 10e3, 3e3, 1e3)
    ]
    assert np.all(np.diff(spread) < 0.0)
    assert spread[-1] < 1e-2 * spread[0]


def test_far_objects_fade_into_the_hazy_horizon_behind_them() -> None:
    """From 10 km of visibility on, haze is thick at the horizon; clear air at 6 km is thin, its horizon darker."""
    for visibility_m in (10e3, 2e3):
        sky = _sky(Weather(visibility_m=visibility_m), _toward(35.0, 60.0), BARE)
        assert sky.airlight(_toward(0.0)) == pytest.approx(sky.radiance(_toward(0.0)[None])[0], rel=0.01)
    clear = _sky(sun=_toward(35.0, 60.0), sheet=BARE)
    assert clear.radiance(_toward(0.0)[None])[0] < 0.5 * clear.airlight(_toward(0.0))


def _dip_deg(height_m: float) -> float:
    """Of the horizon below level."""
    return math.degrees(math.acos(SHEET.earth_radius_m / (SHEET.earth_radius_m + height_m)))


def test_cloud_above_is_lit_until_the_sun_sets_on_its_own_height() -> None:
    """Closed and so thick that no clear sky comes through: what is left is the air below it, next to nothing."""
    closed, up = Weather(cloud_cover=1.0, cloud_optical_depth=100.0), np.array([_toward(70.0, 90.0)])
    dip = _dip_deg(ALTITUDE_M + SHEET.cloud_height_m)
    lit, dark = (_law(closed, _toward(-dip + way)).radiance(up)[0] for way in (0.01, -0.01))
    assert lit > 0.01
    assert dark < 1e-3
    near_sun = np.array([_toward(-dip - 0.01)])
    thin = Weather(cloud_cover=1.0, cloud_optical_depth=0.1)
    assert _law(thin, near_sun[0]).upward(near_sun)[0] < _law(None, near_sun[0]).upward(near_sun)[0]  # no aureole


def test_the_deck_is_lit_until_the_sun_sets_on_its_top() -> None:
    closed, down = replace(BARE, deck_cover=1.0), np.array([_toward(-60.0, 90.0), _toward(-90.0)])
    lit, dark = (_law(None, _toward(-_dip_deg(SHEET.deck_top_m) + way), closed).radiance(down) for way in (0.01, -0.01))
    assert lit.min() > 0.01
    assert dark.max() == 0.0


@pytest.mark.parametrize("altitude_m", [0.0, ALTITUDE_M])
def test_haze_and_beam_last_until_the_sun_sets_on_the_camera(altitude_m: float) -> None:
    """Fog so thin that much of the beam would still come through; endless, it is all that there is."""
    hazy = Weather(visibility_m=50e3)
    for elevation_deg in (-_dip_deg(altitude_m) + 0.01, -_dip_deg(altitude_m) - 0.01, -8.0):
        sun = _toward(elevation_deg)
        law, lit = SkyRadiance(BARE, hazy, sun, altitude_m, 7), elevation_deg > -_dip_deg(altitude_m)
        assert (law.airlight(_toward(0.0, 90.0)) > 0.01) == lit
        assert (law.airlight(_toward(0.0, 90.0)) == 0.0) == (not lit)
        assert (law.beam(sun[None])[0] > 0.0) == lit


def test_a_sun_below_the_horizon_leaves_the_clear_sky_as_it_is() -> None:
    """Sky and air by Eq. (2) of the angle from the Sun alone: the same light 50 degrees beside a Sun at any height."""
    for elevation_deg in (3.0, -3.0):
        law, up = _law(sun=_toward(elevation_deg, 60.0), sheet=BARE), _toward(0.0)
        cosine = float(up @ _toward(elevation_deg, 60.0))
        even = _law(sun=_toward(0.0, 90.0), sheet=BARE)
        factor = 1.0 + float(SHEET.beyond_even(np.array([cosine]))[0])
        assert law.radiance(up[None])[0] == pytest.approx(
            factor / (1.0 + float(SHEET.beyond_even(np.zeros(1))[0])) * even.radiance(up[None])[0], rel=1e-6
        )
        assert law.airlight(up) == pytest.approx(SHEET.airlight * factor, rel=1e-12)


_MEAN_NOISE = 1.3383e-4  # of a normal law above -4, where a cover of 1 begins: cloud as thick as its mean


class _Even:
    """A texture that is the same everywhere, and remembers where it was asked for."""

    def __init__(self, value: float) -> None:
        self.value, self.asked = value, np.empty((0, 3))

    def at(self, x_m: np.ndarray, y_m: np.ndarray, footprint_m: np.ndarray) -> np.ndarray:
        self.asked = np.column_stack([x_m, y_m, footprint_m])
        return np.full(len(x_m), self.value)


def _air_mass(sine: float) -> float:
    return 1.0 / (sine + 0.025 * math.exp(-11.0 * sine))


def _flux(depth: float) -> float:
    """Two-stream, [clouds, eq 7]."""
    return 1.0 / (1.0 + 0.75 * (1.0 - SHEET.cloud_asymmetry) * depth)


KEY_M = np.array([700.0, -400.0, 250.0])


def test_cloud_above_is_that_of_where_the_ray_crosses_it_as_fine_as_the_tables_nodes_stand_there() -> None:
    """Eq. (3): height (d_x, d_y)/(s + w). Nodes are 1/(s + w) farther apart along than across: the mean of both."""
    law, d = _law(Weather(cloud_cover=0.5)), np.array([_toward(90.0), _toward(30.0, 20.0), _toward(4.0, -70.0)])
    law._above = above = _Even(0.5)  # type: ignore[assignment]
    law.beam(d)
    reach = SHEET.cloud_height_m / (d[:, 2] + SHEET.cloud_aspect)
    wanted = np.column_stack(
        [d[:, 0] * reach, d[:, 1] * reach, NODE_RAD * reach / np.sqrt(d[:, 2] + SHEET.cloud_aspect)]
    )
    assert above.asked == pytest.approx(wanted, rel=1e-12, abs=1e-9)


def test_deck_and_ground_are_those_of_where_the_ray_meets_them_from_the_key() -> None:
    """Eq. (4), in the triangle with the Earth's middle by the laws of sine and cosine; nodes are 1/mu farther along."""
    law, d = _law(), np.array([_toward(-90.0), _toward(-40.0, 20.0), _toward(-4.0, -70.0)])
    ground, coasts, deck = _Even(0.0), _Even(0.0), _Even(0.0)
    law._ground, law._coasts, law._deck = ground, coasts, deck  # type: ignore[assignment]
    law.below(d, KEY_M)
    law.over(d, KEY_M)
    for found, top_m in ((ground, 0.0), (coasts, 0.0), (deck, SHEET.deck_top_m)):
        high, low = (SHEET.earth_radius_m + h for h in (ALTITUDE_M + KEY_M[2], top_m))
        nadir = np.arccos(-d[:, 2])
        incidence = np.arcsin(np.sin(nadir) * high / low)
        distance = np.sqrt(high**2 + low**2 - 2.0 * high * low * np.cos(incidence - nadir))
        level = KEY_M[:2] + d[:, :2] * distance[:, None]
        wanted = np.column_stack([level, LAYER_NODE_RAD * distance / np.sqrt(np.cos(incidence))])
        assert found.asked == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("noise", [-0.9, 0.8, 2.0])
@pytest.mark.parametrize("elevation_deg", [-90.0, -35.0])
def test_a_deck_reflects_what_its_slant_thickness_does_and_lets_the_rest_through(
    noise: float, elevation_deg: float
) -> None:
    """Eq. (5), under a closed cloud of 8 optical depths: bumps that face the Sun are brighter, none beyond white."""
    s, w, sun = math.sin(math.radians(-elevation_deg)), SHEET.cloud_aspect, math.radians(50.0)
    law = _law(Weather(cloud_cover=1.0), _toward(50.0), replace(BARE, deck_cover=1.0))
    law._deck = _Even(noise)  # type: ignore[assignment]
    (light, clear) = law.over(np.array([_toward(elevation_deg)]), np.zeros(3))[0]
    tau = float(optical_depth(np.array([noise]), 1.0, SHEET.deck_optical_depth)[0])
    mu = s if s == 1.0 else math.sqrt(1.0 - (6377e3 / 6373e3 * math.cos(math.radians(elevation_deg))) ** 2)
    share = _flux(tau * (1.0 + w) / (mu + w))
    facing = min((math.sin(sun) + w) / (1.0 + w) * (1.0 + w * noise), 1.0)
    assert light == pytest.approx((1.0 - share) * facing * _flux(8.0), rel=1e-9)
    assert clear == pytest.approx(share, rel=1e-9)


@pytest.mark.parametrize("visibility_m", [100e3, 8e3])
def test_a_deck_of_no_thickness_changes_nothing(visibility_m: float) -> None:
    """Air and haze before it and under it are one: what is below is neither dimmed twice nor not at all."""
    weather, d = Weather(visibility_m=visibility_m, cloud_cover=0.5), np.array([_toward(-80.0), _toward(-15.0, 60.0)])
    thin, none = (replace(SHEET, **changes) for changes in ({"deck_optical_depth": 0.0}, {"deck_cover": 0.0}))
    assert _law(weather, sheet=thin).has_deck and not _law(weather, sheet=none).has_deck
    assert _law(weather, sheet=thin).radiance(d) == pytest.approx(_law(weather, sheet=none).radiance(d), rel=1e-9)


@pytest.mark.parametrize(
    ("noise", "coast", "share_of_land"), [(0.7, -0.06, 1.0), (-0.7, 0.0, 0.5), (-3.0, -1.0, 1.0), (0.7, 0.06, 0.0)]
)
def test_land_is_as_patchy_as_the_sheet_says_and_ends_where_the_waters_share_begins(
    noise: float, coast: float, share_of_land: float
) -> None:
    """Lambertian under a closed cloud; the coast is where noise exceeds its quantile of 1 - water's share, 0.1 wide."""
    sun, sheet = math.radians(50.0), replace(SHEET, deck_cover=0.0, aerosol_optical_depth=0.0)
    law = _law(Weather(cloud_cover=1.0), _toward(50.0), sheet)
    shore = float(ndtri(1.0 - SHEET.water_cover))
    law._ground, law._coasts = _Even(noise), _Even(shore + coast)  # type: ignore[assignment]
    land = SHEET.ground_reflectance * max(1.0 + SHEET.ground_contrast * noise, 0.0)
    seen = share_of_land * land + (1.0 - share_of_land) * SHEET.water_reflectance
    assert law.radiance(_toward(-60.0)[None]) == pytest.approx([seen * math.sin(sun) * _flux(8.0)], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("depth", [0.3, 40.0])
def test_cloud_is_lit_from_the_ground_by_what_comes_through_and_comes_back(depth: float) -> None:
    """Of T sin 50 degrees the ground sends up its reflectance; cloud as thick as its mean sends back 1 - T of that."""
    weather, up = Weather(cloud_cover=1.0, cloud_optical_depth=depth), _toward(70.0, 90.0)[None]
    light = []
    for reflectance in (0.25, 0.0):
        law = _law(weather, _toward(50.0), replace(BARE, zenith=1e-9, ground_reflectance=reflectance))
        law._above = _Even(_MEAN_NOISE)  # type: ignore[assignment]
        light.append(law.upward(up)[0])
    through = _flux(depth)
    assert light[0] - light[1] == pytest.approx(
        0.25 * math.sin(math.radians(50.0)) * through * (1.0 - through), rel=1e-6
    )


def test_air_before_a_cloud_dims_it_and_air_behind_is_seen_through_it() -> None:
    """Of the air the part under the cloud is 1 - exp(-height/scale); a black ground. What cloud sends is [clouds]'s."""
    depth, sheet = 1.5, replace(BARE, zenith=0.05, ground_reflectance=0.0)
    weather, d = Weather(cloud_cover=1.0, cloud_optical_depth=depth), _toward(40.0, 100.0)
    law, thin = (_law(weather, _toward(50.0), s) for s in (sheet, replace(sheet, zenith=1e-9)))
    for each in (law, thin):
        each._above = _Even(_MEAN_NOISE)  # type: ignore[assignment]
    b, s, w = -math.log(1.0 - 0.05 / SHEET.airlight), math.sin(math.radians(40.0)), SHEET.cloud_aspect
    before = math.exp(-b * (1.0 - math.exp(-SHEET.cloud_height_m / SHEET.aerosol_scale_m)) * _air_mass(s))
    behind = math.exp(-b * _air_mass(s))
    lit = SHEET.airlight * (1.0 + float(SHEET.beyond_even(np.array([d @ _toward(50.0)]))[0]))
    wanted = law.airlight(d) * (1.0 - before) + before * thin.upward(d[None])[0]
    wanted += lit * (before - behind) * math.exp(-depth * (1.0 + w) / (s + w))
    assert law.upward(d[None])[0] == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("visibility_m", [100e3, 5e3])
@pytest.mark.parametrize("azimuth_deg", [15.0, 90.0])
def test_in_the_shade_of_clouds_air_has_less_sun_in_it_and_in_haze_still_less(
    visibility_m: float, azimuth_deg: float
) -> None:
    """What 0.6 of cloud diffracts still is a beam, exp(-tau/2 mu) of it; of haze exp(-t m), the rest is even."""
    weather, w = Weather(cloud_cover=0.6, cloud_optical_depth=3.0, visibility_m=visibility_m), SHEET.cloud_aspect
    law, s = _law(weather, _toward(40.0)), math.sin(math.radians(40.0))
    mu = (s + w) / (1.0 + w)
    light = 0.4 + 0.6 * _flux(3.0)
    beam = (0.4 + 0.6 * math.exp(-0.5 * 3.0 / mu)) / light
    cosine = float(_toward(0.0, azimuth_deg) @ _toward(40.0))
    air = SHEET.airlight * light * (1.0 + beam * float(SHEET.beyond_even(np.array([cosine]))[0]))
    haze = 3.912023 * (1.0 / visibility_m - 1e-5) * SHEET.haze_depth_m
    direct = math.exp(-haze * _air_mass(s))
    wanted = air * direct + light * mu * max(_flux(haze) - direct, 0.0)
    assert law.airlight(_toward(0.0, azimuth_deg)) == pytest.approx(wanted, rel=1e-6)


def test_air_clearer_than_the_clear_skys_is_as_clear() -> None:
    sun, d = _toward(40.0), _directions(50, 4)
    clear, clearer = (_law(Weather(visibility_m=v), sun) for v in (SHEET.clear_visibility_m, 1e6))
    assert np.array_equal(clearer.radiance(d), clear.radiance(d))
    assert np.array_equal(clearer.beam(d), clear.beam(d))


def test_the_length_of_directions_does_not_matter() -> None:
    weather, d = Weather(cloud_cover=0.5, visibility_m=20e3), _directions(50, 4)
    one, other = (_law(weather, length * _toward(40.0, 10.0)) for length in (1.0, 7.0))
    assert other.radiance(3.0 * d) == pytest.approx(one.radiance(d), rel=1e-9)
    assert other.airlight(3.0 * d[0]) == pytest.approx(one.airlight(d[0]), rel=1e-12)


def test_the_light_in_the_shade_leaves_the_clouds_aureole_out() -> None:
    """Before a Sun at 35 degrees that of one optical depth holds 0.249 of the sunlight, a quarter of it all round."""
    law = _law(Weather(cloud_cover=1.0, cloud_optical_depth=1.0), _toward(35.0), BARE)
    law._above = _Even(_MEAN_NOISE)  # type: ignore[assignment]
    assert law.radiance(_directions(100_000, 5)).mean() - law._ambient() == pytest.approx(0.249 / 4.0, abs=0.015)


def test_at_night_all_is_dark() -> None:
    night = _sky(Weather(night=True, cloud_cover=0.5), _toward(10.0))
    assert np.all(_picture(night) == np.float32(SHEET.night))
    assert night.beam(_directions(20, 3)).max() == 0.0
    assert night.airlight(_toward(0.0)) == night.ambient == SHEET.night


def test_the_light_in_the_shade_is_the_mean_radiance_all_round() -> None:
    """Against 20 000 random directions; the standard error of their mean is 0.004."""
    sky = _sky(sun=_toward(40.0, 30.0))
    assert sky.ambient == pytest.approx(sky.radiance(_directions(20_000, 5)).mean(), abs=0.02)


def test_cloud_before_the_sun_makes_all_light_diffuse() -> None:
    sun = _toward(40.0, 30.0)
    laws = _law(sun=sun), _law(Weather(cloud_cover=1.0, cloud_optical_depth=20.0), sun)
    shares = [law.ambient / (law.ambient + float(law.beam(sun[None])[0])) for law in laws]
    assert 0.1 < shares[0] < 0.3
    assert shares[1] > 0.999


@pytest.mark.parametrize(("depth", "beam", "aureole"), [(1.0, 0.226, 0.249), (2.0, 0.051, 0.175)])
def test_what_the_aureole_takes_from_the_light_on_solids_is_as_large_as_stated(
    depth: float, beam: float, aureole: float
) -> None:
    """From 35 degrees: the beam by Eq. (4) of `clouds`, the aureole's flux by the integral of Eq. (5) about the Sun."""
    law = _law(sun=_toward(35.0))
    mu = (math.sin(math.radians(35.0)) + SHEET.cloud_aspect) / (1.0 + SHEET.cloud_aspect)
    assert math.exp(-depth / mu) == pytest.approx(beam, abs=5e-4)
    cosine = 1.0 - np.geomspace(1e-9, 2.0, 20_000)
    radiance = law._droplets.aureole(np.full(20_000, depth), np.full(20_000, mu), cosine)
    assert 2.0 * np.trapezoid(radiance, -cosine) == pytest.approx(aureole, abs=2e-3)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *(("cloud_cover", value) for value in (1.2, -0.1, math.nan)),
        *(("cloud_optical_depth", value) for value in (-1.0, math.inf, math.nan)),
        *(("visibility_m", value) for value in (0.0, math.nan)),
    ],
)
def test_impossible_weather_is_refused_by_name(key: str, value: float) -> None:
    with pytest.raises(DockairError, match=key):
        Weather(**{key: value})


def test_a_sky_that_nobody_needs_is_gone_at_once() -> None:
    """Its tables are many megabytes: flight after flight in one process must not wait for the garbage collector."""
    sky = _sky()
    _picture(sky)
    table = weakref.ref(sky._deck_table)
    gc.disable()
    try:
        del sky
        assert table() is None
    finally:
        gc.enable()


def test_a_flight_that_begins_on_the_ground_sees_it_from_above_and_none_from_below() -> None:
    sky = Sky(SkyRadiance(load_parameters("sky", SkyParameters), Weather(), np.array([-0.8, 0.1, 0.5]), 0.0, 5))
    x, y = np.linspace(-0.02, 0.02, 8), np.array([-0.03, -0.01, 0.02, 0.05])
    above, below = np.empty((2, 4, 8), dtype=np.float32)
    sky.fill(above, np.eye(3), x, y, np.array([10.0, 0.0, 5.0]))
    sky.fill(below, np.eye(3), x, y, np.array([10.0, 0.0, -5.0]))
    np.testing.assert_array_equal(above[:2], below[:2])
    assert np.isfinite(above).all() and (above[2:] != below[2:]).all()
