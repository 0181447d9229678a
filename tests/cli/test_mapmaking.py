"""`bsmap slam` and `bsmap map`: what comes out, the report, and what is refused or lost."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import pytest

from bsmap_cli.exchange.log_writers import write_log
from bsmap_cli.exchange.tum import read_tum
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.mapping.map_file import read_map
from tests.cli.conftest import SAMPLES, SCANS
from tests.cli.tool import bsmap, message, names, shell

REPORT = [
    *("scans", "scans_used", "scans_skipped", "keyframes", "submaps"),
    *("loops", "loops_tried", "loops_rejected", "tracking_lost", "degenerate_share"),
    *("odometry", "seconds", "stage_seconds", "scans_per_second", "tracking_scans_per_second"),
    *("realtime_factor", "peak_memory_mb", "travelled_m", "map", "settings"),
]
STAGES = ["read", "fit", "register", "merge", "loops", "graph", "final_map", "write"]
STATS = [
    *("file_bytes", "payload_bytes", "path_bytes", "curves", "control_points"),
    *("bytes_per_control_point", "degree", "length_m", "bounds_m", "redundancy", "levels"),
    *("grid_5cm_bytes", "ratio_to_grid_5cm", "grid_5cm_png_bytes", "ratio_to_png"),
]


def map_of(path):
    return read_map(io.BytesIO(path.read_bytes()))


def report_of(ran):
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


@pytest.mark.parametrize(
    "verb", [["slam", "run.mcap"], ["map", "run.mcap", "--poses", "truth.tum"]], ids=lambda v: v[0]
)
def test_the_report_has_the_promised_keys(verb, here):
    report = report_of(bsmap(*verb, "-o", "m.bsm", "--json", cwd=here))
    assert list(report) == REPORT
    assert list(report["stage_seconds"]) == STAGES
    assert list(report["map"]) == STATS
    assert report["scans"] == report["scans_used"] == SCANS
    assert report["scans_per_second"] == pytest.approx(SCANS / report["seconds"], rel=0.01)
    assert report["map"] == report_of(bsmap("stats", "m.bsm", "--json", cwd=here))
    assert report["map"]["file_bytes"] == (here / "m.bsm").stat().st_size
    assert sum(report["stage_seconds"].values()) <= report["seconds"] * 1.05


def test_the_same_command_gives_the_same_bytes_on_any_number_of_threads(here):
    for threads in ("1", "2"):
        ran = bsmap(
            *("slam", "run.mcap", "-o", f"{threads}.bsm", "--traj", f"{threads}.tum", "-q"),
            cwd=here,
            NUMBA_NUM_THREADS=threads,
            PYTHONHASHSEED=threads,
        )
        assert ran.returncode == 0, ran.stderr
        assert (here / f"{threads}.bsm").read_bytes() == (here / "map.bsm").read_bytes()
        assert (here / f"{threads}.tum").read_bytes() == (here / "map.tum").read_bytes()


def test_there_is_one_pose_for_every_scan(here):
    with (here / "map.tum").open() as lines:
        poses = read_tum(lines)
    with open_log([here / "run.mcap"], ReadOptions()) as reader:
        stamps = [scan.stamp_ns for scan in reader.scans()]
    assert poses.stamps_ns.tolist() == stamps
    assert poses.poses[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_the_map_tells_what_it_is_of_and_no_path(here):
    meta = map_of(here / "map.bsm").meta
    size = (here / "run.mcap").stat().st_size
    assert meta["logs"] == [{"name": "run.mcap", "bytes": size}]
    assert meta["scans"] == SCANS
    assert meta["settings"]["ladder"] == [0.4, 0.2, 0.1]
    assert str(here) not in json.dumps(meta)


@pytest.mark.parametrize(
    ("wanted", "steps"),
    [("finest", [0.1]), ("all", [0.4, 0.2, 0.1]), ("0.2", [0.2]), ("0.1,0.4", [0.4, 0.1])],
)
def test_the_wanted_levels_are_written(wanted, steps, here):
    ran = bsmap("slam", "run.mcap", "-o", "m.bsm", "--levels", wanted, "-q", cwd=here)
    assert ran.returncode == 0, ran.stderr
    assert [level.knot_step_m for level in map_of(here / "m.bsm").levels] == steps


def test_the_path_can_be_left_out(here):
    assert len(map_of(here / "map.bsm").path) > 1
    bsmap("slam", "run.mcap", "-o", "m.bsm", "--no-path", "-q", cwd=here)
    assert len(map_of(here / "m.bsm").path) == 0


@pytest.mark.parametrize(("name", "start"), [("t.csv", b"stamp_ns,x,y,theta\n"), ("t.json", b"{")])
def test_the_extension_tells_the_format_of_the_trajectory(name, start, here):
    ran = bsmap("slam", "run.mcap", "-o", "m.bsm", "--traj", name, "-q", cwd=here)
    assert ran.returncode == 0, ran.stderr
    assert (here / name).read_bytes().startswith(start)
    report = report_of(bsmap("eval", name, "map.tum", "--json", cwd=here))
    assert report["matched"] == SCANS
    assert report["ate"]["max_m"] < 1e-6


def test_scans_are_chosen_by_time_and_number(here):
    flags = {
        ("--max-scans", 7): 7,
        ("--every", 4): SCANS // 4,
        ("--end", 0.5): 2,  # 3 scans a second, the first at 0
        ("--start", 1.1, "--duration", 1): 3,
    }
    for arguments, count in flags.items():
        ran = bsmap("scans", "run.mcap", *arguments, "-o", "-", "--format", "csv", cwd=here)
        assert len(ran.stdout.splitlines()) == count + 1, arguments


def test_poses_from_odometry_and_from_a_file(here):
    for poses in ("odom", "truth.tum"):
        ran = bsmap("map", "run.mcap", "--poses", poses, "-o", f"{poses}.bsm", "-q", cwd=here)
        assert ran.returncode == 0, ran.stderr
        assert len(map_of(here / f"{poses}.bsm").finest) > 0


def test_poses_from_a_file_are_what_was_used(here):
    """Whatever odometry the log holds besides."""
    arguments = ("map", "run.mcap", "--poses", "truth.tum", "-o", "m.bsm", "--json")
    ran = bsmap(*arguments, cwd=here)
    assert ran.stderr.decode().splitlines()[0] == "poses: truth.tum"
    assert report_of(ran)["odometry"] == "none"


def test_scans_without_a_pose_are_a_loss(here):
    lines = (here / "truth.tum").read_text().splitlines(keepends=True)
    (here / "half.tum").write_text("".join(lines[: SCANS // 2]))
    before = names(here)
    ran = bsmap("map", "run.mcap", "--poses", "half.tum", "-o", "m.bsm", "--strict", cwd=here)
    assert ran.returncode == 1
    assert names(here) == before
    ran = bsmap("map", "run.mcap", "--poses", "half.tum", "-o", "m.bsm", cwd=here)
    assert ran.returncode == 3
    assert f"{SCANS // 2} scans have no pose" in ran.stderr.decode()
    assert (here / "m.bsm").exists()


def test_poses_of_another_time_are_refused(here):
    (here / "other.tum").write_text("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")
    ran = bsmap("map", "run.mcap", "--poses", "other.tum", "-o", "m.bsm", cwd=here)
    assert ran.returncode == 1
    assert b"no pose lies near the stamp" in ran.stderr
    assert not (here / "m.bsm").exists()


def test_a_truncated_log_is_used_and_said_to_be(here):
    whole = (SAMPLES / "wall.mcap").read_bytes()
    (here / "cut.mcap").write_bytes(whole[: len(whole) // 3])
    before = names(here)
    ran = bsmap("slam", "cut.mcap", "-o", "m.bsm", "--strict", cwd=here)
    assert ran.returncode == 1
    assert b"because of --strict" in ran.stderr
    assert names(here) == before
    ran = bsmap("slam", "cut.mcap", "-o", "m.bsm", cwd=here)
    assert ran.returncode == 3
    assert b"missing or damaged" in ran.stderr
    assert len(map_of(here / "m.bsm").finest) > 0


def test_of_two_scan_topics_one_is_asked_for(here):
    with open_log([here / "run.mcap"], ReadOptions()) as reader:
        scans = [
            replace(scan, topic="/front" if number % 2 else "/rear")
            for number, scan in enumerate(reader.scans())
        ]
    write_log(here / "two.mcap", scans, "mcap")
    ran = bsmap("slam", "two.mcap", "-o", "m.bsm", cwd=here)
    assert ran.returncode == 2
    assert "--topic /front --topic /rear" in message(ran)
    assert not (here / "m.bsm").exists()
    ran = bsmap("slam", "two.mcap", "-t", "/front", "-o", "m.bsm", cwd=here)
    assert ran.returncode == 0, ran.stderr
    info = report_of(bsmap("info", "two.mcap", "--json", cwd=here))
    assert info["selected"] == []
    assert [topic["topic"] for topic in info["topics"] if topic["usable"]] == ["/front", "/rear"]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["map.bsm", "-o", "m.bsm"], 1, "a map and no log"),
        (["truth.tum", "-o", "m.bsm"], 1, "not a log"),
        (["empty", "-o", "m.bsm"], 1, "empty"),
        (["absent.mcap", "-o", "m.bsm"], 1, "absent.mcap"),
        (["bare.mcap", "-o", "m.bsm"], 1, "scan"),
        (["run.mcap", "-o", "map.bsm"], 2, "--force"),
        (["run.mcap", "-o", "run.mcap", "--force"], 2, "also an input"),
        (["run.mcap", "-o", "m.bsm", "--traj", "m.bsm"], 2, "two outputs"),
        (["run.mcap", "-o", "m.bsm", "--traj", "map.tum"], 2, "map.tum exists"),
        (["run.mcap", "-o", "m.bsm", "-t", "/nope"], 2, "--topic /scan"),
        (["run.mcap", "-o", "m.bsm", "--odom", "/nope"], 2, "--odom /odom"),
        (["run.mcap", "-o", "m.bsm", "--levels", "0.3"], 2, "0.4, 0.2, 0.1"),
        (["run.mcap", "-o", "m.bsm", "--levels", "fine"], 2, "finest, all"),
        (["run.mcap", "-o", "m.bsm", "--laser-pose", "1,2"], 2, "3 numbers"),
        (["run.mcap", "-o", "m.bsm", "--range", "5,1"], 2, "range_min_m (5)"),
        (["run.mcap", "-o", "m.bsm", "--ignore-angles", "a,b"], 2, "2 numbers"),
        (["run.mcap", "-o", "m.bsm", "--end", "3", "--duration", "3"], 2, "--duration"),
        (["run.mcap", "-o", "m.bsm", "--start", "3", "--end", "2"], 2, "later --end"),
        (["run.mcap", "-o", "m.bsm", "--start", "1e6"], 1, "--start"),
        (["run.mcap", "-o", "m.bsm", "--every", "0"], 2, "--every"),
        (["run.mcap", "-o", "m.bsm", "--set", "loops.enabeld=true"], 2, "loops.enabled"),
        (["run.mcap", "-", "-o", "m.bsm"], 2, "cannot be joined"),
        (["run.mcap", "-o", "m.png"], 2, "bsmap export"),
        (["run.mcap", "-o", "m.tum"], 2, "written as .bsm"),
        (["run.mcap", "-o", ""], 2, "name of an output is empty"),
        (["run.mcap", "-o", "m.bsm", "--traj", "m.svg"], 2, ".tum, .csv, .json, .kitti"),
        (["run.mcap", "-o", "m.bsm", "--z-min", "nan"], 2, "finite"),
        (["run.mcap", "-o", "m.bsm", "--z-min", "2", "--z-max", "1"], 2, "no height"),
        (["run.mcap", "-o", "m.bsm", "--laser-pose", "1,2"], 2, "0.2,0,90"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(arguments, code, words, here):
    (here / "empty").touch()
    bsmap("export", "map.bsm", "-o", "bare.mcap", cwd=here)  # an MCAP file without scans
    before = names(here)
    ran = bsmap("slam", *arguments, cwd=here)
    assert ran.returncode == code
    assert words in message(ran)
    assert names(here) == before


def test_settings_reach_the_run_in_their_order(here):
    (here / "robot.yaml").write_text("ladder: [0.4, 0.2]\nfitting:\n  penalty: 1e-3\n")
    flags = ["-c", "robot.yaml", "--set", "ladder=[0.2]", "--range", "0.1,8"]
    report = report_of(bsmap("slam", "run.mcap", "-o", "m.bsm", "--json", *flags, cwd=here))
    assert report["settings"]["ladder"] == [0.2]
    assert report["settings"]["fitting"]["penalty"] == 1e-3
    assert report["settings"]["sensor"]["range_max_m"] == 8.0


def test_the_unknown_key_is_found_in_its_line(here):
    (here / "robot.yaml").write_text("ladder: [0.2]\nfitting:\n  penalti: 1e-3\n")
    ran = bsmap("slam", "run.mcap", "-o", "m.bsm", "-c", "robot.yaml", cwd=here)
    assert ran.returncode == 2
    expected = "robot.yaml:3: unknown setting 'fitting.penalti'; did you mean 'fitting.penalty'?"
    assert message(ran) == f"error: {expected}"


def test_the_choice_of_odometry_is_said_and_reported(here):
    for odom, said in (("auto", "/odom"), ("none", "none")):
        ran = bsmap("slam", "run.mcap", "-f", "-o", "m.bsm", "--json", "--odom", odom, cwd=here)
        assert ran.stderr.decode().splitlines()[0] == f"odometry: {said}"
        assert report_of(ran)["odometry"] == said


def test_verbose_tells_where_the_time_went(here):
    ran = bsmap("slam", "run.mcap", "-o", "m.bsm", "-v", cwd=here)
    assert b"seconds: read " in ran.stderr


def test_a_folder_and_several_files_are_one_run(here):
    (here / "parts").mkdir()
    for number, flags in enumerate((["--max-scans", 20], ["--start", 6.5])):
        name = here / "parts" / f"part_{number}.mcap"
        assert bsmap("scans", "run.mcap", *flags, "-o", name, "-q", cwd=here).returncode == 0
    ran = shell("bsmap scans parts -o - --format csv | wc -l", here)
    assert int(ran.stdout) == SCANS + 1
    ran = shell("bsmap scans parts/part_0.mcap parts/part_1.mcap -o - --format csv | wc -l", here)
    assert int(ran.stdout) == SCANS + 1
