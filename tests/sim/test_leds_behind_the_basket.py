"""LEDs that the whole scene hides from the camera, the drogue turned on its hose until the basket is in the way."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from dockair.calibration import LedRing
from dockair.sim.camera.camera import NearInfraredCamera
from dockair.sim.camera.camera_noise import CameraNoise
from dockair.sim.camera.sheets import CameraSheets
from dockair.sim.camera.solids import VISIBLE_GROUPS

SHEETS = CameraSheets.load()
HINGES = ("drogue_y", "drogue_z")
UNDECIDED_M = 1e-3  # around the clearance, where two ways to reckon a distance may differ


@pytest.fixture
def scene(make_world: Callable[..., Any], small_world: Any) -> Iterator[tuple[Any, NearInfraredCamera]]:
    """World and camera, the drogue 2.5 m before the probe."""
    world = make_world(p_PD_B=(2.5, 0.1, 0.1))
    built = replace(small_world.as_built, ring_positions_D=LedRing().positions_D)
    camera = NearInfraredCamera(
        SHEETS, built, CameraNoise.of(3), world.model, sun_direction_W=None, background="analytic"
    )
    yield world, camera
    camera.close()


def _turned(world: Any, hinge: str, angles_deg: np.ndarray) -> Iterator[float]:
    """Turn the drogue about a hinge at the hose's end, as far as asked from where it hangs."""
    at = world.model.joint(hinge).qposadr[0]
    rest = float(world.data.qpos[at])
    for angle in angles_deg:
        world.data.qpos[at] = rest + np.radians(angle)
        mujoco.mj_forward(world.model, world.data)
        yield float(angle)
    world.data.qpos[at] = rest
    mujoco.mj_forward(world.model, world.data)


def _hiders(world: Any, camera: NearInfraredCamera) -> list[tuple[str, float]]:
    """Of each LED what MuJoCo's ray from the lens meets first, and how far before the LED."""
    p_WC, found = camera.pose(world.data)[1], []
    for k in range(8):
        way = world.data.site(f"led_{k}").xpos - p_WC
        geom, length = np.full(1, -1, dtype=np.int32), float(np.linalg.norm(way))
        hit = mujoco.mj_ray(world.model, world.data, p_WC, way / length, VISIBLE_GROUPS, 1, -1, geom)
        found.append((world.model.geom(int(geom[0])).name if geom[0] >= 0 else "", length - hit))
    return found


def test_a_drogue_turned_up_to_sixty_degrees_hides_none_of_its_leds(scene) -> None:
    world, camera = scene
    for hinge in HINGES:
        for angle in _turned(world, hinge, np.arange(-60.0, 61.0, 10.0)):
            assert camera.visible_leds(world.data).all(), (hinge, angle)


def test_a_drogue_edge_on_hides_its_far_leds_behind_its_near_rim_and_canopy(scene) -> None:
    """To either side, up and down; what stands before each hidden LED is the drogue itself."""
    world, camera = scene
    for hinge in HINGES:
        for angle in _turned(world, hinge, np.array([-90.0, 90.0])):
            hidden = ~camera.visible_leds(world.data)
            assert 2 <= hidden.sum() <= 5, (hinge, angle, hidden)
            for k in np.flatnonzero(hidden):
                name, before_m = _hiders(world, camera)[k]
                assert name.startswith(("basket_", "canopy_", "led_housing_")), (hinge, angle, name)
                assert before_m > 0.1  # across the ring, not its own seat
            lights = camera._sources.of(world.data, camera.pose(world.data), 2e-5, np.ones(8)).electrons[:8]
            assert np.all(lights[hidden] == 0.0)


def test_from_no_side_an_led_is_seen_through_the_scene_or_hidden_by_nothing(scene) -> None:
    """Against MuJoCo's rays, one at a time; rim, canopy, ribs, housings and the probe all get in the way somewhere."""
    world, camera = scene
    clearance_m = SHEETS.leds.occlusion_clearance_m
    hiders, seen = set(), 0
    for hinge in HINGES:
        for angle in _turned(world, hinge, np.arange(-150.0, 151.0, 2.5)):
            visible = camera.visible_leds(world.data)
            for k, (name, before_m) in enumerate(_hiders(world, camera)):
                blocked = name != "" and before_m > clearance_m
                if name and abs(before_m - clearance_m) < UNDECIDED_M:
                    continue
                assert visible[k] != blocked, (hinge, angle, k, name, before_m)
                hiders |= {name.rsplit("_", 1)[0]} if blocked else set()
                seen += int(visible[k])
    assert {"basket_rim", "basket_rib", "canopy", "led_housing", "probe"} <= hiders, hiders
    assert seen > 500
