"""A replay gives the flight's estimates bit for bit, or says where it does not, and no simulator can help it."""

import json
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import dockair
from dockair.errors import DockairError
from dockair.messages import Light, PodSignal, TankerAnnouncement
from dockair.scenarios.message_log import ESTIMATES, MESSAGES, MessageLog
from dockair.scenarios.navigator_recipe import NAVIGATOR, NavigatorRecipe, code_fingerprint
from dockair.scenarios.replay import FORBIDDEN, _RefuseForbiddenModules, replay, replay_in_this_process, same_bits

SUMS = '''
import numpy as np
from dockair.messages import NavSolution, ReceiverCommand
{imports}

class Sums:
    """Believes the running sum of everything it was told: every bit of every message matters."""

    def __init__(self, sheets):
        self.sheets, self.total = sheets, np.zeros(3)

    def announce(self, announcement):
        self.total = self.total + announcement.turn_rate_rad_s

    def signal(self, signal):
        self.total = self.total * (1.0 + signal.light.value)

    def step(self, imu, frame):
        for sample in imu:
            self.total = self.total * 0.9 + sample.angular_rate_rad_s + sample.time_stamp_s
        if frame is not None:
            self.total = self.total + np.sqrt(frame.pixels.astype(float)).mean() / (1.0 + frame.window.row_start)
        return NavSolution(
            time_stamp_s=imu[-1].time_stamp_s, valid=True, phase="approach", status="summed", p_PD_B=self.total,
            v_PD_B=imu[-1].angular_rate_rad_s / 3.0, R_BD=np.eye(3),
            covariance=np.full((9, 9), np.nan), command=ReceiverCommand(), frame_time_stamp_s=float("nan"),
            window=None if frame is None else frame.window,
            candidates_px=np.empty((0, 2)), led_pixels_px=np.full((8, 2), np.nan),
        )
'''

SAID = TankerAnnouncement(time_stamp_s=0.12, starts_s=12.25, entry_s=10.0, turn_rate_rad_s=0.0254, climb_rad=0.0)
SHOWN = PodSignal(time_stamp_s=0.18, light=Light.RED)


@pytest.mark.parametrize(
    ("files", "got"),
    [
        (["result.json"], "a flight that kept no frames: navigator.json is not there"),
        (["result.json", NAVIGATOR, ESTIMATES], "a flight that kept no frames: messages.parquet is not there"),
        ([], "no flight: navigator.json is not there"),
    ],
)
def test_a_folder_without_frames_is_refused_in_plain_words(tmp_path, files, got):
    for name in files:
        (tmp_path / name).touch()
    expected = "a flight by camera, recorded with --record window or full"
    with pytest.raises(DockairError) as refused:
        replay(tmp_path)
    assert str(refused.value) == f"{tmp_path}: expected {expected}, got '{got}'"


@pytest.fixture
def record(hand_made, tmp_path, monkeypatch):
    """Record a flight of a navigator that is a module of the user's own."""

    def recorded(imports: str = "", ticks: int = 40):
        module = f"users_navigator_{abs(hash(imports))}"
        (tmp_path / f"{module}.py").write_text(textwrap.dedent(SUMS.replace("{imports}", imports)))
        monkeypatch.syspath_prepend(str(tmp_path))
        recipe = NavigatorRecipe(class_name=f"{module}:Sums", sheets=hand_made.sheets)
        navigator = recipe.build()
        out = tmp_path / "flight"
        out.mkdir()
        with MessageLog(out, recipe) as log:
            for k, (_, imu, frame, _) in enumerate(hand_made.ticks(ticks)):
                said, shown = (SAID if k == 11 else None), (SHOWN if k == 17 else None)
                if said is not None:
                    navigator.announce(said)
                if shown is not None:
                    navigator.signal(shown)
                log.append(imu, frame, navigator.step(imu, frame), said, shown)
        return out

    return recorded


def _edit(path, column: str, row: int, value) -> None:
    table = pq.read_table(path)
    entries = table[column].to_pylist()
    entries[row] = value(entries[row])
    index = table.schema.get_field_index(column)
    pq.write_table(table.set_column(index, table.schema.field(column), pa.array(entries, table[column].type)), path)


def test_a_recorded_flight_replays_bit_for_bit(record):
    report = replay(record())
    assert report.identical
    assert (report.ticks, report.frames) == (40, 20)
    assert report.first_difference is None


def test_a_gyro_sample_changed_in_its_last_bit_is_found(record):
    out = record()
    _edit(out / MESSAGES, "gyro_angular_rate_rad_s", 25, lambda v: [*v[:-1], np.nextafter(v[-1], 1.0)])
    report = replay(out)
    assert not report.identical
    assert report.first_difference is not None
    assert (report.first_difference.tick, report.first_difference.field) == (25, "v_PD_B")


def test_an_estimate_changed_in_its_last_bit_is_found(record):
    out = record()
    _edit(out / ESTIMATES, "v_PD_B", 7, lambda v: [np.nextafter(v[0], 1e9), *v[1:]])
    report = replay(out)
    assert report.first_difference is not None
    assert (report.first_difference.tick, report.first_difference.field) == (7, "v_PD_B")


def test_an_estimate_that_a_recording_of_before_does_not_have_is_a_difference(record):
    out = record()
    pq.write_table(pq.read_table(out / ESTIMATES).drop_columns(["heading_rad"]), out / ESTIMATES)
    report = replay_in_this_process(out)
    assert (report.identical, report.ticks) == (False, 0)
    assert (report.first_difference.field, report.first_difference.recorded) == ("heading_rad", "nothing")


def test_a_difference_says_whether_the_code_is_still_the_flights(record):
    out = record()
    _edit(out / ESTIMATES, "valid", 0, lambda v: [0.0])
    assert "have changed since the flight" not in str(replay(out))
    recipe = json.loads((out / NAVIGATOR).read_text())
    (out / NAVIGATOR).write_text(json.dumps(recipe | {"code": "another"}))
    assert "have changed since the flight" in str(replay(out))


def test_a_navigator_of_ones_own_that_has_changed_since_the_flight_is_said_to_have(record, tmp_path):
    out = record()
    (module,) = tmp_path.glob("users_navigator_*.py")
    module.write_text(module.read_text().replace("0.9", "0.8"))
    assert "have changed since the flight" in str(replay(out))


@pytest.mark.parametrize("name", ["rotations.py", "nav/navigator.py"])
def test_sources_below_the_navigation_are_its_code_too(tmp_path, monkeypatch, name):
    source, copy = Path(dockair.__file__).parent, tmp_path / "dockair"
    shutil.copytree(source / "nav", copy / "nav", ignore=shutil.ignore_patterns("__pycache__"))
    for leaf in source.glob("*.py"):
        shutil.copy(leaf, copy)
    before = code_fingerprint("dockair.nav.navigator:Navigator")
    monkeypatch.setattr(dockair, "__file__", str(copy / "__init__.py"))
    assert code_fingerprint("dockair.nav.navigator:Navigator") == before
    (copy / name).write_text((copy / name).read_text() + "# changed\n")
    assert code_fingerprint("dockair.nav.navigator:Navigator") != before


def test_a_recording_that_was_cut_off_is_refused(record):
    out = record()
    pq.write_table(pq.read_table(out / ESTIMATES).slice(0, 39), out / ESTIMATES)
    with pytest.raises(DockairError, match="cut-off recording"):
        replay(out)


@pytest.mark.parametrize(
    ("name", "damage", "got"),
    [
        (NAVIGATOR, lambda whole: b"{}", "KeyError: 'sheets'"),
        (NAVIGATOR, lambda whole: b"[]", "TypeError: list indices"),
        (NAVIGATOR, lambda whole: whole[: len(whole) // 2], "JSONDecodeError"),
        (MESSAGES, lambda whole: whole[: len(whole) // 2], "Parquet magic bytes not found"),
        (ESTIMATES, lambda whole: whole[: len(whole) // 2], "Parquet magic bytes not found"),
    ],
)
def test_a_damaged_recording_is_refused_with_the_name_of_the_file(record, name, damage, got):
    out = record()
    (out / name).write_bytes(damage((out / name).read_bytes()))
    with pytest.raises(DockairError, match=f"{name}: expected a .*{re.escape(got)}"):
        replay_in_this_process(out)


def test_a_table_of_another_kind_in_the_place_of_the_messages_is_refused(record):
    out = record()
    (out / MESSAGES).write_bytes((out / ESTIMATES).read_bytes())
    with pytest.raises(DockairError, match=f"{MESSAGES}: expected a whole table .* accelerometer_specific_force"):
        replay_in_this_process(out)


@pytest.mark.parametrize(
    ("imports", "refused"),
    [
        ("import dockair.sim.truth", "dockair.sim"),
        ("import mujoco", "mujoco"),
        ("import dockair.parameters", "dockair.parameters"),
    ],
)
def test_a_navigator_that_reads_the_simulator_cannot_be_replayed(record, imports, refused):
    with pytest.raises(DockairError, match=f"{refused} must not be imported in a replay"):
        replay(record(imports=imports))


def test_what_holds_truth_or_sheets_is_refused_with_all_below_it_and_nothing_else_is():
    guard = _RefuseForbiddenModules()
    for name in (*FORBIDDEN, "dockair.sim.truth", "mujoco.viewer", "dockair.assets.parameters"):
        with pytest.raises(ImportError, match=f"^{name} must not be imported in a replay"):
            guard.find_spec(name, None)
    assert {"dockair.sim", "mujoco", "dockair.assets", "dockair.parameters"} <= set(FORBIDDEN)
    for name in ("dockair", "dockair.nav", "dockair.simple", "mujoco_other", "assets"):
        assert guard.find_spec(name, None) is None


def test_a_navigator_may_print(record):
    """The report of the replaying process is on stdout."""
    assert replay(record(imports="print('hello')")).identical


def test_the_replaying_process_refuses_to_start_with_a_simulator_loaded(record):
    out = record()
    code = f"import mujoco, sys; from dockair.scenarios.replay import main; sys.exit(main([{str(out)!r}]))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "mujoco is already imported" in done.stderr


def test_replaying_loads_no_forbidden_module(record):
    """Looked at from inside the process, after a replay."""
    out = record()
    code = textwrap.dedent(f"""
        import json, sys
        from dockair.scenarios.replay import main
        assert main([{str(out)!r}]) == 0
        print(json.dumps(sorted(sys.modules)))
    """)
    path = {"PYTHONPATH": str(out.parent)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=path)
    loaded = json.loads(done.stdout.splitlines()[-1])
    assert not [m for m in loaded for name in FORBIDDEN if m == name or m.startswith(f"{name}.")]


def test_a_folder_without_a_recording_is_refused_with_one_line(tmp_path):
    with pytest.raises(DockairError, match="--record window or full"):
        replay(tmp_path)


def test_bits_are_compared_and_not_values():
    assert same_bits(np.array([np.nan, 1.0]), np.array([np.nan, 1.0]))
    assert same_bits(np.array([np.nan]), np.array([-np.nan]))  # whatever the sign and the rest of it
    assert not same_bits(np.array([0.0]), np.array([-0.0]))
    assert not same_bits(np.array([1.0]), np.array([1.0, 1.0]))
    assert not same_bits(np.array([1.0]), np.array([np.nan]))
    assert not same_bits(np.array([np.nan]), np.array([1.0]))
    assert not same_bits("hold", np.array([1.0]))
