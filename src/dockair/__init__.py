"""Dockair: a test bed for autonomous aerial refuelling by vision.

Importing this package makes the gymnasium environments known by *string* entry points and loads nothing else:
neither gymnasium itself nor MuJoCo. When gymnasium is imported later, the registration happens then.
"""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

__version__ = "0.1.0"

ENVIRONMENTS = {
    "dockair/Dock-v0": "dockair.scenarios.envs:DockEnv",
    "dockair/DockFast-v0": "dockair.scenarios.envs:DockFastEnv",
    "dockair/DockPixels-v0": "dockair.scenarios.envs:DockPixelsEnv",
}


def _register_environments() -> None:
    from gymnasium.envs.registration import register, registry

    for environment_id, entry_point in ENVIRONMENTS.items():
        if environment_id not in registry:
            # gymnasium's checker takes a first reset or step that was refused for one that it has checked
            register(environment_id, entry_point=entry_point, disable_env_checker=True)


class _RegisterWhenGymnasiumIsImported(MetaPathFinder):
    """Finds `gymnasium` as usual and registers our environments after it has been executed.

    Importing gymnasium here instead would load it into every process that only wants `dockair.nav`.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != "gymnasium":
            return None
        others = [finder for finder in sys.meta_path if finder is not self]  # an editable gymnasium has one of its own
        found = (finder.find_spec(fullname, path, target) for finder in others)
        spec = next((spec for spec in found if spec is not None), None)
        if spec is None or spec.loader is None:
            return None
        execute = spec.loader.exec_module

        def execute_and_register(module: ModuleType) -> None:
            if self in sys.meta_path:  # stays until then: a spec may be asked for and never executed
                sys.meta_path.remove(self)
            execute(module)
            _register_environments()

        spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec


if "gymnasium" in sys.modules:
    _register_environments()
else:
    sys.meta_path.insert(0, _RegisterWhenGymnasiumIsImported())
