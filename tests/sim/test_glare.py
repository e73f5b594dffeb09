"""All of the Sun's stray light together: what enters is accounted for, in the field, at its edge and beyond."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.messages import Window
from dockair.parameters import load_parameters
from dockair.rotations import Array
from dockair.sim.camera.glare import Glare
from dockair.sim.camera.halo import Halo
from dockair.sim.camera.radiometry import Responses
from dockair.sim.camera.sheets import GlareParameters, LensParameters, LightParameters

PARAMETERS = load_parameters("glare", GlareParameters)
LENS = load_parameters("lens", LensParameters)
LIGHT = load_parameters("light", LightParameters)
FLUX_E_S, EXPOSURE_S = 4.5e14, 20e-6  # at f/8
RESPONSE = Responses(
    led_e_m2_sr_w_s=0.0,
    led_transmission=np.ones(2),
    white_e_s=0.0,
    sun_disc_e_s=0.0,
    sun_flux_e_s=FLUX_E_S,
    glint_e_m2_s=0.0,
)
STRAIGHT = Camera()
BENT = Camera(distortion=(-0.25, 0.08, 1e-3, -5e-4, 0.0))
WIDE = Camera(width_px=8192, height_px=8192, principal_point_px=(4095.5, 4095.5))
MIDDLE = Window(3400, 4800, 3400, 4800)  # of WIDE: everything that is added pixel by pixel
NONE = np.zeros(2)
ALONE = {"veiling_glare": 0.0, "halo_share": NONE, "spike_share": 0.0, "ghost_share": np.zeros(6)}
SIGMA_PX = 0.7


def _glare(camera: Camera = STRAIGHT, f_number: float = LENS.f_number, **changes: object) -> Glare:
    parameters = replace(PARAMETERS, **changes)
    return Glare(parameters, replace(LENS, f_number=f_number), camera, LIGHT, RESPONSE, 870e-9)


def _toward(place: tuple[float, float], camera: Camera = STRAIGHT) -> Array:
    return np.asarray(camera.rays_from_pixels(np.array([place]))[0])


def _stray(glare: Glare, sun_C: Array, camera: Camera = STRAIGHT) -> Array:
    grid = glare.stray(sun_C, 1.0, EXPOSURE_S, camera.full_window)
    assert grid is not None
    return np.asarray(grid.values, dtype=float)


def _on_pixels(glare: Glare, sun_C: Array, window: Window, disc: bool = True) -> Array:
    """(rows, columns) of what is added pixel by pixel."""
    image = np.zeros(window.shape, dtype=np.float32)
    start = window.row_start, window.column_start
    glare.add_fine(image, start, sun_C, 1.0, EXPOSURE_S)
    if disc:
        glare.add_disc(image, start, sun_C, np.ones(window.shape), start, EXPOSURE_S, SIGMA_PX)
    return image


def _plane_sum(nodes: Array) -> float:
    """Integral of nodes over the sensor, the outermost counted half."""
    return float(64.0 * np.trapezoid(np.trapezoid(nodes, axis=1)))


def test_what_enters_the_lens_is_accounted_for() -> None:
    """Shares add up to 1, and each is what is found in the image of a sensor eight times as wide."""
    glare = _glare(WIDE)
    assert sum(glare.shares.values()) == pytest.approx(1.0, rel=1e-12)
    assert min(glare.shares.values()) > 0.0
    sun_C = _toward((4700.0, 3700.0), WIDE)
    entered = FLUX_E_S * EXPOSURE_S * sun_C[0] / LENS.transmittance
    total = _plane_sum(_stray(glare, sun_C, WIDE)) + _on_pixels(glare, sun_C, MIDDLE).sum(dtype=float)
    assert total / entered + glare.shares["lost"] == pytest.approx(1.0, abs=5e-4)
    stray = _plane_sum(_stray(glare, sun_C, WIDE)) + _on_pixels(glare, sun_C, MIDDLE, False).sum(dtype=float)
    told = 1.0 - glare.shares["lost"] - glare.shares["disc"]
    assert stray / entered == pytest.approx(told, rel=0.01)  # 0.7 % of it lies beyond even this sensor


@pytest.mark.parametrize("camera", [STRAIGHT, BENT])
@pytest.mark.parametrize("place", [(1023.5, 543.5), (300.3, 200.8), (1900.0, 950.5)])
@pytest.mark.parametrize("f_number", [2.8, 8.0, 16.0])
def test_disc_and_wing_hold_the_flux_that_radiometry_predicts(
    camera: Camera, place: tuple[float, float], f_number: float
) -> None:
    """Sun's flux through the lens times the cosine: what scatters and reflects is beside it, the wing part of it."""
    glare, sun_C = _glare(camera, f_number), _toward(place, camera)
    window = Window(int(place[1]) - 40, int(place[1]) + 40, int(place[0]) - 40, int(place[0]) + 40)
    image, start = np.zeros(window.shape, dtype=np.float32), (window.row_start, window.column_start)
    glare.add_disc(image, start, sun_C, np.ones(window.shape), start, EXPOSURE_S, SIGMA_PX)
    alone = _glare(camera, f_number, **(ALONE | {"spike_share": 1.0}))
    wing = alone.shares["spikes"] / LENS.transmittance
    expected = FLUX_E_S * EXPOSURE_S * sun_C[0]
    assert image.sum(dtype=float) + wing * expected == pytest.approx(expected, rel=1e-3)
    assert 0.003 < wing < 0.06


def test_each_part_alone_puts_its_own_share_on_the_sensor() -> None:
    sun_C = _toward((4700.0, 3700.0), WIDE)
    entered = FLUX_E_S * EXPOSURE_S * sun_C[0] / LENS.transmittance
    base = ALONE | {"iris_blades": 0}
    wing = _plane_sum(_stray(_glare(WIDE, **base), sun_C, WIDE))
    wing += _on_pixels(_glare(WIDE, **base), sun_C, MIDDLE, False).sum(dtype=float)
    for changes, name in (
        ({"veiling_glare": 0.01}, "veil"),
        ({"halo_share": PARAMETERS.halo_share}, "halo"),
        ({"ghost_share": PARAMETERS.ghost_share}, "ghosts"),
        ({"iris_blades": 6, "spike_share": 1.0}, "spikes"),
    ):
        glare = _glare(WIDE, **(base | changes))
        light = _plane_sum(_stray(glare, sun_C, WIDE))
        light += _on_pixels(glare, sun_C, MIDDLE, False).sum(dtype=float)
        beside = 0.0 if name in ("spikes", "halo") else wing
        # the halo's tail beyond 4096 px is 2.4 % of it
        assert (light - beside) / entered == pytest.approx(glare.shares[name], rel=0.03 if name == "halo" else 0.01)


def test_the_veil_is_the_glare_indexs_share_of_the_flux_on_every_pixel_alike() -> None:
    """ISO 9358: 1 % of 4.5e14 e-/s in 20 us over 2048 x 1088 pixels is 40 e- each."""
    glare = _glare(**(ALONE | {"veiling_glare": 0.01, "iris_blades": 0}))
    bare = _glare(**(ALONE | {"iris_blades": 0}))
    sun_C = _toward((1500.0, 300.0))
    veil = _stray(glare, sun_C) - _stray(bare, sun_C)
    assert veil[:, 5:100] == pytest.approx(0.01 * 9e9 / (2048 * 1088) * sun_C[0], rel=1e-3)
    assert np.ptp(veil) < 1e-2


@pytest.mark.parametrize("camera", [STRAIGHT, BENT])
def test_stray_light_is_continuous_as_the_sun_leaves_the_picture(camera: Camera) -> None:
    glare = _glare(camera)
    inside, outside = (_stray(glare, _toward((u, 400.0), camera), camera)[:, :230] for u in (2046.99, 2047.01))
    assert np.abs(outside / inside - 1.0).max() < 3e-3
    # and far beyond it, where the lens's polynomial is not to be trusted: no jump from step to step
    angles = np.deg2rad(np.linspace(15.0, 60.0, 181))
    level = [_stray(glare, np.array([np.cos(a), -np.sin(a), 0.01]), camera)[60, 20] for a in angles]
    falls = np.diff(np.log(level))
    assert np.abs(np.diff(falls)).max() < 0.1


def test_beyond_a_distorted_field_the_suns_image_moves_on_as_a_pinholes() -> None:
    """Told by the ghost that stands at a quarter of the Sun's distance from the centre, on the other side."""
    glare = _glare(BENT, veiling_decay_rad=1.0)
    places = [
        glare.compact_ghosts(np.array([np.cos(a), -np.sin(a), 0.0]), 1.0, EXPOSURE_S).pixels[0]
        for a in np.deg2rad([35.0, 45.0])
    ]
    way = 0.25 * BENT.focal_length_px * (np.tan(np.deg2rad(45.0)) - np.tan(np.deg2rad(35.0)))
    assert places[0] - places[1] == pytest.approx([way, 0.0], abs=0.1)


@pytest.mark.parametrize(
    ("side", "edge_px"), [((-1.0, 0.0), 1023.5), ((1.0, 0.0), 1023.5), ((0.0, -1.0), 543.5), ((0.0, 1.0), 543.5)]
)
def test_outside_the_field_the_hood_cuts_it_to_1_over_e_in_its_angle(side: tuple[float, float], edge_px: float) -> None:
    glare, bare = (_glare(**(ALONE | {"veiling_glare": share, "iris_blades": 0})) for share in (0.01, 0.0))
    edge = np.arctan(edge_px / STRAIGHT.focal_length_px)

    def veil(angle: float) -> float:
        sun_C = np.array([np.cos(angle), *np.sin(angle) * np.array(side)])
        return float(np.median(_stray(glare, sun_C) - _stray(bare, sun_C)))

    foreshortening = np.cos(edge + PARAMETERS.veiling_decay_rad) / np.cos(edge)
    ratio = veil(edge + PARAMETERS.veiling_decay_rad) / veil(edge - 1e-6)
    assert ratio == pytest.approx(np.exp(-1.0) * foreshortening, rel=2e-3)


def test_behind_the_camera_or_hidden_the_sun_gives_nothing() -> None:
    glare, full = _glare(), STRAIGHT.full_window
    for sun_C, visible in ((np.array([-0.2, 0.6, 0.77]), 1.0), (_toward((900.0, 500.0)), 0.0)):
        assert glare.stray(sun_C, visible, EXPOSURE_S, full) is None
        image = np.zeros((1088, 2048), dtype=np.float32)
        glare.add_fine(image, (0, 0), sun_C, visible, EXPOSURE_S)
        assert not image.any()
    image = np.zeros((60, 60), dtype=np.float32)
    glare.add_disc(image, (0, 0), np.array([-1.0, 0.0, 0.0]), np.ones((60, 60)), (0, 0), EXPOSURE_S, SIGMA_PX)
    assert not image.any()


@pytest.mark.parametrize(("visible", "exposure_s"), [(0.25, EXPOSURE_S), (1.0, 5e-6), (0.5, 1e-5)])
def test_it_is_proportional_to_the_visible_part_and_to_the_exposure(visible: float, exposure_s: float) -> None:
    glare, sun_C = _glare(), _toward((700.0, 400.0))
    assert (grid := glare.stray(sun_C, visible, exposure_s, STRAIGHT.full_window)) is not None
    assert np.allclose(grid.values, 0.25 * _stray(glare, sun_C), rtol=1e-5)
    image = np.zeros((1088, 2048), dtype=np.float32)
    glare.add_fine(image, (0, 0), sun_C, visible, exposure_s)
    assert np.allclose(image, 0.25 * _on_pixels(glare, sun_C, STRAIGHT.full_window, False), rtol=1e-5, atol=0.0)
    part, whole = glare.compact_ghosts(sun_C, visible, exposure_s), glare.compact_ghosts(sun_C, 1.0, EXPOSURE_S)
    assert part.electrons == pytest.approx(0.25 * whole.electrons)


@pytest.mark.parametrize("degrees_outside", [2.0, 6.0])
def test_with_the_sun_outside_the_picture_its_ghosts_are_inside(degrees_outside: float) -> None:
    glare = _glare(**(ALONE | {"ghost_share": PARAMETERS.ghost_share, "iris_blades": 0}))
    edge = np.arctan((2047.0 - 1023.5) / STRAIGHT.focal_length_px)
    outside = np.deg2rad(degrees_outside)
    sun_C = np.array([np.cos(edge + outside), -np.sin(edge + outside), 0.0])
    ghosts = glare.compact_ghosts(sun_C, 1.0, EXPOSURE_S)
    strength = FLUX_E_S * EXPOSURE_S * sun_C[0] * np.exp(-((outside / PARAMETERS.veiling_decay_rad) ** 2))
    assert ghosts.electrons == pytest.approx(PARAMETERS.ghost_share[:3] * strength, rel=1e-6)
    inside = np.all((ghosts.pixels > 40) & (ghosts.pixels < [2008, 1048]), axis=1)
    assert inside[:2].all()
    image = _on_pixels(glare, sun_C, STRAIGHT.full_window, False)
    assert image[:, :1500].sum(dtype=float) == pytest.approx(ghosts.electrons[inside].sum(), rel=0.01)


def test_the_two_sharpest_ghosts_look_like_leds() -> None:
    """20 us at f/8: LEDs' peaks are some thousands of electrons over some ten pixels; 53 e- are a grey level."""
    glare, sun_C = _glare(), _toward((500.0, 300.0))
    ghosts = glare.compact_ghosts(sun_C, 1.0, EXPOSURE_S)
    image = _on_pixels(glare, sun_C, STRAIGHT.full_window)
    for (u, v), radius in zip(ghosts.pixels[:2], ghosts.radius_px[:2], strict=True):
        patch = image[int(v) - 15 : int(v) + 16, int(u) - 15 : int(u) + 16]
        assert 800.0 < patch.max() < 8000.0
        assert 10 < np.sum(patch > 0.5 * patch.max()) < 250
        assert radius < 8.0


def test_stopping_down_shrinks_a_defocused_ghost_and_lengthens_spikes() -> None:
    open_, closed = _glare(f_number=4.0), _glare(f_number=8.0)
    sun_C = _toward((500.0, 300.0))
    assert open_.shares["spikes"] == pytest.approx(0.5 * closed.shares["spikes"], rel=1e-9)
    wide, narrow = (g.compact_ghosts(sun_C, 1.0, EXPOSURE_S).radius_px for g in (open_, closed))
    assert len(wide) == 2  # the third has outgrown the pixels' list
    assert wide[0] == narrow[0]  # in focus: the Sun's image
    assert len(narrow) == 3


def test_a_round_iris_has_no_spikes_and_loses_no_light_by_it() -> None:
    polygon, circle = _glare(), _glare(iris_blades=0)
    assert circle.shares["spikes"] == 0.0
    assert circle.shares["disc"] == pytest.approx(polygon.shares["disc"], rel=2e-3)
    glare = _glare(**(ALONE | {"iris_blades": 0}))
    nodes = _stray(glare, _toward((1024.0, 544.0)))
    ring = [nodes[68 + i, 128 + j] for i, j in ((30, 40), (-40, 30), (50, 0), (0, -50), (-30, -40))]
    assert ring == pytest.approx([ring[0]] * 5, rel=1e-5)


def test_a_round_irises_wing_is_the_airy_patterns_tail() -> None:
    """Beyond r a point has 2 lambda N/(pi^2 r) [Born & Wolf 8.5.2]; 37 radii of the Sun's image out so has the Sun."""
    glare, sun_C = _glare(**(ALONE | {"iris_blades": 0})), _toward((700.0, 400.0))
    Q, nodes = 2.0 * 870e-9 * 8.0 / (np.pi**2 * 5.5e-6), _stray(glare, sun_C)
    v, u = 8.0 * np.indices(nodes.shape)
    r = np.hypot(u - 700.0, v - 400.0)
    law = Q / (2.0 * np.pi * r**3) * FLUX_E_S * EXPOSURE_S * sun_C[0]
    assert np.allclose(nodes[r > 500.0], law[r > 500.0], rtol=1e-3)


@pytest.mark.parametrize("along_px", [300.0, 800.0, 1400.0])
def test_spikes_run_along_the_sheets_angle_and_widen_by_its_fan(along_px: float) -> None:
    """[iris, eqs 2, 3] in a spike's middle, which the grid holds to an eighth; between two spikes there is none."""
    glare, sun_C = _glare(**(ALONE | {"spike_share": 1.0})), _toward((300.0, 400.0))
    grid = glare.stray(sun_C, 1.0, EXPOSURE_S, STRAIGHT.full_window)
    assert grid is not None
    turned = PARAMETERS.iris_angle_rad + np.array([0.0, np.pi / PARAMETERS.iris_blades])
    middle, between = grid.at([300.0, 400.0] + along_px * np.column_stack([np.cos(turned), np.sin(turned)]))
    R = STRAIGHT.focal_length_px * np.tan(LIGHT.sun_angular_radius_rad)
    z = np.sqrt(7.0 * (R**2 / 4.0 + (PARAMETERS.spike_fan_rad * along_px) ** 2))
    each = glare.shares["spikes"] / LENS.transmittance / PARAMETERS.iris_blades * FLUX_E_S * EXPOSURE_S * sun_C[0]
    law = each * along_px / R**2 * (1.0 + (along_px / R) ** 2) ** -1.5 * 15.0 / (16.0 * z)
    assert middle == pytest.approx(law, rel=0.125)
    assert between < 1e-3 * law


def test_a_ghost_is_as_large_as_the_defocused_pupil_or_as_the_suns_image_in_it() -> None:
    """A cone of f/2.8 is, from its axis, 1/5.6 as wide as it is long."""
    told = _glare(f_number=2.8).compact_ghosts(_toward((500.0, 300.0)), 1.0, EXPOSURE_S)
    R, k = STRAIGHT.focal_length_px * np.tan(LIGHT.sun_angular_radius_rad), slice(len(told.radius_px))
    pupil, sun = PARAMETERS.ghost_defocus_m[k] / 5.6 / 5.5e-6, np.abs(PARAMETERS.ghost_position[k]) * R
    assert told.radius_px == pytest.approx(np.maximum(pupil, sun))
    assert (pupil > sun).any() and (pupil < sun).any()


def test_dirt_raises_veil_and_halo_and_nothing_else() -> None:
    glare, sun_C, full = _glare(), _toward((700.0, 400.0)), STRAIGHT.full_window
    clean, dirty = (glare.stray(sun_C, 1.0, EXPOSURE_S, full, factor) for factor in (1.0, 3.0))
    assert clean is not None and dirty is not None
    more = dirty.values.astype(float) - clean.values
    v, u = 8.0 * np.indices(more.shape)
    halo = Halo(
        PARAMETERS.halo_share,
        PARAMETERS.halo_core_rad * STRAIGHT.focal_length_px,
        PARAMETERS.halo_exponent,
        STRAIGHT.focal_length_px * np.tan(LIGHT.sun_angular_radius_rad),
    )
    r = np.hypot(u - 700.0, v - 400.0)
    law = halo.densities(r[r > 120.0]).sum(axis=0) + PARAMETERS.veiling_glare / (2048 * 1088)
    assert np.allclose(more[r > 120.0], 2.0 * law * FLUX_E_S * EXPOSURE_S * sun_C[0], rtol=2e-3)


def test_all_is_centred_where_the_lens_images_the_sun() -> None:
    """At a corner of a distorted picture, 19 px from the pinhole's place."""
    glare, place = _glare(BENT), (150.0, 100.0)
    sun_C = _toward(place, BENT)
    assert np.linalg.norm(STRAIGHT.pixels_from_points(sun_C[None])[0] - place) > 15.0
    window = Window(50, 150, 100, 200)
    grid = glare.stray(sun_C, 1.0, EXPOSURE_S, window)
    assert grid is not None
    v, u = np.indices(window.shape)
    at = np.column_stack([u.ravel() + 100.0, v.ravel() + 50.0])
    image = _on_pixels(glare, sun_C, window) + grid.at(at).reshape(window.shape)
    heart = np.where(image > 0.02 * image.max(), image, 0.0)
    centre = [(heart * u).sum() / heart.sum() + 100.0, (heart * v).sum() / heart.sum() + 50.0]
    assert centre == pytest.approx(place, abs=0.1)


@pytest.mark.parametrize("camera", [STRAIGHT, BENT])
@pytest.mark.parametrize("place", [(1200.0, 500.0), (2090.0, 300.0)])
def test_a_window_is_the_full_frames_crop_bit_for_bit(camera: Camera, place: tuple[float, float]) -> None:
    glare = _glare(camera)
    sun_C = _toward(place, camera)
    full = camera.full_window
    grid, image = glare.stray(sun_C, 1.0, EXPOSURE_S, full), _on_pixels(glare, sun_C, full)
    assert grid is not None
    rng = np.random.default_rng(8)
    for _ in range(40):
        r, c = int(rng.integers(0, 788)), int(rng.integers(0, 1748))
        window = Window(r, r + int(rng.integers(1, 300)), c, c + int(rng.integers(1, 300)))
        part = glare.stray(sun_C, 1.0, EXPOSURE_S, window)
        assert part is not None
        (i, j), (m, n) = part.first, part.values.shape
        assert np.array_equal(part.values, grid.values[i : i + m, j : j + n])
        assert np.array_equal(_on_pixels(glare, sun_C, window), image[r : window.row_stop, c : window.column_stop])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"iris_blades": 1}, r"iris_blades.*at least 3.*1"),
        ({"iris_blades": 2}, r"iris_blades.*at least 3.*2"),
        ({"veiling_glare": 0.1, "halo_share": np.array([0.03, 0.03])}, r"<= 1"),
        ({"halo_share": np.array([0.01])}, r"halo_share.*halo_core_rad"),
        ({"ghost_position": np.array([0.5])}, r"ghost_position.*ghost_defocus_m"),
    ],
)
def test_a_sheet_that_cannot_be_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(DockairError, match=message):
        _glare(**changes)


def test_no_lens_of_the_sheets_throws_all_of_the_disc_into_its_wing() -> None:
    """The widest wing of all ranges, over the smallest image of the Sun: 1 mm, f/16, three blades, a micrometre."""
    parameters, lens = replace(PARAMETERS, iris_blades=3), replace(LENS, f_number=16.0)
    sun = replace(LIGHT, sun_angular_radius_rad=4.5e-3)
    shares = Glare(parameters, lens, Camera(focal_length_m=1e-3), sun, RESPONSE, 1e-6).shares
    assert 0.0 < shares["disc"] < 0.1 * LENS.transmittance
