"""A camera on a small world of its own, so that the sensors' tests do not depend on the whole scene; hose wound in."""

from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np
import pytest

from dockair.calibration import Camera, LedRing, Mounting
from dockair.rotations import exp, quaternion_from_matrix
from dockair.sim.as_built import AsBuilt
from dockair.sim.camera.camera import CameraNoise, NearInfraredCamera
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.faults import Fault, Faults
from dockair.sim.hose.rest import hinge_angles
from dockair.sim.world import World

AS_BUILT = AsBuilt(
    camera=Camera(principal_point_px=(1020.7, 545.1), focal_length_m=0.01601),
    ring_positions_D=LedRing().positions_D + 1e-3 * np.sin(np.arange(24.0)).reshape(8, 3),
    led_intensity_w_sr=0.015 * (1.0 + 0.3 * np.cos(np.arange(8.0))),
    mounting=Mounting(
        R_BC=exp(np.array([0.002, -0.001, -0.05])), p_BC=np.array([3.3, -0.45, 0.75]), p_BP=np.array([6.0, -0.9, 0.6])
    ),
)
ASIDE_M = 50.0


class SmallWorld:
    """Drogue ahead of the camera along its axis; everything floats and can be put anywhere."""

    def __init__(self) -> None:
        spec = mujoco.MjSpec()
        spec.visual.headlight.active = 0
        spec.stat.extent = 40.0
        spec.visual.map.znear = 0.0025
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[0, 0, -1], ambient=[0.25] * 3, diffuse=[0.75] * 3
        )
        self._body(spec, "receiver", "probe_boom", mujoco.mjtGeom.mjGEOM_CAPSULE, [0.04, 0.8, 0.0], [5.2, -0.9, 0.6])
        self._body(spec, "drogue", "basket_hub", mujoco.mjtGeom.mjGEOM_SPHERE, [0.1, 0.0, 0.0], [0.5, 0.0, 0.0])
        self._body(spec, "tanker", "tanker_wing", mujoco.mjtGeom.mjGEOM_BOX, [1.0, 15.0, 0.2], [0.0, 0.0, 0.0])
        self._body(spec, "box", "box", mujoco.mjtGeom.mjGEOM_BOX, [0.02, 0.05, 0.05], [0.0, 0.0, 0.0])
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.as_built = AS_BUILT
        self.put("receiver", np.array([1.0, 2.0, 3.0]), exp(np.array([0.1, -0.05, 0.2])))
        self.put("tanker", np.array([40.0, 2.0, 12.0]), np.eye(3))
        self.put_aside("box")

    @staticmethod
    def _body(spec: Any, name: str, geom: str, kind: mujoco.mjtGeom, size: list[float], at: list[float]) -> None:
        body = spec.worldbody.add_body(name=name)
        body.add_freejoint(name=name)
        turned = quaternion_from_matrix(exp(np.array([0.0, np.pi / 2, 0.0]))) if name == "receiver" else [1, 0, 0, 0]
        body.add_geom(name=geom, type=kind, size=size, pos=at, quat=turned, rgba=[0.4, 0.4, 0.4, 1.0])

    def put(self, name: str, p_W: np.ndarray, R_W: np.ndarray) -> None:
        address = self.model.joint(name).qposadr[0]
        self.data.qpos[address : address + 3] = p_W
        self.data.qpos[address + 3 : address + 7] = quaternion_from_matrix(R_W)
        mujoco.mj_forward(self.model, self.data)

    def put_drogue(self, camera: NearInfraredCamera, p_CD: np.ndarray, R_CD: np.ndarray | None = None) -> None:
        R_WC, p_WC = camera.pose(self.data)
        self.put("drogue", p_WC + R_WC @ p_CD, R_WC @ (np.eye(3) if R_CD is None else R_CD))

    def put_aside(self, name: str) -> None:
        """Out of everybody's way."""
        self.put(name, np.array([-30.0, ASIDE_M, 0.0]), np.eye(3))


@pytest.fixture
def small_world() -> SmallWorld:
    """A world without a camera."""
    return SmallWorld()


@pytest.fixture(params=[pytest.param("mujoco", marks=pytest.mark.gl), "analytic"])
def make_camera(request: pytest.FixtureRequest) -> Iterator[Callable[..., tuple[SmallWorld, NearInfraredCamera]]]:
    """make_camera(sun_W, seed, faults, overrides, hub, unseen, **more of NearInfraredCamera) -> world, camera.

    Once with each background. The drogue is 8 m ahead of the lens; the exposure is fixed.
    """
    opened = []

    def build(
        sun_W: np.ndarray | None = None,
        seed: int = 77,
        faults: tuple[Fault, ...] = (),
        overrides: dict[str, dict[str, Any]] | None = None,
        hub: bool = True,
        unseen: tuple[str, ...] = (),  # geoms of a group that is not drawn
        **more: Any,
    ) -> tuple[SmallWorld, NearInfraredCamera]:
        world = SmallWorld()
        if not hub:  # LEDs alone
            world.model.geom("basket_hub").rgba[3] = 0.0
        for name in unseen:
            world.model.geom(name).group = 3
        options = {"automatic_exposure": False, "background": request.param, "altitude_m": 6000.0} | more
        camera = NearInfraredCamera(
            CameraSheets.load(overrides=overrides),
            world.as_built,
            CameraNoise.of(seed),
            world.model,
            sun_direction_W=None if sun_W is None else sun_W / np.linalg.norm(sun_W),
            faults=Faults(faults, 8),
            **options,
        )
        world.put_drogue(camera, np.array([8.0, 0.2, -0.1]))
        opened.append(camera)
        return world, camera

    yield build
    for camera in opened:
        camera.close()


def wind_in(world: World, length_m: float) -> None:
    """Put the world's hose at rest with a length of it in the pod."""
    parameters, links = world.parameters, world.parameters.hose.links
    directions = np.vstack([world.rest.t_W, world.rest.t_D_W])
    directions[: int(length_m / parameters.hose.link_length_m)] = [1.0, 0.0, 0.0]
    assert len(directions) == links + 1
    first, last = world.model.joint("hose_0_y").qposadr[0], world.model.joint("drogue_z").qposadr[0]
    world.data.qpos[first : last + 1] = hinge_angles(directions).ravel()
    world.data.qpos[world.model.joint("reel").qposadr[0]] = length_m
    mujoco.mj_step1(world.model, world.data)
    world._observe(0)


@pytest.fixture(name="wind_in")
def _wind_in() -> Callable[[World, float], None]:
    return wind_in
