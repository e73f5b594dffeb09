"""The loop's benchmark adds up; how fast it is belongs to the machine and is not tested."""

from types import SimpleNamespace

import pytest

from dockair.scenarios.bench import loop


def test_of_every_case_the_fastest_turn_stands_beside_median_and_slowest(monkeypatch):
    asked, speeds = [], iter([3.0, 6.0, 5.0])

    def at_once(what, count):
        asked.append((what, count))
        speed = next(speeds) if what == "windowed, 50 Hz" else 4.0
        return [{"x_real_time": speed, "wall_s": 20.0 / speed}] * count

    monkeypatch.setattr(loop, "_FLIGHTS", 3)
    monkeypatch.setattr(loop, "_at_once", at_once)
    monkeypatch.setattr(loop, "environment_speeds", dict)
    flights = loop.bench_loop()["flights"]
    assert asked == 3 * ([(what, 1) for what in loop.CASES] + [("windowed, 50 Hz, one process", 2)])
    assert list(flights) == list(loop.CASES)
    found = {"x_real_time": 6.0, "median": 5.0, "slowest": 3.0, "wall_s": pytest.approx(20.0 / 6.0)}
    assert flights["windowed, 50 Hz"] == found
    assert flights["perfect navigation"]["slowest"] == 4.0


def test_two_flights_at_once_are_compared_with_one_alone_of_the_same_turn(monkeypatch):
    alone, pairs = iter([5.0, 2.0, 4.0]), iter([(4.0, 4.5), (2.0, 2.0), (2.0, 2.0)])

    def at_once(what, count):
        if what != "windowed, 50 Hz, one process":
            return [{"x_real_time": 1.0}]
        return [{"x_real_time": speed} for speed in ((next(alone),) if count == 1 else next(pairs))]

    monkeypatch.setattr(loop, "_FLIGHTS", 3)
    monkeypatch.setattr(loop, "_at_once", at_once)
    monkeypatch.setattr(loop, "environment_speeds", lambda: {"dockair/DockFast-v0": 300.0, "Humanoid-v5": 200.0})
    assert loop.bench_loop()["ratios"] == {
        "two flights at once over one": pytest.approx(8.5 / 5.0),  # of 1.7, 2 and 1
        "steps a second, DockFast-v0 over Humanoid-v5": pytest.approx(1.5),
    }


def test_an_environment_that_cannot_be_made_here_is_left_out(monkeypatch):
    monkeypatch.setattr(loop, "_at_once", lambda _, count: [{"x_real_time": 1.0}] * count)
    monkeypatch.setattr(loop, "environment_speeds", lambda: {"dockair/DockFast-v0": 300.0})
    assert list(loop.bench_loop()["ratios"]) == ["two flights at once over one"]


class _Environment:
    """Steps of 2 s, resets of 100 s; the third step is truncated, the fifth terminates."""

    def __init__(self):
        self.now_s, self.steps, self.resets = 0.0, 0, []
        self.action_space = SimpleNamespace(sample=lambda: None, seed=lambda seed: None)

    def reset(self, seed=None):
        self.now_s += 100.0
        self.resets.append(self.steps)

    def step(self, action):
        self.now_s += 2.0
        self.steps += 1
        return None, 0.0, self.steps == 5, self.steps == 3, {}

    def close(self):
        pass


def test_only_steps_are_timed_and_an_episode_that_is_over_begins_anew(monkeypatch):
    environment = _Environment()
    monkeypatch.setattr(loop.time, "process_time", lambda: environment.now_s)
    assert loop._time_of_steps(environment) == 2.0 * loop._STEPS
    assert environment.resets == [3, 5]


def test_an_environment_s_speed_is_that_of_its_quickest_turn(monkeypatch):
    """Humanoid-v5 cannot be made here."""
    import gymnasium

    def make(name):
        if name == "Humanoid-v5":
            raise gymnasium.error.DependencyNotInstalled(name)
        return _Environment()

    times_s = iter([3.0, 2.0, 5.0])
    monkeypatch.setattr(gymnasium, "make", make)
    monkeypatch.setattr(loop, "_TURNS", 3)
    monkeypatch.setattr(loop, "_time_of_steps", lambda environment: next(times_s))
    assert loop.environment_speeds() == {"dockair/DockFast-v0": loop._STEPS / 2.0}


def test_a_flight_that_fails_in_its_process_ends_the_bench(monkeypatch):
    monkeypatch.setattr(loop, "_SCRIPT", "raise SystemExit(3)")
    with pytest.raises(loop.subprocess.CalledProcessError):
        loop.bench_loop()


@pytest.mark.slow
def test_speed_is_simulated_over_wall_time_without_the_first_second():
    figures = loop.fly_timed("windowed, 50 Hz", seconds=0.5)
    assert figures["simulated_s"] == pytest.approx(0.5)
    assert figures["x_real_time"] == pytest.approx(figures["simulated_s"] / figures["wall_s"])
    assert figures["frames_per_s"] * figures["wall_s"] == pytest.approx(25.0)
    assert 0.0 < figures["flight_process_s"] and 0.0 < figures["camera_process_s"]
    longer = max(figures["flight_process_s"], figures["camera_process_s"])
    assert figures["x_of_own_time"] == pytest.approx(0.5 / longer)
    assert figures["load"] > 0.0
    assert 0.0 < figures["waited_s"] < figures["wall_s"]


def test_the_time_of_processes_beside_is_that_of_their_work():
    """As much as a child that works for a quarter of a second says of itself, before it is read and after."""
    ours, theirs = loop.multiprocessing.get_context("fork").Pipe()
    child = loop.multiprocessing.get_context("fork").Process(target=_work, args=(theirs, 0.25), daemon=True)
    assert loop._children_s() == 0.0
    child.start()
    before_s = ours.recv()
    read_s = loop._children_s()
    ours.send("go on")
    assert 0.2 < before_s - 1e-9 <= read_s <= ours.recv() + 1e-9  # all in the system's hundredths
    ours.send("end")
    child.join()
    assert loop._children_s() == 0.0


def _work(pipe, seconds):
    while loop.time.process_time() < seconds:
        pass
    for _ in ("before", "after"):
        own = loop.os.times()
        pipe.send(own.user + own.system)
        pipe.recv()
