"""Plans: what is flown, in which order, over what; and what is refused with one line."""

import os
import shlex
from importlib.resources import files
from pathlib import Path

import pytest

from dockair.errors import DockairError
from dockair.scenarios.campaign.jobs import as_toml, jobs_of, with_background
from dockair.scenarios.campaign.plan_file import PlanFile, plan_names
from dockair.scenarios.campaign.points import refuse_too_many, runs_of
from dockair.scenarios.scenario_file import scenario_names
from dockair.scenarios.schema import load_scenario
from dockair.scenarios.toml_files import toml_value


@pytest.fixture
def plan(tmp_path):
    """Make a plan from TOML, named "p"; `changes` and `settings` as from the command line."""

    def make(text: str, changes=None, settings=None) -> PlanFile:
        path = tmp_path / "p.toml"
        path.write_text(f'name = "p"\n{text}', encoding="utf-8")
        return PlanFile(path, changes, settings)

    return make


def refusal_of(plan, text: str, changes=None, settings=None) -> str:
    with pytest.raises(DockairError) as refused:
        jobs_of(plan(text, changes, settings))
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_jobs_are_scenarios_by_seeds_numbered_in_the_order_of_the_plan(plan):
    jobs = jobs_of(
        plan('scenarios = ["still_air", { scenario = "default", seeds = [9, 4] }]\nseeds = 3\nfirst_seed = 10')
    )
    assert [(job.number, job.scenario.name, job.seed) for job in jobs] == [
        (0, "still_air", 10), (1, "still_air", 11), (2, "still_air", 12), (3, "default", 19), (4, "default", 14),
    ]  # fmt: skip


def test_the_star_is_every_scenario_of_the_library(plan):
    assert sorted(job.scenario.name for job in jobs_of(plan('scenarios = ["*"]'))) == sorted(
        load_scenario(name).name for name in scenario_names()
    )


def test_the_later_setting_holds_plan_entry_draw_command_line(plan):
    text = """
scenarios = ["default", { scenario = "default", set = { "flight.duration_s" = 20.0, start.aft_m = 5.0 } }]
[set]
flight.duration_s = 10.0
"guidance.hold_s" = 1.0
[draw."start.up_m"]
values = [1.5]
"""
    first, second = (job.scenario for job in jobs_of(plan(text, settings={"guidance.hold_s": "2.0"})))
    assert (first.flight.duration_s, first.start.aft_m, first.start.up_m, first.guidance.hold_s) == (
        10.0,
        4.0,
        1.5,
        2.0,
    )
    assert (second.flight.duration_s, second.start.aft_m, second.guidance.hold_s) == (20.0, 5.0, 2.0)


@pytest.mark.parametrize(
    ("first", "second", "command_line", "flown"),
    [
        ("intensity", "sigma_m_s", "intensity", (None, "light")),
        ("sigma_m_s", "intensity", "sigma_m_s", (0.7, None)),
        ("intensity", "sigma_m_s", None, (2.5, None)),
        ("intensity", "intensity", "sigma_m_s", (0.7, None)),
    ],
)
def test_of_two_keys_that_exclude_each_other_the_later_holds(plan, first, second, command_line, flown):
    values = {"intensity": ['"severe"', '"moderate"', '"light"'], "sigma_m_s": ["1.5", "2.5", "0.7"]}
    text = f"""
scenarios = [{{ scenario = "default", set = {{ "turbulence.{second}" = {values[second][1]} }} }}]
[set]
"turbulence.{first}" = {values[first][0]}
"""
    settings = {f"turbulence.{command_line}": values[command_line][2]} if command_line else {}
    (job,) = jobs_of(plan(text, settings=settings))
    assert (job.scenario.turbulence.sigma_m_s, job.scenario.turbulence.intensity) == flown
    assert flown_again(job) == job.scenario


def flown_again(job):
    """The scenario that a job's command flies."""
    _, _, file, _, _, *options = shlex.split(job.command)
    return load_scenario(file, dict(option.split("=", 1) for option in options[1::2]))


def test_lists_of_tables_and_whatever_toml_knows_can_be_set(plan, tmp_path):
    sheet = tmp_path / 'a "quoted" path, ä.toml'
    sheet.write_text("diameter_m = 0.5\ncount = 8\n")
    text = f"""
scenarios = ["default"]
[set]
faults = [{{ kind = "dead_reel", start_s = 1.5 }}, {{ kind = "led_dim", leds = [1, 2], factor = 0.25 }}]
gusts = [{{ at_s = 1e-3, length_m = 1e3, velocity_m_s = [0.0, -1.0, 2.0] }}]
"hardware.ring" = '{sheet}'
"turbulence" = {{ sigma_m_s = 0.3, model = "dryden" }}
"wake.present" = false
"""
    (job,) = jobs_of(plan(text))
    assert [fault.kind for fault in job.scenario.faults] == ["dead_reel", "led_dim"]
    assert job.scenario.gusts[0].velocity_m_s == (0.0, -1.0, 2.0)
    assert job.scenario.wake.present is False
    assert flown_again(job) == job.scenario


@pytest.mark.parametrize(
    "value",
    [True, 3, -0.0, 1e16, 1e-5, 'a "b" \\ \n \x7f ä', [], [[1], ["x"]], {"a b": {"c": [1.5]}, "d-e": {}, "": 0}],
)
def test_a_value_comes_back_from_its_toml(value):
    assert toml_value(as_toml(value, "key")) == value
    assert "\n" not in as_toml(value, "key")


def test_a_background_that_is_asked_for_stays_whatever_the_machine_could_draw(plan):
    asked = [f'{{ scenario = "default", set.camera.background = "{name}" }}' for name in ("analytic", "auto")]
    analytic, auto = jobs_of(plan(f"scenarios = [{', '.join(asked)}]"))
    assert with_background(analytic, "mujoco") is analytic and with_background(auto, "") is auto
    assert with_background(auto, "mujoco").scenario.camera.background == "mujoco"
    assert auto.scenario.camera.background == "auto"


def test_only_numbers_that_follow_one_another_are_a_run():
    assert runs_of([3, 4, 5, 2, 2, 1, 9]) == [(3, 5), (2, 2), (2, 2), (1, 1), (9, 9)]
    assert runs_of([]) == []


def test_a_text_of_the_plan_stays_a_text(plan):
    scenario = jobs_of(plan('scenarios = ["default"]\n[set]\nname = "true"'))[0].scenario
    assert scenario.name == "true"


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ('sampler = "grid"', 3 * 4),
        ('sampler = "random"', 4),
        ('sampler = "latin_hypercube"', 4),
        ('sampler = "latin_hypercube"\ndraws = 5', 5 * 4),
    ],
)
def test_a_grid_and_a_number_of_draws_meet_every_seed_else_each_seed_has_a_point(plan, more, expected):
    text = f"""
scenarios = ["default"]
seeds = 4
{more}
[draw."turbulence.sigma_m_s"]
low = 0.1
high = 0.3
{"points = 3" if "grid" in more else ""}
"""
    jobs = jobs_of(plan(text))
    assert len({job.key for job in jobs}) == len(jobs) == expected
    for job in jobs:
        assert job.scenario.turbulence.sigma_m_s == job.drawn["turbulence.sigma_m_s"]
        assert 0.1 <= job.drawn["turbulence.sigma_m_s"] <= 0.3


def test_scenarios_are_flown_with_the_same_points(plan):
    jobs = jobs_of(plan('scenarios = ["default", "racetrack"]\nseeds = 5\n[draw."start.aft_m"]\nlow = 3.0\nhigh = 5.0'))
    assert [job.drawn for job in jobs[:5]] == [job.drawn for job in jobs[5:]]


@pytest.mark.parametrize("points", ["", "draws = 3\n"])
@pytest.mark.parametrize("sampler", ["random", "latin_hypercube"])
def test_another_seed_of_the_draws_draws_other_points_for_the_same_flights(plan, sampler, points):
    def drawn(seed):
        head = f'scenarios = ["default"]\nseeds = 2\nsampler = "{sampler}"\ndraw_seed = {seed}\n{points}'
        jobs = jobs_of(plan(f'{head}[draw."start.aft_m"]\nlow = 3.0\nhigh = 5.0'))
        return [(job.seed, job.drawn["start.aft_m"]) for job in jobs]

    assert drawn(0) == drawn(0)
    assert [seed for seed, _ in drawn(0)] == [seed for seed, _ in drawn(1)]
    assert not {place for _, place in drawn(0)} & {place for _, place in drawn(1)}


def test_a_plan_with_a_seed_of_its_draws_is_flown_on_a_grid_where_the_command_line_says_so(plan):
    text = 'scenarios = ["default"]\nseeds = 1\ndraw_seed = 3\n[draw."start.aft_m"]\nvalues = [3.0, 4.0]'
    assert len(jobs_of(plan(text, {"sampler": "grid"}))) == 2


def test_the_command_line_replaces_seeds_everywhere_and_the_sampler(plan):
    text = 'scenarios = [{ scenario = "default", seeds = 9 }]\nseeds = 7\n[draw."start.aft_m"]\nvalues = [3.0, 4.0]'
    assert len(jobs_of(plan(text, {"seeds": 2}))) == 2
    assert len(jobs_of(plan(text, {"seeds": 2, "sampler": "grid"}))) == 4


def test_an_empty_table_in_set_is_a_value_as_on_the_command_line(plan):
    (job,) = jobs_of(plan('scenarios = ["moderate_gusts"]\n[set]\nturbulence = {}'))
    assert job.scenario.turbulence == load_scenario("moderate_gusts", {"turbulence": "{}"}).turbulence
    assert job.scenario.turbulence != load_scenario("moderate_gusts").turbulence


@pytest.mark.parametrize("name", plan_names())
def test_every_packaged_plan_can_be_flown_and_says_what_for(name):
    source = PlanFile(name)
    assert source.plan.name == name
    assert source.plan.claim
    assert jobs_of(source)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('scenarios = ["default"]\nseed = 3', "p.toml: seed: expected a known key, got 'seed'; exists: claim, draw"),
        ("seeds = 3", "a name or a table with scenario, seeds, set, got 'nothing'"),
        ("scenarios = []", "p.toml: scenarios: expected a list of scenarios"),
        ('scenarios = "default"', "p.toml: scenarios: expected a list of scenarios"),
        ('scenarios = [{ scenario = "default", sed = 1 }]', "p.toml: scenarios[0].sed: expected a known key"),
        ("scenarios = [{ seeds = 1 }]", "p.toml: scenarios[0].scenario: expected a string, got 'nothing'"),
        ('scenarios = ["defualt"]', "scenarios[0]: scenario: expected a scenario of the library"),
        ('scenarios = ["mine.toml"]', "mine.toml: expected a scenario file, got 'no such file'"),
        ('scenarios = ["default", "default"]', "scenarios: expected every flight once, got 'default, seed 0, twice'"),
        ('scenarios = ["default"]\nseeds = 0', "seeds: expected how many seeds, from 1 to 100000"),
        ('scenarios = ["default"]\nseeds = []', "each from 0 to 2^63 - 1, got []"),
        ("scenarios = []", "with scenario, seeds, set, got []"),
        ('scenarios = ["default"]\nseeds = [-1]', "seeds[0]: expected how many seeds"),
        ('scenarios = ["default"]\nseeds = true', "seeds: expected how many seeds"),
        ('scenarios = ["default"]\nseeds = [1, 1]', "expected every flight once, got 'default, seed 1, twice'"),
        ('scenarios = ["default"]\nsampler = "sobol"', "exists: grid, random, latin_hypercube"),
        ('scenarios = ["default"]\nsampler = "random"', "sampler: expected keys to draw, or no sampler, got 'random'"),
        ('scenarios = ["default"]\ndraws = 3', "draws: expected keys to draw"),
        ('scenarios = ["default"]\ndraw_seed = 3', "draw_seed: expected keys to draw"),
        (
            'scenarios = ["default"]\nsampler = "grid"\ndraw_seed = 3\n[draw."start.aft_m"]\nvalues = [3.0, 4.0]',
            "p.toml: draw_seed: expected keys to draw at random or by Latin hypercube, or no seed of the draws, got 3",
        ),
        (
            'scenarios = ["default"]\n[set]\n"turbulence.sigma" = 1.0',
            "p.toml: set.turbulence.sigma: expected a known key",
        ),
        (
            'scenarios = ["default"]\n[set]\nstart.aft_m = -1.0',
            "p.toml: set.start.aft_m: expected a number from 0.5 to 40.0",
        ),
        (
            'scenarios = [{ scenario = "default", set = { "start.aft_m" = "x" } }]',
            "p.toml: scenarios[0].set.start.aft_m: expected a number from 0.5 to 40.0, got 'x'",
        ),
        (
            'scenarios = [{ scenario = "default", set = { "start.aft_m" = -1.0 } }]\n[set]\n"start.aft_m" = 3.0',
            "p.toml: scenarios[0].set.start.aft_m: expected",
        ),
        (
            'scenarios = ["default"]\n[draw."start.aft_m"]\nlow = 0.0\nhigh = 0.1',
            'p.toml: draw."start.aft_m": expected a number from 0.5 to 40.0',
        ),
        (
            'scenarios = ["default"]\n[draw."start.aft_m"]\nlow = 0.0',
            'p.toml: draw."start.aft_m": expected low and high, or',
        ),
        (
            'scenarios = ["default"]\n[draw."start.aft_m"]\nlo = 0.0',
            'p.toml: draw."start.aft_m".lo: expected a known key',
        ),
        ('scenarios = ["default"]\n[draw]\nx = 1', 'p.toml: draw."x": expected a table, got 1'),
        ('scenarios = ["default"]\n[gate]\nsuccess_rate = 1.5', "p.toml: gate.success_rate: expected a number"),
        (
            'scenarios = ["default"]\n[gate.scenarios.night]\nsuccess_rate = 0.5',
            "gate.scenarios: expected a scenario of the",
        ),
        (
            'scenarios = ["default"]\n[gate.scenarios.default]\nrate = 0.5',
            "gate.scenarios.default.rate: expected a known",
        ),
        (
            'scenarios = ["default"]\n[set]\n"navigation.navigator" = "no_such_module:Navigator"',
            'navigation.navigator: expected an importable "module:Class", got "no_such_module:Navigator: No module',
        ),
        (
            'scenarios = ["default"]\n[set]\n"navigation.navigator" = "dockair.messages:Mine"',
            'navigation.navigator: expected an importable "module:Class"',
        ),
        (
            'scenarios = ["default"]\n[set]\n"navigation.navigator" = "os:path"',
            "navigation.navigator: expected a class that is made of (sheets) and has step(imu, frame)",
        ),
        (
            'scenarios = ["default"]\n[set]\n"start.aft_m" = 2020-01-01',
            "p.toml: set.start.aft_m: expected a number, a text, true or false, a list or a table, got '2020-01-01'",
        ),
        (
            'scenarios = [{ scenario = "default", set = { faults = [{ kind = "dead_reel", start_s = 07:32:00 }] } }]',
            "p.toml: scenarios[0].set.faults: expected a number, a text",
        ),
        ('scenarios = ["default"]\n[set]\n"start.aft_m" = nan', "p.toml: set.start.aft_m: expected a number from 0.5"),
        (
            'scenarios = ["default"]\n[draw."turbulence.sigma_m_s"]\nvalues = [0.5]\n'
            '[draw."turbulence.intensity"]\nvalues = ["light"]',
            'p.toml: draw."turbulence.sigma_m_s": expected a key in whose place nothing else is set or drawn',
        ),
        (
            'scenarios = ["default"]\nseeds = 2\n[draw.seed]\nvalues = [5, 6]',
            'p.toml: draw."seed": expected a key that decides the flight',
        ),
        ('scenarios = ["default"]\n[set]\nseed = 5', "p.toml: set.seed: expected a key that decides the flight"),
        ('scenarios = ["default"]\n[set]\nclaim = "x"', "p.toml: set.claim: expected a key that decides the flight"),
        (
            'scenarios = ["still_air", { scenario = "default", set = { accept = { outcome = "miss" } } }]',
            "p.toml: scenarios[1].set.accept.outcome: expected a key that decides the flight",
        ),
        (
            'scenarios = ["default"]\nseeds = [4611686018427387904]\nfirst_seed = 4611686018427387904',
            "p.toml: first_seed: expected seeds up to 9223372036854775807, first_seed added, got 9223372036854775808",
        ),
        (
            'scenarios = ["default"]\nseeds = 2\ndraws = 5\n[draw."turbulence.sigma_m_s"]\nvalues = [0.1, 0.2]',
            "p.toml: draws: expected points that differ; of listed values fewer draws make them",
        ),
        (
            'scenarios = ["default"]\nsampler = "grid"\n[draw."turbulence.sigma_m_s"]\nvalues = [0.1, 0.2, 0.1]',
            "p.toml: draw: expected values that differ, got 'turbulence.sigma_m_s = 0.1 2 times'",
        ),
        (
            'scenarios = ["default"]\nsampler = "grid"\n[draw."turbulence.sigma_m_s"]\nlow = 0.1\nhigh = 1.0',
            'p.toml: draw."turbulence.sigma_m_s": expected values, or low, high and points: the plan is a grid',
        ),
        (
            'scenarios = ["default"]\n[set]\n"parameters.drogue.ring_diameter_m" = 0.6',
            "p.toml: scenarios: default: parameters.drogue.ring_diameter_m: expected the LED ring's own diameter",
        ),
        (
            'scenarios = ["default"]\n[set]\n"camera.sensing" = "measurements"\n'
            '"faults" = [{ kind = "hot_pixels", count = 3 }]',
            'p.toml: scenarios: default: camera.sensing: expected "frames": the scenario has what acts',
        ),
        (
            'scenarios = ["default"]\n[set]\n"faults" = [{ kind = "exposure_stuck", exposure_us = 5000.0 }]',
            "p.toml: scenarios: default: faults[0].exposure_us: expected 14 to 500 us, the hardware's limits",
        ),
        (
            'scenarios = ["still_air"]\n[set]\n"turbulence.model" = "none"\n'
            '[draw."turbulence.sigma_m_s"]\nlow = 0.1\nhigh = 1.0',
            'p.toml: draw."turbulence.sigma_m_s": expected turbulence.model that is not set to none',
        ),
        (
            'scenarios = ["default"]\n[draw."start.aft_m"]\nlow = 3.0\nhigh = 5.0\npoints = 7',
            'p.toml: draw."start.aft_m".points: expected none, or sampler = "grid": only a grid has points, got 7',
        ),
        (
            'scenarios = ["default"]\n[set]\n"start.aft_m" = 3.0\n[set.start]\naft_m = 4.0',
            "p.toml: set: expected every key once, got 'start.aft_m, twice'",
        ),
        (
            'scenarios = ["default"]\n[set.parameters.hose]\nlength_m = 14.0\n[set.parameters]\n"hose.length_m" = 15.0',
            "p.toml: set: expected every key once, got 'parameters.hose.length_m, twice'",
        ),
        (
            'scenarios = ["night", { scenario = "default", set = { start = { aft_m = 3.0 }, "start.aft_m" = 3.0 } }]',
            "p.toml: scenarios[1].set: expected every key once, got 'start.aft_m, twice'",
        ),
        (
            'scenarios = ["default"]\n[draw."start.aft_m"]\nlow = 3.0\nhigh = 4.0\n[draw.start.aft_m]\nvalues = [4.0]',
            "p.toml: draw: expected every key once, got 'start.aft_m, twice'",
        ),
        (
            'scenarios = ["default"]\n[set]\n"start.aft_m" = 3.0\n[set.start]',
            "p.toml: set: expected every key once, got 'start and start.aft_m'",
        ),
        (
            'scenarios = ["default"]\n[set]\nparameters = {}\n"parameters.hose.length_m" = 14.0',
            "p.toml: set: expected every key once, got 'parameters and parameters.hose.length_m'",
        ),
        (
            'scenarios = ["default"]\n[set.navigation]\nheading_every_s = 1.0\nheading = "yes"',
            "p.toml: set.navigation.heading: expected",
        ),
        ('scenarios = ["default"]\nseeds = [9223372036854775808]', "p.toml: seeds"),
        ("scenarios = [", "p.toml: expected TOML"),
    ],
)
def test_what_cannot_be_flown_is_refused_with_one_line_that_says_where(plan, text, said):
    assert said in refusal_of(plan, text)


def test_what_holds_a_wrong_entry_is_not_told_to_be_wrong_too(plan):
    assert "also wrong" not in refusal_of(plan, 'scenarios = ["default"]\nseeds = ["1"]')
    assert refusal_of(plan, "scenarios = [{ scenario = 3, seeds = 0 }]").endswith("; also wrong: scenarios[0].seeds")


def test_a_limit_that_a_value_may_not_reach_is_told(plan):
    said = refusal_of(plan, 'scenarios = ["default"]\n[gate]\nfalse_alarm = 0.9')
    assert "gate.false_alarm: expected a number above 0.0 below 0.5, got 0.9" in said


def test_a_drawn_key_may_be_written_as_nested_tables_as_one_that_is_set(plan):
    quoted, nested = (
        jobs_of(plan(f'scenarios = ["default"]\nseeds = 3\n[draw.{key}]\nlow = 0.2\nhigh = 1.0'))
        for key in ('"turbulence.sigma_m_s"', "turbulence.sigma_m_s")
    )
    assert [job.drawn for job in nested] == [job.drawn for job in quoted]
    assert [*nested[0].drawn] == ["turbulence.sigma_m_s"]


def test_what_an_entry_of_a_list_has_is_drawn_by_its_place(plan):
    """When a fault acts, over the plan's own list of faults; each flight is flown again by its command."""
    text = """
scenarios = ["default", "gyro_faults"]
seeds = 4
set.faults = [{ kind = "camera_drop_out", stop_s = 20.0 }, { kind = "dead_reel" }]
[draw."faults[0].start_s"]
low = 5.0
high = 15.0
"""
    jobs = jobs_of(plan(text))
    assert len({job.drawn["faults[0].start_s"] for job in jobs[:4]}) == 4
    for job in jobs:
        drop_out, reel = job.scenario.faults
        assert (drop_out.start_s, drop_out.stop_s, reel.start_s) == (job.drawn["faults[0].start_s"], 20.0, 0.0)
        assert flown_again(job) == job.scenario


def test_a_list_that_is_set_later_replaces_what_was_set_in_an_earlier_one(plan):
    text = """
scenarios = [{ scenario = "gyro_faults", set = { "faults[8].limit_deg_s" = 9.0 } }]
"""
    (job,) = jobs_of(plan(text))
    assert job.scenario.faults[8].limit_deg_s == 9.0
    (job,) = jobs_of(plan(text, settings={"faults": '[{ kind = "dead_reel" }]'}))
    assert ([*job.settings], len(job.scenario.faults)) == (["faults"], 1)
    assert flown_again(job) == job.scenario


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[draw."faults[1].start_s"]\nvalues = [1.0]', 'draw."faults[1].start_s": expected a place from 0 to 0'),
        ('[draw."faults[0].cover"]\nvalues = [0.1]', 'draw."faults[0].cover": expected a key of the kind led_off'),
        (
            '"faults[0].start_s" = 1.0',
            "p.toml: set: expected every key once, got 'faults and faults[0].start_s'",
        ),
    ],
)
def test_a_place_that_the_list_does_not_have_is_refused_where_it_stands(plan, text, said):
    faults = 'scenarios = ["default"]\n[set]\nfaults = [{ kind = "led_off" }]\n'
    assert said in refusal_of(plan, faults + text)


def test_a_list_from_the_command_line_may_not_replace_what_is_drawn_in_it(plan):
    text = 'scenarios = ["gyro_faults"]\n[draw."faults[0].start_s"]\nvalues = [1.0, 3.0]'
    said = refusal_of(plan, text, settings={"faults": '[{ kind = "dead_reel" }]'})
    assert 'draw."faults[0].start_s": expected a key in whose place nothing else is set' in said


def test_what_the_command_line_asks_in_vain_is_said_to_be_its_own(plan):
    assert refusal_of(plan, 'scenarios = ["default"]', settings={"start.aft_m": "-1"}).startswith(
        "--set start.aft_m: expected"
    )
    text = 'scenarios = ["default"]\n[draw."start.aft_m"]\nvalues = [3.0]'
    assert "expected a key that the plan does not draw" in refusal_of(plan, text, settings={"start.aft_m": "3"})
    assert refusal_of(plan, 'scenarios = ["default"]', settings={"start.aft_m": "2020-01-01"}).startswith(
        "--set start.aft_m: expected a number, a text"
    )
    assert refusal_of(plan, 'scenarios = ["default"]', settings={"seed": "3"}) == (
        "--set seed: expected a key that decides the flight, got 'seed'"
    )


@pytest.mark.parametrize("setting", [{"turbulence.intensity": "light"}, {"turbulence": "{ sigma_m_s = 0.3 }"}])
def test_what_is_drawn_is_flown_or_refused(plan, setting):
    """The column of a drawn key would hold values that no flight had."""
    text = 'scenarios = ["default"]\nseeds = 3\n[draw."turbulence.sigma_m_s"]\nlow = 1.0\nhigh = 3.0'
    said = refusal_of(plan, text, settings=setting)
    assert said.startswith(f'{plan(text)._shown}: draw."turbulence.sigma_m_s": expected a key in whose place nothing')
    assert all(job.scenario.turbulence.sigma_m_s == job.drawn["turbulence.sigma_m_s"] for job in jobs_of(plan(text)))


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("def step(:", "SyntaxError: invalid syntax (own_broken.py, line 1)"),
        ("gain = 1\nhalf = gain / 0", "ZeroDivisionError: division by zero (/"),
        ("raise SystemExit(0)", "SystemExit: 0 (/"),
        ("raise KeyError('two\\nlines')", "KeyError: "),
    ],
)
def test_a_navigator_whose_module_fails_is_refused_with_what_it_said(plan, tmp_path, monkeypatch, source, said):
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "own_broken.py").write_text(source)
    text = 'scenarios = ["default"]\n[set]\n"navigation.navigator" = "own_broken:Navigator"'
    refused = refusal_of(plan, text)
    assert 'navigation.navigator: expected an importable "module:Class"' in refused
    assert said in refused


def test_a_scenario_is_no_plan_by_name_or_by_path(tmp_path):
    with pytest.raises(DockairError, match="^plan: expected a plan, got 'a scenario, for dockair fly night'$"):
        PlanFile("night")
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\n[turbulence]\nsigma_m_s = 1.0\n', encoding="utf-8")
    with pytest.raises(DockairError, match=f"^{path}: expected a plan, got 'a scenario, for dockair fly {path}'$"):
        PlanFile(path)


def test_a_plan_that_does_not_exist_lists_those_that_do():
    with pytest.raises(DockairError) as refused:
        PlanFile("level")
    assert "plan: expected a packaged plan, or the path of a TOML file, got 'level'; exists: " in str(refused.value)
    assert "levels" in refused.value.exists
    assert str(refused.value).endswith("; did you mean levels?")
    with pytest.raises(DockairError, match="expected a plan file, got 'no such file'"):
        PlanFile(Path("no") / "such.toml")


def test_scenarios_of_ones_own_lie_beside_the_plan(plan, tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text('name = "my_own"')
    monkeypatch.chdir("/")
    assert jobs_of(plan('scenarios = ["mine.toml"]'))[0].scenario.name == "my_own"


def test_a_file_whose_name_begins_with_a_dash_is_flown_again_as_a_file(plan, tmp_path, monkeypatch):
    (tmp_path / "-mine.toml").write_text('name = "mine"')
    monkeypatch.chdir(tmp_path)
    plan('scenarios = ["-mine.toml"]')
    (job,) = jobs_of(PlanFile(Path("p.toml")))
    assert job.command == "dockair fly ./-mine.toml --seed 0"
    assert flown_again(job) == job.scenario


def test_what_is_no_utf8_is_refused_before_it_is_flown_for_no_table_holds_it(tmp_path, plan):
    odd = tmp_path / os.fsdecode(b"\xff")
    odd.mkdir()
    (odd / "mine.toml").write_text('name = "mine"')
    for name, text in (("own", '["mine.toml"]'), ("library", '["default"]')):
        (odd / f"{name}.toml").write_text(f'name = "p"\nscenarios = {text}')
    with pytest.raises(DockairError, match=r"own.toml: scenarios\[0\]: expected UTF-8, got '.*udcff/mine.toml'"):
        jobs_of(PlanFile(odd / "own.toml"))
    assert len(jobs_of(PlanFile(odd / "library.toml"))) == 1
    said = refusal_of(plan, 'scenarios = ["default"]', settings={"hardware.ring": str(odd / "ring.toml")})
    assert said.startswith("--set hardware.ring: expected UTF-8, got ")


RING, OTHER_RING = "diameter_m = 0.5\ncount = 8", "diameter_m = 0.5\ncount = 8\nbrightness = [2, 1, 1, 1, 1, 1, 1, 1]"
MINE = 'name = "mine"\nclaim = "{claim}"\n[turbulence]\nsigma_m_s = {sigma}\n[hardware]\nring = "ring.toml"'


@pytest.fixture
def two_files(tmp_path):
    """Two scenario files named "mine", each with a sheet beside it; returns what makes the second anew."""
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "ring.toml").write_text(RING)
        (tmp_path / folder / "mine.toml").write_text(MINE.format(claim=folder, sigma=0.2))

    def second(sigma: float, ring: str) -> None:
        (tmp_path / "b/mine.toml").write_text(MINE.format(claim="b", sigma=sigma))
        (tmp_path / "b/ring.toml").write_text(ring)

    return second


@pytest.mark.parametrize("draw", ["", '[draw."start.aft_m"]\nlow = 3.0\nhigh = 5.0'])
@pytest.mark.parametrize(("sigma", "ring"), [(2.0, RING), (0.2, OTHER_RING)])
def test_two_scenarios_of_one_name_are_no_plan(plan, two_files, sigma, ring, draw):
    """Pooled, the good one would carry the bad one through the gate."""
    two_files(sigma, ring)
    said = refusal_of(plan, f'scenarios = ["a/mine.toml", {{ scenario = "b/mine.toml", seeds = [9] }}]\n{draw}')
    assert "p.toml: scenarios: expected a name for each scenario, for flights are pooled by it, got 'mine in " in said
    assert "a/mine.toml, another in " in said and said.endswith("b/mine.toml'")


def test_one_scenario_in_two_files_or_under_two_names_is_a_plan(plan, two_files):
    assert len(jobs_of(plan('scenarios = ["a/mine.toml", { scenario = "b/mine.toml", seeds = [9] }]'))) == 2
    two_files(2.0, RING)
    renamed = 'scenarios = ["a/mine.toml", { scenario = "b/mine.toml", set = { name = "rough" } }]'
    assert [job.scenario.name for job in jobs_of(plan(renamed))] == ["mine", "rough"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seeds = 100000\ndraws = 100000", "p.toml: draws: expected up to 200000 flights, got 10000000000"),
        ('seeds = 9\nsampler = "grid"', "p.toml: draw: expected up to 200000 flights, got 900000000"),
        ('scenarios = ["*"]\nseeds = 100000', "p.toml: seeds: expected up to 200000 flights, got "),
        (
            'scenarios = ["default", { scenario = "racetrack", seeds = 100000 }]\nseeds = 1\ndraws = 2',
            "p.toml: draws: expected up to 200000 flights, got 200002",
        ),
    ],
)
def test_too_many_flights_are_refused_before_any_is_made(plan, monkeypatch, text, said):
    for name in ("points.grid", "points.samples", "jobs.load_scenario", "jobs.Job"):
        monkeypatch.setattr(f"dockair.scenarios.campaign.{name}", lambda *_: pytest.fail("made"))
    scenarios = "" if "scenarios" in text else 'scenarios = ["default"]\n'
    ranges = "".join(
        f'[draw."{key}"]\nlow = 3.0\nhigh = 5.0\npoints = 10000\n' for key in ("start.aft_m", "start.up_m")
    )
    if "grid" not in text:
        ranges = ranges.replace("points = 10000", "")
    assert said in refusal_of(plan, f"{scenarios}{text}\n{ranges}")


def test_as_many_flights_as_are_allowed_are_not_too_many(plan):
    half = '{{ scenario = "{}", seeds = 100000 }}'
    refuse_too_many(plan(f"scenarios = [{half.format('default')}, {half.format('racetrack')}]"))


def test_paths_of_sheets_in_a_plan_are_taken_from_its_folder_as_those_of_scenarios(plan, monkeypatch, tmp_path):
    """Whoever calls it from elsewhere flies the same sheet."""
    source = plan('scenarios = ["default"]\n[set]\n"hardware.ring" = "ring.toml"')
    sheet = files("dockair.assets") / "calibration" / "ring.toml"
    (source.folder / "ring.toml").write_text(sheet.read_text(encoding="utf-8"))
    monkeypatch.chdir(tmp_path.parent)
    (job,) = jobs_of(source)[:1]
    assert job.scenario.hardware.ring == str(source.folder / "ring.toml")


def test_a_listed_value_that_cannot_be_flown_is_refused_though_no_flight_drew_it(plan):
    text = (
        'scenarios = ["light_gusts", "moderate_gusts"]\nseeds = 1\nsampler = "random"\ndraw_seed = {seed}\n'
        '[draw."turbulence.intensity"]\nvalues = ["light", "{last}"]'
    )
    for seed in range(4):  # some of them draw the first value, some the last
        assert len(jobs_of(plan(text.format(seed=seed, last="moderate")))) == 2
        said = refusal_of(plan, text.format(seed=seed, last="heavy"))
        assert 'p.toml: draw."turbulence.intensity": expected' in said and "got 'heavy'; exists: light" in said


def test_sheets_that_are_drawn_are_taken_from_the_plans_folder_too(plan, monkeypatch, tmp_path):
    source = plan('scenarios = ["default"]\nsampler = "grid"\n[draw."hardware.ring"]\nvalues = ["a.toml", "b.toml"]')
    for name in ("a.toml", "b.toml"):
        (source.folder / name).write_text(f"# {name}\ndiameter_m = 0.5\ncount = 8\n")
    monkeypatch.chdir(tmp_path.parent)
    jobs = jobs_of(source)
    assert [job.drawn for job in jobs] == [{"hardware.ring": name} for name in ("a.toml", "b.toml")]
    assert [job.scenario.hardware.ring for job in jobs] == [str(source.folder / name) for name in ("a.toml", "b.toml")]
