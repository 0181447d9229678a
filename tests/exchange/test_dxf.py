"""DXF: read, audited and flattened by ezdxf, and compared with the curves."""

import io

import ezdxf
import numpy as np
import pytest
from scipy.interpolate import BSpline

from bsmap_cli.exchange.clamping import clamped_pieces
from bsmap_cli.exchange.dxf import write_dxf
from bsmap_cli.exchange.selection import select
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.sampling import evaluate
from tests.exchange.exported import assert_same_lines, wavy_document, written
from tests.maps import make_level


def drawing(document, **options):
    text = written(write_dxf, select(document, **options)).decode("ascii")
    return ezdxf.read(io.StringIO(text))


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_flattened_splines_are_the_curves(degree):
    document = wavy_document(degree)
    found = drawing(document)
    splines = found.modelspace().query("SPLINE")
    assert len(splines) == 4
    assert {spline.dxf.degree for spline in splines} == {degree}
    lines = [[(v.x, v.y) for v in spline.flattening(1e-4)] for spline in splines]
    assert_same_lines(lines, document.finest, 2e-4)


def test_an_auditor_finds_nothing():
    document = wavy_document()
    document = MapDocument(
        degree=3, max_weight=50, levels=wavy_document(levels=(0.2, 0.1)).levels, parts=True
    )
    auditor = drawing(document).audit()
    assert not auditor.has_errors
    assert not auditor.has_fixes


def test_version_units_layers_and_ids():
    found = drawing(wavy_document())
    assert found.dxfversion == "AC1015"
    assert found.units == ezdxf.units.M
    layers = {layer.dxf.name for layer in found.layers}
    assert {"0", "curves 0.1", "path"} <= layers
    ids = [s.get_xdata("BSMAP")[0].value for s in found.modelspace().query("SPLINE")]
    assert ids == ["curve 1", "curve 1", "curve 2", "curve 3"]
    (path,) = found.modelspace().query("LWPOLYLINE")
    assert path.dxf.layer == "path"
    np.testing.assert_allclose(
        [point[:2] for point in path], [[-13.0, 33.5], [-12.0, 33.6]], atol=1e-6
    )


def test_handles_are_unique_and_below_the_seed():
    text = written(write_dxf, select(wavy_document())).decode("ascii")
    lines = text.splitlines()
    tags = list(zip(map(int, lines[::2]), lines[1::2], strict=True))
    seed = int(tags[tags.index((9, "$HANDSEED")) + 1][1], 16)
    handles = [int(v, 16) for code, v in tags if code == 5][1:]
    assert len(set(handles)) == len(handles)
    assert max(handles) < seed


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_clamping_changes_no_point(degree):
    (selected,) = select(wavy_document(degree)).levels
    pieces = selected.pieces
    for k, curve in enumerate(clamped_pieces(selected)):
        assert (curve.knots[: degree + 1] == 0.0).all()
        assert len(set(curve.knots[-degree - 1 :])) == 1
        spline = BSpline(curve.knots, curve.control_points, degree)
        tau = np.linspace(0.0, curve.knots[-1], 200)
        u = pieces.start[k] + tau / selected.level.knot_step_m
        truth, _ = evaluate(selected.level, np.full(200, pieces.curve[k]), u)
        np.testing.assert_allclose(spline(tau), truth, atol=1e-9)


def test_an_empty_map_is_a_drawing_too():
    document = MapDocument(degree=3, max_weight=50, levels=(make_level([]),))
    assert len(drawing(document).modelspace()) == 0
