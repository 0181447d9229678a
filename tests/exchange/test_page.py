"""The page of a map: what is in it, and what it does in a real browser."""

import json
import math
import re

import numpy as np
import pytest

from bsmap_cli.exchange.page import MOST_POSES, MOST_SCANS, write_page
from bsmap_cli.exchange.selection import select
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.sampling import evaluate
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.trajectory import Trajectory
from tests.exchange.browser import CHROMIUM, Browser
from tests.exchange.exported import wavy_document, written
from tests.maps import make_level, room_document


def walk(count=100):
    t = np.linspace(0.0, 4.0, count)
    poses = np.column_stack((0.8 + 0.5 * t, 1.0 + 0.2 * np.sin(t), 0.1 * t))
    return Trajectory(10**18 + (t * 1e10).astype(np.int64), poses)


def scans(trajectory):
    """A laser that sees a wall a metre ahead of it, in an arc."""
    return [
        Scan(
            stamp_ns=int(stamp),
            ranges_m=np.full(31, 1.0, np.float32),
            angle_min_rad=-1.5,
            angle_increment_rad=0.1,
        )
        for stamp in trajectory.stamps_ns
    ]


def page(document, title="a <map> & more", **options):
    trajectory = options.pop("trajectory", None)
    return written(write_page, select(document, trajectory=trajectory), title=title, **options)


def data_of(text):
    return json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.S)[1])


def test_the_page_is_whole_and_asks_for_nothing():
    text = page(room_document(), trajectory=walk()).decode()
    assert "@" not in re.sub(r"@media", "", text.split('<script id="data"')[0])
    assert "<title>a &lt;map&gt; &amp; more</title>" in text
    assert not re.search(
        r"https?://|@import|url\(|src=|<link (?!rel=\"icon\" href=\"data:,\")", text
    )
    assert text.rstrip().endswith("</html>")


def test_the_same_map_gives_the_same_page():
    assert page(room_document()) == page(room_document())


def test_names_cannot_end_the_script():
    document = room_document()
    document.meta["frame"] = "</script><script>alert(1)</script>"
    text = page(document, title="</script>").decode()
    assert text.count("</script>") == 2


def test_a_map_of_100_000_control_points_stays_small():
    levels = wavy_document().levels
    per_point = len(page(wavy_document())) - len(page(room_document()))
    assert per_point < 30 * (len(levels[0].weights))


def test_scans_are_thinned_evenly():
    trajectory = walk(5 * MOST_SCANS)
    text = page(room_document(), trajectory=trajectory, scans=scans(trajectory)).decode()
    assert len(data_of(text)["scans"]["poses"]) == pytest.approx(MOST_SCANS * 4 * 4 / 3, rel=0.01)
    assert data_of(page(room_document(), trajectory=trajectory).decode())["scans"] is None


def test_a_long_path_is_thinned():
    text = page(room_document(), trajectory=walk(2 * MOST_POSES)).decode()
    assert (data_of(text)["path"]["count"], data_of(text)["path"]["every"]) == (MOST_POSES, 2)


needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no chromium here to show the page")


@pytest.fixture(scope="module")
def browser():
    shown = Browser()
    yield shown
    shown.close()


@pytest.fixture
def shown(browser, tmp_path):
    """The page of a room of two levels, the path and the scans along it."""
    fine, coarse = room_document(0.1), room_document(0.2)
    levels = (coarse.finest, fine.finest)
    document = MapDocument(degree=3, max_weight=50, levels=levels, path=fine.path)
    trajectory = walk()
    data = page(document, trajectory=trajectory, scans=scans(trajectory))
    (tmp_path / "page.html").write_bytes(data)
    browser.open((tmp_path / "page.html").as_uri())
    yield browser
    assert browser.complaints() == []


PIXEL = """(() => {{
  const v = bsmap.view, r = window.devicePixelRatio || 1;
  const px = ({x} - v.x) * v.scale + v.width / 2, py = v.height / 2 - ({y} - v.y) * v.scale;
  const c = new OffscreenCanvas(3, 3).getContext('2d', {{willReadFrequently: true}});
  c.drawImage(document.getElementById('map'), Math.round(1 - px * r), Math.round(1 - py * r));
  const d = c.getImageData(0, 0, 3, 3).data;
  let least = 765;
  for (let i = 0; i < d.length; i += 4) least = Math.min(least, d[i] + d[i + 1] + d[i + 2]);
  return least;
}})()"""


def darkness(browser, x, y):
    """The darkest of the pixels round a place of the map, 0 black to 765 white."""
    return browser.value(PIXEL.format(x=x, y=y))


def place(browser, x, y):
    """Where in the window a place of the map is drawn."""
    view = browser.value("({...bsmap.view})")
    return (
        (x - view["x"]) * view["scale"] + view["width"] / 2,
        view["height"] / 2 - (y - view["y"]) * view["scale"],
    )


@needs_browser
class TestInABrowser:
    def test_walls_are_drawn_where_they_are(self, shown):
        for x, y in ((3.0, 0.0), (6.0, 2.0), (3.0, 4.0), (0.0, 2.0), (3.5, 2.0)):
            assert darkness(shown, x, y) < 650
        assert darkness(shown, 5.5, 3.3) > 700
        assert shown.value("document.getElementById('summary').textContent").startswith("5 curves")

    def test_the_wheel_zooms_round_the_pointer(self, shown):
        x, y = place(shown, 3.5, 2.0)
        before = shown.value("bsmap.view.scale")
        shown.mouse("mouseWheel", x, y, deltaX=0, deltaY=-400)
        shown.settle()
        assert shown.value("bsmap.view.scale") > 1.5 * before
        assert place(shown, 3.5, 2.0) == pytest.approx((x, y), abs=0.5)
        assert darkness(shown, 3.5, 2.0) < 650

    def test_dragging_pans(self, shown):
        x, y = place(shown, 2.0, 2.0)
        shown.mouse("mousePressed", x, y, button="left", clickCount=1)
        shown.mouse("mouseMoved", x + 80, y - 40, button="left", buttons=1)
        shown.mouse("mouseReleased", x + 80, y - 40, button="left")
        shown.settle()
        assert place(shown, 2.0, 2.0) == pytest.approx((x + 80, y - 40), abs=0.5)

    def test_two_fingers_zoom(self, shown):
        before = shown.value("bsmap.view.scale")
        shown.touch("touchStart", (500, 400), (600, 400))
        for k in range(1, 6):
            shown.touch("touchMove", (500 - 10 * k, 400), (600 + 10 * k, 400))
        shown.touch("touchEnd")
        shown.settle()
        assert shown.value("bsmap.view.scale") == pytest.approx(2 * before, rel=0.15)

    def test_the_keyboard_zooms_pans_and_fits(self, shown):
        start = shown.value("({...bsmap.view})")
        shown.key("+")
        assert shown.value("bsmap.view.scale") == pytest.approx(1.3 * start["scale"])
        shown.key("ArrowRight")
        assert shown.value("bsmap.view.x") > start["x"]
        shown.key("ArrowUp")
        assert shown.value("bsmap.view.y") > start["y"]
        shown.key("0")
        assert shown.value("({...bsmap.view})") == pytest.approx(start)

    def test_hovering_tells_a_curve_s_figures(self, shown):
        shown.mouse("mouseMoved", *place(shown, 3.5, 2.0))
        shown.settle()
        tip = shown.value("document.getElementById('tip').textContent")
        assert tip.startswith("curve 5\nknot step 10 cm, 32 control points\n")
        assert float(re.search(r"([\d.]+) m long, weight 5.0 of 50", tip)[1]) == pytest.approx(
            math.pi - 0.2, rel=0.02
        )
        shown.mouse("mouseMoved", *place(shown, 5.2, 3.4))
        shown.settle()
        assert shown.value("document.getElementById('tip').hidden")

    def test_levels_points_and_the_free_side_are_switched(self, shown):
        assert shown.value("bsmap.levels.map((level) => level.shown)") == [False, True]
        shown.key("2")
        assert darkness(shown, 3.0, 4.0) > 700
        shown.key("1")
        assert darkness(shown, 3.0, 4.0) < 650
        before = shown.value("document.getElementById('map').toDataURL()")
        for key in ("k", "n", "p", "s"):
            shown.key(key)
            after = shown.value("document.getElementById('map').toDataURL()")
            # without the path there is no scan to hide
            assert (after != before) or key == "s"
            before = after

    def test_the_path_plays_with_its_scans(self, shown):
        assert darkness(shown, 1.8, 1.0) < 700  # a metre ahead of the first pose
        shown.key(" ")
        shown.wait("bsmap.player.at > 3")
        shown.key(" ")
        at = shown.value("bsmap.player.at")
        shown.settle()
        assert shown.value("bsmap.player.at") == at
        shown.value("bsmap.setPose(99)")
        shown.settle()
        assert shown.value("document.getElementById('clock').textContent") == "0:40  pose 100"
        pose = walk().poses[99]
        x, y = pose[0] + math.cos(pose[2]), pose[1] + math.sin(pose[2])
        assert darkness(shown, x, y) < 700

    def test_a_distance_is_measured_and_snaps_to_curves(self, shown):
        shown.key("m")
        shown.click(*place(shown, 0.01, 2.0))
        shown.click(*place(shown, 5.99, 2.0))
        ends = shown.value("[bsmap.ruler.start, bsmap.ruler.end]")
        np.testing.assert_allclose(ends, [[0.0, 2.0], [6.0, 2.0]], atol=0.03)
        assert [end[0] for end in ends] == pytest.approx([0.0, 6.0], abs=1e-5)
        shown.key("Escape")
        assert not shown.value("bsmap.ruler.on")

    def test_a_place_is_copied(self, shown):
        shown.mouse("mouseMoved", *place(shown, 2.5, 1.5))
        shown.settle()
        where = shown.value("document.getElementById('place').textContent")
        assert [float(v) for v in re.findall(r"-?[\d.]+", where)] == pytest.approx(
            [2.5, 1.5], abs=0.02
        )
        shown.key("c")
        shown.wait("document.getElementById('place').textContent.startsWith('copied 2.')")

    def test_light_and_dark(self, shown):
        shown.value("document.getElementById('theme').click()")
        shown.settle()
        dark = shown.value("document.documentElement.dataset.theme") == "dark"
        assert (darkness(shown, 5.5, 3.3) < 200) == dark
        shown.value("document.getElementById('theme').click()")
        shown.settle()
        assert (darkness(shown, 5.5, 3.3) < 200) != dark


@needs_browser
@pytest.mark.parametrize("degree", [2, 4, 5])
def test_other_degrees_are_drawn_too(browser, tmp_path, degree):
    document = wavy_document(degree)
    (tmp_path / "page.html").write_bytes(page(document))
    browser.open((tmp_path / "page.html").as_uri())
    (selected,) = select(document).levels
    pieces = selected.pieces
    points, _ = evaluate(selected.level, pieces.curve, 0.5 * (pieces.start + pieces.end))
    for x, y in points:
        assert darkness(browser, x, y) < 650
    assert browser.complaints() == []


@needs_browser
def test_an_empty_map_is_a_page_too(browser, tmp_path):
    document = MapDocument(degree=3, max_weight=50, levels=(make_level([]),))
    (tmp_path / "page.html").write_bytes(page(document))
    browser.open((tmp_path / "page.html").as_uri())
    assert browser.complaints() == []
    assert browser.value("document.getElementById('player').hidden")


@needs_browser
@pytest.mark.parametrize(("width", "height"), [(390, 844), (844, 390)])
def test_a_phone_sees_the_map_and_opens_the_panel(browser, tmp_path, width, height):
    (tmp_path / "page.html").write_bytes(page(room_document(), trajectory=walk()))
    metrics = {"width": width, "height": height, "deviceScaleFactor": 2, "mobile": True}
    browser.call("Emulation.setDeviceMetricsOverride", **metrics)
    try:
        browser.open((tmp_path / "page.html").as_uri())
        panel = "document.getElementById('panel')"
        assert browser.value(f"{panel}.offsetHeight") == 0
        for x, y in ((3.0, 0.0), (6.0, 2.0), (3.0, 4.0), (0.0, 2.0)):
            px, py = place(browser, x, y)
            shown = f"document.elementFromPoint({px}, {py}).id"
            assert browser.value(shown) == "map", (x, y)
        menu = browser.value(
            "(() => { const b = document.getElementById('menu').getBoundingClientRect();"
            " return [b.x + b.width / 2, b.y + b.height / 2, b.width, b.height]; })()"
        )
        assert min(menu[2:]) >= 44  # a finger's width
        browser.click(*menu[:2])
        assert browser.value(f"{panel}.offsetHeight") > 100
        assert browser.value(f"{panel}.getBoundingClientRect().bottom") <= height
        browser.click(*menu[:2])
        assert browser.value(f"{panel}.offsetHeight") == 0
        assert browser.complaints() == []
    finally:
        browser.call("Emulation.clearDeviceMetricsOverride")


@needs_browser
def test_a_phone_that_is_turned_fits_the_map_anew(browser, tmp_path):
    (tmp_path / "page.html").write_bytes(page(room_document(), trajectory=walk()))
    upright = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
    across = {**upright, "width": 844, "height": 390}
    try:
        browser.call("Emulation.setDeviceMetricsOverride", **across)
        browser.open((tmp_path / "page.html").as_uri())
        browser.call("Emulation.setDeviceMetricsOverride", **upright)
        browser.wait("bsmap.view.width === 390")
        turned = browser.value("bsmap.view.scale")
        browser.value("bsmap.fit()")
        assert turned == browser.value("bsmap.view.scale")
        browser.value("bsmap.zoomAt(100, 100, 2)")  # the user looks elsewhere: left alone
        scale = browser.value("bsmap.view.scale")
        browser.call("Emulation.setDeviceMetricsOverride", **across)
        browser.wait("bsmap.view.width === 844")
        assert browser.value("bsmap.view.scale") == scale
    finally:
        browser.call("Emulation.clearDeviceMetricsOverride")


@needs_browser
def test_100_000_control_points_are_drawn_and_moved(browser, tmp_path):
    step = np.arange(100) * 0.1
    curves = [
        np.column_stack((12.0 * (k % 32) + step, 2.0 * (k // 32) + 0.2 * np.sin(step + k)))
        for k in range(1000)
    ]
    document = MapDocument(degree=3, max_weight=50, levels=(make_level(curves),))
    (tmp_path / "page.html").write_bytes(page(document))
    browser.open((tmp_path / "page.html").as_uri())
    for key in ("k", "n"):
        browser.key(key)
    before = browser.value("bsmap.frames.count")
    for factor in (1.1, 1.1, 0.9, 0.9):
        browser.value(f"bsmap.zoomAt(400, 300, {factor})")
        browser.settle()
    assert browser.value("bsmap.frames.count") >= before + 4
    browser.mouse("mouseMoved", *place(browser, *curves[0][50]))
    browser.settle()
    assert browser.value("document.getElementById('tip').textContent").startswith("curve ")
    assert browser.complaints() == []
