"""The report's page in a real browser, offline: every issue is there, the map works, text stays text."""

import html
import json
import re
import subprocess
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from browser import CHROMIUM, ONE_LOOK, needs_browser

from dojo_maps.inspection import inspect, write_reports
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.report.page import write_page
from dojo_maps.validation.runner import run_checks

EVIL = "</script><script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">"
_WATCH = """<script>window.problems = [];
window.addEventListener("error", (event) => problems.push(String(event.message)));
window.addEventListener("securitypolicyviolation", (event) => problems.push(event.violatedDirective));
</script>"""
_ASK = """<script>{
const rows = [...document.querySelectorAll("#list li")];
const shown = () => rows.filter((row) => !row.hidden).map((row) => row.id);
const map = document.getElementById("map");
const view = () => map.getAttribute("viewBox").split(" ").map(Number);
const change = (name, value) => {
  const field = document.getElementById("filters").elements[name];
  if (field.type === "checkbox") field.checked = value; else field.value = value;
  field.dispatchEvent(new Event("input", { bubbles: true }));
};
const answer = (() => { %s })();
setTimeout(() => {
  const result = document.createElement("pre");
  result.id = "answer";
  result.textContent = JSON.stringify({ answer, problems, title: document.title });
  document.body.append(result);
}, 1500);
}</script>"""


@lru_cache(maxsize=4)
def _report(name: str) -> tuple[Any, dict[str, Any]]:
    return inspect(name)


def _page(name: str, folder: Path) -> Path:
    page = folder / f"{name}.html"
    write_reports(*_report(name), html=page)
    return page


def _ask(page: Path, question: str, address: str = "") -> dict[str, Any]:
    """Open a copy of a page that runs some more script; what that says, and every error on the way."""
    text = page.read_text(encoding="utf-8")
    asked = page.with_name("asked.html")
    asked.write_text(
        text.replace("<head>", f"<head>{_WATCH}", 1).replace("</body>", f"{_ASK % question}</body>"),
        encoding="utf-8",
    )
    command = [
        CHROMIUM,
        *ONE_LOOK,
        f"--user-data-dir={page.parent / 'profile'}",
        "--dump-dom",
        "--enable-logging=stderr",
    ]
    done = subprocess.run(
        [*command, asked.as_uri() + address], capture_output=True, text=True, timeout=120, check=False
    )
    found = re.search(r'<pre id="answer">(.*?)</pre>', done.stdout, re.S)
    assert found, done.stderr[-2000:]
    result = json.loads(html.unescape(found.group(1)))
    assert result["problems"] == []
    assert "CONSOLE" not in done.stderr
    return result


@pytest.mark.slow
@pytest.mark.sampled(1)
@needs_browser
@pytest.mark.parametrize("name", ["cologne1", "ingolstadt7", "arterial4x4"])
def test_page_shows_every_issue_with_its_picture(name: str, tmp_path: Path) -> None:
    _, report = _report(name)
    asked = _ask(
        _page(name, tmp_path),
        """const drawn = (row) => {
          const picture = row.querySelector(".picture");
          paint(data.issues[picture.dataset.issue], picture);
          const [x, y, width, height] = picture.getAttribute("viewBox").split(" ").map(Number);
          return [...picture.querySelectorAll(".hit")].filter((hit) => {
            const box = hit.getBBox();
            return box.x < x + width && box.x + box.width > x && box.y < y + height && box.y + box.height > y;
          }).length;
        };
        const markers = document.querySelectorAll(".marker").length;
        const texts = rows.map((row) => row.textContent);
        return { ids: shown(), texts, markers, drawn: rows.map(drawn) };""",
    )["answer"]
    assert min(asked["drawn"]) >= 1, "a picture shows none of its issue's elements"
    assert sorted(asked["ids"]) == sorted(f"issue-{k}" for k in range(len(report["issues"])))
    assert asked["markers"] == len(report["issues"])
    by_id = dict(zip(asked["ids"], asked["texts"], strict=True))
    for k, issue in enumerate(report["issues"]):
        text = by_id[f"issue-{k}"]
        for part in (issue["check"], issue["message"], issue["hint"], issue["severity"]):
            assert part in text
        if issue["measured"] is not None:
            assert "measured" in text
    ranks = [
        next(k for k, s in enumerate(("error", "warning", "note")) if t.startswith(s)) for t in asked["texts"]
    ]
    assert ranks == sorted(ranks)


@pytest.mark.slow
@needs_browser
def test_page_filters_by_severity_check_junction_and_word(tmp_path: Path) -> None:
    _, report = _report("ingolstadt7")
    asked = _ask(
        _page("ingolstadt7", tmp_path),
        """const found = {};
        change("note", false); change("warning", false); found.errors = shown();
        change("note", true); change("warning", true);
        change("check", "geometry.short_edge"); found.check = shown(); change("check", "");
        const junctions = document.getElementById("filters").elements.junction;
        found.name = junctions.options[3].value;
        change("junction", found.name); found.junction = shown(); change("junction", "");
        change("text", "GNEJ210 conflict"); found.word = shown();
        const markers = [...document.querySelectorAll(".marker")];
        found.hidden = markers.filter((marker) => marker.style.display === "none").length;
        change("text", "no such thing");
        found.none = [shown().length, document.getElementById("none").hidden];
        change("text", "");
        found.all = shown().length;
        found.status = document.getElementById("shown").textContent;
        return found;""",
    )["answer"]
    issues = report["issues"]

    def ids(fits: Any) -> list[str]:
        return sorted(f"issue-{k}" for k, issue in enumerate(issues) if fits(issue))

    assert sorted(asked["errors"]) == ids(lambda i: i["severity"] == "error")
    assert sorted(asked["check"]) == ids(lambda i: i["check"] == "geometry.short_edge")
    assert asked["junction"]
    assert len(asked["junction"]) < len(issues)
    assert sorted(asked["word"]) == ids(
        lambda i: "conflict" in i["check"] and any(e["id"] == "gneJ210" for e in i["elements"])
    )
    assert asked["hidden"] == len(issues) - len(asked["word"])
    assert asked["none"] == [0, False]
    assert asked["all"] == len(issues)
    assert asked["status"] == f"{len(issues)} of {len(issues)} issues shown"


@pytest.mark.slow
@needs_browser
def test_page_goes_to_an_issue_pans_and_zooms(tmp_path: Path) -> None:
    read, report = _report("ingolstadt7")
    k = next(n for n, issue in enumerate(report["issues"]) if issue["check"] == "signals.green_conflict")
    asked = _ask(
        _page("ingolstadt7", tmp_path),
        f"""const found = {{ whole: view() }};
        document.getElementById("issue-{k}").click();
        found.chosen = view();
        found.hits = [...map.querySelectorAll(".hit")].map((path) => path.getAttribute("class"));
        found.address = location.hash;
        document.getElementById("in").click(); found.closer = view();
        document.getElementById("out").click(); found.farther = view();
        const at = map.getBoundingClientRect();
        const mouse = (type, x, y, buttons) => map.dispatchEvent(
          new PointerEvent(type, {{ clientX: at.x + x, clientY: at.y + y, buttons, bubbles: true }}));
        mouse("pointerdown", 200, 200, 1); mouse("pointermove", 150, 180, 1); mouse("pointerup", 150, 180, 0);
        found.moved = view();
        found.place = document.getElementById("place").textContent;
        const there = {{ clientX: at.x + 100, clientY: at.y + 100 }};
        map.dispatchEvent(new WheelEvent("wheel", {{ deltaY: -100, ...there }}));
        found.wheel = view();
        document.getElementById("all").click(); found.again = view();
        return found;""",
    )["answer"]
    x, y = np.array(report["issues"][k]["position"][:2]) - read.road_map.origin
    left, top, width, height = asked["chosen"]
    assert left + width / 2 == pytest.approx(x, abs=0.1)
    assert top + height / 2 == pytest.approx(-y, abs=0.1)
    assert len(asked["hits"]) >= 4
    assert sum("way" in name for name in asked["hits"]) == 2
    assert asked["address"] == f"#issue-{k}"
    assert asked["closer"][2] < width < asked["farther"][2] * 1.05
    assert asked["moved"][0] > asked["farther"][0]
    assert asked["moved"][1] > asked["farther"][1]
    assert asked["moved"][2:] == asked["farther"][2:]
    assert asked["wheel"][2] == pytest.approx(asked["moved"][2] * 0.8)
    assert asked["again"] == asked["whole"]
    assert re.fullmatch(r"-?[\d.]+, -?[\d.]+", asked["place"])


@needs_browser
def test_page_copies_the_selection_and_moves_by_keys(tmp_path: Path) -> None:
    _, report = _report("ingolstadt7")
    asked = _ask(
        _page("ingolstadt7", tmp_path),
        """const copied = [];
        document.execCommand = () => { copied.push(document.activeElement.value); return true; };
        const row = document.getElementById("issue-0");
        for (const button of row.querySelectorAll("button")) button.click();
        const labels = [...row.querySelectorAll("button")].map((button) => button.textContent);
        rows[0].focus();
        rows[0].dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowDown", bubbles: true }));
        return { copied, labels, chosen: document.querySelector("li.chosen").id, second: rows[1].id };""",
    )["answer"]
    issue = report["issues"][0]
    selection, position, lonlat = asked["copied"]
    first = issue["elements"][0]
    assert selection.splitlines()[0] == f"{first['kind'].replace('road', 'edge')}:{first['id']}"
    assert [float(v) for v in position.split(",")] == pytest.approx(issue["position"][:2], abs=0.01)
    assert [float(v) for v in lonlat.split(",")] == pytest.approx(issue["lonlat"][::-1], abs=1e-5)
    assert asked["labels"] == ["copied"] * 3
    assert asked["chosen"] == asked["second"]


@pytest.mark.slow
@needs_browser
def test_page_opens_on_the_issue_that_the_address_names(tmp_path: Path) -> None:
    page = _page("ingolstadt7", tmp_path)
    question = 'return [...document.querySelectorAll("li.chosen")].map((row) => row.id);'
    assert _ask(page, question, "#issue-5")["answer"] == ["issue-5"]
    assert _ask(page, question, "#issue-99999")["answer"] == []
    assert _ask(page, question, "#issue-</script>")["answer"] == []


@pytest.mark.slow
@needs_browser
def test_page_shows_markup_from_the_map_as_text(tmp_path: Path) -> None:
    read, _ = _report("cologne1")
    issue = Issue(
        check="topology.duplicate_id",
        severity=Severity.ERROR,
        elements=(Element(kind="lane", id=EVIL), Element(kind="junction", id=EVIL)),
        position=(*read.road_map.origin, 0.0),
        message=EVIL,
        hint=EVIL,
        measured=1.0,
        limit=2.0,
    )
    source = replace(read.road_map.source, file=EVIL)
    roads = [replace(road, id=EVIL, name=EVIL) for road in read.road_map.roads[:1]]
    junctions = [replace(junction, id=EVIL) for junction in read.road_map.junctions[:1]]
    evil = replace(
        read.road_map,
        name=EVIL,
        source=source,
        roads=(*roads, *read.road_map.roads),
        junctions=(*junctions, *read.road_map.junctions[1:]),
    )
    report = run_checks(evil, None, [issue])
    report["checks"][0]["reason"] = EVIL
    report["excluded"] = [{**report["issues"][0], "reason": EVIL}]
    page = tmp_path / "evil.html"
    write_page(report, evil, page)
    assert page.read_text(encoding="utf-8").count("<script") == 2
    asked = _ask(
        page,
        """choose(0); change("text", "<img src=x");
        return { images: document.images.length, scripts: document.scripts.length,
          shown: rows.some((row) => row.querySelector(".message").textContent === %s),
          heading: document.querySelector("h1").textContent };""".replace(
            "%s", json.dumps(EVIL).replace("<", "\\u003c")
        ),
    )
    assert asked["title"] == f"{EVIL}: report"
    assert asked["answer"] == {"images": 0, "scripts": 4, "shown": True, "heading": EVIL}


@needs_browser
def test_page_of_a_network_with_strange_names_is_whole(network_path, tmp_path: Path) -> None:
    page = tmp_path / "strange.html"
    write_reports(*inspect(str(network_path("strange_names"))), html=page)
    asked = _ask(page, "return [rows.length, document.images.length];")
    assert asked["answer"][0] > 0
    assert asked["answer"][1] == 0


def test_page_loads_nothing_from_anywhere(tmp_path: Path) -> None:
    text = _page("ingolstadt7", tmp_path).read_text(encoding="utf-8")
    markup = "".join(part.rpartition("<script")[0] for part in text.split("</script>"))
    assert "default-src 'none'" in markup
    for loading in ("src=", "href=", "@import", "url("):
        assert loading not in markup
    assert "://" not in text.replace("http://www.w3.org/2000/svg", "")


@pytest.mark.slow
@needs_browser
def test_page_draws_the_map(tmp_path: Path) -> None:
    page, picture = _page("arterial4x4", tmp_path), tmp_path / "page.png"
    command = [CHROMIUM, *ONE_LOOK, f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={picture}"]
    subprocess.run(
        [*command, "--window-size=1400,900", page.as_uri()], capture_output=True, timeout=120, check=False
    )
    pixels = cv2.cvtColor(cv2.imread(str(picture)), cv2.COLOR_BGR2RGB).astype(int)[60:, 470:]
    road = np.abs(pixels - (0x8D, 0x94, 0x9E)).max(axis=2) < 12
    assert 0.01 < road.mean() < 0.3
    columns = np.flatnonzero(road.any(axis=0))
    assert 5 < columns.min() < columns.max() < pixels.shape[1] - 5
    assert abs(columns.min() + columns.max() - pixels.shape[1]) < 20, "the map is not in the middle"
