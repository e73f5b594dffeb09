"""Outlines of tanker and receiver."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Mounting
from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.rotations import matrix_from_quaternion
from dockair.sim.outlines import Piece, TankerParameters, receiver_pieces, tanker_pieces
from dockair.sim.skins import receiver_skins

TANKER = load_parameters("tanker", TankerParameters)
MOUNTING = Mounting(R_BC=np.eye(3), p_BC=np.array([3.3, -0.45, 0.75]), p_BP=np.array([6.0, -0.9, 0.6]))
OUTLINES = {"tanker": tanker_pieces(TANKER), "receiver": receiver_pieces(MOUNTING)}


def named(pieces: list[Piece], name: str) -> Piece:
    return next(piece for piece in pieces if piece.name == name)


@pytest.mark.parametrize("aircraft", OUTLINES)
def test_right_side_mirrors_the_left(aircraft: str) -> None:
    """A point of the left piece, mirrored in the plane of symmetry, is the point of the right one across its own y."""
    pieces, mirror = OUTLINES[aircraft], np.diag([1.0, -1.0, 1.0])
    pairs = [(p, named(pieces, p.name.replace("_left", "_right"))) for p in pieces if p.name.endswith("_left")]
    assert len(pairs) >= 2
    for left, right in pairs:
        R_left, R_right = (matrix_from_quaternion(np.array(p.q_wxyz)) for p in (left, right))
        np.testing.assert_allclose(mirror @ left.at, right.at, atol=1e-12)
        np.testing.assert_allclose(mirror @ R_left @ mirror, R_right, atol=1e-12)
        assert left.size == right.size


@pytest.mark.parametrize("aircraft", OUTLINES)
def test_wings_sweep_aft_and_the_tankers_rise(aircraft: str) -> None:
    left = named(OUTLINES[aircraft], "wing_left")
    outward = matrix_from_quaternion(np.array(left.q_wxyz))[:, 1]
    assert outward[1] > 0.0 > outward[0]
    assert outward[2] == 0.0 if aircraft == "receiver" else outward[2] > 0.0


def test_pod_ends_where_the_hose_comes_out_and_the_nose_behind_the_probes_tip() -> None:
    pod = named(OUTLINES["tanker"], "pod")
    assert pod.to is not None
    np.testing.assert_allclose(np.array(pod.to) - [pod.size[0], 0.0, 0.0], TANKER.exit_m, atol=1e-12)
    foremost = max(p.at[0] + p.size[0] for p in OUTLINES["receiver"] if p.name.startswith("fuselage"))
    assert foremost == pytest.approx(MOUNTING.p_BP[0] - 1.2)


def test_the_right_pods_exit_mirrors_the_left_ones_and_the_centreline_stays() -> None:
    left, right = TANKER.at_pod("left_wing"), TANKER.at_pod("right_wing")
    np.testing.assert_array_equal(right.exit_m, left.exit_m * [1.0, -1.0, 1.0])
    assert left.exit_m[1] > 0.5 * TANKER.fuselage_radius_m + 3.0  # clear of the fuselage
    assert TANKER.at_pod("centreline") is TANKER
    pods = {pod: named(tanker_pieces(TANKER.at_pod(pod)), "pod").at[1] for pod in ("left_wing", "right_wing")}
    assert pods == {"left_wing": left.exit_m[1], "right_wing": right.exit_m[1]}


def test_an_unknown_pod_is_refused() -> None:
    with pytest.raises(DockairError, match="tanker.pod"):
        TANKER.at_pod("middle")  # type: ignore[arg-type]


@pytest.mark.parametrize("outline", ["fighter", "unmanned"])
@pytest.mark.parametrize("tip_x_m", [-10.0, 1.2, 2.0, 3.5])
def test_a_probe_before_which_there_is_no_room_for_a_nose_is_refused(outline: str, tip_x_m: float) -> None:
    """Its sheet's range allows it; of the fuselage ahead of the wing nothing would be left."""
    mounting = replace(MOUNTING, p_BP=np.array([tip_x_m, -0.9, 0.6]))
    for make in (receiver_pieces, receiver_skins):
        with pytest.raises(DockairError, match=r"probe_tip_m: expected a tip more than 3\.5 m ahead"):
            make(mounting, outline)
    nearly = replace(MOUNTING, p_BP=np.array([3.6, -0.9, 0.6]))
    assert min(size for piece in receiver_pieces(nearly, outline) for size in piece.size[:1]) > 0.0
