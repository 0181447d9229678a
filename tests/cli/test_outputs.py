"""Outputs: refused before the work, whole or absent after it."""

from __future__ import annotations

import os
import stat

import pytest

from bsmap_cli.cli.outputs import Outputs
from bsmap_cli.errors import BsmapError, UsageError
from tests.cli.tool import names


def put(outputs, path, data):
    outputs.add(str(path)).open().write(data)


def test_all_outputs_appear_at_the_end(tmp_path):
    with Outputs(force=False) as outputs:
        put(outputs, tmp_path / "a", b"one")
        put(outputs, tmp_path / "b", b"two")
        assert not (tmp_path / "a").exists()
    assert (tmp_path / "a").read_bytes() == b"one"
    assert (tmp_path / "b").read_bytes() == b"two"
    assert names(tmp_path) == ["a", "b"]


@pytest.mark.parametrize("end", [KeyboardInterrupt, SystemExit, ValueError, OSError])
def test_a_run_that_ends_badly_leaves_nothing(tmp_path, end):
    with pytest.raises(end), Outputs(force=False) as outputs:
        put(outputs, tmp_path / "a", b"one")
        raise end
    assert names(tmp_path) == []


def test_a_run_that_ends_badly_leaves_the_old_file(tmp_path):
    (tmp_path / "a").write_bytes(b"old")
    with pytest.raises(ValueError, match="stop"), Outputs(force=True) as outputs:
        put(outputs, tmp_path / "a", b"new")
        raise ValueError("stop")
    assert (tmp_path / "a").read_bytes() == b"old"
    assert names(tmp_path) == ["a"]


def test_an_output_that_exists_is_refused_before_the_work(tmp_path):
    (tmp_path / "a").write_bytes(b"old")
    with pytest.raises(UsageError, match="exists: replace it with --force"):
        Outputs(force=False).add(str(tmp_path / "a"))


def test_force_replaces(tmp_path):
    (tmp_path / "a").write_bytes(b"old")
    with Outputs(force=True) as outputs:
        put(outputs, tmp_path / "a", b"new")
    assert (tmp_path / "a").read_bytes() == b"new"


def test_an_input_is_never_replaced(tmp_path):
    source = tmp_path / "log.mcap"
    source.write_bytes(b"log")
    (tmp_path / "link").symlink_to(source)
    for path in (source, tmp_path / "link", tmp_path / "." / "log.mcap"):
        with pytest.raises(UsageError, match="also an input"):
            Outputs(force=True, inputs=[str(source)]).add(str(path))


def test_one_file_cannot_be_two_outputs(tmp_path):
    outputs = Outputs(force=False)
    outputs.add(str(tmp_path / "a"))
    with pytest.raises(UsageError, match="two outputs"):
        outputs.add(f"{tmp_path}/./a")


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(UsageError, match="is a folder"):
        Outputs(force=True).add(str(tmp_path))


def test_a_missing_folder_is_refused(tmp_path):
    with pytest.raises(BsmapError, match=r"no folder .*nowhere: make it first"):
        Outputs(force=False).add(str(tmp_path / "nowhere" / "a"))


def test_a_link_stays_and_the_file_behind_it_is_replaced(tmp_path):
    (tmp_path / "real").write_bytes(b"old")
    (tmp_path / "link").symlink_to("real")
    with Outputs(force=True) as outputs:
        put(outputs, tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new"


def test_the_file_gets_the_permissions_of_any_new_file(tmp_path):
    (tmp_path / "plain").write_bytes(b"")
    with Outputs(force=False) as outputs:
        put(outputs, tmp_path / "a", b"")
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("plain", "a")]
    assert modes[0] == modes[1]


def test_a_device_is_written_in_place():
    with Outputs(force=False) as outputs:
        put(outputs, "/dev/null", b"gone")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_a_full_disk_names_the_target():
    with pytest.raises(OSError, match="No space left") as caught, Outputs(force=False) as outputs:
        put(outputs, "/dev/full", b"x" * 100_000)
    assert caught.value.filename == "/dev/full"
