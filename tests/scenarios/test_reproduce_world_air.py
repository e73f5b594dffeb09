"""The wake and the bow wave made again beside closed forms, a solution by other hands, and a settled MuJoCo world."""

import json

import cv2
import numpy as np
import pytest

from dockair.messages import ReceiverCommand
from dockair.parameters import load_parameters
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world import bow_wave as world_bow_wave
from dockair.scenarios.reproduce.world import wake as world_wake
from dockair.scenarios.reproduce.world.tow_at_rest import tow_at_rest
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.air.bow_wave import BowWaveParameters, bow_wave_coefficients, bow_wave_velocity
from dockair.sim.air.motion import AirMotion
from dockair.sim.air.wake import WakeParameters, wake_coefficients, wake_velocity
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.rest import rest_shape

MODULES = (world_wake, world_bow_wave)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pictures")


@pytest.fixture(scope="module")
def made(folder):
    return {module.ID: module.reproduce(folder) for module in MODULES}


def _cases(result, beginning):
    return [row for row in result["rows"] if row["case"].startswith(beginning)]


@pytest.mark.parametrize("wanted", [module.ID for module in MODULES])
def test_each_has_the_form_is_json_and_draws_a_picture(made, folder, wanted):
    result = made[wanted]
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert result["id"] == wanted
    for row in result["rows"]:
        assert list(row) == ["case", "ours", "reference"]
        assert row["reference"].keys() <= row["ours"].keys()
    assert cv2.imread(str(folder / picture_name(wanted))).std() > 10.0


def test_the_wakes_field_is_the_closed_forms(made):
    for row in (*_cases(made["world/wake"], "on the axis"), *_cases(made["world/wake"], "far behind")):
        for key, reference in row["reference"].items():
            assert row["ours"][key] == pytest.approx(reference, rel=1e-6), (row["case"], key)
    (sheet,) = _cases(made["world/wake"], "elliptic sheet")
    for key, reference in sheet["reference"].items():
        assert sheet["ours"][key] == pytest.approx(reference, rel=0.01)


def test_in_the_wake_the_drogue_hangs_lower_as_in_a_stream_turned_down(made):
    """The reference takes one downwash, that halfway along the hose, for all of it."""
    rows = _cases(made["world/wake"], "drogue at rest")
    assert len(rows) == 2
    for row in rows:
        assert row["ours"]["sinks_m"] > 0.2
        assert row["ours"]["sinks_m"] == pytest.approx(row["reference"]["sinks_m"], rel=0.05)
        assert row["ours"]["root_tension_n"] == pytest.approx(row["reference"]["root_tension_n"], rel=0.005)


def test_the_half_body_has_the_closed_forms_nose_flux_and_width(made):
    (row,) = _cases(made["world/bow-wave"], "half-body 0.75 m at 180")
    for key, reference in row["reference"].items():
        assert row["ours"][key] == pytest.approx(reference, rel=1e-3)


def test_the_push_is_the_references_to_the_centimetre_it_is_given_to_and_three_per_cent(made):
    rows = [row for row in made["world/bow-wave"]["rows"] if "beside" in row["case"]]
    assert sum(len(row["reference"]) for row in rows) == 35
    for row in rows:
        for key, reference in row["reference"].items():
            assert row["ours"][key] == pytest.approx(reference, abs=0.005 + 0.03 * reference), (row["case"], key)


def test_the_nearer_the_default_receiver_comes_the_farther_the_drogue_gives_way_to_the_probes_side(made):
    rows = _cases(made["world/bow-wave"], "default flight")
    left = [row["ours"]["left_m"] for row in rows]
    assert all(b < a < 0.0 for a, b in zip(left, left[1:], strict=False))  # the probe is on the right of the nose
    assert all(abs(row["ours"]["forward_m"]) < 0.05 for row in rows)


def test_without_motion_the_balance_is_rest_shapes():
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    air, wind_W = standard_atmosphere(6000.0), np.array([-180.0, 0.0, 0.0])
    ours = tow_at_rest(hose, drogue, wind_W, air, np.zeros_like)
    rest = rest_shape(hose, drogue, wind_W, air.density_kg_m3, air.kinematic_viscosity_m2_s)
    np.testing.assert_allclose(ours.p_WH, rest.p_WH, atol=1e-6)
    assert ours.root_tension_n == pytest.approx(rest.root_tension_n, rel=1e-6)
    assert ours.drogue_tension_n == pytest.approx(rest.drogue_tension_n, rel=1e-6)


def test_a_stream_turned_by_the_motion_is_a_stream_that_was_turned_before():
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    air, wind_W, down = standard_atmosphere(6000.0), np.array([-180.0, 0.0, 0.0]), np.array([0.0, 1.0, -4.0])
    moved = tow_at_rest(hose, drogue, wind_W, air, lambda places: np.tile(down, (len(places), 1)))
    turned = tow_at_rest(hose, drogue, wind_W + down, air, np.zeros_like)
    np.testing.assert_allclose(moved.p_WD, turned.p_WD, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("sources", ["wake", "bow wave", "both"])
def test_a_settled_world_hangs_where_the_balance_says(make_world, sources):
    """Two programs, one air: the probe's tip held 0.6 m behind and 0.4 m below the undisturbed ring."""
    world = make_world(p_PD_B=(0.6, 0.0, 0.4))
    p, air = world.parameters, standard_atmosphere(6000.0)
    wake = wake_coefficients(
        load_parameters("wake", WakeParameters), mass_kg=80e3, span_m=40.0, airspeed_m_s=180.0, air=air
    )
    bow_wave = bow_wave_coefficients(load_parameters("bow_wave", BowWaveParameters), p.mounting.p_BP, 180.0)
    wake, bow_wave = (None if sources == "bow wave" else wake), (None if sources == "wake" else bow_wave)
    exit_T, p_WB = p.tanker.exit_m, world.truth.p_WB.copy()
    world._air = AirMotion(wake=wake, bow_wave=bow_wave, exit_T=exit_T, receiver_points_B=np.zeros((1, 3)))
    for _ in range(7000):
        world.step(ReceiverCommand())
        world.data.qvel[:] *= 1.0 - 2e-3  # a brake: the place of rest is the same, the swing dies sooner
    np.testing.assert_allclose(world.truth.p_WB, p_WB, atol=1e-6)

    def motion(places):
        moved = np.zeros_like(places)
        if wake is not None:
            moved += wake_velocity(places + exit_T, wake)
        if bow_wave is not None:
            moved += bow_wave_velocity(places - p_WB, bow_wave)
        return moved

    rest = tow_at_rest(p.hose, p.drogue, np.array([-180.0, 0.0, 0.0]), air, motion)
    still = tow_at_rest(p.hose, p.drogue, np.array([-180.0, 0.0, 0.0]), air, np.zeros_like)
    assert np.linalg.norm(rest.p_WD - still.p_WD) > 0.06
    np.testing.assert_allclose(world.truth.p_WD, rest.p_WD, atol=0.005)
    assert world.truth.root_tension_n == pytest.approx(rest.root_tension_n, rel=2e-3)


def test_the_bow_wave_pushes_the_drogue_and_hardly_the_hose():
    """The half-body of 0.75 m abeam, 1.2 m beside: with air added at the drogue alone the push is 90 to 99 % of it."""
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    air, wind_W = standard_atmosphere(3000.0), np.array([-120.0, 0.0, 0.0])
    still = tow_at_rest(hose, drogue, wind_W, air, np.zeros_like).p_WD
    k = world_bow_wave._source(0.75, 120.0)
    both, alone = (
        tow_at_rest(
            hose, drogue, wind_W, air, lambda p: bow_wave_velocity(p - still + [0.0, 1.2, 0.0], k), on_hose=on_hose
        ).p_WD[1]
        for on_hose in (True, False)
    )
    assert 0.9 * both < alone < 0.99 * both
