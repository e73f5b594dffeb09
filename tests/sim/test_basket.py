"""The drogue's geometry, and whether its sheets fit each other."""

import mujoco
import numpy as np
import pytest

from dockair.calibration import LedRing
from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import matrix_from_quaternion, quaternion_from_matrix
from dockair.sim.basket import place_leds
from dockair.sim.camera.obstacles import Obstacles
from dockair.sim.camera.occlusion import hidden
from dockair.sim.hose.chain import DrogueParameters
from dockair.sim.hose.coupling import CouplingParameters

DROGUE = load_parameters("drogue", DrogueParameters)
COUPLING = load_parameters("coupling", CouplingParameters)


def test_tip_anywhere_in_the_bore_at_the_coupling_point_is_near_enough_to_latch():
    assert 0.0 < COUPLING.socket_radius_m - COUPLING.probe_tip_radius_m < COUPLING.capture_distance_m


def test_tip_anywhere_at_the_bottom_of_the_bore_is_near_enough_to_latch():
    """A nozzle that came in at an angle gets there before the drogue is in line, and has to be held once it is."""
    aside = COUPLING.socket_radius_m - COUPLING.probe_tip_radius_m
    assert np.hypot(aside, COUPLING.stop_gap_m) < COUPLING.capture_distance_m


@pytest.mark.parametrize(
    ("drogue", "coupling", "words"),
    [
        ({"rim_x_m": 0.01}, {}, "parameters.drogue.rim_x_m: expected more than drogue.rim_tube_radius_m = 0.02"),
        ({"rim_x_m": 0.02}, {}, "parameters.drogue.rim_x_m"),
        (
            {"rim_x_m": 0.01, "rim_tube_radius_m": 0.005, "led_housing_gap_m": 0.01},
            {},
            "parameters.drogue.led_housing_gap_m: expected less than drogue.rim_x_m = 0.01",
        ),
        (
            {"rim_x_m": 0.1, "throat_x_m": 0.1},
            {},
            "parameters.drogue.throat_x_m: expected more than drogue.rim_x_m = 0.1",
        ),
        ({"throat_x_m": 0.3}, {}, "parameters.coupling.depth_m: expected more than drogue.throat_x_m = 0.3"),
        ({}, {"depth_m": 0.6}, "parameters.coupling.depth_m: expected less than drogue.hose_joint_x_m = 0.55"),
        ({}, {"depth_m": 0.53, "stop_gap_m": 0.025}, "parameters.coupling.depth_m: expected less than"),
        (
            {},
            {"probe_tip_radius_m": 0.05},
            "parameters.coupling.probe_tip_radius_m: expected less than coupling.socket",
        ),
        (
            {},
            {"probe_boom_radius_m": 0.04},
            "parameters.coupling.probe_boom_radius_m: expected at most coupling.probe",
        ),
        (
            {},
            {"closing_speed_min_m_s": 1.0, "closing_speed_max_m_s": 1.0},
            "parameters.coupling.closing_speed_max_m_s: expected more than coupling.closing_speed_min_m_s = 1.0, or no",
        ),
        ({}, {"capture_distance_m": 0.023}, "parameters.coupling.capture_distance_m: expected at least 0.0234 m, as"),
        ({}, {"stop_gap_m": 0.03}, "parameters.coupling.capture_distance_m: expected at least 0.0324 m"),
        ({"inertia_kg_m2": [1.5, 0.5, 0.5]}, {}, "parameters.drogue.inertia_kg_m2: expected the inertia of a body"),
    ],
)
def test_a_basket_or_coupling_out_of_order_is_refused_although_every_value_is_in_its_range(
    make_world, drogue, coupling, words
):
    with pytest.raises(DockairError) as caught:
        make_world(drogue=drogue, coupling=coupling)
    assert str(caught.value).startswith(words)


@pytest.mark.parametrize(
    ("drogue", "coupling"),
    [
        ({"rim_x_m": 0.021, "throat_x_m": 0.1}, {"depth_m": 0.15}),
        ({"rim_tube_radius_m": 0.029, "throat_x_m": 0.299}, {"depth_m": 0.49}),
        ({"inertia_kg_m2": [1.0, 0.5, 0.5]}, {"probe_tip_radius_m": 0.049, "probe_boom_radius_m": 0.049}),
    ],
)
def test_of_what_is_just_in_order_every_led_is_seen_and_the_tip_reaches_the_coupling_point(
    make_world, drogue, coupling
):
    world = make_world(drogue=drogue, coupling=coupling)
    model, data = world.model, world.data
    R_WD, p_WD = data.body("drogue").xmat.reshape(3, 3), data.body("drogue").xpos
    lens_W, leds_W = p_WD + R_WD @ np.array([-3.0, 0.3, 0.2]), p_WD + LedRing().positions_D @ R_WD.T
    assert not hidden(Obstacles.of(model), data, lens_W, leds_W, 0.01).any()
    address, tip_B = model.joint("receiver").qposadr[0], world.parameters.mounting.p_BP
    data.qpos[address : address + 3] = data.site("coupling").xpos - R_WD @ tip_B
    data.qpos[address + 3 : address + 7] = quaternion_from_matrix(R_WD)
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    mujoco.mj_forward(model, data)
    probe = [i for i in range(model.ngeom) if model.geom(i).name.startswith("probe_")]
    assert not np.isin(data.contact.geom, probe).any()


@pytest.mark.parametrize("name", ["rim", "rib", "stave"])
def test_pieces_stand_evenly_round_the_axis(make_world, name):
    world = make_world()
    prefix = "coupling_stave" if name == "stave" else f"basket_{name}"
    pieces = [i for i in range(world.model.ngeom) if world.model.geom(i).name.startswith(prefix)]
    middle = world.model.geom_pos[pieces]
    np.testing.assert_allclose(middle[:, 1:].mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.ptp(np.hypot(middle[:, 1], middle[:, 2])), 0.0, atol=1e-12)
    angle = np.sort(np.arctan2(middle[:, 2], middle[:, 1]))
    np.testing.assert_allclose(np.diff(angle), 2.0 * np.pi / len(pieces), atol=1e-9)


def _along(geom):
    """Middle (3,), half of the way from end to end (3,) whichever way round, and size of a geom, in the drogue's axes.

    Of a capsule or a cylinder along its z, of a panel along its x.
    """
    R, panel = matrix_from_quaternion(geom.quat), geom.type[0] == mujoco.mjtGeom.mjGEOM_BOX
    return geom.pos, (geom.size[0] * R[:, 0] if panel else geom.size[1] * R[:, 2]), geom.size


def _runs(geom, begin, end, radius):
    """Check that a capsule or cylinder of a radius runs between two places."""
    middle, half, size = _along(geom)
    np.testing.assert_allclose(middle, 0.5 * (begin + end), atol=1e-9)
    np.testing.assert_allclose(np.outer(half, half), 0.25 * np.outer(end - begin, end - begin), atol=1e-9)
    assert size[0] == pytest.approx(radius)


def test_ribs_run_from_the_rim_to_the_bore_and_the_rim_from_rib_to_rib_all_round(make_world):
    model, n = make_world().model, DROGUE.ribs
    angle = 2.0 * np.pi * np.arange(n) / n
    round_axis = np.column_stack([np.zeros(n), np.cos(angle), np.sin(angle)])
    rim = [DROGUE.rim_x_m, 0.0, 0.0] + 0.5 * DROGUE.ring_diameter_m * round_axis
    bore = [DROGUE.throat_x_m, 0.0, 0.0] + (COUPLING.socket_radius_m + DROGUE.rib_radius_m) * round_axis
    for k in range(n):
        _runs(model.geom(f"basket_rib_{k}"), rim[k], bore[k], DROGUE.rib_radius_m)
        _runs(model.geom(f"basket_rim_{k}"), rim[k], rim[(k + 1) % n], DROGUE.rim_tube_radius_m)


def test_bore_reaches_from_the_throat_to_its_bottom_and_the_solid_body_from_there_to_the_hose(make_world):
    model, ahead = make_world().model, np.array([1.0, 0.0, 0.0])
    bottom, wall = (COUPLING.depth_m + COUPLING.stop_gap_m) * ahead, COUPLING.socket_wall_m
    aside = np.array([0.0, COUPLING.socket_radius_m + 0.5 * wall, 0.0])
    _runs(model.geom("coupling_stave_0"), DROGUE.throat_x_m * ahead + aside, bottom + aside, 0.5 * wall)
    _runs(model.geom("coupling_body"), bottom, DROGUE.hose_joint_x_m * ahead, COUPLING.socket_radius_m + wall)


def test_leds_housings_reach_from_their_gap_behind_the_lens_to_the_rim(make_world):
    model, aside = make_world().model, np.array([0.0, 0.5 * DROGUE.ring_diameter_m, 0.0])
    gap, rim = (np.array([x, 0.0, 0.0]) + aside for x in (DROGUE.led_housing_gap_m, DROGUE.rim_x_m))
    _runs(model.geom("led_housing_0"), gap, rim, DROGUE.led_housing_radius_m)


@pytest.mark.parametrize("k", [0, 5, 18])
def test_canopys_panels_reach_from_the_rims_front_to_its_own_rim_and_meet_their_neighbours_there(make_world, k):
    model, angle = make_world().model, 2.0 * np.pi * k / 24
    out = np.array([0.0, np.cos(angle), np.sin(angle)])
    begin = np.array([DROGUE.rim_x_m + DROGUE.rim_tube_radius_m, 0.0, 0.0]) + 0.5 * DROGUE.ring_diameter_m * out
    end = begin + [DROGUE.canopy_length_m, 0.0, 0.0] + 0.5 * (DROGUE.canopy_diameter_m - DROGUE.ring_diameter_m) * out
    middle, half, size = _along(model.geom(f"canopy_{k}"))
    np.testing.assert_allclose(middle, 0.5 * (begin + end), atol=1e-9)
    np.testing.assert_allclose(np.outer(half, half), 0.25 * np.outer(end - begin, end - begin), atol=1e-9)
    assert 24 * 2.0 * size[1] == pytest.approx(np.pi * DROGUE.canopy_diameter_m)


def test_staves_leave_the_bore_free_and_the_canopy_opens_aft_of_its_rim_outward(make_world):
    model = make_world().model
    stave = model.geom("coupling_stave_0")
    assert np.hypot(*stave.pos[1:]) - stave.size[0] == pytest.approx(COUPLING.socket_radius_m)
    panel = model.geom("canopy_0")
    assert np.hypot(*panel.pos[1:]) == pytest.approx(0.25 * (DROGUE.ring_diameter_m + DROGUE.canopy_diameter_m))
    assert panel.pos[0] > DROGUE.rim_x_m  # forward of the rim, so that no LED hides behind it


def test_the_leds_of_a_coded_ring_are_put_where_its_sheet_has_them_and_nothing_else_moves(make_world):
    world, plain = make_world(), make_world()
    coded = LedRing(angles_deg=(0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 327.0))
    place_leds(world.model, world.data, coded)
    drogue = world.data.body("drogue")
    leds_W = drogue.xpos + coded.positions_D @ drogue.xmat.reshape(3, 3).T
    for k, p_WL in enumerate(leds_W):
        np.testing.assert_allclose(world.data.site(f"led_{k}").xpos, p_WL, atol=1e-12)
        housing_D = (world.data.geom(f"led_housing_{k}").xpos - drogue.xpos) @ drogue.xmat.reshape(3, 3)
        np.testing.assert_allclose(housing_D[1:], coded.positions_D[k, 1:], atol=1e-12)
    moved = {"led_7", "led_housing_7"}
    model, before = world.model, plain.model
    assert {model.geom(i).name for i in np.flatnonzero((model.geom_pos != before.geom_pos).any(axis=1))} <= moved
    assert {model.site(i).name for i in np.flatnonzero((model.site_pos != before.site_pos).any(axis=1))} <= moved
    np.testing.assert_array_equal(model.body_mass, before.body_mass)
    np.testing.assert_array_equal(model.body_inertia, before.body_inertia)


def test_the_default_ring_stays_to_the_bit(make_world):
    world, plain = make_world(), make_world()
    place_leds(world.model, world.data, LedRing())
    np.testing.assert_array_equal(world.model.geom_pos, plain.model.geom_pos)
    np.testing.assert_array_equal(world.data.geom_xpos, plain.data.geom_xpos)
    np.testing.assert_array_equal(world.data.qpos, plain.data.qpos)


def test_a_ring_of_more_leds_than_the_drogue_carries_is_refused(make_world):
    world = make_world()
    with pytest.raises(DockairError, match="ring.count: expected 8 LEDs"):
        place_leds(world.model, world.data, LedRing(count=10))
