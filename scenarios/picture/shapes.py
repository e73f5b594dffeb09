"""A picture of the shapes and of what is below, as the camera's background draws them without OpenGL.

`python -m dockair.scenarios.picture.shapes docs/images/world-shapes.png`
"""

import sys
from pathlib import Path

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.parameters import load_parameters
from dockair.rotations import Array, matrix_from_yaw_pitch_roll
from dockair.scenarios.assembly.mounting_parameters import MountingParameters
from dockair.sim.camera.sheets import LightParameters, SkyParameters
from dockair.sim.camera.sky import Sky
from dockair.sim.camera.sky_radiance import SkyRadiance
from dockair.sim.camera.solids import Haze, Lighting
from dockair.sim.camera.traced import TracedSolids
from dockair.sim.camera.weather import Weather
from dockair.sim.outlines import TankerParameters
from dockair.sim.skins import Skin, receiver_skins, tanker_skins

_SHAPE, _PER_TANGENT = (272, 512), 727.0  # blocks of 4 x 4 pixels of the default camera
_ALTITUDE_M, _KEY = 6000.0, 7
_REFLECTANCE, _EXTENT_M = 0.45, 40.0
_SUN_W = np.array([-0.5, 0.4, 0.77]) / np.linalg.norm([-0.5, 0.4, 0.77])
_WHITE, _GREYS = 0.8, 24.0  # radiance that is drawn white; grey levels, for a small file


def main(path: Path) -> None:
    """Write the picture: six panels, two in a row."""
    sky = Sky(SkyRadiance(load_parameters("sky", SkyParameters), Weather(), _SUN_W, _ALTITUDE_M, _KEY))
    tanker, mounting = (
        tanker_skins(load_parameters("tanker", TankerParameters)),
        load_parameters("mounting", MountingParameters).mounting(),
    )
    panels = [
        _aircraft(sky, tanker, (-70.0, 10.0, -14.0)),
        _aircraft(sky, tanker, (30.0, 75.0, 22.0)),
        _aircraft(sky, receiver_skins(mounting, "fighter"), (12.0, 15.0, 6.0)),
        _aircraft(sky, receiver_skins(mounting, "unmanned"), (17.0, 18.0, 8.0)),
        _sky(sky, matrix_from_yaw_pitch_roll(0.0, 0.05, 0.0)),
        _sky(sky, matrix_from_yaw_pitch_roll(0.3, 0.2, -0.4)),
    ]
    rows = [np.hstack(panels[k : k + 2]) for k in range(0, len(panels), 2)]
    cv2.imwrite(str(path), np.vstack(rows))


def _tangents() -> tuple[Array, Array]:
    rows, columns = ((np.arange(n) - 0.5 * (n - 1)) / _PER_TANGENT for n in _SHAPE)
    return columns, rows


def _aircraft(sky: Sky, skins: list[Skin], eye_m: tuple[float, float, float]) -> NDArray[np.uint8]:
    """One aircraft alone before the sky, from a place in its own axes, looked at in the middle."""
    model = _model(skins)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    forward = -np.array(eye_m) / np.linalg.norm(eye_m)
    left = np.cross([0.0, 0.0, 1.0], forward)
    left /= np.linalg.norm(left)
    R = np.column_stack([forward, left, np.cross(forward, left)])
    x, y = _tangents()
    out = np.empty(_SHAPE, dtype=np.float32)
    sky.fill(out, R, x, y)
    radius_rad = load_parameters("light", LightParameters).sun_angular_radius_rad
    TracedSolids(model, Lighting.toward(_SUN_W, sky, radius_rad)).draw(out, data, (R, np.array(eye_m)), x, y, Haze())
    return _grey(out)


def _model(skins: list[Skin]) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.stat.extent = _EXTENT_M
    for skin in skins:
        mesh = spec.add_mesh(name=skin.name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert, mesh.usernormal = skin.mesh.vertices_m.ravel().tolist(), skin.mesh.normals.ravel().tolist()
        mesh.userface = mesh.userfacenormal = skin.mesh.triangles.ravel().tolist()
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=skin.name, rgba=[_REFLECTANCE * skin.shade] * 3 + [1.0]
        )
    return spec.compile()


def _sky(sky: Sky, R: Array) -> NDArray[np.uint8]:
    x, y = _tangents()
    out = np.empty(_SHAPE, dtype=np.float32)
    sky.fill(out, R, x, y)
    return _grey(out)


def _grey(radiance: NDArray[np.float32]) -> NDArray[np.uint8]:
    level = np.round(_GREYS * np.sqrt(np.clip(radiance / _WHITE, 0.0, 1.0)))
    return np.asarray(255.0 / _GREYS * level, dtype=np.uint8)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
