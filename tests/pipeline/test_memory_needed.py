"""Maps too large for the memory there is are refused at once."""

import pytest

from bsmap_cli.config import load_settings
from bsmap_cli.errors import UsageError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.pipeline import memory_needed, run_localize, run_slam
from bsmap_cli.pipeline.two_maps import place_map
from tests.maps import room_document

DOCUMENT, SETTINGS = room_document(), load_settings()


@pytest.mark.parametrize(
    "use",
    [
        lambda: place_map(DOCUMENT, DOCUMENT, SETTINGS, SE2.identity()),
        lambda: run_localize(None, DOCUMENT, SETTINGS),
        lambda: run_slam(None, SETTINGS, old=DOCUMENT),
    ],
)
def test_a_map_that_takes_too_much_memory_is_refused(use, monkeypatch):
    monkeypatch.setattr(memory_needed, "memory_bytes", lambda: 10_000)
    with pytest.raises(UsageError, match=r"bsmap export MAP --clip"):
        use()


def test_where_the_memory_is_not_known_nothing_is_refused(monkeypatch):
    monkeypatch.setattr(memory_needed, "memory_bytes", lambda: None)
    memory_needed.refuse_beyond_memory(10**12, 500.0, "a map of")


def test_a_process_has_what_its_control_group_was_given(monkeypatch, tmp_path):
    given = tmp_path / "memory.max"
    monkeypatch.setattr(memory_needed, "CONTROL_GROUP", given)
    everything = memory_needed.memory_bytes()
    given.write_text("max\n")
    assert memory_needed.memory_bytes() == everything
    given.write_text("1000000\n")
    assert memory_needed.memory_bytes() == (1_000_000 if everything else None)
