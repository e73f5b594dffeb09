"""Each source of noise in a flight has a random stream to itself."""

import sys

import numpy as np
import pytest

from dockair.scenarios.assembly import measured as build_measured
from dockair.scenarios.assembly import parts as build_module
from dockair.scenarios.loop import Flight
from dockair.scenarios.schema import load_scenario
from dockair.sim.camera import camera_noise
from dockair.streams import STREAM_NAMES, counter_key, random_stream

SEED = 5
CAMERA = {"image", "fixed_pattern", "hot_pixels", "clouds", "frame_transfer", "dirt"}
#: What there is no noise of, by how a scenario is sensed.
UNUSED = {"frames": {"measurements"}, "measurements": set(), "truth": CAMERA | {"measurements"}}
#: Of a stream; who is given one spawned from it has a stream of its own.
DRAWS = [name for name in dir(np.random.Generator) if name[0] != "_" and name not in ("bit_generator", "spawn")]


class WatchedStream(np.random.Generator):
    """A stream that notes who draws from it: the function's file, and the object it is a method of."""

    def __init__(self, bit_generator):
        super().__init__(bit_generator)
        self.drawn_by = set()


def _watched(method):
    def draw(stream, *arguments, **settings):
        caller = sys._getframe(1)
        stream.drawn_by.add((caller.f_code.co_filename, id(caller.f_locals.get("self"))))
        return getattr(np.random.Generator, method)(stream, *arguments, **settings)

    return draw


for _method in DRAWS:
    setattr(WatchedStream, _method, _watched(_method))


def watched_stream(seed, name):
    return WatchedStream(random_stream(seed, name).bit_generator)


@pytest.fixture
def asked(monkeypatch):
    """(name, stream or key) of all that a flight asks for with its own seed."""
    found = []

    def asking(make):
        def ask(seed, name):
            made = make(seed, name)
            if seed == SEED:  # of another seed nothing is drawn (`buildable`)
                found.append((name, made))
            return made

        return ask

    for module in (build_module, build_measured, camera_noise):
        monkeypatch.setattr(module, "random_stream", asking(watched_stream))
    monkeypatch.setattr(camera_noise, "counter_key", asking(counter_key))
    monkeypatch.setattr(build_module, "SETTLE_S", 0.0)
    return found


def fly_a_little(sensing):
    how = {"navigation.navigator": "truth"} if sensing == "truth" else {"camera.sensing": sensing}
    gusts = {"turbulence.model": "dryden", "turbulence.intensity": "light"}
    flight = Flight(load_scenario("racetrack", {"camera.background": "analytic"} | gusts | how), SEED)
    for _ in range(6):
        flight.step()
    return flight


@pytest.mark.parametrize("sensing", list(UNUSED))
def test_every_stream_is_asked_for_once_and_only_one_draws_from_it(sensing, asked):
    fly_a_little(sensing).close()
    assert sorted(name for name, _ in asked) == sorted(set(STREAM_NAMES) - UNUSED[sensing])
    drawn_by = {name: stream.drawn_by for name, stream in asked if isinstance(stream, WatchedStream)}
    assert {name: callers for name, callers in drawn_by.items() if len(callers) > 1} == {}
    not_drawn = {name for name, callers in drawn_by.items() if not callers}
    assert not_drawn <= {"dirt"}  # of which a copy is drawn, and only where the window is dirty
