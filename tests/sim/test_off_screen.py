"""The off-screen context: what kind it is, and what a machine without one is told."""

import sys

import mujoco
import pytest

from dockair.errors import MachineError
from dockair.sim import off_screen
from dockair.sim.off_screen import gl_context, open_renderer

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
    with pytest.raises(MachineError, match="render: .*no surface"):
        open_renderer(MODEL, 8, 8, FONT, "render")
    assert len(freed) == 1
    assert MODEL.vis.quality.offsamples == 4


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
