"""The page in a browser: it is drawn, it moves, it can be clicked, on narrow and on wide screens."""

import csv
import io
import shutil
import time

import numpy as np
import pytest
from common import handmade
from common.results import unproven
from tools.browser import browser, missing, open_page, resize

from vibroplat.continuation.rows import orbit_motion
from vibroplat.page import report
from vibroplat.page.report import write_report
from vibroplat.results.tables import read_table, write_table

pytestmark = [pytest.mark.long, pytest.mark.skipif(bool(missing()), reason=missing())]

HOSTILE = "</script><script>window.hacked = 1</script><img src=x onerror='window.hacked = 1'>"
WIDTHS = (360, 1600)
#: Titles of the panels of a run with two layers.
PANELS = 10


@pytest.fixture(scope="module", params=WIDTHS)
def driver(request):
    with browser(request.param, 1000) as opened:
        opened.width = request.param
        yield opened


#: For what does not depend on the width of the screen.
WIDE = pytest.mark.parametrize("driver", WIDTHS[1:], indirect=True)


@pytest.fixture(scope="module")
def pages(moved, started, swept, followed, branched, measured, tmp_path_factory):
    """Paths of pages by name."""
    place = tmp_path_factory.mktemp("pages")
    layers, bare, bouncing = (moved[name] for name in ("two layers", "bare", "bouncing"))
    wanted = {"one": [layers], "several": [layers, bare, bouncing], "all": [layers, swept]}
    wanted |= {"orbits": [branched, measured], "start": [started]}
    return {name: write_report(of, place / f"{name}.html", mover=orbit_motion) for name, of in wanted.items()}


@pytest.fixture(scope="module")
def by_hand(swept, followed, tmp_path_factory):
    """Path of a page of results that no motion belongs to."""
    return {"points": write_report([swept, followed], tmp_path_factory.mktemp("points") / "points.html")}


@pytest.fixture
def visit(driver, pages, by_hand):
    """Open a page at the driver's width: nothing is loaded or wider than the screen, and its console stays silent."""

    def visit(path):
        resize(driver, driver.width, 1000)
        driver.get_log("browser")
        open_page(driver, (pages | by_hand).get(path, path))
        assert js(driver, "performance.getEntriesByType('resource').map(entry => entry.name)") == []
        assert js(driver, "document.documentElement.scrollWidth") <= driver.width
        assert js(driver, "document.getElementById('title').textContent")
        return driver

    yield visit
    assert driver.get_log("browser") == []


def js(driver, text, *arguments):
    return driver.execute_script(f"return {text}", *arguments)


def clock(driver):
    return js(driver, "window.vibroplat.player.time")


def click_at(driver, x, y):
    """Click at a place of the window."""
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        mouse(driver, kind, x, y)


def mouse(driver, kind, x, y, *, held=False):
    button = {"button": "left", "buttons": 1, "clickCount": 1} if held or kind != "mouseMoved" else {"buttons": 0}
    driver.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": kind, "x": x, "y": y, **button})
    time.sleep(0.08)


def drag(driver, start, end):
    mouse(driver, "mouseMoved", *start)
    mouse(driver, "mousePressed", *start)
    for share in (0.3, 0.6, 1.0):
        x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
        mouse(driver, "mouseMoved", x, y, held=True)
    mouse(driver, "mouseReleased", *end)


def place_of(driver, figure, share_x, axis="yaxis", share_y=0.5):
    """Place in the window at shares of a panel's width and height."""
    found = js(
        driver,
        """(() => { const box = document.getElementById(arguments[0]), {xaxis, [arguments[1]]: y} = box._fullLayout;
        box.scrollIntoView(); const {left, top} = box.getBoundingClientRect();
        return [left + xaxis._offset, xaxis._length, top + y._offset, y._length]; })()""",
        figure,
        axis,
    )
    return found[0] + share_x * found[1], found[2] + share_y * found[3]


def test_all_panels_are_drawn(visit):
    page = visit("one")
    assert js(page, "window.vibroplat.data.panels.length") == PANELS
    assert js(page, "document.querySelectorAll('#curves .readout b').length") == PANELS
    drawn = js(
        page,
        """[...document.querySelectorAll('#curves .subplot')].map(panel => [...panel.querySelectorAll('path.js-line')]
        .map(line => line.getBBox()).some(({width, height}) => width + height > 0))""",
    )
    assert drawn == [True] * PANELS
    assert js(page, "document.querySelectorAll('#overview path.js-line').length") == 1
    assert js(page, "document.querySelectorAll('#machines svg').length") == 1


@WIDE
def test_without_scripts_summary_tables_parameters_and_figures_are_there(driver, pages, by_hand):
    def all_of(selector):
        return driver.find_elements("css selector", selector)

    def table(heading):
        return next(box for box in all_of("section") if box.text.startswith(heading))

    driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        for path, figures in ((pages["one"], 4), (by_hand["points"], 4)):
            driver.get(path.resolve().as_uri())
            drawn = [(one.is_displayed(), js(driver, "arguments[0].naturalWidth > 400", one)) for one in all_of("img")]
            assert drawn == [(True, True)] * figures
            assert len(table("Parameters").text.splitlines()) > 30
        assert "46" in table("Table sweep").text
        driver.get(pages["one"].resolve().as_uri())
        assert "RMS y mm 0." in table("Summary").text
        assert "liftoff" in table("Table events").text
    finally:
        driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})


@WIDE
def test_parameters_are_readable_on_a_telephone(visit):
    page = visit("several")
    resize(page, 390, 800)
    rows = js(
        page,
        """[...document.querySelectorAll('#parameters tbody tr')].map(row =>
        [row.getBoundingClientRect().right, row.scrollWidth - row.clientWidth, row.innerText])""",
    )
    assert max(right for right, _, _ in rows) <= 390.0
    assert max(beyond for _, beyond, _ in rows) <= 0
    name, meaning, *rest = next(text for _, _, text in rows if "platform mass" in text).splitlines()
    assert (name, meaning) == ("platform mass", "m0: mass of the platform, without the unbalances")
    assert "12.42" in "".join(rest)


@WIDE
def test_speeds_of_several_runs_show_their_ripple(visit):
    page = visit("several")
    number = js(page, "window.vibroplat.data.panels.findIndex(({title}) => title === 'speed from its mean')")
    low, high = js(page, f"document.getElementById('curves')._fullLayout.yaxis{number + 1}.range")
    assert low < 0.0 < high
    assert high - low < 2.0  # Hz; speeds are near 26


def test_several_machines_move_side_by_side_and_headings_lie_between_panels(visit):
    page = visit("several")
    machines = "[...document.querySelectorAll('#machines svg')].map(svg => svg.innerHTML)"
    before = js(page, machines)
    page.execute_script("window.vibroplat.player.seek(window.vibroplat.player.time + 0.007)")
    assert len(before) == js(page, "document.querySelectorAll('#legend li').length") == 3
    assert all(old != new for old, new in zip(before, js(page, machines), strict=True))
    places = js(
        page,
        """(() => { const box = document.getElementById('curves'), top = box.getBoundingClientRect().top;
        const axes = Object.entries(box._fullLayout).filter(([key]) => key.startsWith('yaxis')).map(([, axis]) => axis);
        return [...document.querySelectorAll('#curves .readout')].map((readout, number) => {
          const {top: from, bottom: to} = readout.getBoundingClientRect(), before = axes[number - 1];
          const end = before ? before._offset + before._length : 0;
          return [end, from - top, to - top, axes[number]._offset]; }); })()""",
    )
    assert len(places) == PANELS
    for end, first, last, begin in places:
        assert end <= first < last <= begin + 0.5


@WIDE
def test_figures_keep_their_place_when_the_window_changes(visit):
    page = visit("all")
    boxes = "[...document.querySelectorAll('.figure')].map(box => box.getBoundingClientRect().height)"
    before = js(page, boxes)
    assert min(before) > 80
    resize(page, 700, 900)
    time.sleep(0.6)
    assert js(page, boxes) == before
    assert js(page, "document.querySelector('.cursor').getBoundingClientRect().height") > 1000
    axis = js(page, "document.getElementById('curves')._fullLayout.xaxis._length")
    assert 500 < axis < 700


@WIDE
def test_play_and_keys_move_the_drawing_and_the_cursor_through_time(visit):
    page = visit("one")
    state = """[window.vibroplat.player.time, document.querySelector('#machines svg').innerHTML,
        document.querySelector('.cursor').style.transform]"""
    still = js(page, state)
    time.sleep(0.3)
    assert js(page, state) == still
    button = page.find_element("id", "play")
    button.click()
    time.sleep(1.0)
    assert all(old != new for old, new in zip(still, js(page, state), strict=True))
    button.click()
    stopped = clock(page)
    time.sleep(0.3)
    assert clock(page) == stopped
    assert button.text == "▶ Play"
    body = page.find_element("tag name", "body")
    turn, start = js(page, "window.vibroplat.player.turn"), js(page, "window.vibroplat.player.start")
    body.send_keys("\ue011")  # Home
    assert clock(page) == start
    body.send_keys("\ue014")  # right
    assert clock(page) == pytest.approx(start + turn / 50.0)
    body.send_keys("\ue008\ue014\ue008")  # shift and right
    assert clock(page) == pytest.approx(start + turn * 51.0 / 50.0)
    body.send_keys("\ue010")  # End
    assert clock(page) == js(page, "window.vibroplat.player.end")
    rate = js(page, "window.vibroplat.player.rate")
    body.send_keys("-")
    assert js(page, "window.vibroplat.player.rate") < rate
    body.send_keys(" ")
    assert js(page, "window.vibroplat.player.isPlaying")
    body.send_keys(" ")
    assert not js(page, "window.vibroplat.player.isPlaying")


RANGE = "document.getElementById('curves')._fullLayout.xaxis.range"


def test_clicks_and_drags_set_the_time_and_the_interval(visit):
    page = visit("one")
    first, last = js(page, RANGE)
    click_at(page, *place_of(page, "curves", 0.5))
    assert clock(page) == pytest.approx(0.5 * (first + last), abs=0.02 * (last - first))
    drag(page, place_of(page, "curves", 0.5), place_of(page, "curves", 0.75))
    assert clock(page) == pytest.approx(0.25 * first + 0.75 * last, abs=0.03 * (last - first))
    assert js(page, RANGE) == pytest.approx([first, last])
    drag(page, place_of(page, "overview", 0.2), place_of(page, "overview", 0.5))
    time.sleep(0.5)
    whole, shown = js(page, "window.vibroplat.player.curves.whole"), js(page, RANGE)
    assert shown == pytest.approx([0.2 * whole[1], 0.5 * whole[1]], abs=0.02 * whole[1])
    assert shown[0] <= clock(page) <= shown[1]
    page.find_element("css selector", "#views button:last-child").click()
    time.sleep(0.5)
    assert js(page, RANGE) == pytest.approx(whole)


@WIDE
def test_a_table_sets_the_time_is_sorted_and_saved(visit, tmp_path):
    page = visit("one")
    page.execute_async_script("window.vibroplat.player.curves.show([0.2, 0.25]).then(arguments[0])")
    page.execute_script("document.querySelector('.events tbody tr:nth-child(2)').click()")
    wanted = js(page, "window.vibroplat.data.tables[0].columns[0].values[1]")
    time.sleep(0.5)
    first, last = js(page, RANGE)
    assert first <= wanted <= last
    assert clock(page) == pytest.approx(wanted)
    heading = page.find_element("css selector", ".events th:nth-child(5) button")  # impulse
    page.execute_script("arguments[0].click(); arguments[0].click()", heading)
    cells = page.find_elements("css selector", ".events tbody td:nth-child(5)")
    shown = [float(cell.get_attribute("textContent")) for cell in cells]
    assert shown == sorted(shown, reverse=True)
    assert shown[0] > 0.0
    page.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)})
    page.execute_script("document.querySelector('.events .buttons button:last-child').click()")
    deadline = time.monotonic() + 10.0
    while not (saved := list(tmp_path.glob("*.csv"))) and time.monotonic() < deadline:
        time.sleep(0.1)
    rows = list(csv.DictReader(io.StringIO(saved[0].read_text())))
    assert saved[0].name == "quickstart-events.csv"
    assert len(rows) == js(page, "window.vibroplat.data.tables[0].rows")
    assert float(rows[0]["impulse_n_s"]) == pytest.approx(shown[0], rel=1e-5)


def point_of(driver, figure, trace, place):
    """Place in the window of a point of a curve in the first panel."""
    return js(
        driver,
        """(() => { const box = document.getElementById(arguments[0]), {xaxis, yaxis} = box._fullLayout;
        box.scrollIntoView(); const {left, top} = box.getBoundingClientRect(), line = box.data[arguments[1]];
        return [left + xaxis._offset + xaxis.l2p(line.x[arguments[2]]),
          top + yaxis._offset + yaxis.l2p(line.y[arguments[2]])]; })()""",
        figure,
        trace,
        place,
    )


def test_clicks_show_rows_of_points_multipliers_and_special_points(visit):
    page = visit("points")
    click_at(page, *point_of(page, "picture-0", 0, 1))
    told = js(page, "document.querySelector('.study .row').textContent")
    assert "43 Hz" in told
    assert "antiphase" in told
    assert js(page, "document.querySelectorAll('.study tr.picked').length") == 1
    page.execute_script("document.querySelector('.study .picked + tr').click()")
    assert "44 Hz" in js(page, "document.querySelector('.study .row').textContent")
    lines = js(page, "document.getElementById('picture-1').data.map(line => line.line && line.line.dash)")
    assert {"solid", "dash"} <= {*lines}
    page.execute_script("document.querySelectorAll('.study')[1].querySelector('tbody tr:nth-child(3)').click()")
    assert js(page, "document.querySelectorAll('.circle circle').length") == 3  # the unit circle and two multipliers
    assert js(page, "document.querySelectorAll('.orbit').length") == 0
    assert "without orbits" in js(page, "document.querySelectorAll('.study')[1].textContent")
    grazing = "{points: [{customdata: 32}]}"  # behind 31 rows of the table
    page.execute_script(f"document.getElementById('picture-1').emit('plotly_click', {grazing})")
    assert "grazing" in js(page, "document.querySelectorAll('.study .row')[1].textContent")
    assert js(page, "document.getElementById('picture-2').data.length") == 2


@WIDE
def test_a_start_is_played_from_its_beginning(visit):
    page = visit("start")
    whole = js(page, "window.vibroplat.player.curves.whole")
    assert whole == pytest.approx([0.0, 1.5])
    assert js(page, RANGE) == pytest.approx(whole)
    assert js(page, "[window.vibroplat.player.start, window.vibroplat.player.end]") == pytest.approx(whole)
    assert clock(page) == 0.0
    page.find_element("css selector", "#views button:first-child").click()
    time.sleep(0.5)
    assert clock(page) > 0.0  # the last turns


@WIDE
def test_phases_are_told_as_in_the_tables(visit):
    page = visit("one")
    number = js(page, "window.vibroplat.data.panels.findIndex(panel => panel.title === 'phase difference')")
    shown = f"document.querySelectorAll('#curves .readout')[{number}].querySelector('output').textContent"
    phases = "window.vibroplat.player.runs[0].columns.phase"
    row = js(page, f"{phases}.findIndex(phase => phase > Math.PI + 1e-3)")
    assert row >= 0
    page.execute_script("window.vibroplat.player.seek(window.vibroplat.player.runs[0].t[arguments[0]])", row)
    told, drawn = js(page, shown), js(page, f"{phases}[arguments[0]]", row)
    assert float(told.replace("−", "-")) == pytest.approx(drawn - 2.0 * np.pi, abs=2e-3)
    lines = js(page, "document.getElementById('curves').data.map(({y, text}) => [Array.from(y), text])")
    above = [(y, text) for ys, texts in lines if texts for y, text in zip(ys, texts, strict=True) if "−3.1" in text]
    assert above
    assert all(y > np.pi for y, _ in above if y > 0.0)
    ticks = js(page, f"document.getElementById('curves')._fullLayout.yaxis{number + 1}.ticktext")
    assert ticks == ["0", "π/2", "±π", "−π/2"]


def eventually(look, wanted):
    """Look until it is as wanted, and return it; a busy machine draws late."""
    deadline = time.monotonic() + 20.0
    while not wanted(found := look()):
        assert time.monotonic() < deadline, found
        time.sleep(0.1)
    return found


@WIDE
@pytest.mark.parametrize("name", ["several", "orbits"])
def test_figures_fit_on_a_sheet_of_paper_and_controls_are_left_out(visit, name):
    page = visit(name)
    sizes = """[...document.querySelectorAll('.figure')].map(box => box.getBoundingClientRect())
        .map(({width, height}) => [width, height])"""
    before = js(page, sizes)
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    page.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    millimetre = 96.0 / 25.4
    width, none = pytest.approx(180.0 * millimetre, rel=0.02), (0.0, 0.0)  # no run, no curves
    found = eventually(lambda: js(page, sizes), lambda found: all(w == width or (w, h) == none for w, h in found))
    assert all(height < 210.0 * millimetre for _, height in found)  # a heading and the whole run's strip have room too
    drawn = "[...document.querySelectorAll('.figure .main-svg:first-child')].map(e => e.getBoundingClientRect().width)"
    eventually(lambda: js(page, drawn), lambda found: all(w == width for w in found))
    controls = "[...document.querySelectorAll('.screen, #play, #time, .buttons button')]"
    assert not any(js(page, f"{controls}.map(box => box.offsetHeight)"))
    page.execute_script("window.dispatchEvent(new Event('afterprint'))")
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    eventually(lambda: js(page, sizes), lambda found: found == [pytest.approx(size, abs=1.0) for size in before])


def curves_of_orbit(driver, number=0):
    """Values of the solid curves in the figure of an orbit, without what is missing."""
    return js(
        driver,
        """[...document.getElementById(`orbit-${arguments[0]}`).data].filter(({line}) => line.dash !== 'dot')
        .map(({x, y}) => [x, y].map(values => [...values].filter(value => value !== null)))""",
        number,
    )


def test_a_click_on_a_point_of_a_branch_draws_its_orbit(visit):
    page = visit("orbits")
    rows, period, gap = js(
        page,
        """(() => { const {table, series} = window.vibroplat.data.pictures[0];
        const values = name => table.columns.find(column => column.name === name).values, gaps = values('gap_max_m');
        const flies = gaps.findLastIndex(gap => gap > 0), number = series.findIndex(({rows}) => rows.includes(flies));
        return [[number, series[number].rows.indexOf(flies)], values('period_s')[flies], gaps[flies]]; })()""",
    )
    click_at(page, *point_of(page, "picture-0", *rows))
    time.sleep(0.5)
    (y, speed), (turns, opened) = curves_of_orbit(page)
    assert max(opened) == pytest.approx(1e3 * gap, rel=0.01)
    assert (min(turns), max(turns)) == (0.0, pytest.approx(1.0))
    assert abs(speed[-1] - speed[0]) < 1e-3 * (max(speed) - min(speed))
    assert abs(y[-1] - y[0]) < 1e-3 * (max(y) - min(y))
    assert f"Period {1e3 * period:.4g} ms, 1 turn" in js(page, "document.querySelector('.orbit').textContent")
    assert js(page, "document.getElementById('picture-0').layout.shapes.length") == js(
        page, "window.vibroplat.data.pictures[0].measures.length"
    )
    box = js(page, "document.querySelector('.row').getBoundingClientRect()")
    assert box["top"] < 1000.0
    assert box["bottom"] > 0.0
    assert js(page, "document.documentElement.scrollWidth") <= page.width


@WIDE
def test_the_machine_moves_through_orbits_of_all_kinds_of_points(visit):
    page = visit("orbits")
    page.execute_script("document.querySelector('.study tbody tr').click()")
    time.sleep(0.3)
    state = """[document.querySelector('.orbit svg').innerHTML,
        document.querySelector('.orbit .dot').style.transform]"""
    still = js(page, state)
    time.sleep(0.3)
    assert js(page, state) == still
    page.execute_script("document.querySelector('.orbit .play').click()")
    time.sleep(0.7)
    assert all(old != new for old, new in zip(still, js(page, state), strict=True))
    page.execute_script("document.querySelector('.orbit .play').click()")
    stopped = js(page, state)
    time.sleep(0.3)
    assert js(page, state) == stopped
    page.execute_script(
        "const at = document.querySelector('.orbit input'); at.value = 0; at.dispatchEvent(new Event('input'))"
    )
    assert js(page, state) == still
    page.execute_script(
        "document.querySelectorAll('.study')[0].querySelectorAll('.table')[1].querySelector('tr[tabindex]').click()"
    )
    time.sleep(0.3)
    assert "Orbit at this liftoff" in js(page, "document.querySelector('.orbit').textContent")
    (_, (_, opened)) = curves_of_orbit(page)
    assert max(opened) < 1e-3  # mm: contact is about to be lost
    page.execute_script("document.querySelectorAll('.study')[1].querySelector('tbody tr:nth-child(2)').click()")
    time.sleep(0.3)
    assert len(curves_of_orbit(page, 1)) == 2
    assert "Orbit of this point" in js(page, "document.querySelectorAll('.study')[1].querySelector('.row').textContent")


@WIDE
def test_a_point_without_an_orbit_says_so_and_shows_its_neighbour(visit, branched, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "MOST_SAMPLES", 600)
    page = visit(write_report([branched], tmp_path / "few.html", mover=orbit_motion))
    row = js(
        page,
        """(() => { const {table, motions} = window.vibroplat.data.pictures[0];
        return [...Array(table.rows).keys()].find(row => !(row in motions.rows)); })()""",
    )
    page.execute_script(
        f"document.getElementById('picture-0').emit('plotly_click', {{points: [{{customdata: {row}}}]}})"
    )
    time.sleep(0.3)
    told = js(page, "document.querySelector('.orbit').textContent")
    assert "does not hold the orbit of this point" in told
    assert "the nearest one" in told
    assert len(curves_of_orbit(page)) >= 1
    assert "orbits of" in js(page, "document.querySelector('.study').textContent")


@WIDE
def test_curves_have_all_samples_where_these_are_shown(visit, moved, tmp_path):
    page = visit(write_report([moved["two layers"]], tmp_path / "part.html", 0.1, 0.2))
    count = "document.getElementById('curves').data[0].x.length"
    assert js(page, "window.vibroplat.data.runs[0].coarse") is not None
    rows = js(page, "window.vibroplat.data.runs[0].rows")
    page.execute_async_script("window.vibroplat.player.curves.show([0.1, 0.2]).then(arguments[0])")
    assert js(page, count) == pytest.approx(rows, abs=2)
    page.execute_async_script("window.vibroplat.player.curves.show([0.0, 0.25]).then(arguments[0])")
    assert js(page, "document.getElementById('curves').data[0].x[0]") == 0.0


@WIDE
def test_text_from_files_is_not_run(visit, moved, tmp_path):
    copy = handmade.rename(unproven(shutil.copytree(moved["two layers"], tmp_path / "copy")), HOSTILE, HOSTILE)
    page = visit(write_report([copy, moved["bare"]], tmp_path / "hostile.html"))
    assert js(page, "window.hacked") is None
    assert js(page, "document.querySelectorAll('img').length") == 0
    assert HOSTILE in js(page, "document.getElementById('title').textContent")
    assert HOSTILE in js(page, "document.getElementById('remarks').textContent")
    assert HOSTILE in js(page, "document.querySelector('.events tbody').textContent")


@pytest.mark.parametrize("name", ["basins", "over", "thresholds", "design", "best"])
def test_clicks_on_starts_values_and_designs_show_their_motion(visit, answered, tmp_path, name):
    """The page is drawn without a word on its console, and a picked point has its orbit beside it, if it has one."""
    page = visit(write_report([answered[name]], tmp_path / "page.html", mover=orbit_motion))
    titles = js(page, "[...document.querySelectorAll('#points h2')].map(box => box.textContent.split(':')[0])")
    drawn = {"basins": ["Basins"], "over": ["Shares", "Basins"], "thresholds": ["Thresholds"]}
    drawn |= {"design": ["Elasticities", "Tolerances"], "best": ["Elasticities", "Searches"]}
    assert titles == drawn[name]
    assert js(page, "document.getElementById('answers').innerText.length") > 60
    found = js(
        page,
        """window.vibroplat.data.pictures.map((study, number) => {
        const box = document.getElementById(`picture-${number}`), rows = study.motions.rows;
        const first = box.data.find(one => one.customdata?.length && one.customdata[0] !== null).customdata[0];
        const row = study.owned ? first : Number(Object.keys(rows).find(one => Number.isInteger(rows[one])) ?? first);
        const trace = box.data.find(one => (one.customdata || []).includes(row));
        const place = trace.customdata.indexOf(row);
        box.emit('plotly_click', {points: [{customdata: trace.customdata[place]}]});
        const panel = box.closest('section').querySelector('.row');
        const ring = box.layout.shapes.find(one => one.type === 'circle');
        return [panel.querySelectorAll('.orbit svg').length > 0, !ring || ring.xanchor === trace.x[place]]; })""",
    )
    assert found == [[title not in ("Tolerances", "Elasticities"), True] for title in titles]


@WIDE
def test_tools_cover_no_legend_and_a_share_of_none_has_no_marker(visit, answered, tmp_path):
    copy = unproven(shutil.copytree(answered["over"], tmp_path / "copy"))
    table = read_table(copy, "attractors")
    none = {name: [0.0, *table[name][1:]] for name in ("fraction", "fraction_low")}
    write_table(table.assign(**none), copy, "attractors", "parquet")
    page = visit(write_report([copy], tmp_path / "page.html"))
    room = """['.legend .bg', '.modebar']
        .map(part => document.querySelector(`#picture-0 ${part}`).getBoundingClientRect())
        .reduce((legend, bar) => legend.top - bar.bottom)"""
    assert js(page, room) >= 0.0
    sizes = "document.getElementById('picture-0').data.flatMap(t => t.yaxis === 'y' ? t.marker.size : [])"
    assert sorted(js(page, sizes))[:2] == [0, 7]


@WIDE
def test_dots_of_starts_are_drawn_for_the_chosen_value_and_found_where_they_are(visit, answered, tmp_path):
    page = visit(write_report([answered["over"]], tmp_path / "page.html"))
    x, y = js(
        page,
        """(() => { const box = document.getElementById('picture-1'), {xaxis, yaxis} = box._fullLayout;
        box.scrollIntoView(); const {left, top} = box.getBoundingClientRect();
        const one = box.data.find(t => t.mode === 'none');
        return [left + xaxis._offset + xaxis.d2p(one.x[0]), top + yaxis._offset + yaxis.d2p(one.y[0])]; })()""",
    )
    click_at(page, x, y)
    heading = "document.querySelector('#picture-1').closest('section').querySelector('.row h3').textContent"
    assert js(page, heading) == "Row 1 of starts"
    starts = """document.getElementById('picture-1').data.filter(t => t.mode === 'none' && t.yaxis === 'y')
        .flatMap(t => t.customdata).sort((a, b) => a - b)"""
    assert js(page, starts) == list(range(20))
    page.execute_script(
        """const box = document.querySelectorAll('#picture-1')[0].closest('section').querySelectorAll('select')[1];
        box.value = '1'; box.dispatchEvent(new Event('change'));"""
    )
    assert js(page, starts) == list(range(20, 40))
    dots = """(() => { const canvas = document.querySelector('#picture-1 canvas'), pen = canvas.getContext('2d');
        return pen.getImageData(0, 0, canvas.width, canvas.height).data.filter(part => part > 0).length; })()"""
    assert js(page, dots) > 1000
