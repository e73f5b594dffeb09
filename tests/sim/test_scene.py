"""The compiled model: names, geometry, who touches whom, what the camera looks past."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.messages import ReceiverCommand
from dockair.rotations import matrix_from_quaternion, matrix_from_yaw_pitch_roll
from dockair.sim.parts import scene_of
from dockair.sim.scene import build_scene
from dockair.sim.skins import receiver_skins, tanker_skins


@pytest.fixture
def world(make_world):
    return make_world(p_PD_B=(4.0, 0.0, 0.0))


def _first_hit(world, start, toward, exclude_name=""):
    """Name of the first geom on the way from a point in a direction, and its distance; "" for none."""
    geom = np.full(1, -1, dtype=np.int32)
    direction = np.asarray(toward, dtype=float)
    distance = mujoco.mj_ray(world.model, world.data, np.asarray(start, dtype=float), direction, None, 1, -1, geom)
    return (world.model.geom(int(geom[0])).name, distance) if geom[0] >= 0 else ("", np.inf)


def test_names_that_others_build_on_exist(world):
    bodies = {world.model.body(i).name for i in range(world.model.nbody)}
    links = world.parameters.hose.links
    assert {"tanker", "drogue", "receiver", *(f"hose_{i}" for i in range(links))} < bodies
    geoms = {world.model.geom(i).name for i in range(world.model.ngeom)}
    for prefix in ("probe_", "basket_", "coupling_", "fuselage_", "tanker_", "hose_", "canopy_"):
        assert any(name.startswith(prefix) for name in geoms), prefix
    assert "" not in geoms


def test_led_sites_are_the_ring_and_lie_in_no_geom(world):
    """Ten millimetres aft of the rim, on the faces of their housings: a sight line from aft reaches every LED."""
    R_WD, p_WD = world.truth.R_WD, world.truth.p_WD
    for k, p_DL in enumerate(LedRing(diameter_m=world.parameters.drogue.ring_diameter_m).positions_D):
        p_WL = p_WD + R_WD @ p_DL
        np.testing.assert_allclose(world.data.site(f"led_{k}").xpos, p_WL, atol=1e-12)
        for yaw, pitch in ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)):
            aft = -R_WD @ matrix_from_yaw_pitch_roll(yaw, pitch, 0.0)[:, 0]
            name, distance = _first_hit(world, p_WL + 3.0 * aft, -aft)
            assert distance > 3.0, (k, yaw, pitch, name)


def test_all_leds_are_seen_by_the_camera_from_near_contact_to_thirty_metres(make_world):
    for distance in (1.5, 3.0, 4.0, 10.0, 30.0):
        world = make_world(p_PD_B=(distance, 0.0, 0.0))
        p_WC = world.truth.p_WB + world.truth.R_WB @ world.parameters.mounting.p_BC
        for k in range(8):
            sight = world.data.site(f"led_{k}").xpos - p_WC
            name, hit = _first_hit(world, p_WC, sight / np.linalg.norm(sight))
            assert hit > np.linalg.norm(sight), (distance, k, name)


def test_nothing_of_the_receiver_but_its_probe_stands_in_the_camera_view(world):
    """Rays over the whole sensor, toed in as mounted; a probe may be in view, a nose at the edge not even that."""
    camera = Camera()
    u, v = np.meshgrid(np.linspace(0, camera.width_px - 1, 25), np.linspace(0, camera.height_px - 1, 15))
    R_BC = matrix_from_yaw_pitch_roll(np.deg2rad(-3.0), 0.0, 0.0)
    rays = camera.rays_from_pixels(np.column_stack([u.ravel(), v.ravel()])) @ (world.truth.R_WB @ R_BC).T
    p_WC = world.truth.p_WB + world.truth.R_WB @ world.parameters.mounting.p_BC
    receiver, seen = world.model.body("receiver").id, set()
    for ray in rays:
        name, _ = _first_hit(world, p_WC, ray)
        seen.add(name.partition("_")[0])
        if name and not name.startswith("probe_"):
            assert world.model.geom(name).bodyid[0] != receiver, name
    assert {"probe", "hose", "tanker"} <= seen


def test_probe_ends_exactly_at_the_mounting_point(world):
    """Its tip is a sphere; the foremost point of the whole probe along the body's x axis is P."""
    p_BP = world.parameters.mounting.p_BP
    tip = world.model.geom("probe_tip")
    assert tip.pos[0] + tip.size[0] == pytest.approx(p_BP[0], abs=1e-12)
    np.testing.assert_allclose(tip.pos[1:], p_BP[1:], atol=1e-12)
    ahead = world.truth.p_WP + np.array([1.0, 0.0, 0.0])
    name, distance = _first_hit(world, ahead, [-1.0, 0.0, 0.0])
    assert name == "probe_tip" and distance == pytest.approx(1.0, abs=1e-6)


def test_probes_boom_runs_straight_from_its_tip_for_the_sheets_length_and_its_mast_begins_where_it_ends(world):
    coupling, p_BP = world.parameters.coupling, world.parameters.mounting.p_BP

    def ends(name):
        """(2, 3) middles of a capsule's two caps, the foremost first."""
        geom = world.model.geom(name)
        half = geom.size[1] * matrix_from_quaternion(geom.quat)[:, 2]
        both = np.array([geom.pos + half, geom.pos - half])
        return both[np.argsort(-both[:, 0])]

    bend = p_BP - [coupling.probe_boom_length_m, 0.0, 0.0]
    np.testing.assert_allclose(ends("probe_boom"), [p_BP - [coupling.probe_tip_radius_m, 0.0, 0.0], bend], atol=1e-9)
    np.testing.assert_allclose(ends("probe_mast")[0], bend, atol=1e-9)
    assert world.model.geom("probe_boom").size[0] == coupling.probe_boom_radius_m


@pytest.mark.parametrize("outline", ["fighter", "unmanned"])
def test_receiver_has_the_skin_of_the_outline_that_the_world_names(world, receiver_on_rails, outline):
    parameters = replace(world.parameters, receiver_outline=outline)
    model = build_scene(scene_of(parameters, receiver_on_rails(), 1e-3))
    seen = {name for i in range(model.ngeom) if (name := model.geom(i).name).startswith("skin_")}
    assert seen == {f"skin_{skin.name}" for skin in receiver_skins(parameters.mounting, outline)}


@pytest.mark.parametrize("products", [(0.0, 1331.0, 0.0), (900.0, 1331.0, -2500.0)])
def test_receiver_has_the_mass_and_inertia_it_was_given(make_world, receiver_on_rails, products):
    """The compiled inertia, turned back from its principal axes, is the matrix that went in: I_xy, I_xz, I_yz, too."""
    xy, xz, yz = products
    given = receiver_on_rails(inertia_B=np.array([[12874.0, xy, xz], [xy, 75674.0, yz], [xz, yz, 85552.0]]))
    body = make_world(receiver=given).model.body("receiver")
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, body.iquat)
    R = R.reshape(3, 3)
    assert body.mass[0] == given.mass_kg
    np.testing.assert_allclose(R @ np.diag(body.inertia) @ R.T, given.inertia_B, atol=1e-6 * given.inertia_B.max())
    np.testing.assert_array_equal(body.ipos, 0.0)


def test_solid_stops_and_latch_stand_where_their_sheets_say_and_are_as_soft(make_world):
    """Out of their own values, which MuJoCo's defaults are not."""
    reel = {"buffer_travel_m": 0.13, "range_m": 6.2, "stop_time_constant_s": 0.03}
    latch = {"latch_time_constant_s": 0.035, "latch_damping_ratio": 1.7}
    model = make_world(reel=reel, coupling=latch).model
    stops = model.joint("reel")
    np.testing.assert_allclose(stops.range, [-0.13, 6.2], rtol=1e-12)
    np.testing.assert_allclose(model.jnt_solref[stops.id], [0.03, 1.0], rtol=1e-12)
    np.testing.assert_allclose(model.equality("latch").solref, [0.035, 1.7], rtol=1e-12)


def test_tow_has_the_masses_of_its_sheets(world):
    hose, drogue = world.parameters.hose, world.parameters.drogue
    links = sum(world.model.body(f"hose_{i}").mass[0] for i in range(hose.links))
    assert links == pytest.approx(hose.line_density_kg_m * hose.length_m)
    assert world.model.body("drogue").mass[0] == drogue.mass_kg


def test_only_the_named_pairs_touch(world):
    """Probe with basket, coupling, hose; the receiver's rest with hose, drogue, tanker; nothing else with anything."""
    model = world.model
    allowed = {
        frozenset(pair)
        for pair in (
            *(("probe", other) for other in ("drogue", "hose")),
            *(("receiver", other) for other in ("drogue", "hose", "tanker")),
        )
    }

    def group(geom):
        if model.geom(geom).name.startswith("probe_"):
            return "probe"
        body = model.body(int(model.geom_bodyid[geom])).name
        return "hose" if body.startswith("hose_") else body

    for a in range(model.ngeom):
        for b in range(a):
            touch = (
                model.geom_contype[a] & model.geom_conaffinity[b] or model.geom_contype[b] & model.geom_conaffinity[a]
            )
            drawn = ("canopy_", "led_housing_", "tanker_skin_", "skin_")
            drawn_only = any(model.geom(g).name.startswith(drawn) for g in (a, b))
            expected = frozenset((group(a), group(b))) in allowed and not drawn_only
            assert bool(touch) == expected, (model.geom(a).name, model.geom(b).name)


def test_probe_tip_cannot_pass_between_two_ribs(world):
    drogue, coupling = world.parameters.drogue, world.parameters.coupling
    spacing = 2.0 * 0.5 * drogue.ring_diameter_m * np.sin(np.pi / drogue.ribs)
    assert spacing - 2.0 * drogue.rib_radius_m < 2.0 * coupling.probe_tip_radius_m


def test_probe_on_the_centre_line_reaches_the_coupling_point_untouched(world):
    coupling = world.parameters.coupling
    assert coupling.socket_radius_m > coupling.probe_tip_radius_m
    R_WD, p_WD = world.truth.R_WD, world.truth.p_WD
    for angle in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        offset = coupling.probe_tip_radius_m * np.array([0.0, np.cos(angle), np.sin(angle)])
        start = p_WD + R_WD @ (offset - np.array([0.5, 0.0, 0.0]))
        name, distance = _first_hit(world, start, R_WD[:, 0])
        assert name == "coupling_body"
        assert distance == pytest.approx(0.5 + coupling.depth_m + coupling.stop_gap_m, abs=1e-6)


def test_light_is_the_sun_alone(world):
    model = world.model
    assert model.nlight == 1 and not model.light_castshadow[0]
    np.testing.assert_allclose(model.light_dir[0], [0.0, 0.0, -1.0], atol=1e-12)
    assert not model.vis.headlight.active
    assert model.vis.quality.offsamples == 0


def test_light_comes_from_the_sun_wherever_it_stands_in_the_sky(world, receiver_on_rails):
    """Given as a vector of any length from the scene to the Sun."""
    sun_W = np.array([-0.6, 1.2, 0.4])
    parameters = replace(world.parameters, sun_direction_W=3.0 * sun_W)
    model = build_scene(scene_of(parameters, receiver_on_rails(), 1e-3))
    np.testing.assert_allclose(model.light_dir[0], -sun_W / 1.4, atol=1e-12)


def test_what_is_seen_is_as_bright_as_its_sheet_says(world):
    p, skins = world.parameters, tanker_skins(world.parameters.tanker)
    of = {"probe_tip": p.coupling.probe_reflectance, "hose_0": p.hose.reflectance, "basket_rim_0": p.drogue.reflectance}
    of |= {"coupling_stave_3": p.drogue.reflectance, "canopy_0": p.drogue.canopy_reflectance}
    of |= {"led_housing_0": p.drogue.led_housing_reflectance}
    of |= {f"tanker_skin_{skin.name}": min(p.tanker.reflectance * skin.shade, 1.0) for skin in skins}
    assert len(set(of.values())) >= 6 and len({skin.shade for skin in skins}) > 1
    for name, reflectance in of.items():
        np.testing.assert_allclose(world.model.geom(name).rgba, [*3 * [reflectance], 1.0], rtol=1e-6, err_msg=name)


def test_every_colour_is_grey(world):
    rgba = world.model.geom_rgba
    np.testing.assert_array_equal(rgba[:, :1], rgba[:, 1:2])
    np.testing.assert_array_equal(rgba[:, :1], rgba[:, 2:3])
    assert rgba[:, 3].min() == 1.0


def test_a_blow_on_the_drogue_has_the_softness_and_friction_of_its_sheet(make_world):
    """Whoever strikes it, probe or nose: MuJoCo would mix in the other geom's default."""
    drogue = make_world().parameters.drogue
    struck = set()
    for p_PD_B in ((-0.03, 0.25, 0.0), (-1.25, 0.9, -0.4)):
        world = make_world(p_PD_B=p_PD_B)
        for contact in world.data.contact[: world.data.ncon]:
            struck |= {world.model.geom(geom).name.split("_")[0] for geom in contact.geom}
            np.testing.assert_allclose(contact.solref, [drogue.contact_time_constant_s, 1.0])
            np.testing.assert_allclose(contact.friction[:2], drogue.friction)
    assert {"probe", "fuselage", "basket"} <= struck


def test_all_that_can_strike_or_be_struck_slides_with_the_sheets_friction_but_the_tanker(world):
    """Of two geoms MuJoCo takes the larger friction, and its default is 1."""
    model, drogue = world.model, world.parameters.drogue
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    solid &= model.geom_bodyid != model.body("tanker").id
    assert {model.body(int(body)).name.split("_")[0] for body in model.geom_bodyid[solid]} == {
        "hose", "drogue", "receiver"
    }  # fmt: skip
    np.testing.assert_array_equal(model.geom_friction[solid, 0], drogue.friction)


def test_tanker_as_heavy_as_it_is_keeps_no_constraint_from_being_solved(make_world):
    """The latch bears the same within 1 per cent at a tolerance a million times tighter."""
    pulls = []
    for factor in (1.0, 1e-6):
        world = make_world(p_PD_B=(1.0, 0.0, 0.0))
        world.model.opt.tolerance *= factor
        for _ in range(1500):
            truth = world.step(ReceiverCommand(velocity_m_s=np.array([1.2, 0.0, 0.0])))
        assert truth.latched
        pulls.append(truth.coupling_force_n)
    assert pulls[0] == pytest.approx(pulls[1], rel=1e-2) and abs(pulls[0]) > 50.0
