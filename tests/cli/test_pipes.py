"""Every pipe of the contract, through the shell, with the installed command."""

from __future__ import annotations

import json
import shutil

import pytest

from tests.cli.conftest import SCANS
from tests.cli.tool import BSMAP, bsmap, message, names, shell


def test_a_map_goes_through_a_pipe_from_log_to_statistics(here):
    ran = shell("cat run.mcap | bsmap slam - -o - | bsmap stats - --json", here)
    assert ran.returncode == 0, ran.stderr
    piped = json.loads(ran.stdout)
    direct = json.loads(bsmap("stats", "map.bsm", "--json", cwd=here).stdout)
    assert piped.pop("file_bytes") != 0  # the description names the log, or does not
    direct.pop("file_bytes")
    assert piped == direct


def test_an_omitted_file_is_standard_input_where_that_is_a_pipe(here):
    ran = shell("cat run.mcap | bsmap slam -o piped.bsm -q && bsmap stats < piped.bsm", here)
    assert ran.returncode == 0, ran.stderr
    assert b"curves" in ran.stdout


@pytest.mark.skipif(shutil.which("jq") is None, reason="needs jq")
def test_the_report_is_one_document_for_jq(here):
    ran = shell("bsmap slam run.bag --json -o m.bsm | jq .loops", here)
    assert (ran.returncode, ran.stdout) == (0, b"0\n")


def test_the_first_scan_through_head(here):
    ran = shell("bsmap scans run.mcap -o - --format csv | head -1", here)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith(b"stamp_ns,")
    assert ran.stderr == b""


def test_packed_text_through_zcat(here):
    line = "bsmap scans run.mcap -o - --format csv | gzip > run.csv.gz && "
    line += "zcat run.csv.gz | bsmap slam - -o m.bsm"
    ran = shell(line, here)
    assert ran.returncode == 0, ran.stderr
    assert "m.bsm" in names(here)


@pytest.mark.parametrize(
    "line",
    [
        "bsmap --help | head -1",
        "bsmap slam --help | head -1",
        "bsmap config show | head -1",
        "bsmap stats map.bsm | head -1",
        "bsmap scans run.mcap -o - --format mcap | head -c 1",
        "bsmap sim wall -o - --format csv | head -c 1",
        "bsmap slam run.mcap -o - | head -c 1",
        "bsmap slam run.mcap -o - | true",
        "bsmap config show | true",
    ],
)
def test_a_closed_pipe_ends_quietly(line, here):
    ran = shell(line, here)
    assert ran.returncode == 0
    assert b"rror" not in ran.stderr


def test_the_trajectory_is_written_although_nobody_reads_the_map(here):
    ran = shell("bsmap slam run.mcap -o - --traj other.tum -q | true", here)
    assert ran.returncode == 0
    assert (here / "other.tum").read_bytes() == (here / "map.tum").read_bytes()


def test_a_map_and_a_report_do_not_share_standard_output(here):
    before = names(here)
    for arguments in (["-o", "-"], ["-o", "m.bsm", "--traj", "-"]):
        ran = bsmap("slam", "run.mcap", "--json", *arguments, cwd=here)
        assert ran.returncode == 2
        assert "--json" in message(ran)
    assert names(here) == before


def test_a_full_standard_output_is_one_line(here):
    for line in ("bsmap config show > /dev/full", "bsmap slam run.mcap -o - -q > /dev/full"):
        ran = shell(line, here)
        assert ran.returncode == 1
        assert "No space left" in message(ran)


def test_a_closed_standard_output_is_one_line(here):
    for line in ("bsmap stats map.bsm >&-", "bsmap slam run.mcap -q -o - >&-"):
        ran = shell(line, here)
        assert ran.returncode == 2
        assert "standard output is closed" in message(ran)


def test_a_closed_standard_error_changes_nothing(here):
    ran = shell("bsmap slam run.mcap -o m.bsm 2>&- && bsmap stats m.bsm", here)
    assert ran.returncode == 0
    assert ran.stdout.startswith(b"file")


def test_waiting_for_a_slow_pipe_is_not_compiling(here):
    ran = shell("(sleep 3.5; cat run.mcap) | bsmap slam - -o m.bsm", here)
    assert ran.returncode == 0
    assert b"compiled" not in ran.stderr


def test_standard_input_that_is_nothing_is_not_taken_for_a_log(tmp_path):
    for verb in (["slam", "-o", "m.bsm"], ["info"], ["stats"]):
        ran = bsmap(*verb, cwd=tmp_path)  # standard input is /dev/null
        assert ran.returncode == 2
        assert "or pipe it in" in message(ran)


def test_an_empty_pipe_is_an_empty_log(tmp_path):
    ran = bsmap("slam", "-o", "m.bsm", cwd=tmp_path, stdin=b"")
    assert ran.returncode == 1
    assert "empty" in message(ran)
    assert names(tmp_path) == []


def test_results_go_to_standard_output_and_talk_to_standard_error(here):
    ran = bsmap("slam", "run.mcap", "-o", "-", cwd=here)
    assert ran.stdout.startswith(b"\x89BSM\r\n\x1a\n")
    assert ran.stderr.decode().splitlines()[-1].startswith(f"{SCANS} scans, ")
    ran = bsmap("stats", "-", cwd=here, stdin=ran.stdout)
    assert ran.stderr == b""


def test_python_m_is_the_same_command(here):
    ran = shell(f"{BSMAP.with_name('python')} -m bsmap_cli stats map.bsm", here)
    assert ran.stdout == bsmap("stats", "map.bsm", cwd=here).stdout
