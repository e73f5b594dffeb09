"""Whether there is OpenGL: which background that means, and that MuJoCo can be imported without it."""

import os
import subprocess
import sys

import pytest

from dockair.errors import DockairError
from dockair.sim import opengl
from dockair.sim.opengl import Trial, available_backend, kind_of_context, try_drawing, why_analytic

#: Takes libEGL and its kin away from a fresh interpreter, then runs what follows.
WITHOUT_LIBRARIES = """
import ctypes
class Missing(ctypes.CDLL):
    def __init__(self, name, *more, **options):
        if any(part in str(name) for part in ("libEGL", "libGL", "libOpenGL", "OSMesa")):
            raise OSError(f"{name}: cannot open shared object file")
        super().__init__(name, *more, **options)
ctypes.CDLL = ctypes.cdll._dlltype = Missing
"""
needs_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL and OSMesa are Linux's")


@pytest.fixture(autouse=True)
def forget() -> None:
    """What another test has tried."""
    opengl._trial.cache_clear()


def _run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    inherited = {key: value for key, value in os.environ.items() if key != "PYOPENGL_PLATFORM"}  # set by MuJoCo
    return subprocess.run([sys.executable, "-c", code], env=inherited | environment, capture_output=True, text=True)


@pytest.mark.parametrize(("trial", "backend"), [(Trial("llvmpipe"), "mujoco"), (Trial("", "why"), "analytic")])
def test_auto_is_mujoco_where_it_can_draw_and_is_tried_once(
    monkeypatch: pytest.MonkeyPatch, trial: Trial, backend: str
) -> None:
    tried = []
    monkeypatch.setattr(opengl, "try_drawing", lambda: tried.append(1) or trial)
    assert [available_backend(), available_backend("auto")] == [backend, backend]
    assert why_analytic() == trial.reason
    assert len(tried) == 1


@pytest.mark.parametrize("wanted", ["mujoco", "analytic"])
def test_a_background_that_was_asked_for_is_not_tried(monkeypatch: pytest.MonkeyPatch, wanted: str) -> None:
    monkeypatch.setattr(opengl, "try_drawing", lambda: pytest.fail("tried"))
    assert available_backend(wanted) == wanted


def test_an_unknown_background_is_refused_with_those_that_exist() -> None:
    with pytest.raises(DockairError, match="camera.background: .* got 'vulkan'; exists: auto, mujoco, analytic"):
        available_backend("vulkan")


@pytest.mark.parametrize("word", ["disabled", "off", "0", "False"])
def test_opengl_that_is_switched_off_is_not_tried(monkeypatch: pytest.MonkeyPatch, word: str) -> None:
    monkeypatch.setenv("MUJOCO_GL", word)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("tried"))
    assert try_drawing() == Trial("", f"MUJOCO_GL is {word}")


def test_what_fails_is_said_in_one_line_and_its_own_words_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "egl")
    trial = try_drawing("print('half'); raise ImportError('no driver')")
    assert trial == Trial("", "no picture through egl", "ImportError: no driver")
    assert try_drawing("import os; os.abort()").reason == "no picture through egl"
    assert try_drawing("import time; time.sleep(60)", 0.3).reason == "no picture within 0 s"


@needs_linux
def test_egl_is_the_kind_where_nobody_chose() -> None:
    assert kind_of_context({}) == "egl"
    assert kind_of_context({"MUJOCO_GL": " EGL "}) == "egl"
    assert kind_of_context({"MUJOCO_GL": "glfw"}) == "glfw"


@pytest.mark.gl
def test_this_machine_says_who_renders() -> None:
    assert try_drawing().renderer
    assert available_backend() == "mujoco" and why_analytic() == ""


@needs_linux
@pytest.mark.parametrize("kind", ["egl", "osmesa"])
def test_mujoco_can_be_imported_where_the_library_asked_for_is_missing(kind: str) -> None:
    """And without our help it cannot: should MuJoCo learn to, the help may go."""
    bare = _run(WITHOUT_LIBRARIES + "import mujoco", MUJOCO_GL=kind)
    assert bare.returncode != 0
    helped = _run(WITHOUT_LIBRARIES + "import dockair.sim; import mujoco", MUJOCO_GL=kind)
    assert helped.returncode == 0, helped.stderr


@needs_linux
def test_mujoco_can_be_imported_where_a_context_is_asked_for_that_it_does_not_know() -> None:
    assert _run("import mujoco", MUJOCO_GL="nosuch").returncode != 0
    helped = _run("import dockair.sim; import mujoco", MUJOCO_GL="nosuch")
    assert helped.returncode == 0, helped.stderr


@needs_linux
@pytest.mark.parametrize(
    ("there", "left"), [("libEGL.so.1 libGL.so.1", "egl"), ("libEGL.so.1", "disabled"), ("libGL.so.1", "disabled")]
)
def test_egl_needs_its_own_library_and_one_of_opengls(there: str, left: str) -> None:
    code = (
        "from dockair.sim import opengl; import os;"
        f"opengl._loads = {there.split()}.__contains__; opengl.let_mujoco_be_imported(); print(os.environ['MUJOCO_GL'])"
    )
    assert _run(code, MUJOCO_GL="egl").stdout.strip() == left


@needs_linux
@pytest.mark.gl
def test_a_library_that_is_there_stays_chosen() -> None:
    code = (
        "from dockair.sim.opengl import let_mujoco_be_imported as let; let(); import os; print(os.environ['MUJOCO_GL'])"
    )
    assert _run(code, MUJOCO_GL="egl").stdout.strip() == "egl"
