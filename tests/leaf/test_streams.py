import subprocess
import sys

import numpy as np
import pytest

from dockair.streams import STREAM_NAMES, counter_key, random_stream


def test_same_seed_and_name_give_the_same_numbers():
    np.testing.assert_array_equal(random_stream(7, "gust").normal(size=100), random_stream(7, "gust").normal(size=100))


def test_same_seed_gives_the_same_numbers_in_another_process():
    """Python's own hash() of a name would not."""
    code = "from dockair.streams import *; print(counter_key(7, 'image'), random_stream(7, 'gyro').integers(2**60))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert [int(word) for word in out] == [counter_key(7, "image"), int(random_stream(7, "gyro").integers(2**60))]


def test_drawing_from_one_stream_leaves_the_others_unchanged():
    expected = random_stream(3, "gyro").normal(size=10)
    random_stream(3, "gust").normal(size=1000)
    np.testing.assert_array_equal(random_stream(3, "gyro").normal(size=10), expected)


def test_streams_and_seeds_are_uncorrelated():
    """28 + 6 pairs of 20 000 samples: |correlation| < 4.5 sigma fails by luck once in 4000."""
    n = 20_000
    streams = [random_stream(0, name).normal(size=n) for name in STREAM_NAMES]
    streams += [random_stream(seed, "gust").normal(size=n) for seed in (1, 2, 2**62)]
    correlation = np.corrcoef(streams) - np.eye(len(streams))
    assert np.abs(correlation).max() < 4.5 / np.sqrt(n)


def test_keys_fit_64_bits_and_differ_by_seed_and_name():
    keys = {counter_key(seed, name) for seed in (0, 1, 2**63 - 1) for name in STREAM_NAMES}
    assert len(keys) == 3 * len(STREAM_NAMES)
    assert all(0 <= key < 2**64 for key in keys)


def test_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(KeyError, match="gust"):
        random_stream(0, "wind")
