"""The off-screen context: what kind it is, and what a machine without one is told."""

import sys
import threading

import mujoco
import numpy as np
import pytest

from dockair.errors import DockairError, MachineError
from dockair.sim import off_screen
from dockair.sim.off_screen import Canvas, gl_context, open_renderer

MODEL = mujoco.MjModel.from_xml_string("<mujoco><visual><quality offsamples='4'/></visual></mujoco>")
FONT = 50


def test_a_machine_without_opengl_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_context(width: int, height: int) -> None:
        raise ImportError("libEGL.so.1: cannot open shared object file")

    monkeypatch.setattr(off_screen, "gl_context", no_context)
    with pytest.raises(MachineError, match="libegl1 libgl1-mesa-dri libopengl0") as caught:
        open_renderer(MODEL, 8, 8, FONT, "camera")
    assert caught.value.exit_code == 3


def test_a_renderer_that_fails_leaves_no_context_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    freed = []

    class Context:
        def make_current(self) -> None:
            raise RuntimeError("no surface")

        def free(self) -> None:
            freed.append(self)

    monkeypatch.setattr(off_screen, "gl_context", lambda width, height: Context())
    with pytest.raises(MachineError, match="render: .*no surface.*; type: sudo apt-get install -y libegl1"):
        open_renderer(MODEL, 8, 8, FONT, "render")
    assert len(freed) == 1
    assert MODEL.vis.quality.offsamples == 4


@pytest.mark.gl
@pytest.mark.parametrize("use", ["render", "close"])
def test_a_canvas_that_another_thread_uses_is_refused_with_the_names_of_both(use: str) -> None:
    canvas, said = Canvas(MODEL, 8, 8, "camera"), []
    do = {"close": canvas.close, "render": lambda: canvas.render(mujoco.MjvScene(), np.empty((8, 8, 3), np.uint8))}

    def refused() -> None:
        with pytest.raises(DockairError) as caught:
            do[use]()
        said.append(str(caught.value))

    other = threading.Thread(target=refused, name="other")
    other.start()
    other.join()
    assert said == ["camera: expected the thread in which its OpenGL context was made, 'MainThread', got 'other'"]
    canvas.close()


@pytest.mark.gl
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL is Linux's")
def test_the_context_is_egl_even_when_mujoco_was_imported_for_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    context = gl_context(8, 8)
    context.free()
    assert "egl" in type(context).__module__


@pytest.mark.gl
def test_the_renderer_has_no_multisampling_and_the_model_keeps_its_own() -> None:
    context, renderer = open_renderer(MODEL, 8, 8, FONT, "camera")
    try:
        assert renderer.offSamples == 0
        assert (renderer.offWidth, renderer.offHeight) == (8, 8)
        assert MODEL.vis.quality.offsamples == 4
    finally:
        renderer.free()
        context.free()


def _balls_scene(model: mujoco.MjModel) -> mujoco.MjvScene:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    view = mujoco.MjvCamera()
    view.azimuth, view.elevation, view.distance, view.lookat[:] = 0.0, 0.0, 4.0, (4.0, 0.0, 0.0)
    scene = mujoco.MjvScene(model, 10)
    everything = mujoco.mjtCatBit.mjCAT_ALL.value
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, view, everything, scene)
    scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = 0
    return scene


@pytest.mark.gl
def test_a_picture_does_not_depend_on_how_large_the_one_before_was() -> None:
    """Smaller, the same, larger than the buffer was made; nothing of another picture is left in it."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom size='0.2' pos='4 0 -0.8' rgba='1 1 1 1'/></worldbody></mujoco>"
    )
    scene, canvas = _balls_scene(model), Canvas(model, 100, 90, "camera")
    pictures: dict[tuple[int, int], list[bytes]] = {}
    for shape in ((90, 100), (60, 80), (130, 120), (61, 80), (60, 80), (90, 100), (130, 120)):
        colours, depths = np.empty((*shape, 3), dtype=np.uint8), np.empty(shape, dtype=np.float32)
        canvas.render(scene, colours, depths)
        assert colours.max() > 30
        pictures.setdefault(shape, []).append(colours.tobytes() + depths.tobytes())
    canvas.close()
    assert all(len(set(same)) == 1 for same in pictures.values())


@pytest.mark.gl
def test_a_canvas_reads_colours_and_depths_from_the_bottom_row_up() -> None:
    """A ball in the lower half of the view, 4 m away; depth is 0 at the near plane, 1 at the far one."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom size='0.2' pos='4 0 -0.8' rgba='1 1 1 1'/></worldbody></mujoco>"
    )
    scene = _balls_scene(model)
    colours, depths = np.empty((60, 80, 3), dtype=np.uint8), np.empty((60, 80), dtype=np.float32)
    canvas = Canvas(model, 100, 90, "camera")
    canvas.render(scene, colours, depths)
    canvas.close()
    canvas.close()  # twice is once
    shown = colours[..., 0] > 30
    rows, columns = np.nonzero(shown)
    assert rows.size > 10 and rows.max() < 30
    assert columns.mean() == pytest.approx(39.5, abs=1.0)
    near, far = scene.camera[0].frustum_near, scene.camera[0].frustum_far
    metres = near * far / (far - depths * (far - near))
    assert metres[shown].min() == pytest.approx(3.8, abs=0.02)
    assert np.all(depths[~shown & (np.roll(shown, 1, axis=0) == 0)] > 0.999)
