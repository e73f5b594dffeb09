"""How fast the sensors' stages are on this machine, beside what a user would take instead.

A time is the least of many repetitions in one process, after some that compile. What is compared is timed by turns, a
few repetitions each. Times are the processor's, OpenGL's own threads included, so that other processes do not count.

A time differs more from one start of a process to the next than within one: what takes two milliseconds in this may
take three in that. So everything is measured in several fresh processes, one after the other. Reported are the medians
over them, of a ratio that of the ratios within each process, with the lowest and the highest beside it. Speeds are
benchmarks, never tests: they belong to the machine that printed them.
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from statistics import median
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from dockair.messages import Window
from dockair.scenarios.assembly.parts import Parts, build, camera_sheets
from dockair.scenarios.doctor import require_rendering
from dockair.scenarios.schema import Scenario
from dockair.sim.camera.camera import NearInfraredCamera
from dockair.sim.camera.electronics import digitise
from dockair.sim.camera.fixed_pattern import FixedPattern
from dockair.sim.world import World

_PROCESSES = 5
_TURNS, _EACH = 10, 4
_ROWS = Window(344, 744, 0, 2048)
_SMALL = Window(394, 694, 874, 1174)
_FULL = Window(0, 1088, 0, 2048)
_WARM_UP = 3

Stages = dict[str, Callable[[], Any]]


def bench_sensors(scenario: Scenario) -> dict[str, Any]:
    """Return {"milliseconds": {what: ms}, "ratios": {what: ratio}}, the medians over processes.

    Of each ratio "what, lowest" and "what, highest" stand among the ratios, too.

    Args:
        scenario: whose start is looked at, with its own seed.

    Raises:
        MachineError: there is no off-screen OpenGL to compare with.
    """
    require_rendering()
    runs = _in_fresh_processes(_measure, scenario)
    milliseconds = {what: median(times) for what, times in _by_name(runs)}
    ratios: dict[str, float] = {}
    for what, values in _by_name([_ratios(run) for run in runs]):
        ratios |= {what: median(values), f"{what}, lowest": min(values), f"{what}, highest": max(values)}
    return {"milliseconds": milliseconds, "ratios": ratios}


def _in_fresh_processes(measure: Callable[..., Any], *arguments: Any) -> list[Any]:
    """Return what a function does in several processes, each begun when the one before has ended."""
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as pool:
        return [pool.submit(measure, *arguments).result() for _ in range(_PROCESSES)]


def _by_name(runs: Sequence[dict[str, float]]) -> Iterable[tuple[str, list[float]]]:
    """Yield (name, figures of all runs)."""
    return ((name, [run[name] for run in runs]) for name in runs[0])


def _measure(scenario: Scenario) -> dict[str, float]:
    """Return {what: ms} of this process."""
    names = ("mujoco", "analytic")
    parts = [_with_background(scenario, name) for name in names]
    world, imu = parts[0].world, parts[0].imu
    stages: Stages = {}
    try:
        for name, each in zip(names, parts, strict=True):
            assert isinstance(each.camera, NearInfraredCamera)
            stages |= _camera_stages(each.camera, each.world, name)
        milliseconds = _least(stages | _electronics(scenario))
    finally:
        for each in parts:
            if each.camera is not None:
                each.camera.close()
    milliseconds |= _least(_random_numbers(), turns=1)
    milliseconds["bare mujoco.Renderer, RGB, full size"] = _bare_renderer(world)
    return milliseconds | _least({"IMU sample": lambda: imu.step(0.0, np.zeros(3), np.zeros(3), np.zeros(3))})


def _with_background(scenario: Scenario, name: str) -> Parts:
    options = scenario.camera.model_copy(update={"sensing": "frames", "background": name})
    return build(scenario.model_copy(update={"camera": options}), scenario.seed)


def _camera_stages(camera: NearInfraredCamera, world: World, name: str) -> Stages:
    stages: Stages = {}
    for what, window in (("full frame", _FULL), ("400 rows", _ROWS), ("300 x 300", _SMALL)):
        stages[f"{name}: expose, {what}"] = partial(camera.expose, world.data, 0.0, 0, window)
        out = np.empty(window.shape, dtype=np.float32)  # `expose`, too, has its memory already
        stages[f"{name}: without electronics, {what}"] = partial(camera.expected_electrons, world.data, window, out=out)
        stages[f"{name}: background, {what}"] = partial(camera.background_electrons, world.data, window, out=out)
    return stages


def _electronics(scenario: Scenario) -> Stages:
    """Of a full frame."""
    sensor, expected = camera_sheets(scenario).sensor, _levels()
    pattern = FixedPattern(sensor, 1, *expected.shape)
    return {"electronics, full frame": lambda: digitise(expected, sensor, pattern, 1, 0, (0, 0), 2e-5)}


def _random_numbers() -> Stages:
    """NumPy's own, for the electronics of a full frame."""
    rng, expected = np.random.default_rng(0), _levels()
    return {
        "NumPy: normals alone, full frame": lambda: rng.standard_normal(expected.shape, dtype=np.float32),
        "NumPy: Poisson alone, full frame": lambda: rng.poisson(expected),
    }


def _levels() -> NDArray[np.float32]:
    """Expected electrons of a full frame, of all levels."""
    return np.random.default_rng(0).uniform(20.0, 3000.0, _FULL.shape).astype(np.float32)


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

        return _least({"": draw}, turns=2)[""]
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


def _least(stages: Stages, turns: int = _TURNS) -> dict[str, float]:
    """Shortest time of each [ms], after some that compile and fill caches."""
    least = dict.fromkeys(stages, math.inf)
    for function in stages.values():
        for _ in range(_WARM_UP):
            function()
    for _ in range(turns):
        for name, function in stages.items():
            for _ in range(_EACH):
                begun = time.process_time()
                function()
                least[name] = min(least[name], 1e3 * (time.process_time() - begun))
    return least
