"""Skins of tanker and receiver: scale, symmetry, where nose and hose's exit are, and what is struck."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Mounting
from dockair.errors import DockairError
from dockair.parameters import load_parameters
from dockair.sim.outlines import TankerParameters, receiver_pieces
from dockair.sim.skins import Skin, outline_names, receiver_skins, tanker_skins

TANKER = load_parameters("tanker", TankerParameters)
MOUNTING = Mounting(R_BC=np.eye(3), p_BC=np.array([3.3, -0.45, 0.75]), p_BP=np.array([6.0, -0.9, 0.6]))
AIRCRAFT = {
    "tanker": tanker_skins(TANKER),
    "fighter": receiver_skins(MOUNTING, "fighter"),
    "unmanned": receiver_skins(MOUNTING, "unmanned"),
}


def _corners(skins: list[Skin], name: str = "") -> np.ndarray:
    return np.vstack([skin.mesh.vertices_m for skin in skins if skin.name.startswith(name)])


@pytest.mark.parametrize("aircraft", AIRCRAFT)
def test_the_right_side_mirrors_the_left(aircraft: str) -> None:
    skins = {skin.name: skin.mesh for skin in AIRCRAFT[aircraft]}
    left = [name for name in skins if name.endswith("_left")]
    assert len(left) >= 2
    for name in left:
        other = skins[name.replace("_left", "_right")]
        np.testing.assert_array_equal(other.vertices_m, skins[name].vertices_m * [1.0, -1.0, 1.0])


def test_the_tanker_is_as_long_and_wide_as_its_sheet() -> None:
    for scale in (1.0, 1.2):
        tanker = replace(TANKER, length_m=scale * TANKER.length_m, span_m=scale * TANKER.span_m)
        corners = _corners(tanker_skins(tanker))
        assert np.ptp(corners[:, 0]) == pytest.approx(tanker.length_m, rel=0.01)
        assert np.ptp(corners[:, 1]) == pytest.approx(tanker.span_m, rel=0.01)


@pytest.mark.parametrize(("aircraft", "span_m"), [("fighter", 9.45), ("unmanned", 20.0)])
def test_the_receivers_have_the_span_of_their_class_and_end_behind_the_probes_tip(aircraft: str, span_m: float) -> None:
    corners = _corners(AIRCRAFT[aircraft])
    assert np.ptp(corners[:, 1]) == pytest.approx(span_m, rel=0.01)
    assert corners[:, 0].max() == pytest.approx(MOUNTING.p_BP[0] - 1.2, abs=1e-9)


@pytest.mark.parametrize("exit_m", [(30.0, 0.0, -2.0), (-7.0, 30.0, -2.0), (-19.5, 0.0, 30.0)])
def test_a_refuelling_unit_that_nothing_is_above_is_refused(exit_m: tuple[float, ...]) -> None:
    with pytest.raises(DockairError, match="exit_m: expected a place below the fuselage or a wing, got") as refusal:
        tanker_skins(replace(TANKER, exit_m=np.array(exit_m)))
    assert refusal.value.got == list(exit_m)


@pytest.mark.parametrize("exit_m", [(-19.5, 0.0, -1.9), (-7.0, -12.0, -2.2), (-7.0, 12.0, -2.2)])
def test_the_refuelling_unit_ends_at_the_hoses_exit_and_hangs_from_what_is_above(exit_m: tuple[float, ...]) -> None:
    skins = tanker_skins(replace(TANKER, exit_m=np.array(exit_m)))
    pod, pylon = _corners(skins, "pod"), _corners(skins, "pod_pylon")
    assert pod[:, 0].min() == pytest.approx(exit_m[0], abs=1e-9)
    end = pod[pod[:, 0] < exit_m[0] + 1e-6]
    np.testing.assert_allclose(end.mean(axis=0), exit_m, atol=1e-6)
    above = np.vstack([s.mesh.vertices_m for s in skins if not s.name.startswith("pod")])
    near = above[np.hypot(above[:, 0] - pylon[:, 0].mean(), above[:, 1] - exit_m[1]) < 3.0]
    assert near[:, 2].min() - 0.3 <= pylon[:, 2].max() <= near[:, 2].max()


@pytest.mark.parametrize("outline", ["fighter", "unmanned"])
def test_what_is_struck_is_where_something_is_seen(outline: str) -> None:
    """Middles and ends of the struck primitives lie within 0.6 m of a corner of the skin or inside its outline."""
    corners = _corners(AIRCRAFT[outline])
    low, high = corners.min(axis=0) - 0.3, corners.max(axis=0) + 0.3
    for piece in receiver_pieces(MOUNTING, outline):
        for at in [piece.at] + ([piece.to] if piece.to is not None else []):
            assert np.all(at >= low) and np.all(at <= high), piece.name


@pytest.mark.parametrize("aircraft", AIRCRAFT)
def test_there_are_few_enough_triangles_to_draw_every_frame(aircraft: str) -> None:
    assert 500 < sum(len(skin.mesh.triangles) for skin in AIRCRAFT[aircraft]) < 2500


def test_another_outline_is_refused_with_those_there_are() -> None:
    assert outline_names() == ["fighter", "transport", "unmanned"]
    with pytest.raises(DockairError, match="unmanned"):
        receiver_skins(MOUNTING, "glider")
    with pytest.raises(DockairError, match="unmanned"):
        receiver_pieces(MOUNTING, "glider")
