"""The house itself: format, lint, types, floors, size, and what starting up may import."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MODULES = sorted((ROOT / "bsmap_cli").rglob("*.py"))
HEAVY = ("scipy", "numba", "matplotlib", "rosbags", "mcap", "numpy", "yaml")
SLOW_TO_START = ("scipy.linalg", "scipy.spatial", "rosbags.typesys.stores.latest", "matplotlib")


def tool(*arguments):
    """Run a tool of the test extra on the checkout; fail with what it says."""
    ran = subprocess.run(
        [sys.executable, "-m", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_lint():
    tool("ruff", "check", "--no-cache")


def test_format():
    tool("ruff", "format", "--check", "--no-cache")


def test_types():
    tool("mypy")


def test_floors():
    script = Path(sys.executable).with_name("lint-imports")
    ran = subprocess.run([script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_files_and_functions_stay_short():
    long = []
    for path in MODULES:
        text = path.read_text()
        if text.count("\n") > 300:
            long.append(str(path))
        for node in ast.walk(ast.parse(text)):
            # a kernel may be as long as its loop is one thought
            if isinstance(node, ast.FunctionDef) and not node.decorator_list:
                body = node.body[1:] if ast.get_docstring(node) else node.body
                if body and node.end_lineno - body[0].lineno >= 60:
                    long.append(f"{path}:{node.lineno} {node.name}")
    assert not long


def imported_by(code, names=HEAVY):
    """Which of the heavy packages are imported once `code` has run."""
    probe = f"import sys\n{code}\nprint(*(name for name in {names} if name in sys.modules))"
    ran = subprocess.run(
        [sys.executable, "-c", probe], capture_output=True, text=True, check=True, cwd=ROOT
    )
    return ran.stdout.splitlines()[-1].split()


def test_help_imports_nothing_heavy():
    assert imported_by("from bsmap_cli.cli.door import run; run(['--help'])") == []


@pytest.mark.parametrize("verb", ["slam", "map", "config"])
def test_the_help_of_a_verb_imports_nothing_heavy(verb):
    assert imported_by(f"from bsmap_cli.cli.door import run; run(['{verb}', '--help'])") == []


def test_stats_imports_numpy_alone(tmp_path):
    golden = ROOT / "tests" / "mapping" / "golden" / "room.bsm"
    code = f"from bsmap_cli.cli.door import run; assert run(['stats', {str(golden)!r}]) == 0"
    assert imported_by(code) == ["numpy"]


def test_slam_starts_without_what_it_does_not_need(tmp_path):
    arguments = ["slam", "sample_logs/shapes.mcap", "-o", str(tmp_path / "map.bsm"), "-qf"]
    code = f"from bsmap_cli.cli.door import run; assert run({arguments}) == 0"
    assert imported_by(code, SLOW_TO_START) == []
    # what was hidden from the compiler is there for others
    assert imported_by(f"{code}; import scipy.linalg", SLOW_TO_START) == ["scipy.linalg"]


def test_the_library_never_prints():
    for path in MODULES:
        if "cli" in path.relative_to(ROOT / "bsmap_cli").parts:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in {"print", "exit"}, f"{path}:{node.lineno}"
