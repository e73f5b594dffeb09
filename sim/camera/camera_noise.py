"""Where a camera's random numbers come from."""

from dataclasses import dataclass

import numpy as np

from dockair.streams import counter_key, random_stream


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraNoise:
    """Keys of those that are functions of a place, streams of the others."""

    image: int
    fixed_pattern: int
    hot_pixels: int
    clouds: int
    transfer: np.random.Generator
    dirt: np.random.Generator

    @classmethod
    def of(cls, seed: int) -> "CameraNoise":
        """Return the named streams of a scenario's seed."""
        return cls(
            image=counter_key(seed, "image"),
            fixed_pattern=counter_key(seed, "fixed_pattern"),
            hot_pixels=counter_key(seed, "hot_pixels"),
            clouds=counter_key(seed, "clouds"),
            transfer=random_stream(seed, "frame_transfer"),
            dirt=random_stream(seed, "dirt"),
        )
