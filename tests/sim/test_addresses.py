"""Where things are in the compiled model's arrays."""

import numpy as np
import pytest

from dockair.sim.addresses import Addresses


@pytest.fixture
def world(make_world):
    return make_world()


def test_addresses_name_the_bodies_and_joints_they_say(world):
    model, at = world.model, Addresses.of(world.model)
    links = world.parameters.hose.links
    bodies = [model.body(i).name for i in range(at.tow.start, at.tow.stop)]
    assert bodies == [*(f"hose_{i}" for i in range(links)), "drogue"]
    assert at.links == slice(at.tow.start, at.tow.stop - 1) and at.drogue == at.tow.stop - 1
    joint_of = {int(address): model.joint(j).name for j, address in enumerate(model.jnt_qposadr)}
    hinges = [joint_of[i] for i in range(at.hinges.start, at.hinges.stop)]
    assert hinges == [f"{body}_{axis}" for body in bodies for axis in "yz"]
    assert joint_of[at.reel_qpos] == "reel" and joint_of[at.receiver_qpos.start] == "receiver"
    assert model.joint(at.drogue_joint).name == "drogue_y"


def test_every_solid_geom_is_of_one_party(world):
    at = Addresses.of(world.model)
    parties = at.geom_is_probe.astype(int) + at.geom_is_receiver + at.geom_is_drogue
    others = {at.geom_names[i].split("_")[0] for i in np.flatnonzero(parties == 0)}
    assert parties.max() == 1
    assert others == {"tanker", "hose", "led", "canopy"}  # the two last are drawn only


def test_contacts_tell_probe_from_receiver_whichever_geom_comes_first(world):
    at = Addresses.of(world.model)
    probe, nose, rim, hose = (world.model.geom(n).id for n in ("probe_tip", "fuselage_nose", "basket_rim_0", "hose_3"))
    wing = world.model.geom("tanker_wing_left").id
    for pairs, expected in (
        ([], (False, "")),
        ([(probe, rim)], (True, "")),
        ([(rim, probe)], (True, "")),
        ([(probe, hose)], (False, "hose_3")),  # the hose is not the drogue: a probe that strikes it has collided
        ([(hose, nose)], (False, "hose_3")),
        ([(nose, wing), (rim, probe)], (True, "tanker_wing_left")),
    ):
        assert at.contacts(np.array(pairs, dtype=np.int32).reshape(-1, 2)) == expected
