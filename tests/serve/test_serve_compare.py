"""Two diagnoses side by side: verdicts, effects, errors and overlays of both; times as a reader's clock has them."""

import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import serve_work
from report_example import diagnosis
from serving import client_of, desk_at, done, id_of, new, ready
from starlette.testclient import TestClient

from cosim_serve import comparison
from cosim_serve.chart import HEIGHT, LEFT, WIDTH, chart, ticks
from cosim_serve.desk import Desk


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    with desk_at(tmp_path / "data", serve_work.comparing) as made:
        yield made


@pytest.fixture
def client(desk: Desk) -> TestClient:
    return client_of(desk)


def test_two_diagnoses_stand_in_one_table_with_both_overlays(client: TestClient, desk: Desk) -> None:
    ids = [done(client, desk, job) for job in (ready(client), ready(client, "alone.csv"))]
    home = client.get("/").text
    assert home.count('form="compare"') == 2
    assert "run1.csv, heldout.csv" in home
    assert re.search(r"Validation RMS error [\d.]+ → [\d.]+\sN·m\.", home)
    text = client.get("/compare", params={"job": ids}).text
    for said in ("Two effects are missing", "Nothing missing that these recordings can show", "alone.csv"):
        assert said in text
    rows = dict(re.findall(r'<tr><th scope="row">([^<]+)</th>(.*?)</tr>', text, re.DOTALL))
    assert "0.42\N{NO-BREAK SPACE}N·m" in rows["Cogging"].replace("0.42 N", "0.42\N{NO-BREAK SPACE}N")
    assert len(re.findall("<td>", rows["with the improved card"])) == 2
    assert text.count('class="error_after"') == 2
    assert text.count(" s</text>") == 4  # the last tick of each time axis has the unit


def test_others_than_two_that_are_done_are_a_sentence(client: TestClient, desk: Desk) -> None:
    job = done(client, desk, ready(client))
    for chosen in ([], [job], [job, job], [job, id_of(new(client))]):
        answer = client.get("/compare", params={"job": chosen})
        assert answer.status_code == 400
        assert "Choose two diagnoses that are done" in answer.text
    assert client.get("/compare", params={"job": [job, "../.."]}).status_code == 404


def test_what_an_older_version_made_is_compared_as_far_as_it_goes(client: TestClient, desk: Desk) -> None:
    ids = [done(client, desk, job) for job in (ready(client), ready(client, "alone.csv"))]
    path = desk.store.result(ids[0]) / comparison.FILE
    for text in ("", "{}", "[1]", '{"heading": 3}'):
        path.write_text(text, "utf-8")
        shown = client.get("/compare", params={"job": ids})
        assert shown.status_code == 200
        assert "diagnose it again to compare it" in shown.text
        assert "polyline" not in shown.text
    path.unlink()
    assert client.get("/compare", params={"job": ids}).status_code == 200


def test_a_line_keeps_every_peak_and_its_error() -> None:
    found = diagnosis("two")
    made = comparison.compared(found)
    (trace,) = (one for one in found.traces if one.heldout)
    assert max(made.lines["measured"].values) == pytest.approx(trace.tau.max(), rel=1e-3)
    assert max(made.lines["error_before"].values) == pytest.approx((trace.tau - trace.before).max(), rel=1e-3)
    assert len(made.lines["measured"].t) <= comparison.CORNERS
    assert [one.size for one in made.effects if one.id == "cogging"] == ["0.42 N·m"]


@pytest.mark.parametrize(("low", "high"), [(0.0, 30.0), (-0.82, 0.83), (1e-7, 3e-7), (-4e5, 9e6), (99.0, 101.0)])
def test_ticks_are_round_inside_and_evenly_spaced(low: float, high: float) -> None:
    for most in (4, 7):
        found = ticks(low, high, most)
        assert 2 <= len(found) <= most + 1
        assert all(low - 1e-9 * abs(low) <= value <= high + 1e-9 * abs(high) for value, _ in found)
        steps = [b - a for (a, _), (b, _) in pairwise(found)]
        assert steps == pytest.approx([steps[0]] * len(steps))
        assert len({text for _, text in found}) == len(found)
        for value, text in found:
            assert float(text.replace("\N{MINUS SIGN}", "-")) == pytest.approx(value, rel=1e-2, abs=1e-12)


def test_a_constant_or_empty_signal_has_axes_too() -> None:
    made = chart({"x": ([0.0, 1.0], [2.0, 2.0])}, (0.0, 1.0), (2.0, 2.0))
    assert [one.text for one in made.y] == ["2"]
    points = np.array([[float(x) for x in pair.split(",")] for pair in made.lines["x"].split()])
    assert points[:, 0].min() >= LEFT
    assert points[:, 0].max() <= WIDTH
    assert points[:, 1].max() <= HEIGHT
    assert chart({}, (0.0, 0.0), (0.0, 0.0)).x[0].text == "0"
