"""Independent random streams, one a source, all from the scenario's seed.

A stream's numbers depend on the seed and its own name only: switching one source of noise off, or drawing more from
it, leaves every other unchanged.
"""

from hashlib import blake2b

import numpy as np

#: Of a scenario: what a table's column of whole numbers holds.
LARGEST_SEED = 2**63 - 1

#: Every source of randomness there is; a new one is added here so that no two modules share a name by accident.
STREAM_NAMES = (
    "start",
    "gust",
    "as_built",
    "gyro",
    "accelerometer",
    "imu_clock",
    "image",
    "fixed_pattern",
    "frame_transfer",
    "clouds",
    "dirt",
    "hot_pixels",
    "inertial_velocity",
    "announcement",
    "measurements",
)


def _words(name: str) -> tuple[int, int]:
    if name not in STREAM_NAMES:
        raise KeyError(f"no random stream {name!r}; exists: {', '.join(STREAM_NAMES)}")
    digest = blake2b(name.encode(), digest_size=8).digest()
    return int.from_bytes(digest[:4], "little"), int.from_bytes(digest[4:], "little")


def random_stream(seed: int, name: str) -> np.random.Generator:
    """Generator of the named source.

    Args:
        seed: the scenario's seed, 0 to LARGEST_SEED.
        name: one of STREAM_NAMES.
    """
    return np.random.Generator(np.random.PCG64DXSM(np.random.SeedSequence((seed, *_words(name)))))


def counter_key(seed: int, name: str) -> int:
    """64-bit key of the named source, for noise that is a function of (key, frame, row, column)."""
    return int(np.random.SeedSequence((seed, *_words(name))).generate_state(1, np.uint64)[0])
