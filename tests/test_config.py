"""Settings: precedence, refusals with the nearest name and the line, and a loss-free dump."""

from __future__ import annotations

import math
import string
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import NoneType
from typing import get_args

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.config import (
    Settings,
    dump_settings,
    load_settings,
    profile_names,
    settings_as_dict,
)
from bsmap_cli.config.gathered import leaves
from bsmap_cli.errors import ConfigError

CONFIGS = Path(__file__).parent.parent / "configs"


def refusal(*overrides, **more):
    with pytest.raises(ConfigError) as caught:
        load_settings(overrides=overrides, **more)
    message = str(caught.value)
    assert "\n" not in message
    return message


def write(tmp_path, text):
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    return path


def test_what_comes_later_wins(tmp_path):
    file = write(tmp_path, "segmentation:\n  rel_gap: 5\n  max_gap: 0.9\n")
    assert Settings().fitting.parameters == "arc"
    settings = load_settings("paper", file, ["segmentation.max_gap=0.8"])
    assert settings.fitting.parameters == "chord"  # profile over built-in
    assert settings.segmentation.rel_gap == 5.0  # file over profile
    assert settings.segmentation.max_gap == 0.8  # override over file
    assert settings.segmentation.min_points == 16  # untouched by what came later


def test_the_default_profile_is_the_built_in_values():
    assert load_settings() == load_settings("default") == Settings()


def test_the_paper_profile_has_the_values_of_the_paper():
    paper = load_settings("paper")
    assert paper.degree == 3
    assert paper.segmentation.rel_gap == 3.0
    assert paper.segmentation.max_gap == 0.7
    assert paper.segmentation.min_points == 4 * (paper.degree + 1)
    assert paper.association.track_dist == 1.0
    assert paper.merging.max_weight == 50


@pytest.mark.parametrize("profile", profile_names())
def test_every_profile_has_a_commented_file_in_configs(profile, rewrite_golden):
    path, text = CONFIGS / f"{profile}.yaml", dump_settings(load_settings(profile))
    if rewrite_golden:
        path.write_text(text)
    assert path.read_text() == text


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_file_in_configs_loads(path):
    assert isinstance(load_settings(file=path), Settings)


def test_yaml_reads_1e_3_as_a_word_and_we_read_it_as_a_number(tmp_path):
    assert yaml.safe_load("1e-3") == "1e-3"
    file = write(tmp_path, "fitting:\n  penalty: 1e-3\nladder: [4e-1, 2e-1]\n")
    settings = load_settings(file=file)
    assert settings.fitting.penalty == 1e-3
    assert settings.ladder == (0.4, 0.2)
    assert load_settings(overrides=["fitting.penalty=2e-3"]).fitting.penalty == 2e-3


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        ("segmentation.relgap", "segmentation.rel_gap"),
        ("segmentation.rel_gpa", "segmentation.rel_gap"),
        ("rel_gap", "segmentation.rel_gap"),
        ("fit.penalty", "fitting.penalty"),
        ("lader", "ladder"),
        ("sensor.range_max", "sensor.range_max_m"),
    ],
)
def test_an_unknown_key_is_refused_with_the_nearest_name(wrong, meant, tmp_path):
    assert f"did you mean {meant!r}?" in refusal(f"{wrong}=1")
    section, _, name = wrong.rpartition(".")
    nested = f"{section}:\n    {name}: 1\n" if section else f"{name}: 1\n"
    message = refusal(file=write(tmp_path, f"# mine\ndegree: 3\n{nested}"))
    assert f"did you mean {meant!r}?" in message


def test_a_key_like_no_other_is_refused_with_the_way_to_the_list():
    message = refusal("flux_capacitor=1")
    assert "flux_capacitor" in message and "bsmap config show" in message


def test_the_line_of_the_file_is_named(tmp_path):
    file = write(tmp_path, "degree: 3\n\nsegmentation:\n  rel_gap: 3\n  min_pionts: 4\n")
    assert refusal(file=file).startswith(f"{file}:5: unknown setting 'segmentation.min_pionts'")
    file = write(tmp_path, "degree: 3\nfitting:\n  penalty: [\n")
    assert refusal(file=file).startswith(f"{file}:4: not YAML")
    file = write(tmp_path, "degree: 3\nsegmentation: 4\n")
    assert refusal(file=file).startswith(f"{file}:2: segmentation must hold")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("degree=6", "at most 5"),
        ("degree=1", "at least 2"),
        ("degree=3.5", "a whole number"),
        ("degree=true", "a whole number"),
        ("degree=", "no value"),
        ("degree=null", "no value"),
        ("merging.max_weight=256", "at most 255"),
        ("fitting.penalty=-1", "at least 0"),
        ("fitting.penalty=.nan", "finite"),
        ("fitting.penalty=.inf", "finite"),
        ("fitting.penalty=[1]", "a number"),
        ("fitting.parameters=spline", "one of arc, chord"),
        ("ladder=0.1", "a list of numbers"),
        ("ladder=[]", "get smaller"),
        ("ladder=[0.1, 0.2]", "get smaller"),
        ("ladder=[0.1, 0.1]", "get smaller"),
        ("ladder=[0.1, -0.1]", "above 0"),
        ("sensor.ignore_angles_deg=[1, 2]", "a list of pairs"),
        ("sensor.range_max_m=far", "a number or null"),
        ("merging=4", "is a section"),
        ("degree", "key=value"),
        ("=4", "key=value"),
        ("degree=[", "not YAML"),
    ],
)
def test_a_bad_value_is_refused_in_plain_words(override, words):
    message = refusal(override)
    assert words in message
    assert override.partition("=")[0].partition(".")[0] in message


def test_settings_that_contradict_each_other_are_refused():
    message = refusal("sensor.range_min_m=5", "sensor.range_max_m=4")
    assert "range_min_m (5) must be less than sensor.range_max_m (4)" in message


def test_off_and_no_are_words_where_a_word_is_expected():
    assert load_settings(overrides=["sensor.deskew=off"]).sensor.deskew == "off"


def test_a_setting_given_twice_in_a_file_is_refused(tmp_path):
    file = write(tmp_path, "degree: 3\ndegree: 4\n")
    assert refusal(file=file) == f"{file}:2: degree is given twice"


def test_empty_files_and_sections_change_nothing(tmp_path):
    assert load_settings(file=write(tmp_path, "")) == Settings()
    assert load_settings(file=write(tmp_path, "# nothing\nfitting:\n")) == Settings()


def test_files_that_cannot_be_read_are_refused(tmp_path):
    assert "No such file" in refusal(file=tmp_path / "absent.yaml")
    binary = tmp_path / "map.bsm"
    binary.write_bytes(b"\x89BSM\r\n\x1a\n\xff\xfe")
    assert "not a text file" in refusal(file=binary)


def test_an_unknown_profile_is_refused_with_those_there_are():
    message = refusal(profile="papr")
    assert "did you mean 'paper'?" in message and "default, paper" in message


def test_every_setting_is_declared_with_its_meaning():
    def check(owner):
        for entry in fields(owner):
            value = getattr(owner, entry.name)
            if is_dataclass(value):
                check(value)
            else:
                assert entry.metadata.get("meaning"), f"{type(owner).__name__}.{entry.name}"

    check(Settings())


def test_the_dump_tells_the_meaning_and_the_symbol_of_each_setting():
    text = dump_settings(Settings())
    for leaf in leaves().values():
        assert f"# {leaf.meaning}" in text
        if leaf.symbol:
            assert f"the paper's {leaf.symbol}" in text


def test_the_dict_is_plain_and_sorted():
    plain = settings_as_dict(load_settings("paper"))
    assert list(plain) == sorted(plain)
    assert plain["ladder"] == [0.4, 0.2, 0.1]
    assert list(plain["segmentation"]) == sorted(plain["segmentation"])


def values(leaf):
    """Any value that the setting's declaration allows."""
    low = leaf.minimum if leaf.minimum is not None else -1e6
    high = leaf.maximum if leaf.maximum is not None else 1e6
    if leaf.key == "ladder":
        steps = st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=4, unique=True)
        return steps.map(lambda numbers: sorted(numbers, reverse=True))
    if leaf.choices:
        return st.sampled_from(leaf.choices)
    kinds = get_args(leaf.type) if NoneType in get_args(leaf.type) else (leaf.type,)
    numbers = {
        int: st.integers(math.ceil(low), math.floor(high)),
        float: st.floats(low, high),
        bool: st.booleans(),
    }
    if kinds[0] in numbers:
        return numbers[kinds[0]]
    return st.lists(st.tuples(st.floats(-360, 360), st.floats(-360, 360)).map(list), max_size=3)


@given(st.data())
def test_what_is_dumped_loads_back_unchanged(tmp_path_factory, data):
    chosen = data.draw(st.sets(st.sampled_from(sorted(leaves())), max_size=5))
    overrides = []
    for key in sorted(chosen):
        value = data.draw(values(leaves()[key]), label=key)
        overrides.append(f"{key}={yaml.safe_dump(value, default_flow_style=True, width=1e9)}")
    try:
        settings = load_settings(overrides=overrides)
    except ConfigError as refused:
        assert "must be less than" in str(refused)  # the two range limits were drawn crossed
        return
    file = tmp_path_factory.getbasetemp() / "dumped.yaml"
    file.write_text(dump_settings(settings))
    assert load_settings(file=file) == settings


@given(st.text(string.printable, max_size=40))
def test_no_text_breaks_an_override(text):
    try:
        settings = load_settings(overrides=[text])
    except ConfigError as refused:
        assert "\n" not in str(refused)
    else:
        assert isinstance(settings, Settings)


@given(st.text(max_size=60))
def test_no_text_breaks_a_file(tmp_path_factory, text):
    file = tmp_path_factory.getbasetemp() / "any.yaml"
    file.write_text(text, encoding="utf-8", errors="surrogatepass")
    try:
        settings = load_settings(file=file)
    except ConfigError as refused:
        assert "\n" not in str(refused) and str(refused).startswith((str(file), "sensor."))
    else:
        assert isinstance(settings, Settings)
