"""Found means more likely than not: word, count and probability agree on page, terminal and in the data."""

from dataclasses import replace

import pytest
from report_example import FOUND, REST, RIVALS, diagnosis

from cosim.diagnosis.answer.result import Diagnosis, Finding
from cosim.report import lead, words
from cosim.report.quantities import Scales
from cosim.report.terminal import summary
from cosim_serve.work import in_words
from pyfmi_models.effects import Cogging

MAYBE = replace(FOUND[1], effect="cable_wrap", title="Cable wrap", answer="ambiguous", probability=0.49)


def of(*findings: Finding, unknown: bool = False) -> Diagnosis:
    named = tuple(finding.effect for finding in findings if finding.answer in ("found", "ambiguous"))
    verdict = (*named, "unknown") if unknown else named
    held = tuple(finding.effect for finding in findings if finding.where)
    return replace(diagnosis("two"), findings=(*findings, *REST), verdict=verdict, delivered=held)


def said(whole: Diagnosis) -> str:
    return " ".join(lead.lead(whole, Scales.of(whole)))


@pytest.mark.parametrize(
    ("findings", "unknown", "heading"),
    [
        ((*FOUND, MAYBE), False, "Two effects are missing from the model, perhaps one more"),
        ((*FOUND, *RIVALS), False, "Two effects are missing from the model"),
        (
            (*FOUND, MAYBE),
            True,
            "Two effects are missing from the model, perhaps one more; part of the error fits no known effect",
        ),
        ((MAYBE,), False, "One effect may be missing from the model"),
        ((MAYBE,), True, "One effect may be missing from the model; part of the error fits no known effect"),
        ((MAYBE, *RIVALS), False, "Two effects may be missing from the model, with more than one possible cause"),
        (RIVALS, False, "One effect is missing from the model: gravity unbalance or encoder eccentricity"),
    ],
)
def test_the_heading_counts_what_was_found_and_what_may_be_apart(
    findings: tuple[Finding, ...], unknown: bool, heading: str
) -> None:
    assert lead.heading(of(*findings, unknown=unknown)) == heading


def test_a_heading_of_rivals_is_as_sure_as_they_are_together() -> None:
    doubtful, likely = (tuple(replace(one, probability=p) for one in RIVALS) for p in (0.1, 0.3))
    causes = "gravity unbalance or encoder eccentricity"
    rest = "part of the error fits no known effect"
    assert lead.heading(of(*doubtful, unknown=True)) == f"One effect may be missing from the model: {causes}; {rest}"
    assert lead.heading(of(*likely)) == f"One effect is likely missing from the model: {causes}"
    third = replace(RIVALS[1], effect="cogging", title="Cogging")
    three = replace(of(*RIVALS, third), ambiguous_with=(tuple(one.effect for one in (*RIVALS, third)),))
    assert lead.heading(three) == "One effect is missing from the model, with three possible causes"


def test_page_and_terminal_use_one_word_for_what_may_be() -> None:
    whole = of(*FOUND, MAYBE)
    (block,) = (one for one in words.blocks(whole) if one.first is MAYBE)
    (row,) = (row for row in in_words(whole)["findings"] if row["what"] == "Cable wrap")
    assert block.word == row["answer"] == "Possible"
    lines = summary(whole).splitlines()
    assert lines[0] == "Two effects are missing from mount.toml, perhaps one more"
    assert [line.split()[0] for line in lines if "cable wrap  " in line] == ["possible"]
    assert "; a further error may come from cable wrap (its probability is 0.49)." in said(whole)


def test_what_has_no_name_is_told_as_what_stays_beside_the_rivals_that_the_model_holds() -> None:
    held = replace(of(*RIVALS, unknown=True), delivered=(RIVALS[0].effect,))
    assert said(held).startswith("With gravity unbalance or encoder eccentricity")
    assert "an error remains that none of the" in said(held)
    assert said(replace(held, delivered=())).startswith("The error is one that none of the")


def test_the_lead_names_every_open_question() -> None:
    pair = tuple(replace(one, effect=f"other_{one.effect}", title=f"Other {one.title.lower()}") for one in RIVALS)
    sets = tuple(tuple(one.effect for one in rivals) for rivals in (RIVALS, pair))
    told = said(replace(of(*FOUND, *RIVALS, *pair), ambiguous_with=sets))
    assert "two possible causes: gravity unbalance or encoder eccentricity" in told
    assert "two possible causes: other gravity unbalance or other encoder eccentricity" in told


def test_a_ripple_is_told_with_the_digits_that_a_mechanic_reads() -> None:
    assert "399.8 times per metre" in Cogging(cycles_per_rev=399.8213, amplitude=2.0).statement("N")
    assert "24 times per turn" in Cogging(cycles_per_rev=24.0, amplitude=2.0).statement()
