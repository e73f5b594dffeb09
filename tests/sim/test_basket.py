"""The drogue's geometry, and whether its sheets fit each other."""

import numpy as np
import pytest

from dockair.calibration import LedRing
from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.basket import place_leds
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


def test_coupling_point_lies_in_the_bore_behind_the_throat_and_before_the_hose():
    assert DROGUE.rim_x_m < DROGUE.throat_x_m < COUPLING.depth_m
    assert COUPLING.depth_m + COUPLING.stop_gap_m < DROGUE.hose_joint_x_m


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
