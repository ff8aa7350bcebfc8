"""What may be dropped on the page: names, sizes, damaged files, and how they are shown and corrected."""

import gzip
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serve_work
from damages import damaged
from serving import CARD, HERE, act, client_of, desk_at, id_of, kept, new, put, ready, recording, state_of
from starlette.testclient import TestClient

from cosim.support.errors import InputError
from cosim_serve.desk import Desk
from cosim_serve.looks import HEIGHT, WIDTH, line
from cosim_serve.uploads import Limits, safe_name
from cosim_serve.work import command, job_order
from pyfmi_models.card import parse_card

SMALL = Limits(file=20_000, job=50_000, files=4, card=300, form=2_000)
DAMAGES = 20


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("run1.csv", "run1.csv"),
        ("../../etc/run.csv", "run.csv"),
        ("..\\..\\run.csv", "run.csv"),
        ("/etc/passwd.csv", "passwd.csv"),
        (".hidden.csv", "hidden.csv"),
        ("a\0b\n.csv", "ab.csv"),
        ("C:run?.csv", "C_run_.csv"),
        ("run\u202evsc.csv", "runvsc.csv"),
        ("x" * 300 + ".csv.gz", "x" * 53 + ".csv.gz"),
        ("Übung 測量.csv", "Übung 測量.csv"),
    ],
)
def test_a_name_becomes_a_name_that_stays_in_its_folder(given: str, name: str) -> None:
    assert safe_name(given, 60) == name


@pytest.mark.parametrize("given", ["", "..", "/", "run", "...", "a/", "\0", "../.."])
def test_what_is_no_name_is_refused(given: str) -> None:
    with pytest.raises(InputError, match="is no name"):
        safe_name(given, 60)


def test_a_name_may_have_any_signs_and_no_path_in_it_leads_out(client: TestClient, desk: Desk, tmp_path: Path) -> None:
    job, signs = new(client), "Lauf #1 & 50% + Übung.csv"
    for name in ("../../../run.csv", "..%2f..%2frun2.csv", "..\\run3.csv", signs):
        put(client, job, name, recording())
    assert {one.parent for one in desk.store.home.rglob("*.csv")} == {desk.store.home / id_of(job) / "recordings"}
    assert [one.name for one in tmp_path.iterdir()] == ["data"]
    assert state_of(desk, job).uploads[-1].name == signs


@pytest.mark.parametrize("path", ["../job.json", "..%2fjob.json", "%2e%2e/job.json", "card.toml", "/etc/passwd"])
def test_only_what_the_diagnosis_wrote_can_be_fetched(client: TestClient, path: str) -> None:
    job = ready(client)
    assert client.get(f"{job}/result/{path}").status_code in (404, 405)


@pytest.mark.parametrize("name", ["nothing", "20260101-000000-abcdef", "..%2f..", "20260101-000000-abcdef%0a"])
def test_a_job_that_is_not_there_is_a_sentence(client: TestClient, name: str) -> None:
    assert client.get(f"/jobs/{name}").status_code in (404, 405)
    assert client.post(f"/jobs/{name}/remove").status_code in (404, 405)


def test_too_much_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    with desk_at(tmp_path / "data", serve_work.quickly, SMALL) as desk:
        client = client_of(desk)
        job, content = new(client), recording(300)
        stated = put(client, job, "large.csv", b"x" * 20_001)
        silent = client.put(f"{job}/files?name=large.csv", content=iter([b"x" * 15_000] * 3))
        for answer in (stated, silent):
            assert answer.status_code == 400
            assert "too large: at most 20 kB" in answer.json()["problem"]
        assert put(client, job, "axis.toml", CARD.encode() + b"#" * 300).status_code == 400
        assert act(client, job, "card", text="x" * 301).status_code == 400
        assert act(client, job, "card", text="x" * 3000).status_code == 400
        assert kept(desk) == []
        for number in range(4):
            assert put(client, job, f"run{number}.csv", content).status_code == 201
        assert "at most 4 recordings" in put(client, job, "run4.csv", content).json()["problem"]
        act(client, job, "drop", file="run3.csv")
        assert "already" in put(client, job, "run1.csv", content).json()["problem"]
        assert put(client, job, "big.csv", b"x" * (50_000 - 3 * len(content) + 1)).status_code == 400


def test_damaged_files_are_each_a_sentence_or_a_picture(client: TestClient, desk: Desk) -> None:
    """Real exports with bytes changed, cut, doubled or from elsewhere; the reader's process survives nearly all."""
    rng = np.random.default_rng(17)
    samples = [one for one in sorted((HERE / "samples").glob("*.*")) if one.suffix not in (".py", ".pyc")]
    job, reader = new(client), set()
    for number in range(DAMAGES):
        source = samples[number % len(samples)]
        name = f"{number}{source.suffix if number % 5 else ('.csv.gz', '.parquet', '.mat', '.toml')[number // 5 % 4]}"
        content = damaged(source.read_bytes(), rng)
        answer = put(client, job, name, gzip.compress(content)[: rng.integers(20, 4000)] if ".gz" in name else content)
        assert answer.status_code in (201, 400), (name, answer.text)
        page = client.get(job)
        assert page.status_code == 200, name
        view = desk.views(state_of(desk, job)).get(name, {"problem": answer.text})
        assert view["problem"] or view["columns"] or view["refused"], name
        assert str(desk.store.home) not in page.text
        reader.add(desk.reader.pid())
        act(client, job, "drop", file=name)
    assert len(reader) <= 1


def test_names_in_files_stay_text(client: TestClient) -> None:
    job, evil = new(client), "<script>alert(1)</script>"
    content = recording().replace(b"t,tau,q", f"t,tau,{evil}".encode())
    put(client, job, "<b>run.csv", content)
    put(client, job, "axis.toml", CARD.replace("azimuth", evil).encode())
    for page in (client.get(job).text, client.get("/").text):
        assert "<script>alert" not in page
        assert "<b>run" not in page
    assert "&lt;script&gt;alert(1)" in client.get(job).text


def test_a_recording_is_shown_with_what_its_columns_serve_as(client: TestClient) -> None:
    job = new(client)
    put(client, job, "scope.csv", (HERE / "samples" / "twincat_scope.csv").read_bytes())
    page = client.get(job).text
    assert "TwinCAT Scope" in page
    assert re.search(r"<b>TorqueCmd</b> torque", page)
    assert re.search(r"<b>ActPos</b> position", page)
    assert page.count("<polyline") == 3


def test_what_a_file_leaves_open_is_asked_and_the_example_can_be_taken(client: TestClient, desk: Desk) -> None:
    job = ready(client)
    put(client, job, "odrive.csv", (HERE / "samples" / "odrive.csv").read_bytes())
    assert "One question." in client.get(job).text
    missing = act(client, job, "start")
    assert missing.status_code == 400
    assert "odrive.csv can be read in more than one way" in missing.text
    act(client, job, "accept", file="odrive.csv")
    seen = desk.views(state_of(desk, job))["odrive.csv"]
    assert not seen["undecided"]
    assert state_of(desk, job).upload("odrive.csv").options["columns"]["tau"]


def test_columns_and_units_are_corrected(client: TestClient, desk: Desk) -> None:
    job = new(client)
    put(client, job, "run.csv", recording().replace(b"t,tau,q", b"t,force,enc"))
    form = {"columns.tau": "force", "columns.q": "enc", "units.q": "deg", "units.tau": "mN.m", "role": "heldout"}
    act(client, job, "correct", file="run.csv", **form)
    one = state_of(desk, job).upload("run.csv")
    assert one.role == "heldout"
    assert one.options == {"columns": {"tau": "force", "q": "enc"}, "units": {"q": "deg", "tau": "mN.m"}, "layout": {}}
    (q,) = [c for c in desk.views(state_of(desk, job))["run.csv"]["columns"] if c["serves"] == "position"]
    assert float(q["greatest"]) == pytest.approx(np.deg2rad(0.1), rel=1e-3)
    act(client, job, "correct", file="run.csv", **{"units.q": "furlong"})
    assert "furlong" in desk.views(state_of(desk, job))["run.csv"]["problem"]
    assert client.get(job).status_code == 200


def test_a_card_that_is_wrong_is_kept_with_its_sentence_and_can_be_mended(client: TestClient, desk: Desk) -> None:
    job = new(client)
    put(client, job, "axis.toml", CARD.replace("inertia", "inertai").encode())
    page = client.get(job).text
    assert "inertai is not a key of a card" in page
    assert "inertai = 30.0" in page
    put(client, job, "run.csv", recording().replace(b"t,tau,q", b"t,alpha,beta"))
    assert desk.views(state_of(desk, job))["run.csv"]["refused"]
    act(client, job, "card", text=CARD + '[columns]\ntau = "alpha"\nq = "beta"\n')
    assert not desk.views(state_of(desk, job))["run.csv"]["refused"], "names that a card gives to columns hold"
    assert desk.card_view(state_of(desk, job))["facts"]["machine"] == "azimuth"
    act(client, job, "card", shipped="paper_mount")
    assert desk.card_view(state_of(desk, job))["facts"]["friction"].startswith("lugre")
    assert act(client, job, "card", shipped="../../etc").status_code == 400


def test_a_form_writes_a_card_in_si(client: TestClient, desk: Desk) -> None:
    job = new(client)
    form = {"name": 'Achse "1"', "motion": "rotary", "friction": "static", "inertia": "2,5", "inertia.unit": "kg cm2"}
    form |= {"Fc": "120", "Fc.unit": "mN.m", "Fs": "0.2", "Vs": "3", "Vs.unit": "deg/s", "sigma2": "0.01"}
    assert act(client, job, "write", **form).status_code == 200
    card = parse_card(desk.card_text(state_of(desk, job)), "card.toml")
    assert (card.mount.name, card.mount.inertia) == ('Achse "1"', pytest.approx(2.5e-4))
    assert (card.friction.Fc, card.friction.Fs) == pytest.approx((0.12, 0.2))  # type: ignore[attr-defined]
    assert card.friction.Vs == pytest.approx(np.deg2rad(3))  # type: ignore[attr-defined]
    assert not desk.card_view(state_of(desk, job))["problem"]


@pytest.mark.parametrize(
    ("form", "said"),
    [
        ({}, "Inertia, or moved mass: it is needed, in kg.m2"),
        ({"inertia": "much"}, "Inertia, or moved mass: &#34;much&#34; is no number."),
        ({"inertia": "nan"}, "is no number"),
        ({"inertia": "1", "inertia.unit": "kg"}, "&#34;kg&#34; does not fit; it is in kg.m2"),
        ({"inertia": "1", "inertia.unit": "stone"}, "stone"),
        ({"inertia": "1", "motion": "linear", "inertia.unit": "kg.m2"}, "it is in kg or a unit"),
        ({"inertia": "-1", "Fc": "1"}, "[mount] inertia = -1.0 breaks the rule"),
        ({"inertia": "1"}, "Fc is missing"),
        ({"inertia": "1", "Fc": "1", "Fs": "2"}, "Fs"),
        ({"inertia": "1", "Fc": "1", "motion": "round"}, "motion"),
    ],
)
def test_a_form_that_is_wrong_says_why_and_keeps_what_was_typed(client: TestClient, form: Any, said: str) -> None:
    answer = act(client, new(client), "write", **form)
    assert answer.status_code == 400
    assert said in answer.text
    for value in form.values():
        assert f'"{value}"' in answer.text or value == "round"


def test_the_line_of_a_signal_keeps_its_peaks_and_fits_its_picture() -> None:
    t, values = np.arange(100_000.0), np.zeros(100_000)
    values[54_321] = 7.0
    corners = [tuple(map(float, one.split(","))) for one in line(t, values).split()]
    assert len(corners) <= WIDTH
    assert min(y for _, y in corners) == 0
    assert max(y for _, y in corners) == HEIGHT


def test_what_is_missing_is_said_in_one_sentence_each(client: TestClient) -> None:
    job = new(client)
    answer = act(client, job, "start")
    for text in ("at least one recording to fit", "Give a model card, or let it be estimated"):
        assert text in answer.text
    put(client, job, "empty.csv", b"")
    assert "empty.csv cannot be used as it is read now" in act(client, job, "start").text
    act(client, job, "role", file="empty.csv", role="out")
    assert "empty.csv cannot be used" not in act(client, job, "start").text
    assert act(client, job, "role", file="empty.csv", role="king").status_code == 400
    assert act(client, job, "role", file="gone.csv", role="out").status_code == 400


def day() -> bytes:
    """Recordings below each other, told apart by a column."""
    parts = [recording(seed=run).decode().splitlines()[1:] for run in range(3)]
    return "\n".join(["run,t,tau,q", *(f"{run},{row}" for run, rows in enumerate(parts) for row in rows)]).encode()


def test_each_recording_of_a_file_is_an_entry_that_waits_for_its_use(client: TestClient, desk: Desk) -> None:
    job = new(client)
    assert put(client, job, "day.csv", day()).status_code == 201
    uploads = state_of(desk, job).uploads
    assert [one.name for one in uploads] == [f"day.csv:run={run}" for run in range(3)]
    assert {one.role for one in uploads} == {"out"}
    assert sum(one.size for one in uploads) <= len(day()) + len(uploads)
    page = client.get(job).text
    assert "day.csv:run=2" in page
    assert "Choose at least one recording to fit." in page
    # What is corrected in one holds for the file, its use for itself.
    act(client, job, "correct", file="day.csv:run=1", role="train", **{"units.q": "deg"})
    uploads, views = state_of(desk, job).uploads, desk.views(state_of(desk, job)).values()
    assert [one.role for one in uploads] == ["out", "train", "out"]
    assert [one.options["units"] for one in uploads] == [{"q": "deg"}] * 3
    assert [(view["problem"], view["columns"][1]["unit"]) for view in views] == [("", "rad")] * 3
    # The file goes with the last of them.
    path = desk.store.recording(state_of(desk, job), "day.csv")
    assert "There is a recording day.csv already" in put(client, job, "day.csv", day()).json()["problem"]
    for run in range(3):
        assert path.exists()
        act(client, job, "drop", file=f"day.csv:run={run}")
    assert not path.exists()
    assert state_of(desk, job).uploads == ()


def test_they_are_diagnosed_and_the_command_line_takes_the_same(client: TestClient, desk: Desk) -> None:
    job = new(client)
    put(client, job, "a day.csv", day())
    put(client, job, "axis.toml", CARD.encode())
    act(client, job, "correct", file="a day.csv:run=0", role="train", **{"columns.tau": "tau", "units.tau": "mN.m"})
    act(client, job, "role", file="a day.csv:run=2", role="heldout")
    there = state_of(desk, job)
    assert desk.lacking(there) == []
    order = job_order(there, desk.store.recording(there, ""), desk.store.card(there), desk.store.result(there.id))
    assert command(order) == (
        "cosim diagnose 'a day.csv:run=0' --heldout 'a day.csv:run=2' --card axis.toml "
        "--columns 'a day.csv:tau=tau' --units 'a day.csv:tau=mN.m' --out result"
    )


def test_more_than_there_is_room_for_is_a_sentence(tmp_path: Path) -> None:
    with desk_at(tmp_path / "data", serve_work.quickly, Limits(files=2)) as small:
        client = client_of(small)
        job = new(client)
        assert put(client, job, "day.csv", day()).status_code == 201
        assert [one.name for one in state_of(small, job).uploads] == ["day.csv"]
        said = "day.csv holds 3 recordings; here is room for 2. cosim diagnose takes any of them."
        assert said in client.get(job).text
