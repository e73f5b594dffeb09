"""The gymnasium environments: fly the receiver (docs/environments.md)."""

from dockair.scenarios.envs.dock import DockEnv, DockFastEnv, DockPixelsEnv

__all__ = ["DockEnv", "DockFastEnv", "DockPixelsEnv"]
