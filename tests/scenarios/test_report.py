"""The report: what may be pooled, what it counts, that the page needs no other file and says how to fly again."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure

from dockair.errors import DockairError
from dockair.scenarios.campaign import manifest as manifests
from dockair.scenarios.campaign import table
from dockair.scenarios.campaign.row import COLUMNS
from dockair.scenarios.judgement.causes import CAUSES
from dockair.scenarios.report import figures
from dockair.scenarios.report.acceptance import claim_of, shortfalls_of
from dockair.scenarios.report.cause_words import MEANINGS
from dockair.scenarios.report.evidence import as_text, evidence_of
from dockair.scenarios.report.figures import overview, panels
from dockair.scenarios.report.folders import Campaign, read_campaigns
from dockair.scenarios.report.groups import NOT_SAID, Share, groups_of
from dockair.scenarios.report.page import page
from dockair.scenarios.report.pairs import beside_perfect_navigation, paired, side_by_side
from dockair.scenarios.report.timelines import timelines
from dockair.scenarios.scenario_hash import scenario_hash
from dockair.scenarios.schema import load_scenario
from dockair.scenarios.statistics import wilson_interval

OUR_NAVIGATOR = "dockair.nav.navigator:Navigator"
LIGHT_GUSTS = scenario_hash(load_scenario("light_gusts"))


def _attempt(number, outcome="contact", offset_m=0.05, cause=""):
    return {
        "number": number, "begun_s": 5.0 + 20 * number, "ended_s": 12.0 + 20 * number, "outcome": outcome,
        "radial_offset_m": offset_m, "left_m": offset_m, "up_m": 0.0, "closure_speed_m_s": 1.2, "angle_deg": 3.0,
        "cause": cause, "reason": "",
    }  # fmt: skip


def _good(attempt):
    return attempt["outcome"] == "contact" and not attempt["cause"]


_SENSING = {
    "camera": {},
    "truth": {"navigation.navigator": "truth"},
    "measurements": {"camera.sensing": "measurements"},
}


def _command(scenario, seed, **settings):
    changes = [f"--set '{key}={json.dumps(value)}'" for key, value in settings.items()]
    return " ".join([f"dockair fly {scenario} --seed {seed}", *changes])


def _without_attempt(seed, cause, **changes):
    """A flight that began no attempt."""
    nothing = {"attempts": 0, "attempt_log": "[]", "first_attempt": False, "success": False, "radial_offset_m": None}
    return _row(seed) | nothing | {"outcome": "abort", "cause": cause} | changes


def _row(seed, *, scenario="light_gusts", sensing="camera", attempts=None, **changes):
    log = attempts or [_attempt(1)]
    held = log[-1]["outcome"] == "contact"
    values = {
        "scenario": scenario, "seed": seed, "sensing": sensing,
        "navigator": "truth" if sensing == "truth" else OUR_NAVIGATOR, "controller": "predictive",
        "outcome": log[-1]["outcome"], "attempts": len(log), "first_attempt": _good(log[0]),
        "success": any(map(_good, log)),
        "unsafe": "", "cause": log[0]["cause"], "contact_time_s": 30.0 if held else None,
        "radial_offset_m": log[-1]["radial_offset_m"] if held else None, "closure_speed_m_s": 1.2 if held else None,
        "angle_deg": 3.0, "duration_s": 60.0, "error": "", "attempt_log": json.dumps(log), "timeline": "[]",
        "nav_by_range": "[]", "scenario_hash": f"{scenario}-{sensing}",
        "command": _command(scenario, seed, **_SENSING[sensing]),
    }  # fmt: skip
    return dict.fromkeys(COLUMNS) | values | changes


def _campaign(rows):
    return Campaign(name="made", manifest={"plan": {"name": "made"}, "commit": "abc"}, rows=rows)


class _Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.links, self.ids = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.ids += [values["id"]] if "id" in values else []
        self.links += [values[key] for key in ("href", "src", "xlink:href") if key in values]


def test_sensing_is_never_pooled():
    rows = [_row(seed, sensing=kind) for seed in range(3) for kind in ("camera", "truth", "measurements")]
    groups = groups_of(rows)
    assert [(group.sensing, len(group.rows)) for group in groups] == [("camera", 3), ("measurements", 3), ("truth", 3)]


def test_a_campaign_that_is_not_over_says_how_many_flights_it_plans():
    def first_line(flown: int, planned: int) -> str:
        manifest = {"plan": {"name": "made"}, "flights": planned}
        campaign = Campaign(name="made", manifest=manifest, rows=[_row(seed) for seed in range(flown)])
        return page("made", [campaign]).split('<p class="note">')[1].split("\n")[0]

    assert first_line(3, 8) == "3 of 8 flights planned."
    assert first_line(3, 3) == "3 flights."
    assert first_line(1, 1) == "1 flight."
    assert first_line(3, 2) == "3 flights."  # a damaged manifest makes no flight unflown


def test_the_seeds_of_a_group_are_told_with_their_gaps():
    (group,) = groups_of([_row(seed) for seed in (12, 13, 14, 9, 1, 2, 3, 4)])
    assert group.seeds_in_words == "1 to 4, 9, 12 to 14"
    assert "8 flights, seeds 1 to 4, 9, 12 to 14; navigator" in page("made", [_campaign(group.rows)])
    drawn = {"set.start.aft_m": 5.0}
    (twice,) = groups_of([_row(3, command=_command("light_gusts", 3, **{"start.aft_m": 5.0})) | drawn] * 2)
    assert twice.seeds_in_words == "3"
    assert "2 flights of 1 seed, seed 3; navigator" in page("made", [_campaign(twice.rows)])


@pytest.mark.parametrize("rims_m", [[0.25], [0.305], [0.25, 0.305], []])
def test_the_places_of_the_tip_are_shown_in_the_rim_of_the_drogue_flown_and_without_one_it_is_said(rims_m):
    (group,) = groups_of([_row(seed, rim_radius_m=radius_m) for seed, radius_m in enumerate(rims_m or [None])])
    ax = Figure().subplots()
    figures._scatter(ax, group)
    assert [patch.radius for patch in ax.patches] == [0.15, *rims_m]
    assert [text.get_text() for text in ax.texts] == ([] if rims_m else ["no rim: this table does not say its radius"])
    assert group.rims_m == rims_m


def test_a_table_of_before_the_rims_radius_was_a_column_is_read_and_has_no_rim(tmp_path):
    table.write_table([_row(0)], tmp_path)
    parquet = pq.read_table(tmp_path / table.FILE_NAME).drop_columns(["rim_radius_m"])
    pq.write_table(parquet, tmp_path / table.FILE_NAME)
    (group,) = groups_of(table.read_table(tmp_path))
    assert "rim_radius_m" not in group.rows[0] and group.rims_m == []
    assert "no rim" in panels(group)


def test_what_is_set_makes_a_group_of_its_own_and_so_does_a_draw():
    filters = [_row(0, command=_command("light_gusts", 0, **{"camera.filter": name})) for name in ("none", "band_pass")]
    column, sigma = {"set.turbulence.sigma_m_s": 0.5}, {"turbulence.sigma_m_s": 0.5}
    drawn = [
        _row(1, sensing=kind, command=_command("light_gusts", 1, **sigma, **_SENSING[kind])) | column
        for kind in _SENSING
    ]
    pid = _row(2, controller="pid", command=_command("light_gusts", 2, **{"guidance.controller": "pid"}))
    groups = groups_of([_row(0), *filters, *drawn, pid])
    assert {(group.settings, group.sensing, group.controller, len(group.rows)) for group in groups} == {
        ("", "camera", "predictive", 1), ("", "camera", "pid", 1),
        *(("turbulence.sigma_m_s drawn", kind, "predictive", 1) for kind in _SENSING),
        ('camera.filter="none"', "camera", "predictive", 1), ('camera.filter="band_pass"', "camera", "predictive", 1),
    }  # fmt: skip
    assert len({name for group in groups for name in (group.anchor, group.title, group.label)}) == 3 * len(groups)
    text = page("made", [_campaign([row for group in groups for row in group.rows])])
    assert "with <code>camera.filter=&#34;none&#34;</code>" in text


def test_a_key_that_only_other_flights_of_the_table_drew_is_one_that_is_set():
    """Their column is empty here."""
    sigma = {"turbulence.sigma_m_s": 0.5}
    row = _row(0, command=_command("light_gusts", 0, **sigma)) | {"set.turbulence.sigma_m_s": None}
    assert groups_of([row])[0].settings == "turbulence.sigma_m_s=0.5"


def test_what_is_set_is_compared_with_perfect_navigation_that_flew_it_so():
    with_sigma = [
        _row(0, sensing=kind, command=_command("light_gusts", 0, **{"turbulence.sigma_m_s": 0.5}, **_SENSING[kind]))
        for kind in ("camera", "truth")
    ]
    groups = groups_of([_row(0), *with_sigma])
    pairs = [beside_perfect_navigation(group, groups) for group in groups]
    assert [(g.settings, g.sensing, p and p.flights) for g, p in zip(groups, pairs, strict=True)] == [
        ("", "camera", None), ("turbulence.sigma_m_s=0.5", "camera", 1), ("turbulence.sigma_m_s=0.5", "truth", None),
    ]  # fmt: skip


def test_a_flight_that_crashed_is_no_success_and_still_counts():
    rows = [_row(0), _row(1, error="ValueError: x", outcome="error", success=False, first_attempt=False)]
    (group,) = groups_of(rows)
    assert (group.first_attempt.count, group.first_attempt.of) == (1, 2)
    assert (group.success.count, group.success.of) == (1, 2)
    assert group.outcomes == [("contact", 1), ("error", 1)]


def test_success_within_attempts_grows_and_ends_at_all():
    rows = [_row(k, attempts=[_attempt(i, "rim_strike", 0.3, "gust") for i in range(1, n)] + [_attempt(n)])
            for k, n in enumerate((1, 1, 2, 3))]  # fmt: skip
    (group,) = groups_of(rows)
    assert [group.within(n).count for n in (1, 2, 3)] == [2, 3, 4]
    assert group.causes == [("gust", 3)]


def test_intervals_are_wilsons():
    assert Share(7, 10).interval == wilson_interval(7, 10)
    assert (Share(7, 10).counted, Share(7, 10).between) == ("7/10 = 70.0 %", "(39.7–89.2)")
    assert (Share(0, 0).counted, Share(0, 0).between) == ("–", "")


def test_what_vision_costs_is_counted_on_common_seeds_only():
    bad = [_attempt(1, "miss", 0.4, "gust")]
    camera = [_row(0), _row(1, attempts=bad), _row(2), _row(9)]
    truth = [_row(0, sensing="truth"), _row(1, sensing="truth"), _row(2, sensing="truth", attempts=bad)]
    groups = groups_of(camera + truth)
    pair = beside_perfect_navigation(groups[0], groups)
    assert (pair.seeds, pair.flights, pair.ours, pair.theirs, pair.only_ours, pair.only_theirs) == (3, 3, 2, 2, 1, 1)
    assert beside_perfect_navigation(groups[1], groups) is None


@pytest.mark.parametrize("sensing", ["camera", "measurements"])
def test_perfect_navigation_is_compared_on_the_same_draws_and_settings(sensing):
    """Seed 0 at two draws: the truth docks at the first, ours at the second."""
    bad = [_attempt(1, "miss", 0.4, "gust")]

    def drawn(kind, value, attempts=None):
        command = _command("light_gusts", 0, **{"turbulence.sigma_m_s": value}, **_SENSING[kind])
        row = _row(0, sensing=kind, attempts=attempts, command=command, scenario_hash=f"{kind}-{value}")
        return row | {"set.turbulence.sigma_m_s": value}

    ours = [drawn(sensing, 0.5, bad), drawn(sensing, 1.5), drawn(sensing, 2.5)]  # the last is the truth's never
    groups = groups_of([*ours, drawn("truth", 0.5), drawn("truth", 1.5, bad)])
    pair = beside_perfect_navigation(groups[0], groups)
    assert (pair.flights, pair.seeds, pair.ours, pair.theirs) == (2, 1, 1, 1)
    assert (pair.only_ours, pair.only_theirs) == (1, 1)
    assert beside_perfect_navigation(groups[0], [groups[0], groups_of([drawn("truth", 3.5)])[0]]) is None


def test_an_error_beside_perfect_navigation_is_a_flight_that_has_not_docked():
    camera = [_row(0), _without_attempt(1, "", error="ValueError: x", outcome="error")]
    groups = groups_of(camera + [_row(seed, sensing="truth") for seed in (0, 1)])
    pair = beside_perfect_navigation(groups[0], groups)
    assert (pair.flights, pair.ours, pair.theirs, pair.only_theirs, pair.ratio) == (2, 1, 2, 1, 0.5)


def _flown_by(crew, seed, docks, **settings):
    command = _command("light_gusts", seed, **settings, **crew)
    attempts = None if docks else [_attempt(1, "miss", 0.4, "gust")]
    controller = crew.get("guidance.controller", "predictive")
    return _row(seed, attempts=attempts, controller=controller, command=command)


def test_two_controllers_are_compared_on_the_flights_that_both_have_flown():
    """Of six common flights one is only the first's, three are only the second's; the seventh is nobody's pair."""
    predictive, pid = {}, {"guidance.controller": "pid"}
    one = [_flown_by(predictive, seed, seed < 3) for seed in range(7)]
    other = [_flown_by(pid, seed, seed > 0) for seed in range(6)]
    ((a, b, pair),) = side_by_side(groups_of(one + other))
    assert (a.controller, b.controller) == ("pid", "predictive")
    assert (pair.flights, pair.seeds, pair.ours, pair.theirs, pair.only_ours, pair.only_theirs) == (6, 6, 5, 3, 3, 1)
    assert pair.by_chance == pytest.approx(2 * (1 + 4) / 16)
    (evidence,) = evidence_of([_campaign(one + other)])["side_by_side"]
    assert (evidence["one"]["controller"], evidence["only_one"], evidence["by_chance"]) == ("pid", 3, 0.625)
    text = page("made", [_campaign(one + other)])
    assert "Two crews side by side" in text and "0.62" in text


def test_a_scenario_of_ones_own_is_paired_however_its_path_was_written():
    """One name has one content: `report` has refused anything else."""

    def flown(path, seed, controller):
        command = _command(path, seed, **{"guidance.controller": controller})
        return _row(seed, scenario="mine", controller=controller, command=command)

    one = [flown("sub/mine.toml", seed, "predictive") for seed in range(3)]
    other = [flown("/where/sub/mine.toml", seed, "pid") for seed in range(3)]
    ((_, _, pair),) = side_by_side(groups_of(one + other))
    assert pair.flights == 3


def test_a_key_of_guidance_is_the_crews_and_one_of_the_world_is_not():
    narrow, gusts = {"guidance.capture_radius_m": 0.1}, {"turbulence.sigma_m_s": 0.5}
    rows = [_flown_by({}, 0, True), _flown_by(narrow, 0, False), _flown_by({}, 0, True, **gusts)]
    rows += [_flown_by({}, 0, True, **{"camera.filter": "none"})]  # it changes what there is to see
    ((a, b, pair),) = side_by_side(groups_of(rows))
    assert (a.settings, b.settings, pair.only_ours) == ("", "guidance.capture_radius_m=0.1", 1)


def test_perfect_navigation_is_in_no_pair_of_crews_but_with_itself():
    pid = {"guidance.controller": "pid"}
    truth = [_flown_by(crew | _SENSING["truth"], 0, True) | {"sensing": "truth"} for crew in ({}, pid)]
    pairs = side_by_side(groups_of([_row(0), *truth]))
    assert [(a.sensing, b.sensing) for a, b, _ in pairs] == [("truth", "truth")]


def test_a_draw_of_the_crews_own_is_in_no_pair():
    """One seed at two capture radii has no single flight of the other crew beside it."""

    def drawn(radius_m):
        row = _flown_by({"guidance.capture_radius_m": radius_m}, 0, True)
        return row | {"set.guidance.capture_radius_m": radius_m}

    groups = groups_of([drawn(0.1), drawn(0.12), _row(0)])
    assert side_by_side(groups) == [] and paired(*reversed(groups), apart=("guidance.",)) is None


def test_flights_that_began_no_attempt_are_counted_by_their_causes_and_errors_with_them():
    idle = [_without_attempt(k, "never_steady") for k in range(3)] + [_without_attempt(3, "detection")]
    broken = _without_attempt(4, "", error="ValueError: x", outcome="error")
    tried = _row(5, attempts=[_attempt(1, "miss", 0.4, "gust")])
    (group,) = groups_of([*idle, broken, tried])
    assert group.causes == [("gust", 1)]
    assert group.causes_without_attempt == [("never_steady", 3), ("detection", 1), ("error", 1)]
    (evidence,) = evidence_of([_campaign(group.rows)])["groups"]
    assert evidence["causes_of_flights_without_attempt"] == {"never_steady": 3, "detection": 1, "error": 1}
    (idle_only,) = groups_of(idle)
    assert "none failed" not in panels(idle_only) and "never steady" in panels(idle_only)
    assert "none failed" in panels(groups_of([_row(0)])[0])


def test_a_flight_without_attempt_says_why_and_is_told_apart_by_what_its_navigation_said():
    def waited(phase, reason):
        entries = ((phase, 0.0, ""), ("clear", 45.0, reason))
        return json.dumps([dict(zip(("phase", "begun_s", "reason"), entry, strict=True)) for entry in entries])

    slot = {"timeline": waited("pre_contact", "time slot over"), "duration_s": 45.0}
    lost = {"timeline": waited("join_up", "drogue lost"), "duration_s": 45.0}
    rows = [*(_without_attempt(k, "never_steady", **slot) for k in (0, 1)), _without_attempt(2, "never_steady", **lost)]
    (group,) = groups_of(rows)
    names = [("never steady: time slot over in pre contact", 2), ("never steady: drogue lost in join up", 1)]
    assert group.endings_without_attempt == names
    text = page("made", [_campaign(rows)])
    for seed, (name, _) in ((0, names[0]), (2, names[1])):
        (line,) = (line for line in text.splitlines() if f"--seed {seed}</code>" in line)
        assert f"no attempt after 45.0 s; {name}" in line
        assert f">{name}</a>" in text


def test_every_cause_has_a_meaning():
    assert {*CAUSES, "error", NOT_SAID} == set(MEANINGS)


def test_an_unsafe_flight_says_so_in_its_story():
    touched = _row(4, unsafe="touch at 3.10 m/s")
    (line,) = (line for line in page("made", [_campaign([touched])]).splitlines() if "--seed 4</code>" in line)
    assert "<td>1: contact 0.05 m off; unsafe: touch at 3.10 m/s</td>" in line


def test_the_page_says_of_every_kind_of_unsafe_flight_that_it_is_counted():
    text = " ".join(page("made", [_campaign([_row(4)])]).split())
    said = text[text.index("<i>Unsafe</i>") : text.index("<i>Accepted</i>")]
    for kind in ("too fast or outside the basket", "marked unusable", "collision", "departure from controlled flight"):
        assert kind in said


def test_the_time_beyond_three_sigmas_is_told_as_the_mean_of_the_flights_however_long_they_lasted():
    headings = ("turned_deg", "error_deg", "sigma_deg", "error_rms_deg", "error_max_deg")
    figures = {f"heading_{name}": 1.0 for name in headings}
    parts = [{"heading_beyond_3_sigma": part, "duration_s": long} for part, long in ((0.1, 90.0), (0.02, 10.0))]
    rows = [_row(seed, **figures, **part) for seed, part in enumerate(parts)]
    text = " ".join(page("made", [_campaign(rows)]).split())
    assert "beyond three of its standard deviations for 6.0 % of a flight on average." in text


def test_a_flight_that_lost_the_drogue_after_a_good_contact_had_docked_by_then():
    """Good at the first of three attempts, the drogue lost before refuelling, and tried again."""
    went_on = _row(0, attempts=[_attempt(1), _attempt(2, "miss", 0.4, "gust"), _attempt(3, "given_up", 0.3, "gust")])
    wide_first = _row(2, attempts=[_attempt(1, "contact", 0.2, "gust"), _attempt(2)])
    (group,) = groups_of([went_on, _row(1), wide_first])
    assert [group.within(n).count for n in (1, 2, 3)] == [2, 3, 3]
    assert group.within(1) == group.first_attempt and group.within(3) == group.success


def test_a_seed_that_occurs_twice_is_said_and_marks_the_intervals():
    twice = [_row(seed, scenario_hash=f"point {k}") for seed in range(3) for k in range(20)]
    text = page("made", [_campaign(twice)])
    assert "60 flights of 3 seeds" in text and "= 100.0 %<br>" in text and "(94.0–100.0) †</span>" in text
    (group,) = evidence_of([_campaign(twice)])["groups"]
    assert (group["flights"], group["seeds"], group["independent"]) == (60, 3, False)
    once = [_row(seed) for seed in range(60)]
    assert "†" not in page("made", [_campaign(once)])
    assert evidence_of([_campaign(once)])["groups"][0]["independent"]


def test_two_navigators_of_the_same_class_name_have_each_their_own_section():
    bad = [_attempt(1, "miss", 0.4, "gust")]
    rows = [_row(0, navigator="mine_v1:Navigator", attempts=bad), _row(0, navigator="mine_v2:Navigator")]
    one, two = groups_of(rows)
    assert one.anchor != two.anchor and one.title != two.title and one.label != two.label
    text = page("made", [_campaign(rows)])
    first, second = text.split("<h2 id=")[1:]
    assert "0.40 m off (gust)" in first and "0.40 m off (gust)" not in second
    assert OUR_NAVIGATOR not in groups_of([_row(0)])[0].title


def test_only_the_librarys_scenarios_as_they_are_written_are_held_to_their_claims(tmp_path, monkeypatch):
    bad = [_attempt(1, "miss", 0.4, "gust")]
    (written,) = groups_of([_row(seed, attempts=bad, scenario_hash=LIGHT_GUSTS) for seed in range(3)])
    assert shortfalls_of(written) and claim_of(written)
    (of_another_file,) = groups_of([row | {"scenario_hash": "before it was changed"} for row in written.rows])
    changed = _row(9, attempts=bad, command=_command("light_gusts", 9, **{"turbulence.sigma_m_s": 3}))
    drawn = changed | {"set.turbulence.sigma_m_s": 3}
    for other in (of_another_file, groups_of([*written.rows, drawn])[1], groups_of([changed])[0]):
        assert shortfalls_of(other) is None and claim_of(other) == ""
    text = 'name = "mine"\nclaim = "it docks"\n[accept]\noutcome = "contact"\n'
    (tmp_path / "mine.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    (own,) = groups_of([_row(0, scenario="mine", attempts=bad, command="dockair fly mine.toml --seed 0")])
    assert shortfalls_of(own) is None and claim_of(own) == ""


def test_what_is_outside_a_pictures_axes_is_counted_and_shown_at_its_edge():
    far = [_attempt(1, "miss", 0.9, "gust"), _attempt(2, "given_up", 2.0, "gust"), _attempt(3)]
    rows = [_row(0, attempts=far), _row(1, closure_speed_m_s=3.4), _row(2, closure_speed_m_s=-0.1)]
    text = panels(groups_of(rows)[0])
    assert "seen from behind; 2 beyond, on the frame" in text
    assert "limit; 2 beyond, in the end bins" in text
    assert "beyond" not in panels(groups_of([_row(0)])[0])


def _axes_of(group, monkeypatch):
    """The panels of a group by their titles, not yet drawn."""
    with monkeypatch.context() as patch:
        patch.setattr(figures, "as_svg", lambda figure, name: figure)
        return {ax.get_title(loc="left"): ax for ax in panels(group).axes}


def test_panels_show_places_from_behind_and_errors_in_the_middle_of_their_bins(monkeypatch):
    """A tip 0.1 m to the left of the axis stands left of it in the picture too, as for who flies behind."""
    sizes = {"range_rmse_m": 2e-3, "range_sigma_m": 3e-3, "lateral_rmse_m": 4e-3, "lateral_sigma_m": 5e-3}
    others = {"range_bias_m": 0.0, "attitude_rmse_deg": 0.1, "attitude_sigma_deg": 0.1}
    bins = json.dumps([{"low_m": 2.0, "high_m": 3.0, "count": 4} | sizes | others])
    heading = {"heading_sigma_deg": 1.0, "heading_error_rms_deg": 1.0, "heading_error_max_deg": 3.0}
    rows = [
        _row(0, attempts=[_attempt(1, offset_m=0.1) | {"up_m": 0.05}], nav_by_range=bins, heading_error_deg=-2.0),
        _row(1, attempts=[_attempt(1, "miss", 0.3, "gust"), _attempt(2)], heading_error_deg=0.5),
    ]
    axes = _axes_of(groups_of([row | heading for row in rows])[0], monkeypatch)
    contacts = axes["the tip in the ring's plane, or where it came nearest"].collections[0]
    np.testing.assert_allclose(contacts.get_offsets()[0], [-0.1, 0.05])
    known = axes["navigation error (lines), expected (dashed)"].lines
    drawn = [(line.get_linestyle(), *line.get_xdata(), *line.get_ydata()) for line in known]
    assert drawn == [("-", 2.5, 2.0), ("--", 2.5, 3.0), ("-", 2.5, 4.0), ("--", 2.5, 5.0)]
    tries = axes["contact inside the limits within n attempts"].lines
    points = [(*line.get_xdata(), *line.get_ydata()) for line in tries if line.get_marker() == "o"]
    assert points == [(1, 50.0), (2, 100.0)]
    at_end, _, expected = (line.get_xdata() for line in axes["own heading against the truth, 2 flights"].lines)
    assert set(expected) == {1.0}
    assert [size for size in at_end if np.isfinite(size)][-2:] == [0.5, 2.0]


def test_the_overview_has_a_line_a_group_from_the_top_with_both_rates_and_their_intervals(monkeypatch):
    """One that docks late in one of two flights; and one seed flown twice, never docked."""
    late = [_attempt(1, "rim_strike", 0.3, "gust"), _attempt(2)]
    missed = [_attempt(1, "miss", 0.4, "gust")]
    rows = [_row(0), _row(1, attempts=late)] + [_row(0, scenario="severe", attempts=missed) for _ in range(2)]
    groups = groups_of(rows)
    monkeypatch.setattr(figures, "as_svg", lambda figure, name: figure)
    (ax,) = overview(groups).axes
    assert [label.get_text() for label in ax.get_yticklabels()] == [groups[0].label, groups[1].label + " †"]
    assert ax.get_yticks().tolist() == [0, 1] and ax.yaxis_inverted()
    drawn = [(line.get_marker(), *line.get_xdata(), *line.get_ydata()) for line in ax.lines]
    expected = []
    for k, shares in enumerate([((2, 2), (1, 2)), ((0, 2), (0, 2))]):
        for marker, y, share in zip("os", (k - 0.13, k + 0.13), shares, strict=True):
            low, high = wilson_interval(*share)
            expected += [("None", 100 * low, 100 * high, y, y), (marker, 100 * share[0] / share[1], y)]
    assert drawn == [pytest.approx(line) if line[0] == "None" else line for line in expected]
    said = [text.get_text() for text in ax.get_legend().get_texts()]
    assert said == ["any attempt", "first attempt"]


@pytest.mark.parametrize(
    ("shown", "outcomes"),
    [
        ("contact", ("contact",)),
        ("no contact", ("miss", "rim_strike", "collision")),
        ("plane not crossed", ("breakaway", "given_up", "timeout", "diverged")),
    ],
)
def test_the_tip_of_an_attempt_is_marked_by_whether_it_crossed_the_ring_s_plane(shown, outcomes):
    nowhere = _attempt(9, outcomes[0], None, "gust") | {"up_m": 0.1}
    tried = [_attempt(k, outcome, 0.2, "gust") for k, outcome in enumerate(outcomes)]
    (group,) = groups_of([_row(0, attempts=[*tried, nowhere])])
    ax = Figure().subplots()
    figures._scatter(ax, group)
    places = {found.get_label(): found.get_offsets().data.tolist() for found in ax.collections}
    nothing = dict.fromkeys(("contact", "no contact", "plane not crossed"), [])
    assert places == nothing | {shown: [[-0.2, 0.0]] * len(outcomes)}
    crosses = [found.get_label() for found in ax.collections if len(found.get_paths()[0]) < 8]
    assert crosses == ["plane not crossed"]


def test_closing_speeds_are_counted_in_bins_of_5_cm_s_over_the_band_of_practice_and_the_limit():
    (group,) = groups_of([_row(k, closure_speed_m_s=speed) for k, speed in enumerate((1.01, 1.04, 1.06, 2.79))])
    ax = Figure().subplots()
    figures._closing(ax, group)
    band, *bins = ax.patches
    found = {round(bar.get_x(), 9): bar.get_height() for bar in bins if bar.get_height()}
    assert found == {1.0: 2, 1.05: 1, 2.75: 1}
    assert {round(bar.get_width(), 9) for bar in bins} == {0.05}
    assert (band.get_x(), band.get_x() + band.get_width()) == (1.0, 1.5)
    assert set(ax.lines[0].get_xdata()) == {2.6}


def test_without_a_contact_the_panel_of_closing_speeds_says_so(monkeypatch):
    missed = groups_of([_row(0, attempts=[_attempt(1, "miss", 0.4, "gust")])])[0]
    ax = _axes_of(missed, monkeypatch)["closing speed of the contacts"]
    assert [text.get_text() for text in ax.texts] == ["no contact"] and not ax.patches and not ax.axison


def test_errors_by_range_have_ticks_as_far_as_they_go(monkeypatch):
    """One error of 2 m, and the nearest bin, which is drawn at 1 m; and two that the usual axis holds."""
    usual = ["2", "3", "5", "7", "10", "20"], ["0.3", "1", "3", "10", "30", "100"]
    far = ["1", *usual[0]], [*usual[1], "300", "1000"]
    for bins, expected in (((_bin(4, 2e-3), _bin(4, 5e-3, low_m=3.0)), usual), ((_bin(4, 2.0, low_m=0.0),), far)):
        (group,) = groups_of(
            [_row(0, nav_by_range=json.dumps([entry | {"high_m": 2.0 + entry["low_m"]} for entry in bins]))]
        )
        ax = _axes_of(group, monkeypatch)["navigation error (lines), expected (dashed)"]
        assert tuple([label.get_text() for label in axis.get_ticklabels()] for axis in (ax.xaxis, ax.yaxis)) == expected


def test_why_attempts_failed_stands_above_why_flights_began_none(monkeypatch):
    rows = [_row(0, attempts=[_attempt(1, "miss", 0.4, "gust"), _attempt(2, "miss", 0.4, "bow_wave")])]
    rows += [_row(1, attempts=[_attempt(1, "miss", 0.4, "gust")]), _without_attempt(2, "never_steady")]
    (group,) = groups_of(rows)
    ax = _axes_of(group, monkeypatch)["why attempts failed, and why flights began none"]
    bars = {label.get_text(): bar for label, bar in zip(ax.get_yticklabels(), ax.patches, strict=True)}
    found = {name: (bar.get_y() + 0.5 * bar.get_height(), bar.get_width()) for name, bar in bars.items()}
    assert found == {"gust": (0.0, 2), "bow wave": (1.0, 1), "never steady:\nabort": (2.0, 1)}
    assert ax.yaxis_inverted()
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["attempts", "flights without one"]


def test_within_n_attempts_goes_on_to_the_most_that_any_flight_made(monkeypatch):
    late = [_attempt(k, "rim_strike", 0.3, "gust") for k in (1, 2)] + [_attempt(3)]
    (group,) = groups_of([_row(0), _row(1, attempts=late)])
    ax = _axes_of(group, monkeypatch)["contact inside the limits within n attempts"]
    bars = [line.get_ydata() for line in ax.lines if line.get_marker() != "o"]
    intervals = [wilson_interval(count, 2) for count in (1, 1, 2)]
    np.testing.assert_allclose(bars, 100.0 * np.array(intervals))
    assert ax.get_xticks().tolist() == [1, 2, 3]


def test_own_headings_are_shown_by_their_sizes_and_beside_the_median_of_what_was_expected(monkeypatch):
    flown = ((-3.0, 4.0, 0.5), (1.0, 2.0, 0.7), (None, 9.0, None), (2.0, 2.5, 3.0))
    rows = [
        _row(k, heading_error_deg=end, heading_error_max_deg=most, heading_sigma_deg=sigma, heading_error_rms_deg=1.0)
        for k, (end, most, sigma) in enumerate(flown)
    ]
    ax = _axes_of(groups_of(rows)[0], monkeypatch)["own heading against the truth, 4 flights"]
    at_end, largest, expected = ax.lines
    sizes = [sorted(size for size in line.get_xdata() if np.isfinite(size))[1:] for line in (at_end, largest)]
    assert sizes == [[1.0, 2.0, 3.0], [2.0, 2.5, 4.0, 9.0]]
    assert set(expected.get_xdata()) == {0.7}
    assert [line.get_label() for line in (at_end, largest)] == ["at the end", "largest of the flight"]


def test_errors_by_range_are_pooled_by_their_squares():
    """3 frames of 1 mm and 1 of 3 mm: sqrt((3 * 1 + 9) / 4) = sqrt 3 mm; bias (3 * 1 - 3) / 4 = 0."""

    def entry(count, size):
        sizes = dict.fromkeys(("range_rmse_m", "lateral_rmse_m", "range_sigma_m", "lateral_sigma_m"), size)
        return {"low_m": 2.0, "high_m": 3.0, "count": count, "range_bias_m": size if count > 1 else -size,
                "attitude_rmse_deg": size, "attitude_sigma_deg": size} | sizes  # fmt: skip

    rows = [_row(k, nav_by_range=json.dumps([entry(*e)])) for k, e in enumerate(((3, 1e-3), (1, 3e-3)))]
    (bin_,) = groups_of(rows)[0].by_range
    assert bin_["range_rmse_m"] == pytest.approx(np.sqrt(3.0) * 1e-3)
    assert bin_["range_bias_m"] == pytest.approx(0.0, abs=1e-12)
    assert bin_["count"] == 4


def _table(text, begins):
    """Cells of the first table after these words, row by row, without tags."""
    table_ = text[text.index("<tr>", text.index(begins)) :].partition("</table>")[0]
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", row, re.DOTALL) for row in table_.split("<tr>")]
    return [[re.sub(r"<[^>]*>", " ", cell).strip() for cell in row] for row in cells if row]


def test_each_figure_of_the_navigation_stands_in_its_column_of_the_page():
    entry = {"low_m": 2.0, "high_m": 3.5, "count": 4, "range_rmse_m": 2e-3, "range_sigma_m": 3e-3, "range_bias_m": 1e-3}
    entry |= {"lateral_rmse_m": 4e-3, "lateral_sigma_m": 5e-3, "attitude_rmse_deg": 0.6, "attitude_sigma_deg": 0.7}
    heading = {"heading_error_deg": -2.0, "heading_sigma_deg": 0.5, "heading_error_rms_deg": 1.5}
    heading |= {"heading_error_max_deg": 3.0, "heading_beyond_3_sigma": 0.25}
    text = " ".join(page("made", [_campaign([_row(0, nav_by_range=json.dumps([entry]), **heading)])]).split())
    (cells,) = _table(text, "Navigation error by range")
    assert cells == ["2–3.5", "4", "2.0 / 3.0", "+1.0", "4.0 / 5.0", "0.60 / 0.70"]
    assert "RMS 1.50° over the flight and 2.00° at its end (expected 0.50°), largest 3.00°; beyond" in text
    assert "deviations for 25.0 % of a flight on average" in text


def test_each_count_of_a_pair_and_of_a_group_stands_in_its_column_of_the_page():
    """Of seven flights ours dock at once on 0 and 1 and late on 6, perfect navigation on 1 to 4, pid on 1, 4 and 5."""
    late = [_attempt(1, "miss", 0.4, "gust"), _attempt(2, offset_m=0.09)]
    refuelled = {
        "fuel_kg": 9.0,
        "timeline": json.dumps([{"phase": "disconnect", "begun_s": 40.0, "reason": "refuelled"}]),
    }
    ours = [_flown_by({}, seed, seed < 2) for seed in range(6)]
    ours[1]["radial_offset_m"] = 0.07
    ours += [_row(6, attempts=late) | refuelled]
    truth = [_flown_by(_SENSING["truth"], seed, 1 <= seed <= 4) for seed in range(7)]
    truth = [row | {"sensing": "truth", "navigator": "truth"} for row in truth]
    pid = [_flown_by({"guidance.controller": "pid"}, seed, seed in (1, 4, 5)) for seed in range(7)]
    text = page("made", [_campaign([*ours, *truth, *pid])])
    (_, predictive, _) = _table(text, "<h2>Overview</h2>")
    assert [cell.split()[0] for cell in predictive[2:5]] == ["2/7", "3/7", "1/7"]
    assert predictive[5].split() == ["0.070", "0.086"]
    (vision,) = _table(text, "What vision costs")
    assert vision[-7:] == ["7", "7", "2", "4", "0.500", "1", "3"]
    (crews,) = _table(text, "Two crews side by side")
    assert crews[2:-1] == ["7", "7", "3", "2", "2", "1"]  # pid stands first


def test_the_heading_of_a_column_of_numbers_stands_above_them():
    """On the right, as they do: on the left it would stand nearer to the numbers of the column before."""
    missed = {"attempts": [_attempt(1, "miss", 0.4, "gust")], "nav_by_range": json.dumps([_bin(4, 2e-3)])}
    pid = _flown_by({"guidance.controller": "pid"}, 0, True)
    text = page("made", [_campaign([_row(0), _row(1, **missed), _row(0, sensing="truth"), pid])])
    tables = re.findall(r"<table>\s*<tr>(<th.*?)</tr>\s*<tr[^>]*>(.*?)</tr>", text, re.DOTALL)
    cells = [[re.findall(r"<t[hd]([^>]*)>", row) for row in two] for two in tables]
    of_numbers = [[["n" in re.findall(r"\w+", cell) for cell in row] for row in two] for two in cells]
    assert len(of_numbers) == 6 and all(heading == numbers for heading, numbers in of_numbers)


def test_every_picture_can_be_scrolled_where_the_page_is_narrow():
    """Squeezed into a narrow page its labels could not be read."""
    text = page("made", [_campaign([_row(0, timeline=json.dumps([{"phase": "clear", "begun_s": 0.0, "reason": ""}]))])])
    assert text.count("<svg") == text.count('<div class="picture"><svg') == 3


def test_the_page_needs_no_other_file_and_its_links_lead_somewhere():
    rows = [_row(k, attempts=[_attempt(1, "miss", 0.4, "gust")]) for k in range(3)] + [_row(5)]
    text = page("made", [_campaign(rows)])
    parsed = _Page(text)
    assert not re.search(r"(?:src|href)=\"https?:", text)
    assert all(link.startswith("#") and link[1:] in parsed.ids for link in parsed.links)


def test_every_flight_that_failed_says_how_to_fly_it_again():
    rows = [_row(0), _row(7, attempts=[_attempt(1, "miss", 0.4, "gust")], command="dockair fly light_gusts --seed 7")]
    text = page("made", [_campaign(rows)])
    assert "dockair fly light_gusts --seed 7" in text
    assert "0.40 m off (gust)" in text


def test_text_of_a_flight_cannot_become_markup():
    text = page("made", [_campaign([_row(0, error="<script>alert(1)</script>")])])
    assert "<script>alert" not in text


def test_the_same_rows_make_the_same_page():
    rows = [_row(k) for k in range(4)]
    assert page("made", [_campaign(rows)]) == page("made", [_campaign(rows)])


def test_evidence_is_plain_json_with_counts_of_every_group():
    rows = [_row(0), _row(1, attempts=[_attempt(1, "miss", 0.4, "gust")]), _row(0, sensing="truth")]
    table_ = evidence_of([_campaign(rows)])
    text = as_text(table_)
    assert json.loads(text) == json.loads(json.dumps(table_))
    camera, truth = table_["groups"]
    assert table_["each_flight"] == (
        "seed", "outcome", "first_attempt", "success", "unsafe", "attempts", "radial_offset_m", "closure_speed_m_s",
        "drawn",
    )  # fmt: skip
    assert camera["each"] == [
        [0, "contact", True, True, "", 1, 0.05, 1.2, ""], [1, "miss", False, False, "", 1, None, None, ""],
    ]  # fmt: skip
    assert '[1, "miss", false, false, "", 1, null, null, ""]' in text and table_["campaigns"][0]["flown"] == 3
    assert camera["first_attempt"]["count"] == 1 and camera["failed_seeds"] == [1]
    assert camera["causes_of_failed_attempts"] == {"gust": 1}
    assert truth["shortfalls"] is None


def test_evidence_counts_contacts_at_their_limits_and_every_flight_that_was_asked_for():
    """Four contacts, of which the second and the third lie on limits; a touch that was unsafe; one that docked late."""
    late = [_attempt(1, "breakaway", 0.4, "gust"), _attempt(2)]
    fuel = {"fuel_kg": 900.0, "timeline": json.dumps([{"phase": "disconnect", "begun_s": 40.0, "reason": "refuelled"}])}
    rows = [
        _row(0, radial_offset_m=0.05, closure_speed_m_s=0.99, attempts=late, **fuel),
        _row(1, radial_offset_m=0.15, closure_speed_m_s=1.0),
        _row(2, radial_offset_m=0.1, closure_speed_m_s=1.5, **fuel),
        _row(3, attempts=[_attempt(1, "contact", 0.16, "control_limit")], closure_speed_m_s=1.51),
        _row(4, attempts=[_attempt(1, "rim_strike", 0.3, "gust")], unsafe="touch at 2.70 m/s"),
        _row(5, error="ValueError: x", outcome="error", success=False, first_attempt=False, **fuel),
    ]
    (group,) = evidence_of([_campaign(rows)])["groups"]
    shares = ("first_attempt", "success", "refuelled", "inside_capture_radius", "closing_1_0_to_1_5_m_s")
    assert [(group[name]["count"], group[name]["of"]) for name in shares] == [(2, 6), (3, 6), (2, 6), (3, 4), (2, 4)]
    assert group["radial_offset_median_m"] == 0.125
    assert group["radial_offset_90_m"] == pytest.approx(0.15 + 0.7 * 0.01)  # between the third and the fourth
    assert group["closure_speed_max_m_s"] == 1.51
    assert (group["unsafe_seeds"], group["failed_seeds"], group["errors"]) == ([4], [0, 3, 4], 1)
    assert (group["flights"], group["seeds"], group["independent"]) == (6, 6, True)


def test_evidence_says_what_each_flight_had_drawn():
    sigma = {"turbulence.sigma_m_s": 0.5}
    drawn = _row(1, command=_command("light_gusts", 1, **sigma)) | {"set.turbulence.sigma_m_s": 0.5}
    as_written, with_draw = evidence_of([_campaign([_row(0), drawn])])["groups"]
    assert (as_written["settings"], as_written["each"][0][-1]) == ("", "")
    assert with_draw["settings"] == "turbulence.sigma_m_s drawn"
    assert with_draw["each"][0][-1] == "turbulence.sigma_m_s=0.5"


def test_of_many_drawn_keys_titles_and_pictures_say_how_many_and_the_page_says_which_once():
    few = {"flight.airspeed_m_s": 170.0, "start.aft_m": 5.0, "turbulence.sigma_m_s": 0.5}
    for drawn, short in ((few, False), (few | {"parameters.hose.length_m": 14.0}, True)):
        command = _command("light_gusts", 0, **drawn, **{"guidance.hold_s": 9})
        (group,) = groups_of([_row(0, command=command) | {f"set.{key}": value for key, value in drawn.items()}])
        whole = ", ".join(sorted(["guidance.hold_s=9", *(f"{key} drawn" for key in drawn)]))
        named = "guidance.hold_s=9, 4 keys drawn" if short else whole
        assert (group.settings, group.settings_in_short, group.name) == (whole, named, f"light_gusts with {named}")
        text = page("made", [_campaign(group.rows)])
        assert text.count(f"With <code>{whole}</code>") == short and named in text
        assert evidence_of([_campaign(group.rows)])["groups"][0]["settings"] == whole


def test_flights_without_a_draw_keep_their_claim_beside_those_with_one():
    sigma = {"turbulence.sigma_m_s": 9.0}
    drawn = [_row(k, command=_command("light_gusts", k, **sigma)) | {"set.turbulence.sigma_m_s": 9.0} for k in (5, 6)]
    written = [_row(k, scenario_hash=LIGHT_GUSTS) for k in (0, 1)]
    judged = [group["shortfalls"] for group in evidence_of([_campaign([*written, *drawn])])["groups"]]
    assert judged[0] is not None and judged[1] is None


def test_a_contact_outside_the_limits_has_its_cause_in_the_table():
    wide = _row(1, attempts=[_attempt(1, "contact", 0.2, "control_limit")])
    (camera,) = evidence_of([_campaign([_row(0), wide])])["groups"]
    assert camera["causes_of_failed_attempts"] == {"control_limit": 1}


def test_a_flight_in_two_campaigns_is_refused(tmp_path):
    folders = []
    for name in ("a", "b"):
        folder = tmp_path / name
        folder.mkdir()
        begun = {"schema_version": manifests.SCHEMA_VERSION, "plan": {"name": name}}
        manifests.write_json(begun, folder / manifests.FILE_NAME)
        table.write_table([_row(0)], folder)
        folders.append(folder)
    assert len(read_campaigns(folders[:1])[0].rows) == 1
    with pytest.raises(DockairError, match="seed 0, in .*/a and .*/b"):
        read_campaigns(folders)
    table.write_table([_row(0, sensing="truth"), _row(1)], folders[1])  # the same seed, by others
    assert [len(campaign.rows) for campaign in read_campaigns(folders)] == [1, 2]


def test_a_folder_without_a_campaign_is_one_clear_line(tmp_path):
    with pytest.raises(DockairError, match="manifest of a campaign"):
        read_campaigns([tmp_path])


def test_where_perfect_navigation_never_docked_there_is_no_ratio():
    truth = _without_attempt(0, "never_steady", sensing="truth", navigator="truth", scenario_hash="t")
    text = page("made", [_campaign([_without_attempt(0, "never_steady"), truth])])
    assert "What vision costs" in text
    assert ">nan<" not in text
    groups = groups_of([_row(0), truth])
    assert np.isnan(beside_perfect_navigation(groups[0], groups).ratio)


def _bin(count, size, **changes):
    names = ("range_rmse_m", "range_bias_m", "range_sigma_m", "lateral_rmse_m", "lateral_sigma_m")
    figures = dict.fromkeys((*names, "attitude_rmse_deg", "attitude_sigma_deg"), size)
    return {"low_m": 2.0, "high_m": 3.0, "count": count} | figures | changes


def test_frames_without_a_figure_make_it_no_smaller():
    """100 frames of 1 mm beside 300 that say nothing of it: still 1 mm, not 0.5 mm."""
    silent = dict.fromkeys(("range_rmse_m", "range_bias_m", "range_sigma_m", "attitude_sigma_deg"))
    rows = [
        _row(k, nav_by_range=json.dumps([entry]))
        for k, entry in enumerate([_bin(100, 1e-3), _bin(300, 1e-3, **silent)])
    ]
    (bin_,) = groups_of(rows)[0].by_range
    assert bin_["count"] == 400
    assert {name: value for name, value in bin_.items() if name not in ("low_m", "high_m", "count")} == pytest.approx(
        {name: 1e-3 for name in _bin(1, 0.0) if name not in ("low_m", "high_m", "count")}
    )


def test_where_no_frame_has_a_figure_there_is_a_dash():
    silent = dict.fromkeys(("range_sigma_m", "lateral_sigma_m", "attitude_sigma_deg", "range_bias_m"))
    text = page("made", [_campaign([_row(0, nav_by_range=json.dumps([_bin(4, 1e-3, **silent)]))])])
    assert '<td class="n">1.0 / –</td><td class="n">–</td>' in text
    assert ">nan" not in text and "nan<" not in text and "/ nan" not in text


def test_a_long_list_that_is_set_leaves_the_overview_s_axes_their_width(monkeypatch):
    """Its label has as many lines as it needs, and every group as much height."""
    faults = "[" + ", ".join(f'{{ kind = "led_off", leds = [{k}], start_s = {k}.5 }}' for k in range(8)) + "]"
    groups = groups_of([_row(1), _row(0, command=_command("light_gusts", 0, faults=faults, name="many"))])
    monkeypatch.setattr(figures, "as_svg", lambda figure, name: figure)
    figure = overview(groups)
    figure.draw_without_rendering()
    (ax,) = figure.axes
    assert ax.get_position().width > 0.5
    boxes = [label.get_window_extent() for label in ax.get_yticklabels()]
    assert not boxes[0].overlaps(boxes[1])
    long = ax.get_yticklabels()[1].get_text()
    assert long.count("\n") > 4 and long.replace("\n", " ") == groups[1].label and "name=" not in long


def test_no_text_from_outside_is_read_as_mathematics():
    """Of matplotlib's own language it would be nonsense, which raises."""
    sheet, phase = "/tmp/$^$x_y$.toml", "$^$"
    row = _row(0, command=_command("light_gusts", 0, **{"hardware.camera": sheet}), duration_s=9.0)
    row |= {"timeline": json.dumps([{"phase": phase, "begun_s": 0.0, "reason": ""}])}
    failed = _row(
        1, command=row["command"].replace("--seed 0", "--seed 1"), attempts=[_attempt(1, "miss", 0.4, "$^$ cause")]
    )
    (group,) = groups_of([row, failed])
    assert sheet in overview([group])
    assert "$^$ cause" in panels(group) and f">{phase}</text>" in timelines(group)


@pytest.mark.parametrize("text", ["bell \a, nothing \0, red \x1b[31m", "half \udce9", "C1 \x9b, \x7f"])
def test_a_page_holds_no_character_that_no_page_may_hold(text):
    made = page(text, [_campaign([_row(0, error=text)])])
    assert all(character in "\n\t" or character.isprintable() for character in set(made) - set("\xa0\u2009"))
    made.encode()


def test_every_id_is_there_once():
    rows = [_row(k, sensing=kind, attempts=[_attempt(1, "miss", 0.4, "gust")]) for k in range(3) for kind in _SENSING]
    rows += [_row(7, command=_command("light_gusts", 7, faults=[{"kind": "dead reel", "start_s": 1.0}]))]
    ids = _Page(page("made", [_campaign(rows)])).ids
    assert len(ids) == len(set(ids)) > 100
    assert not any(re.search(r"\s", name) for name in ids)


def test_a_picture_shows_the_markers_and_the_clips_that_it_defines():
    text = panels(groups_of([_row(0), _row(1)])[0])
    used = set(re.findall(r'url\(#([^)]+)\)|xlink:href="#([^"]+)"', text))
    assert used and {name for pair in used for name in pair if name} <= set(_Page(text).ids)


def test_each_cause_leads_to_the_flights_that_it_is_of():
    gust, drogue = [_attempt(1, "miss", 0.4, "gust")], [_attempt(1), _attempt(2, "miss", 0.4, "lost_drogue")]
    rows = [_row(0), _row(3, attempts=gust), _row(4, attempts=gust + [_attempt(2, "miss", 0.3, "gust")])]
    rows += [
        _row(5, attempts=drogue),
        _without_attempt(6, "never_steady"),
        _without_attempt(8, "", error="ValueError: x"),
    ]
    text = page("made", [_campaign(rows)])
    table_ = text[text.index("<th>why</th>") : text.index("Flights that failed")]
    lines = [re.findall(r"<td[^>]*>(.*?)</td>", line) for line in table_.splitlines() if line.startswith("<tr>")]
    shown = [[re.sub(r"<[^>]*>", "", cell) for cell in cells] for cells in lines if cells]
    assert [[name, *numbers] for name, _, *numbers in shown] == [
        ["gust", "3", "0", "3, 4"], ["lost drogue", "1", "0", "5"], ["never steady: abort", "0", "1", "6"],
        ["error", "0", "1", "8"],
    ]  # fmt: skip
    assert [meaning for _, meaning, *_ in shown] == [
        MEANINGS["gust"], "", MEANINGS["never_steady"], MEANINGS["error"],
    ]  # fmt: skip
    for seed in (3, 4, 5, 6, 8):
        (link,) = {name for name, shown in re.findall(r'href="#([^"]+)">(\d+)</a>', table_) if shown == str(seed)}
        (row,) = re.findall(rf'<tr id="{link}">.*</tr>', text)
        assert f"dockair fly light_gusts --seed {seed}</code>" in row


@pytest.mark.parametrize("most", [1, 2, 3, 7, 200])
def test_flights_are_counted_in_whole_numbers(most):
    ticks = figures._whole_numbers().tick_values(0.0, most)
    assert len(ticks) > 1 and all(float(tick).is_integer() for tick in ticks)
