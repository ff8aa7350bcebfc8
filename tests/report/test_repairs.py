"""Every effect that a diagnosis looks for has three checks with their results, and a repair by kind of machine."""

import tomllib
from dataclasses import replace
from importlib.resources import files
from typing import get_args

import pytest
from effect_examples import EXAMPLES
from plain_words import unplain
from report_example import FOUND, REST, diagnosis, report_of

from cosim.api.show import show
from cosim.delivery.deliver import as_json
from cosim.diagnosis.effects import TRIED
from cosim.report import render
from cosim.report.repairs import MACHINES, MOTIONS, for_machine, machines_of, repairs_of
from cosim.report.terminal import summary
from cosim.support.errors import InputError
from cosim_serve.work import in_words
from pyfmi_models.card import MachineKind

ASYMMETRY = FOUND[1]


@pytest.mark.parametrize("effect", sorted(TRIED))
def test_an_effect_has_three_checks_with_two_results_and_a_repair_by_machine(effect: str) -> None:
    known = repairs_of(effect)
    assert known is not None
    assert len(known.checks) == 3
    for check in known.checks:
        assert check.do.endswith(".")
        assert len({seen for seen, _ in check.results}) == len(check.results) >= 2
        assert len({means for _, means in check.results}) == len(check.results)
    motions = ("linear",) if effect == "constant_force" else ("rotary", "linear")
    assert {kind for motion in motions for kind in machines_of(motion)} == set(known.by_machine)
    assert all(text.endswith(".") for text in known.by_machine.values())
    text = " ".join([*(f"{c.do} {c.results}" for c in known.checks), *known.by_machine.values()])
    assert not unplain(text)
    assert "improved model" not in text  # it may not hold the effect


def test_no_file_is_of_an_effect_that_there_is_not_and_none_holds_another_key() -> None:
    there = [one for one in files("cosim.report.repairs").iterdir() if one.name.endswith(".toml")]
    assert {one.name.removesuffix(".toml") for one in there} == set(TRIED)
    assert all(set(tomllib.loads(one.read_text("utf-8"))) == {"checks", "repair"} for one in there)


def test_kinds_of_machines_are_those_of_a_card() -> None:
    assert set(get_args(MachineKind)) == set(MACHINES) == {kind for kinds in MOTIONS.values() for kind in kinds}


def test_the_report_has_checks_and_the_repairs_that_fit_the_motion() -> None:
    html = report_of("two")
    known = repairs_of("friction_asymmetry")
    assert known
    assert all(check.do.split(",")[0] in html for check in known.checks)
    for kind, text in known.by_machine.items():
        assert (text.split(",")[0].replace("'", "&#39;") in html) == (kind in MOTIONS["rotary"]), kind
    unsure = replace(ASYMMETRY, answer="not_proven")
    assert "Three checks" not in render(replace(diagnosis("two"), findings=(unsure, *REST), verdict=()))


def test_a_card_that_names_the_machine_has_its_repair_on_first_screen_terminal_and_page_and_in_json() -> None:
    made = diagnosis("two").provenance
    whole = replace(diagnosis("two"), provenance=made | {"card": made["card"] | {"machine": "harmonic_drive"}})  # type: ignore[typeddict-item]
    whole = for_machine(whole, "harmonic_drive")
    repair = whole.findings[1].action
    assert repair.startswith("Check the brake's air gap")
    assert repair in [row["action"] for row in in_words(whole)["findings"]]
    assert repair in [one["action"] for one in as_json(whole)["effects"]]  # type: ignore[call-overload,index,union-attr]
    assert [one.action for one in for_machine(whole, "").findings] == [one.action for one in whole.findings]
    assert "Check the brake&#39;s air gap and the output seal" in render(whole).split("<h2>Findings")[0]
    assert "Friction asymmetry: check the brake's air gap" in summary(whole)
    assert "Check clamp brake and lip seal" in report_of("two")


def test_show_tells_an_effect_and_of_a_slip_the_one_that_was_meant() -> None:
    shown = show("cogging")
    assert [len(shown.tables[name]) for name in ("checks", "repair")] == [6, 6]
    assert shown.tables["checks"][0]["check"].startswith("1. ")  # type: ignore[union-attr]
    with pytest.raises(InputError, match='Did you mean "cogging"'):
        show("cocking")
    for form in EXAMPLES:
        assert show(form.id).facts["effect"] == form.id


def test_an_effect_of_your_own_has_none_and_no_path_is_one() -> None:
    assert repairs_of("my_own") is None
    assert repairs_of("../cogging") is None
