"""The benchmark adds up; how fast it is belongs to the machine and is not tested."""

import pytest

from dockair.scenarios.bench.run import PARTS, bench
from dockair.scenarios.schema import load_scenario

pytestmark = [pytest.mark.slow, pytest.mark.gl]


def test_shares_add_up_and_every_part_was_called():
    report = bench(load_scenario("still_air"), seconds=0.4)
    table = report.to_json()
    assert report.simulated_s == pytest.approx(0.4)
    assert report.frames == 20
    assert set(table["share"]) == {*PARTS, "other"}
    assert sum(table["share"].values()) == pytest.approx(1.0)
    assert all(share >= 0.0 for share in table["share"].values())
    assert report.calls_by_part["physics"] == 400
    assert report.calls_by_part["navigation"] == 40
    assert report.calls_by_part["render"] == report.calls_by_part["sensor"] == 20
    assert all(report.calls_by_part[part] > 0 for part in PARTS)
    assert report.real_time_factor == pytest.approx(report.simulated_s / report.wall_s)


def test_the_stopwatches_are_gone_afterwards():
    from dockair.nav import ring_finder
    from dockair.nav.image.detect import detect

    bench(load_scenario("still_air"), seconds=0.05)
    assert ring_finder.detect is detect


def test_the_image_bench_counts_the_leds_of_its_frames_and_times_every_detector(monkeypatch):
    from dockair.scenarios.bench import image

    monkeypatch.setattr(image, "TITLES", ("30 m", "6 m, Sun behind", "night"))
    for name in ("_REPETITIONS", "_TRIAL_REPETITIONS", "_WINDOW_REPETITIONS", "_CASES", "_CASE_REPETITIONS"):
        monkeypatch.setattr(image, name, 1)
    figures = image.bench_image()
    recall, by_frame = figures["recall"], figures["found_by_frame"]
    assert all(ms > 0.0 for ms in figures["milliseconds"].values())
    assert {row["visible"] for row in recall.values()} == {sum(row["visible"] for row in by_frame.values())}
    for name, row in recall.items():
        assert row["found"] == sum(figures[name] for figures in by_frame.values())
        assert f"{name}: mean frame" in figures["milliseconds"]
    assert set(figures["chosen"]) == set(recall) - {"detect", 'detect, method "frame"'}
    assert by_frame["night"]["detect"] == by_frame["night"]["visible"] == 8
    # nobody finds more than ours does, and all others report more blobs that are no LEDs
    assert all(row["found"] <= recall["detect"]["found"] for row in recall.values())
    assert all(row["others"] > recall["detect"]["others"] for name, row in recall.items() if name != "detect")


def test_identification_is_timed_on_forty_candidates_of_which_eight_are_a_ring():
    import numpy as np

    from dockair.calibration import Camera
    from dockair.nav.identify.ring import identify
    from dockair.scenarios.bench.image import _ring_among_clutter

    points = _ring_among_clutter(np.random.default_rng(1), Camera())
    assert points.shape == (40, 2)
    found = identify(points, camera=Camera())
    assert found.status.name == "FOUND"
    assert len(found.members) == 8


def test_the_world_bench_times_mujoco_and_every_part_of_ours(monkeypatch):
    from dockair.scenarios.bench import world as bench_of_world

    for name in ("_SETTLE_TICKS", "_ROUNDS", "_TICKS", "_WARM_TICKS"):
        monkeypatch.setattr(bench_of_world, name, 2)
    figures = bench_of_world.bench_world()
    assert set(bench_of_world._PARTS) < set(figures["microseconds"])
    assert all(value > 0.0 for values in figures.values() for value in values.values())
