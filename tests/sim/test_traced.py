"""Solids by rays, against MuJoCo's own ray casts (hits, distances, normals) and closed forms."""

from typing import Any

import mujoco
import numpy as np
import pytest

from dockair.rotations import exp
from dockair.sim.camera.solids import VISIBLE_GROUPS, Haze, Lighting
from dockair.sim.camera.traced import TracedSolids

AT_ORIGIN = (np.eye(3), np.zeros(3))
X, Y = np.arange(-40, 41) / 100.0, np.arange(-25, 26) / 100.0
SKY = -1.0
GEOM = mujoco.mjtGeom
KINDS = {
    "sphere": (GEOM.mjGEOM_SPHERE, [0.8, 0.0, 0.0]),
    "ellipsoid": (GEOM.mjGEOM_ELLIPSOID, [1.5, 0.3, 0.6]),
    "capsule": (GEOM.mjGEOM_CAPSULE, [0.3, 1.2, 0.0]),
    "cylinder": (GEOM.mjGEOM_CYLINDER, [0.5, 0.9, 0.0]),
    "box": (GEOM.mjGEOM_BOX, [0.7, 0.2, 1.1]),
}
SUN_W = np.array([-0.6, 0.48, 0.64])
SUNLIT = Lighting(toward_W=SUN_W, ambient=0.1, direct=0.7)
WHITE = Lighting(toward_W=SUN_W, ambient=1.0, direct=0.0)


def _scene(*geoms: dict[str, Any]) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Clipped at 0.1 m and 2 km."""
    spec = mujoco.MjSpec()
    spec.stat.extent, spec.visual.map.znear, spec.visual.map.zfar = 20.0, 0.005, 100.0
    for geom in geoms:
        spec.worldbody.add_geom(**({"rgba": [1.0, 1.0, 1.0, 1.0]} | geom))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _geom(kind: str, at: Any, turn: Any = (0.0, 0.0, 0.0), **more: Any) -> dict[str, Any]:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, exp(np.array(turn, dtype=float)).ravel())
    return {"type": KINDS[kind][0], "size": KINDS[kind][1], "pos": at, "quat": quat} | more


def _draw(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    lighting: Lighting = WHITE,
    haze: Haze | None = None,
    pose: tuple[np.ndarray, np.ndarray] = AT_ORIGIN,
    x: np.ndarray = X,
    y: np.ndarray = Y,
) -> np.ndarray:
    out = np.full((len(y), len(x)), SKY, dtype=np.float32)
    TracedSolids(model, lighting).draw(out, data, pose, x, y, haze or Haze())
    return out


def _cast(
    model: mujoco.MjModel, data: mujoco.MjData, pose: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """MuJoCo's answer: distance (-1 for none), normal and geom of every block's ray."""
    R_WC, p_WC = pose
    distance, normal = np.empty((len(Y), len(X))), np.zeros((len(Y), len(X), 3))
    which = np.full((len(Y), len(X)), -1)
    geom = np.empty(1, dtype=np.int32)
    for i, y in enumerate(Y):
        for j, x in enumerate(X):
            ray = R_WC @ np.array([1.0, -x, -y])
            ray /= np.linalg.norm(ray)
            distance[i, j] = mujoco.mj_ray(model, data, p_WC, ray, VISIBLE_GROUPS, 1, -1, geom, normal[i, j])
            which[i, j] = geom[0]
    return distance, normal, which


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_hits_ranges_and_shades_are_those_of_mujocos_ray_cast(kind: str, seed: int) -> None:
    """One solid in a random place and attitude, seen from a random pose; range by what haze leaves of white."""
    rng = np.random.default_rng(seed)
    pose = exp(rng.normal(0.0, 1.0, 3)), rng.normal(0.0, 5.0, 3)
    ahead = np.array([rng.uniform(2.0, 8.0), *rng.uniform(-1.0, 1.0, 2)])
    model, data = _scene(_geom(kind, pose[1] + pose[0] @ ahead, rng.normal(0.0, 1.0, 3)))
    distance, normal, _ = _cast(model, data, pose)
    hit = distance >= 0.0
    assert hit.sum() > 20
    clear = _draw(model, data, haze=Haze(extinction_1_m=0.1), pose=pose)
    assert np.array_equal(clear > 0.0, hit)
    assert np.allclose(-np.log(clear[hit]) / 0.1, distance[hit], rtol=1e-5)
    shade = _draw(model, data, SUNLIT, pose=pose)[hit]
    assert np.allclose(shade, 0.1 + 0.7 * np.clip(normal[hit] @ SUN_W, 0.0, None), atol=2e-6)


@pytest.mark.parametrize("phase_deg", [0.0, 35.0, 90.0, 130.0, 180.0])
def test_the_mean_of_a_white_ball_from_afar_is_lamberts(phase_deg: float) -> None:
    """A thousand radii away, 250 blocks across: perspective and the disc's edge leave a thousandth."""
    phase = np.radians(phase_deg)
    light = Lighting(
        toward_W=np.array([-np.cos(phase), 0.6 * np.sin(phase), 0.8 * np.sin(phase)]), ambient=0.1, direct=0.7
    )
    model, data = _scene(_geom("sphere", [1000.0, 0.0, 0.0], size=[1.0, 0.0, 0.0]))
    tangents = np.linspace(-1.05e-3, 1.05e-3, 263)
    picture = _draw(model, data, light, x=tangents, y=tangents)
    assert picture[picture != SKY].mean() == pytest.approx(light.on_ball(np.array([-1.0, 0.0, 0.0])), abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_of_many_solids_the_nearest_is_seen(seed: int) -> None:
    """Twenty of all kinds, through and before one another, each of another grey."""
    rng = np.random.default_rng(100 + seed)
    geoms = []
    for k, kind in enumerate(list(KINDS) * 4):
        at = np.array([1.0, *rng.uniform(-0.4, 0.4, 2)]) * rng.uniform(4.0, 12.0)
        grey = (k + 1) / 21.0
        geoms.append(_geom(kind, at, rng.normal(0.0, 1.0, 3), rgba=[grey, grey, grey, 1.0]))
    model, data = _scene(*geoms)
    _, _, which = _cast(model, data, AT_ORIGIN)
    assert len(np.unique(which)) > 10
    expected = np.where(which >= 0, model.geom_rgba[which, 0], SKY)
    assert np.allclose(_draw(model, data), expected, atol=1e-6)


@pytest.mark.parametrize("kind", ["capsule", "cylinder", "box", "ellipsoid"])
@pytest.mark.parametrize("aside", [(0.35, 0.1), (-0.2, -0.3), (0.05, 0.5)])
def test_a_solid_that_reaches_past_the_lens_is_seen_as_far_as_the_near_plane(
    kind: str, aside: tuple[float, float]
) -> None:
    """A rod along the line of sight, from 5 m behind to 5 m ahead; MuJoCo's hits less those nearer than 0.1 m deep."""
    size = {"ellipsoid": [0.1, 0.1, 5.0], "box": [0.1, 0.07, 5.0]}.get(kind, [0.1, 5.0, 0.0])
    model, data = _scene(_geom(kind, [0.0, *aside], (0.03, np.pi / 2 + 0.02, -0.02), size=size))
    distance, _, _ = _cast(model, data, AT_ORIGIN)
    depth = distance / np.sqrt(1.0 + X**2 + Y[:, None] ** 2)
    hit = depth >= 0.1
    assert hit.sum() > 50
    assert np.array_equal(_draw(model, data) > 0.0, hit)


@pytest.mark.parametrize(("size", "kind"), [([0.05, 0.0, 0.0], "sphere"), ([0.05, 0.05, 0.05], "box")])
@pytest.mark.parametrize(("nearest_m", "is_seen"), [(0.11, True), (0.09, False)])
def test_a_solid_that_begins_nearer_than_the_near_plane_is_not_seen(
    kind: str, size: list[float], nearest_m: float, is_seen: bool
) -> None:
    """At 0.1 m here; along the axis."""
    model, data = _scene(_geom(kind, [nearest_m + 0.05, 0.0, 0.0], size=size))
    assert (_draw(model, data)[25, 40] != SKY) == is_seen


@pytest.mark.parametrize("kind", KINDS)
def test_a_solid_around_the_lens_or_behind_it_is_not_seen(kind: str) -> None:
    around, data = _scene(_geom(kind, [0.0, 0.0, 0.0]))
    assert np.all(_draw(around, data) == SKY)
    behind, data = _scene(_geom(kind, [-4.0, 0.0, 0.0]))
    assert np.all(_draw(behind, data) == SKY)


@pytest.mark.parametrize("up", [1.0, -1.0])
@pytest.mark.parametrize("kind", ["capsule", "cylinder"])
def test_a_tube_seen_along_its_axis_shows_its_end(kind: str, up: float) -> None:
    """The middle ray runs along the axis to the bit, as the camera looks along z; the lens is in the endless tube."""
    look_along_z = np.array([[0.0, 0.0, -up], [0.0, 1.0, 0.0], [up, 0.0, 0.0]])
    model, data = _scene(_geom(kind, [0.0, 0.0, 5.0 * up]))
    clear = _draw(model, data, haze=Haze(extinction_1_m=0.1), pose=(look_along_z, np.zeros(3)))
    radius, half = KINDS[kind][1][:2]
    nearest = 5.0 - half - (radius if kind == "capsule" else 0.0)
    assert X[40] == Y[25] == 0.0
    assert -np.log(clear[25, 40]) / 0.1 == pytest.approx(nearest, rel=1e-6)
    assert (clear[25] > 0.0).sum() == pytest.approx(2.0 * radius / (5.0 - half) / (X[1] - X[0]), abs=1.5)


def test_nothing_beyond_the_far_plane_is_seen() -> None:
    """At 2 km here."""
    near, data = _scene(_geom("sphere", [1900.0, 0.0, 0.0], size=[90.0, 0.0, 0.0]))
    assert _draw(near, data).max() == 1.0
    far, data = _scene(_geom("sphere", [2100.0, 0.0, 0.0], size=[90.0, 0.0, 0.0]))
    assert _draw(far, data).max() == SKY


@pytest.mark.parametrize(
    ("rows", "columns"), [(slice(0, 51), slice(0, 1)), (slice(7, 8), slice(3, 70)), (slice(20, 41), slice(33, 64))]
)
def test_a_part_of_the_picture_is_the_same_to_the_bit(rows: slice, columns: slice) -> None:
    rng = np.random.default_rng(5)
    geoms = [_geom(kind, [6.0, *rng.uniform(-2.0, 2.0, 2)], rng.normal(0.0, 1.0, 3)) for kind in list(KINDS) * 3]
    model, data = _scene(*geoms)
    haze = Haze(extinction_1_m=0.05, airlight=0.3)
    whole = _draw(model, data, SUNLIT, haze)
    part = _draw(model, data, SUNLIT, haze, x=X[columns], y=Y[rows])
    assert (whole[rows, columns] != SKY).any()
    assert np.array_equal(part, whole[rows, columns])


def test_a_larger_picture_than_the_one_before_has_room_for_its_rows() -> None:
    """A run for each row of each solid; the compiled code would write beyond without a word."""
    model, data = _scene(*(_geom(kind, [6.0, 0.0, 0.0]) for kind in KINDS))
    traced = TracedSolids(model, WHITE)
    for y in (Y[24:27], Y):
        out = np.full((len(y), len(X)), SKY, dtype=np.float32)
        traced.draw(out, data, AT_ORIGIN, X, y, Haze())
        assert len(traced._placed.runs) >= len(KINDS) * len(y)
        assert np.array_equal(out, _draw(model, data, y=y))


def test_haze_of_no_thickness_changes_nothing_and_thick_haze_hides_all() -> None:
    model, data = _scene(_geom("sphere", [6.0, 0.0, 0.0]))
    plain = _draw(model, data, SUNLIT)
    assert np.allclose(_draw(model, data, SUNLIT, Haze(extinction_1_m=1e-12, airlight=0.3)), plain, atol=1e-7)
    thick = _draw(model, data, SUNLIT, Haze(extinction_1_m=10.0, airlight=0.3))
    assert np.allclose(thick[plain != SKY], 0.3, atol=1e-6)


def test_haze_dims_each_solid_by_its_slant_range_and_leaves_the_sky_alone() -> None:
    """Koschmieder's law on three walls at three depths, to 1e-6; sky between, the last wall at the edge."""
    x, extinction, airlight = np.arange(-200, 201) / 250.0, 0.04, 0.3
    walls = {-0.6: 9.0, 0.05: 25.0, 0.78: 60.0}  # middle's tangent: depth of the face
    size = [0.5, 0.05, 2.0]
    geoms = [
        {"type": GEOM.mjGEOM_BOX, "size": [size[0], size[1] * at, size[2] * at], "pos": [at + size[0], -m * at, 0.0]}
        for m, at in walls.items()
    ]
    model, data = _scene(*geoms)
    clear = _draw(model, data, SUNLIT, x=x)
    hazy = _draw(model, data, SUNLIT, Haze(extinction_1_m=extinction, airlight=airlight), x=x)
    assert np.array_equal(hazy[clear == SKY], clear[clear == SKY])
    for middle, depth in walls.items():
        columns = np.abs(x - middle) < 0.045
        range_m = depth * np.sqrt(1.0 + x[columns] ** 2 + Y[:, None] ** 2)
        through = np.exp(-extinction * range_m)
        assert (clear[:, columns] != SKY).all()
        assert np.allclose(hazy[:, columns], clear[:, columns] * through + airlight * (1.0 - through), atol=1e-6)
