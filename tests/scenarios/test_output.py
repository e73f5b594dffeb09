"""What people are shown: progress that does not flood a log, figures only where there are any."""

import io
import shlex
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from dockair.scenarios.commands.output import (
    FlightProgress,
    show_checks,
    show_reproduction,
    show_result,
    show_stages_bench,
)
from dockair.scenarios.doctor import Check


def tick(time_s: float):
    return SimpleNamespace(time_s=time_s, p_PD_B=np.array([0.0, 3.0, 4.0])), SimpleNamespace(phase="approach")


def test_without_a_terminal_progress_is_a_line_every_five_simulated_seconds():
    text = io.StringIO()
    with FlightProgress(20.0, Console(file=text, width=200)) as progress:
        for time_s in np.arange(0.0, 12.0, 0.01):
            progress(*tick(time_s))
    lines = text.getvalue().splitlines()
    assert [float(line.split()[0]) for line in lines] == [0.0, 5.0, 10.0]
    assert lines[1] == "   5.0 s  approach     distance to drogue   5.00 m"


def test_on_a_terminal_progress_is_a_bar_that_is_gone_afterwards():
    text = io.StringIO()
    console = Console(file=text, width=120, force_terminal=True)
    with FlightProgress(20.0, console) as progress:
        progress(*tick(10.0))
        progress._bar.refresh()
        during = text.getvalue()
    assert "approach" in during
    assert "10.0 of 20 s" in during
    assert text.getvalue().endswith("\x1b[2K")  # the line is cleared


def test_a_flight_without_contact_shows_no_contact_figures_and_no_recording(capsys, tmp_path):
    result = {
        "outcome": "miss",
        "scenario": "mine",
        "seed": 1,
        "contact": None,
        "nav": {"range_rmse_m": None},
        "frames": 7,
        "shortfalls": None,
    }
    show_result(result, tmp_path)
    out = capsys.readouterr().out
    assert out.splitlines()[0] == "miss  mine, seed 1"
    assert "camera frames" in out
    assert "closing speed" not in out
    assert "range error" not in out
    assert "rerun" not in out


@pytest.mark.parametrize(
    ("platform", "display", "options"),
    [
        ("linux", {}, ["--serve-web"]),
        ("linux", {"DISPLAY": ":0"}, []),
        ("linux", {"WAYLAND_DISPLAY": "wayland-0"}, []),
        ("darwin", {}, []),
    ],
)
def test_where_no_window_can_be_opened_the_recording_is_shown_in_a_browser(
    capsys, monkeypatch, tmp_path, platform, display, options
):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    for name, value in display.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("dockair.scenarios.display.sys.platform", platform)
    folder = tmp_path / "of mine"
    folder.mkdir()
    (folder / "episode.rrd").touch()
    show_result({"outcome": "contact", "scenario": "mine", "seed": 1}, folder)
    command = capsys.readouterr().out.splitlines()[-1].rpartition(": ")[2]
    assert shlex.split(command)[1:] == ["--bind", "127.0.0.1", *options, str(folder / "episode.rrd")]


def test_every_failed_attempt_is_told_with_its_cause(capsys, tmp_path):
    """Successful ones need no line: their figures stand below."""
    strike = {"number": 1, "outcome": "rim_strike", "radial_offset_m": 0.21, "cause": "gust", "reason": ""}
    broke = {"number": 2, "outcome": "breakaway", "radial_offset_m": None, "cause": "detection", "reason": "track lost"}
    held = {"number": 3, "outcome": "contact", "radial_offset_m": 0.02, "cause": "", "reason": ""}
    result = {
        "outcome": "contact",
        "scenario": "mine",
        "seed": 1,
        "attempt_log": [strike, broke, held],
        "shortfalls": [],
    }
    show_result(result, tmp_path)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "attempt 1: rim strike, 0.21 m off; cause: gust"
    assert lines[2] == "attempt 2: breakaway (track lost); cause: detection"
    assert not any("attempt 3" in line for line in lines)


def test_without_an_attempt_the_cause_is_told_with_what_the_navigation_said_last(capsys, tmp_path):
    phases = [("join_up", 0.01, ""), ("pre_contact", 12.0, "at the stand-off point"), ("clear", 45.0, "time slot over")]
    timeline = [{"phase": phase, "begun_s": begun_s, "reason": reason} for phase, begun_s, reason in phases]
    result = {"outcome": "abort", "scenario": "mine", "seed": 1, "attempts": 0, "attempt_log": [], "duration_s": 45.01}
    show_result(result | {"cause": "never_steady", "timeline": timeline}, tmp_path)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "no attempt after 45.0 s; never steady: time slot over in pre contact"


def test_a_files_size_is_told_in_a_unit_that_shows_it(capsys, tmp_path):
    for count in (7, 2_345, 99_999, 100_000, 2_345_678):
        (tmp_path / f"{count}").write_bytes(bytes(count))
    show_result({"outcome": "miss", "scenario": "mine", "seed": 1}, tmp_path)
    sizes = {line.split()[0].rpartition("/")[2]: line.split()[1:] for line in capsys.readouterr().out.splitlines()[1:]}
    assert sizes == {
        "7": ["0.0", "kB"], "2345": ["2.3", "kB"], "99999": ["100.0", "kB"], "100000": ["0.1", "MB"],
        "2345678": ["2.3", "MB"],
    }  # fmt: skip


def test_what_others_say_is_printed_as_it_is(capsys, tmp_path):
    """Markup would be swallowed, or raise: a folder's name, a reason of one's own navigator, what the machine lacks."""
    folder = tmp_path / "[hose]" / "[/]"
    folder.mkdir(parents=True)
    (folder / "flight.png").touch()
    failed = {"number": 1, "outcome": "miss", "radial_offset_m": None, "cause": "gust", "reason": "[/] lost"}
    result = {"outcome": "miss", "scenario": "mine", "seed": 1, "attempt_log": [failed], "shortfalls": ["[/] short"]}
    show_result(result, folder)
    show_checks([Check("OpenGL", False, "[egl] none", "see [/]"), Check("disk", True, "[dev]")], {"numpy": "[2]"})
    show_reproduction({"id": "a/b", "source": "[paper]", "rows": []}, folder / "picture.png")
    out = capsys.readouterr().out
    for said in ("attempt 1: miss ([/] lost)", "[/] short", f"  {folder}/flight.png  0.0 kB", "[egl] none; see [/]"):
        assert said in out
    for said in ("ok", "[dev]", "numpy [2]", "a/b  [paper]"):
        assert said in out


def test_a_phase_of_ones_own_navigator_is_no_markup():
    truth, _ = tick(10.0)
    for terminal in (True, False):
        text = io.StringIO()
        with FlightProgress(20.0, Console(file=text, width=120, force_terminal=terminal)) as progress:
            progress(truth, SimpleNamespace(phase="[/hold]"))
            progress._bar.refresh()
            assert "[/hold]" in text.getvalue()


def test_a_row_of_a_bench_is_a_line_in_a_file_however_wide_it_is(capsys):
    headings = [f"a_figure_with_a_long_name_{n}" for n in range(8)]
    flights = {"windowed, 50 Hz, one process": dict.fromkeys(headings, 1.0)}
    show_stages_bench({"flights": flights, "steps_per_second": {"dockair/DockFast-v0": 1.0}, "ratios": {}})
    heading, row, *_ = capsys.readouterr().out.splitlines()
    assert heading.split() == ["what", *headings]
    assert row.split() == ["windowed,", "50", "Hz,", "one", "process", *8 * ["1.00"]]
