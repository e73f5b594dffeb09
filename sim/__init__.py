"""The world: physics and sensors. It knows everything and decides nothing."""

from dockair.sim.opengl import let_mujoco_be_imported

let_mujoco_be_imported()  # before any module here imports mujoco
