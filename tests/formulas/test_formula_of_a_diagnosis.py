"""The formula that a diagnosis tells beside its table; without the package that searches it tells all else."""

from pathlib import Path

import pytest
from commands import call
from learned_cases import droop, learned, parts, swerve, teeth, warm_place

from cosim.delivery.proposal import Proposal
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.terms.learn import learn
from cosim.support import plugins
from cosim.support.errors import PlugInError
from cosim_formulas.find import find
from pyfmi_models.card import read_card


class Point:
    """An entry point whose package is broken."""

    name, value, dist = "mine", "my_search:find", None

    def load(self) -> None:
        raise ImportError("no module named my_search")


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch):
    """Say which entry points there are, by name."""

    def say(points: dict[str, object]) -> None:
        monkeypatch.setattr(plugins, "_points", lambda group: points if group == "cosim.formulas" else {})
        plugins.names.cache_clear()
        plugins.loaded.cache_clear()

    yield say
    monkeypatch.undo()
    plugins.names.cache_clear()
    plugins.loaded.cache_clear()


def test_the_formula_of_what_was_missing_is_proposed_in_the_place_of_its_table() -> None:
    """0.15 (T - 20) exp(-(q / 0.15)^2) N m beside 2 N m of friction."""
    found = learned(warm_place)
    assert found is not None
    (said,) = found.as_json()["formula"]
    numbers = {name: one["value"] for name, one in said["parameters"].items()}
    assert said["over"] == ["position", "temperature"]
    assert "exp(−((q − centre)/width)²)" in said["equation"]
    assert numbers["width"] == pytest.approx(0.15, rel=0.1)
    assert -numbers["k1"] / numbers["k2"] == pytest.approx(20.0, abs=0.5)
    assert numbers["k2"] == pytest.approx(0.075, rel=0.08)


def test_what_a_drive_holds_back_is_told_over_the_command_that_the_model_needs() -> None:
    """Over the recorded command a line would say all: it holds what is left, and a line is a scale of the base."""
    found = learned(droop)
    assert found is not None
    assert all(one["equation"] != "not given = k1 u" for one in found.as_json()["formula"])


def test_the_formula_of_a_drag_or_a_gain_is_told_in_its_own_words() -> None:
    for extra, text in ((swerve, "added drag = v f, f = k1 |a|"), (teeth, "command × (1 + f), f = k1 sin(2π(q")):
        found = learned(extra)
        assert found is not None
        (said,) = found.as_json()["formula"]
        assert said["equation"].startswith(text)
    assert learned(swerve).as_json()["formula"][0]["parameters"]["k1"]["value"] == pytest.approx(6.0, rel=0.05)


def test_it_is_proposed_under_the_names_of_its_quantities() -> None:
    found = learned(warm_place)
    assert found is not None
    ((form, statement),) = found.stated()
    proposal = Proposal(form, statement)
    assert proposal.id == "proposed_friction_over_position_and_temperature"
    assert form.as_json()["equation"] in proposal.text()
    assert statement in proposal.text()


def test_the_search_is_found_by_its_entry_point() -> None:
    assert [plugins.loaded("cosim.formulas", name) for name in plugins.names("cosim.formulas")] == [find]


def test_without_a_search_all_is_said_but_the_formula(installed) -> None:
    whole = learned(warm_place)
    assert whole is not None
    installed({})
    found = learn(*parts(warm_place))
    assert found is not None
    assert found.as_json() == {**whole.as_json(), "formula": []}
    assert found.stated() == ()


def test_to_propose_without_a_search_is_refused_at_once(installed, tmp_path: Path, capsys) -> None:
    installed({})
    run = tmp_path / "run.csv"
    run.write_text("t,q,tau\n0,0,0\n", "utf-8")
    assert call("diagnose", run, run, "--propose", tmp_path / "drafts") == 2
    assert "--propose: no installed package searches for formulas" in capsys.readouterr().err
    assert not (tmp_path / "drafts").exists()


def test_a_search_that_cannot_be_loaded_is_told_before_anything_is_fitted(installed) -> None:
    installed({"mine": Point()})
    with pytest.raises(PlugInError, match='"mine" of my_search:find cannot be loaded: ImportError'):
        diagnose([], [], read_card("paper_mount"))
