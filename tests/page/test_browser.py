"""The page in a browser: its first screen, on a telephone, on paper, read and zoomed, clicked and played."""

import base64
import itertools
import re
import time

import pytest
from common.places import ROOT
from tools.browser import browser, missing, open_page, resize

from vibroplat import load_config, simulate
from vibroplat.continuation.rows import orbit_motion
from vibroplat.page.report import write_report

pytestmark = [pytest.mark.long, pytest.mark.skipif(bool(missing()), reason=missing())]

WIDE, NARROW = (1400, 900), (390, 800)


@pytest.fixture(scope="module")
def driver():
    with browser(*WIDE) as opened:
        yield opened


@pytest.fixture(scope="module")
def pages(saved, started, swept, followed, branched, measured, tmp_path_factory):
    """Paths of pages by name."""
    place = tmp_path_factory.mktemp("pages")
    layers, bare, bouncing = (saved[name] for name in ("two layers", "bare", "bouncing"))
    wanted = {"one": [layers], "several": [layers, bare, bouncing], "all": [layers, swept], "start": [started]}
    wanted |= {"orbits": [branched, measured], "points": [swept, followed]}
    simulate(load_config(ROOT / "configs/templates/feeder.yaml")).save(place / "feeder/run")
    wanted["conveys"] = [place / "feeder/run"]
    movers = {"orbits": orbit_motion}
    return {name: write_report(of, place / f"{name}.html", mover=movers.get(name)) for name, of in wanted.items()}


@pytest.fixture
def visit(driver, pages):
    """Open a page: nothing is loaded or wider than the screen, and its console stays silent."""

    def visit(path, size=WIDE):
        resize(driver, *size)
        driver.get_log("browser")
        open_page(driver, pages.get(path, path))
        assert js(driver, "performance.getEntriesByType('resource').map(entry => entry.name)") == []
        assert js(driver, "document.documentElement.scrollWidth") <= size[0]
        return driver

    yield visit
    assert driver.get_log("browser") == []


def js(driver, text, *arguments):
    return driver.execute_script(f"return {text}", *arguments)


def eventually(look, wanted):
    """Look until it is as wanted, and return it; a busy machine draws late."""
    deadline = time.monotonic() + 20.0
    while not wanted(found := look()):
        assert time.monotonic() < deadline, found
        time.sleep(0.1)
    return found


def mouse(driver, kind, x, y, *, held=False):
    button = {"button": "left", "buttons": 1, "clickCount": 1} if held or kind != "mouseMoved" else {"buttons": 0}
    driver.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": kind, "x": x, "y": y, **button})


def click_at(driver, x, y):
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        mouse(driver, kind, x, y)


def drag(driver, start, end):
    mouse(driver, "mouseMoved", *start)
    mouse(driver, "mousePressed", *start)
    for share in (0.3, 0.6, 1.0):
        mouse(driver, "mouseMoved", *(a + share * (b - a) for a, b in zip(start, end, strict=True)), held=True)
    mouse(driver, "mouseReleased", *end)


def place_in(driver, figure, x, y):
    """Place in the window at shares of the width and the height of a figure's area."""
    left, top, width, height = js(
        driver,
        """(() => { const area = document.querySelectorAll(arguments[0])[0].querySelector('.area');
        area.scrollIntoView({block: 'center'}); const {left, top, width, height} = area.getBoundingClientRect();
        return [left, top, width, height]; })()""",
        figure,
    )
    return left + x * width, top + (1.0 - y) * height


def swipe(driver, x, y, distance):
    """Move a finger up over the screen."""
    touch = "Input.dispatchTouchEvent"
    driver.execute_cdp_cmd(touch, {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for step in range(1, 16):
        driver.execute_cdp_cmd(touch, {"type": "touchMove", "touchPoints": [{"x": x, "y": y - distance * step / 15}]})
        time.sleep(0.02)
    driver.execute_cdp_cmd(touch, {"type": "touchEnd", "touchPoints": []})


#: Where a finger begins.
PLACE = """(box => [box.left + 60, Math.max(box.top + 40, 300)])
    (document.querySelector(arguments[0]).getBoundingClientRect())"""


# -- the first screen, a telephone, paper ---------------------------------------------------------------


@pytest.mark.parametrize("of", ["one", "all"])
def test_the_first_screen_holds_headline_machine_sheet_and_curves(of, visit):
    """A run, or a run and a sweep, whose answers are beside each other."""
    page = visit(of)
    bottoms = js(
        page,
        """['header', '#machines svg', '.sheet', '#curves .plot:nth-child(2)']
        .map(which => document.querySelector(which).getBoundingClientRect().bottom)""",
    )
    assert max(bottoms) <= WIDE[1]
    assert js(page, "document.querySelectorAll('.sheet tr').length") > 20
    assert js(page, "[...document.querySelectorAll('details')].every(one => !one.open)")


@pytest.mark.parametrize("size", [WIDE, (1000, 900)])
def test_the_data_sheet_of_three_runs_is_whole(visit, size):
    page = visit("several", size)
    assert js(page, "document.querySelector('#sheet').scrollWidth - document.querySelector('#sheet').clientWidth") <= 0
    right = "document.querySelector(arguments[0]).getBoundingClientRect().right"
    assert js(page, right, ".sheet td:last-child") <= js(page, right, "main")


def test_all_figures_are_drawn(visit):
    page = visit("one")
    page.execute_script("document.querySelectorAll('details').forEach(one => { one.open = true; })")
    drawn = js(
        page,
        """[...document.querySelectorAll('.plot')].map(plot => [...plot.querySelectorAll('.curve, .band, .dots')]
        .some(path => path.getBBox().width + path.getBBox().height > 0))""",
    )
    assert len(drawn) > 10
    assert all(drawn)


@pytest.mark.parametrize("name", ["one", "several", "all", "orbits", "start"])
def test_pages_fit_on_a_telephone_and_a_finger_scrolls_them(visit, name):
    page = visit(name, NARROW)
    tall = js(
        page, "[...document.querySelectorAll('.plot:not(.bars):not(.strips) .area')].map(one => one.offsetHeight)"
    )
    assert max(tall) <= NARROW[1] / 3
    page.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
    try:
        for which in (".plot .area", "header"):
            page.execute_script("scrollTo(0, 0); document.querySelector(arguments[0]).scrollIntoView()", which)
            page.execute_script("scrollBy(0, -250)")
            before = js(page, "scrollY")
            x, y = js(page, PLACE, which)
            swipe(page, x, y, 225)
            eventually(lambda: js(page, "scrollY"), lambda now, before=before: now - before >= 200)
        assert js(page, "visualViewport.scale") == 1
    finally:
        page.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})


@pytest.mark.parametrize("of", ["one", "several", "conveys"])
def test_a_run_or_three_print_on_one_sheet(visit, of):
    page = visit(of)
    options = {"preferCSSPageSize": True, "printBackground": True}
    pdf = base64.b64decode(page.execute_cdp_cmd("Page.printToPDF", options)["data"])
    assert re.findall(rb"/Count (\d+)", pdf) == [b"1"]
    assert b"/MediaBox [0 0 594.95996 841.91998]" in pdf or b"/MediaBox [0 0 59" in pdf


def test_the_answer_of_a_study_is_read_on_a_telephone_without_a_swipe(visit):
    page = visit("orbits", NARROW)
    cut = "[...document.querySelectorAll('.short, .answer')].filter(one => one.scrollWidth > one.clientWidth).length"
    assert js(page, cut) == 0
    assert js(page, "document.querySelectorAll('.short td').length") > 0


def test_without_scripts_all_is_read(driver, pages):
    driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        driver.get(pages["all"].resolve().as_uri())
        told = driver.find_element("tag name", "body").text
        assert "Amplitude and stroke" in told
        assert "Table sweep" in told
        assert driver.find_element("css selector", "#machines svg").is_displayed()
        assert driver.find_element("css selector", ".plot .curve, .plot .band").is_displayed()
        assert not driver.find_element("css selector", ".play").is_displayed()
    finally:
        driver.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})


# -- curves ---------------------------------------------------------------------------------------------

CURVE = "#curves .plot:nth-child(2)"
READ = f"document.querySelector('{CURVE} output').textContent"
TICKS = f"[...document.querySelectorAll('{CURVE} .xt')].map(tick => parseFloat(tick.textContent))"


def test_the_readout_names_every_curve_with_its_value_and_unit(visit):
    page = visit("one")
    name = "document.querySelector('#curves .plot:nth-child(2)')"
    low, high = (float(end) for end in js(page, f"{name}.dataset.y").split()[:2])
    mouse(page, "mouseMoved", *place_in(page, CURVE, 0.5, 0.5))
    told = eventually(lambda: js(page, READ), bool)
    assert re.search(r"^[\d.]+ s", told)
    assert re.search(r"underside of the material −?[\d.]+ mm", told)
    value = float(re.search(r"platform (−?[\d.]+) mm", told).group(1).replace("−", "-"))
    points = js(
        page,
        f"""(() => {{ let [x, y] = [0, 0]; const line = {name}.querySelector('[data-n=platform]').getAttribute('d');
        const steps = line.match(/-?\\d+/g).map(Number);
        return steps.flatMap((_, n) => n % 2 ? [] : [[x += steps[n], y += steps[n + 1]]]); }})()""",
    )
    nearest = min(points, key=lambda point: abs(point[0] - 5000))
    assert value == pytest.approx(high - nearest[1] / 3000 * (high - low), abs=0.03 * (high - low))


def test_a_drag_zooms_and_a_double_click_returns(visit):
    page = visit("one")
    before = js(page, TICKS)
    drag(page, place_in(page, CURVE, 0.25, 0.5), place_in(page, CURVE, 0.5, 0.5))
    after = eventually(lambda: js(page, TICKS), lambda ticks: ticks != before)
    assert min(before) <= min(after) < max(after) < max(before)
    page.execute_script(f"document.querySelector('{CURVE} .area').ondblclick()")
    assert js(page, TICKS) == before


# -- the machine ----------------------------------------------------------------------------------------

STATE = "document.querySelector('#machines svg').innerHTML"
NUMBER = "Number(document.querySelector('#machines input').value)"


def test_the_machine_moves_stops_and_goes_through_the_whole_run(visit):
    page = visit("one")
    last = js(page, NUMBER)
    still = js(page, STATE)
    eventually(lambda: js(page, STATE), lambda now: now != still)
    button = page.find_element("css selector", "#machines .play")
    button.click()
    assert button.text == "Play"
    stopped = js(page, STATE)
    time.sleep(0.3)
    assert js(page, STATE) == stopped
    page.find_element("css selector", "#machines .whole").click()
    assert js(page, NUMBER) < last
    eventually(lambda: js(page, NUMBER), lambda now: now > 0)
    page.execute_script("const slider = document.querySelector('#machines input'); slider.value = 1; slider.oninput()")
    assert "t = 0.0" in js(page, "document.querySelector('#machines .clock').textContent")


def test_machines_of_several_runs_move_side_by_side(visit):
    page = visit("several")
    machines = "[...document.querySelectorAll('#machines svg')].map(svg => svg.innerHTML)"
    before = js(page, machines)
    assert len(before) == 3
    eventually(lambda: js(page, machines), lambda now: all(a != b for a, b in zip(before, now, strict=True)))


# -- points ---------------------------------------------------------------------------------------------


def click_point(page, number, place):
    """Click at a point of the first figure of a picture; return what is told beside it."""
    x, y = js(
        page,
        """(() => { const plot = document.querySelector(`#picture-${arguments[0]} .picture`);
        const bytes = Uint8Array.from(atob(plot.dataset.p), letter => letter.charCodeAt(0));
        const parts = new Uint16Array(bytes.buffer), count = parts.length / 3;
        const row = Array.from(parts.slice(0, count)).indexOf(arguments[1]), area = plot.querySelector('.area');
        area.scrollIntoView({block: 'center'}); const {left, top, width, height} = area.getBoundingClientRect();
        return [left + parts[count + row] / 65535 * width, top + parts[2 * count + row] / 65535 * height]; })()""",
        number,
        place,
    )
    told = f"document.querySelector('#picture-{number} .row').textContent"
    page.execute_script(f"document.querySelectorAll('#picture-{number} .ring').forEach(ring => ring.remove())")
    click_at(page, x, y)
    eventually(lambda: js(page, f"document.querySelectorAll('#picture-{number} .ring').length"), bool)
    return js(page, told)


def test_a_click_on_a_point_tells_its_numbers(visit):
    page = visit("points")
    told = click_point(page, 0, 1)
    assert "43" in told
    assert "antiphase" in told
    assert js(page, "document.querySelectorAll('#picture-0 tr.picked').length") == 1
    page.execute_script("document.querySelector('#picture-0 .picked + tr').click()")
    assert "44" in js(page, "document.querySelector('#picture-0 .row').textContent")
    page.execute_script("document.querySelectorAll('#picture-1 table.rows')[0].tBodies[0].rows[2].click()")
    assert js(page, "document.querySelectorAll('#picture-1 .circle circle').length") == 3, "a circle, two multipliers"
    assert "without orbits" in js(page, "document.querySelector('#picture-1').textContent")


@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_a_click_or_a_tap_on_a_point_shows_its_orbit_and_the_moving_machine(visit, size):
    page = visit("orbits", size)
    row = js(
        page,
        """(() => { const data = JSON.parse(document.querySelector('#picture-0 .data').textContent);
        return data.owner.findLastIndex((one, n) => n < data.rows && one >= 0 && data.list[one].hits.length); })()""",
    )
    told = click_point(page, 0, row)
    assert "Orbit of this point" in told
    assert re.search(r"period [\d.]+ ms, 1 turn", told)
    box = js(page, "document.querySelector('#picture-0 .row').getBoundingClientRect()")
    assert box["top"] < size[1]
    curves = js(page, "[...document.querySelectorAll('#picture-0 .motion .curve')].map(path => path.dataset.n)")
    assert {"y", "underside"} <= {*curves}
    svg = "document.querySelector('#picture-0 .orbit svg.machine').innerHTML"
    before = js(page, svg)
    eventually(lambda: js(page, svg), lambda now: now != before)
    liftoff = "document.querySelectorAll('#picture-0 table.rows')[1].tBodies[0].rows[0].click()"
    page.execute_script(liftoff)
    assert "Orbit at this liftoff" in js(page, "document.querySelector('#picture-0 .orbit').textContent")
    page.execute_script("document.querySelector('#picture-1 tbody tr').click()")
    assert "Orbit of this point" in js(page, "document.querySelector('#picture-1 .orbit').textContent")
    assert js(page, "document.documentElement.scrollWidth") <= size[0]


@pytest.mark.parametrize("name", ["basins", "over", "thresholds", "design", "best"])
def test_clicks_on_starts_values_and_designs_show_their_motion(visit, answered, tmp_path, name):
    page = visit(write_report([answered[name]], tmp_path / "page.html", mover=orbit_motion))
    page.execute_script("document.querySelectorAll('details').forEach(one => { one.open = true; })")
    titles = js(page, "[...document.querySelectorAll('.study h2')].map(box => box.firstChild.textContent.trim())")
    drawn = {"basins": ["Basins"], "over": ["Basin fractions", "Basins"], "thresholds": ["Thresholds"]}
    drawn |= {"design": ["Elasticities", "Tolerances"], "best": ["Elasticities", "Searches"]}
    assert titles == drawn[name]
    moving = "document.querySelectorAll('#picture-{} .orbit svg.machine').length"
    for number, title in enumerate(titles):
        assert js(page, moving.format(number)) == (title not in ("Tolerances", "Elasticities"))
    page.execute_script("document.querySelectorAll('details').forEach(one => { one.open = false; })")
    if name != "design":
        click_point(page, len(titles) - 1, 0)


# -- tables and safety ----------------------------------------------------------------------------------


def test_tables_are_sorted(visit):
    page = visit("one")
    table = "[...document.querySelectorAll('table.rows')][0]"
    page.execute_script(
        f"{table}.closest('details').open = true; {table}.tHead.rows[0].querySelector('[data-n=impulse_n_s]').click()"
    )
    page.execute_script(f"{table}.tHead.rows[0].querySelector('[data-n=impulse_n_s]').click()")
    column = js(page, f"{table}.tHead.rows[0].querySelector('[data-n=impulse_n_s]').cellIndex")
    shown = js(page, f"[...{table}.tBodies[0].rows].map(row => Number(row.cells[{column}].textContent))")
    assert shown == sorted(shown, reverse=True)
    assert shown[0] > 0.0


def test_grains_go_on_where_a_turn_ended(visit, tmp_path):
    scene = load_config(ROOT / "configs/examples/conveying.yaml", {"run.duration_s": 2.0})
    page = visit(write_report([simulate(scene).save(tmp_path / "conveying")], tmp_path / "conveying.html"))
    js(page, "player.play(false)")

    def first(share):
        page.execute_script(f"player.share = {share}; player.draw()")
        return float(js(page, "document.querySelector('.grains').getAttribute('d')")[1:].split()[0])

    places = [first(share) for share in (0.99, 0.0, 0.01)]
    before, after = ((late - early) % 26.0 for early, late in itertools.pairwise(places))
    assert 0.0 < before < 2.0
    assert 0.0 < after < 2.0
