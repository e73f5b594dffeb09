"""Shapes handed out for drawing are the model's geoms."""

import mujoco
import numpy as np
import pytest

from dockair.sim.shapes import shapes_of

MODEL = """
<mujoco>
  <asset><mesh name="tetra" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 1"/>
    <body name="thing" pos="1 2 3">
      <geom name="ball" type="sphere" size="0.3" pos="0.1 0 0" rgba="0.2 0.3 0.4 1"/>
      <geom name="rod" type="capsule" fromto="0 0 0 2 0 0" size="0.05"/>
      <geom name="drum" type="cylinder" size="0.2 0.7"/>
      <geom name="crate" type="box" size="0.1 0.2 0.3" euler="0 0 90"/>
      <geom name="hull" type="mesh" mesh="tetra"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def shapes():
    return {shape.name: shape for shape in shapes_of(mujoco.MjModel.from_xml_string(MODEL))}


def test_everything_but_planes_is_handed_out(shapes):
    assert {name: shape.kind for name, shape in shapes.items()} == {
        "ball": "ellipsoid", "rod": "capsule", "drum": "cylinder", "crate": "box", "hull": "mesh",
    }  # fmt: skip
    assert {shape.body for shape in shapes.values()} == {"thing"}


def test_half_sizes_are_those_of_the_model_file(shapes):
    np.testing.assert_allclose(shapes["ball"].half_size_m, [0.3, 0.3, 0.3])
    np.testing.assert_allclose(shapes["rod"].half_size_m, [0.05, 0.05, 1.0])
    np.testing.assert_allclose(shapes["drum"].half_size_m, [0.2, 0.2, 0.7])
    np.testing.assert_allclose(shapes["crate"].half_size_m, [0.1, 0.2, 0.3])


def test_a_capsule_from_one_point_to_another_lies_between_them_along_its_z(shapes):
    """fromto (0,0,0)-(2,0,0): centre (1,0,0), z axis along x."""
    rod, turned = shapes["rod"], np.empty(3)
    mujoco.mju_rotVecQuat(turned, np.array([0.0, 0.0, 1.0]), rod.q_wxyz)
    np.testing.assert_allclose(rod.p_m, [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.abs(turned), [1.0, 0.0, 0.0], atol=1e-12)


def test_a_mesh_keeps_its_corners_where_the_file_has_them(shapes):
    """The engine moves a mesh to its own centre of mass and principal axes; the shape's pose must undo that."""
    hull = shapes["hull"]
    placed = []
    for vertex in hull.vertices_m:
        turned = np.empty(3)
        mujoco.mju_rotVecQuat(turned, vertex, hull.q_wxyz)
        placed.append(turned + hull.p_m)
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    for corner in corners:
        assert np.min(np.linalg.norm(np.array(placed) - corner, axis=1)) < 1e-6
    assert hull.triangles.shape == (4, 3)


def test_colours_are_kept(shapes):
    np.testing.assert_allclose(shapes["ball"].rgba, [0.2, 0.3, 0.4, 1.0], atol=1e-7)
