"""Small scenes of geoms, and the Sun's glints in mirrors that are perfect unless told otherwise."""

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from dockair.parameters import load_parameters
from dockair.rotations import quaternion_from_matrix
from dockair.sim.camera.glints import Glints, find_glints
from dockair.sim.camera.mirrors import Mirrors
from dockair.sim.camera.sheets import LightParameters, SurfaceParameters

LIGHT = load_parameters("light", LightParameters)
SHEET = load_parameters("surfaces", SurfaceParameters)
#: Everything counts, and metal mirrors all light at every angle
IDEAL = replace(
    SHEET,
    metal_reflectance=1.0,
    metal_share=1.0,
    grazing_rad=1.57,
    faintest_glint_m2_sr=0.0,
    faintest_radiance=0.0,
    metal_roughness_rad=1e-5,
)
POINT_SUN = replace(LIGHT, sun_angular_radius_rad=1e-6)
EYE = np.zeros(3)
_METAL = "probe_under_test"

Scene = tuple[mujoco.MjModel, mujoco.MjData]


def unit(*v: float) -> np.ndarray:
    """Unit vector of that direction."""
    return np.array(v) / np.linalg.norm(v)


def scene_of(*geoms: dict[str, Any]) -> Scene:
    """Geoms that stand in the world, positions up to date."""
    spec = mujoco.MjSpec()
    for geom in geoms:
        spec.worldbody.add_geom(**geom)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def metal_body(kind: mujoco.mjtGeom, at: np.ndarray, size: list[float], R: np.ndarray | None = None) -> dict[str, Any]:
    """A geom of metal."""
    quat = quaternion_from_matrix(np.eye(3) if R is None else R)
    return {"name": _METAL, "type": kind, "pos": list(at), "size": size, "quat": quat}


def metal_sphere(at: list[float], radius: float, **more: object) -> dict[str, Any]:
    """A sphere of metal, or of another finish by another name."""
    return {"name": _METAL, "type": mujoco.mjtGeom.mjGEOM_SPHERE, "pos": at, "size": [radius, 0.0, 0.0], **more}


def glints_in(
    scene: Scene,
    sun: np.ndarray,
    surfaces: SurfaceParameters = IDEAL,
    light: LightParameters = POINT_SUN,
    eye: np.ndarray = EYE,
    ahead: np.ndarray | None = None,
) -> Glints:
    """The Sun's glints in a scene."""
    return find_glints(*scene, Mirrors.of(scene[0]), eye, sun, surfaces, light, ahead)
