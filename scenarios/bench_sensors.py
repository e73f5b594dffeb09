"""How fast the sensors' stages are on this machine, beside what a user would take instead.

Every figure is the least of several repetitions in one process, after a first one that compiles. Speeds are
benchmarks, never tests: they belong to the machine that printed them.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import mujoco
import numpy as np

from dockair.messages import Window
from dockair.scenarios.build import build, camera_sheets
from dockair.scenarios.schema import Scenario
from dockair.sim.camera.camera import NearInfraredCamera
from dockair.sim.camera.electronics import digitise
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.world import World

_REPETITIONS = 25
_ROWS = Window(344, 744, 0, 2048)
_SMALL = Window(394, 694, 874, 1174)
_WARM_UP = 5


def bench_sensors(scenario: Scenario) -> dict[str, Any]:
    """Return {"milliseconds": {what: ms}, "ratios": {what: ratio}}.

    Args:
        scenario: whose start is looked at, with its own seed.
    """
    other = {"mujoco": "analytic", "analytic": "mujoco"}
    parts = build(scenario, scenario.seed)
    camera, world = parts.camera, parts.world
    assert camera is not None
    milliseconds: dict[str, float] = {}
    try:
        first = camera.background
        milliseconds |= _camera_figures(camera, world, first)
    finally:
        camera.close()
    options = scenario.camera.model_copy(update={"background": other[first]})
    twin = build(scenario.model_copy(update={"camera": options}), scenario.seed)
    assert twin.camera is not None
    try:
        milliseconds |= _camera_figures(twin.camera, twin.world, other[first])
    finally:
        twin.camera.close()
    milliseconds |= _electronics_figures(scenario)
    milliseconds["bare mujoco.Renderer, RGB, full size"] = _bare_renderer(world)
    milliseconds["IMU sample"] = _least(lambda: parts.imu.step(0.0, np.zeros(3), np.zeros(3), np.zeros(3)))
    return {"milliseconds": milliseconds, "ratios": _ratios(milliseconds)}


def _camera_figures(camera: NearInfraredCamera, world: World, name: str) -> dict[str, float]:
    full = Window(0, 1088, 0, 2048)
    figures = {}
    for what, window in (("full frame", full), ("400 rows", _ROWS), ("300 x 300", _SMALL)):
        figures[f"{name}: expose, {what}"] = _least(partial(camera.expose, world.data, 0.0, 0, window))
        figures[f"{name}: without electronics, {what}"] = _least(partial(camera.expected_electrons, world.data, window))
        figures[f"{name}: background, {what}"] = _least(partial(camera.background_electrons, world.data, window))
    return figures


def _electronics_figures(scenario: Scenario) -> dict[str, float]:
    """Electronics of a full frame against NumPy's own random numbers."""
    sensor = camera_sheets(scenario).sensor
    pattern = FixedPattern(sensor, 1, 1088, 2048)
    rng = np.random.default_rng(0)
    expected = rng.uniform(20.0, 3000.0, (1088, 2048)).astype(np.float32)
    return {
        "electronics, full frame": _least(lambda: digitise(expected, sensor, pattern, 1, 0, (0, 0), 2e-5)),
        "NumPy: normals alone, full frame": _least(lambda: rng.standard_normal(expected.shape, dtype=np.float32), 5),
        "NumPy: Poisson alone, full frame": _least(lambda: rng.poisson(expected), 3),
    }


def _bare_renderer(world: World) -> float:
    world.model.vis.global_.offwidth, world.model.vis.global_.offheight = 2048, 1088
    renderer = mujoco.Renderer(world.model, 1088, 2048)
    try:
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        view = mujoco.MjvCamera()
        view.lookat[:], view.distance, view.azimuth, view.elevation = world.truth.p_WD, 6.7, 0.0, 5.0

        def draw() -> Any:
            renderer.update_scene(world.data, view)
            return renderer.render()

        return _least(draw)
    finally:
        renderer.close()


def _ratios(ms: dict[str, float]) -> dict[str, float]:
    bare = ms["bare mujoco.Renderer, RGB, full size"]
    ratios = {}
    for name in ("mujoco", "analytic"):
        full = ms[f"{name}: expose, full frame"]
        ratios[f"{name}: full frame with everything on, over a bare render"] = full / bare
        ratios[f"{name}: full frame over 400 rows"] = full / ms[f"{name}: expose, 400 rows"]
        ratios[f"{name}: full frame over 300 x 300"] = full / ms[f"{name}: expose, 300 x 300"]
    drawn, traced = "mujoco: background, full frame", "analytic: background, full frame"
    ratios["MuJoCo's background over the analytic one, full frame"] = ms[drawn] / ms[traced]
    ratios["NumPy's normals over all electronics"] = (
        ms["NumPy: normals alone, full frame"] / ms["electronics, full frame"]
    )
    return ratios


def _least(function: Callable[[], Any], repetitions: int = _REPETITIONS) -> float:
    """Shortest time of a call [ms], after some that compile and fill caches."""
    for _ in range(min(_WARM_UP, repetitions)):
        function()
    times = []
    for _ in range(repetitions):
        begun = time.perf_counter()
        function()
        times.append(time.perf_counter() - begun)
    return 1e3 * min(times)
