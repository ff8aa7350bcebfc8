"""Found means more likely than not: word, count and probability agree on page, terminal and in the data."""

import re
from dataclasses import replace
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from learned_told import TOLD
from report_example import FOUND, REST, RIVALS, diagnosis, report_of
from report_text import text_of

from cosim.diagnosis.answer.result import Diagnosis, Finding
from cosim.diagnosis.measure.breakdown import samples
from cosim.plots.style import STYLE
from cosim.report import lead, render, words
from cosim.report.figures_own import own, own_torque
from cosim.report.learned import nameless
from cosim.report.page import payload
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture
from cosim.report.terminal import summary
from cosim_serve.work import in_words

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


def test_what_has_no_name_is_said_first_where_the_names_may_only_imitate_it() -> None:
    several = of(MAYBE, unknown=True)
    first = replace(several, verdict=("unknown", MAYBE.effect))
    rest, said = "art of the error fits no known effect", "ne effect may be missing from the model"
    assert (lead.heading(several), lead.heading(first)) == (f"O{said}; p{rest}", f"P{rest}; o{said}")


def test_of_several_causes_the_likeliest_is_read_first_unless_one_is_in_the_model() -> None:
    weak, strong = (replace(one, probability=p) for one, p in zip(RIVALS, (0.01, 0.12), strict=True))
    whole = replace(of(weak, strong), delivered=())
    (block,) = (one for one in words.blocks(whole) if len(one.findings) > 1)
    assert block.first is strong
    lines = summary(whole).splitlines()
    assert any(line.startswith("  possible  encoder eccentricity") for line in lines)
    assert not any(line.startswith("  either") for line in lines), "together they are unlikely"
    (block,) = (one for one in words.blocks(replace(whole, delivered=(weak.effect,))) if len(one.findings) > 1)
    assert block.first is weak


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


# The report and the terminal on what has no name: learned as a table, or tried and left out.


def learned() -> Diagnosis:
    improved: Any = {"card": "card.toml", "fmu": "m_improved.fmu", "speed": [0.3, 1.5], "position": [-1.0, 1.0]}
    return replace(diagnosis("unknown"), learned=TOLD, improved=improved)


def section(html: str) -> str:
    found = re.search(r'<section class="nameless".*?</section>', html, re.DOTALL)
    assert found
    return found[0]


def test_what_was_learned_is_said_with_size_error_range_and_band() -> None:
    said = re.sub(r"<[^>]*>", " ", section(render(learned()))).replace("\N{NO-BREAK SPACE}", " ")
    for part in ("position and temperature", "0.31 N·m", "0.42 → 0.15 N·m", "0.21 to 0.33 N·m", "below 10 Hz"):
        assert part in said
    assert "temperature 18 to 26 °C" in said
    assert "torque = k1 q³; k1 0.310 N·m/rad³ (0.290 to 0.330)" in said


def test_each_table_has_a_figure_with_the_data_beside() -> None:
    found = nameless(learned(), Scales.of(learned()))
    assert found is not None
    assert [one.heading for one in found.pictures] == [
        "Torque over position", "Friction over position and temperature", "Drive over command", "Hysteresis",
    ]  # fmt: skip
    assert all("training recordings" in one.caption for one in found.pictures)


def test_a_model_with_a_table_is_not_called_unchanged() -> None:
    html, text = render(learned()), " ".join(summary(learned()).split())
    assert "No improved model was written" not in html
    assert "there is no gain to prove" not in html
    assert "with what was learned" in html
    assert TOLD["statement"] in text
    assert "As good, and shorter: torque = k1 q³; k1 0.31 N.m/rad3" in text
    assert "→ 0.39 (with what was learned)" in text


@pytest.mark.parametrize("kind", ["two", "none", "unknown"])
def test_where_nothing_was_asked_nothing_is_said(kind: str) -> None:
    assert 'class="nameless"' not in report_of(kind)


def test_a_table_that_does_not_help_is_said_to_be_left_out() -> None:
    said = "A table over position was tried for what has no name and is not in the model."
    told = replace(diagnosis("unknown"), not_learned={"quantities": ["position"], "statement": said})
    assert said in section(render(told))
    assert said in " ".join(summary(told).split())


# The figure of one effect shows that effect: its curve, and what was measured of it with the others taken out.

Q, V = np.linspace(-3.0, 3.0, 200), np.where(np.arange(200) % 2, 0.4, -0.4)
RIPPLE = Finding(
    effect="position_friction", title="Position-dependent friction", answer="found", probability=0.9, gain=0.2,
    parameters={"cycles_per_rev": 2.0, "relative_amplitude": 0.25, "phase": 0.0}, size="25 %",
)  # fmt: skip
LAW = {"friction.Fc": (2.0, 2.0, 2.0), "friction.sigma2": (0.0, 0.0, 0.0)}


def drawn(finding: Finding, of: Diagnosis) -> Picture | None:
    with mpl.rc_context(STYLE):
        return own(finding, of, samples(of.traces), Scales.of(of))


def with_law(finding: Finding) -> Diagnosis:
    whole = diagnosis("two")
    return replace(
        whole, findings=(finding,), delivered=(finding.effect,), friction_law={"base": "coulomb"}, base_parameters=LAW
    )


def test_the_torque_of_a_ripple_is_its_wave_with_the_harmonics() -> None:
    torque = own_torque(FOUND[0], diagnosis("two"))
    assert torque is not None
    expected = 0.42 * np.cos(24 * Q + 0.4) + 0.125 * np.cos(48 * Q - 0.3)
    assert torque(Q, V) == pytest.approx(expected, abs=1e-9)


def test_friction_over_position_resists_by_its_share_of_the_level() -> None:
    torque = own_torque(RIPPLE, with_law(RIPPLE))
    assert torque is not None
    change = torque(Q, V) * np.sign(V)
    assert change.max() == pytest.approx(0.25 * 2.0, rel=0.05)
    assert torque(Q, -V) == pytest.approx(-torque(Q, V))


def test_an_effect_of_the_model_is_drawn_by_itself_and_one_that_is_not_there_is_not() -> None:
    whole = diagnosis("two")
    picture = drawn(FOUND[0], whole)
    assert picture is not None
    assert "other effects taken out" in picture.caption
    assert drawn(FOUND[0], replace(whole, delivered=())) is None
    assert drawn(RIPPLE, with_law(RIPPLE)) is not None


def test_where_nothing_was_added_one_model_is_drawn_and_named_once() -> None:
    whole = diagnosis("none")
    lines = [line[0] for sheet in payload(whole, Scales.of(whole))["sheets"] for line in sheet["lines"]]  # type: ignore[index,union-attr,call-overload]
    assert lines == ["tau", "before", "lost", "q"]
    text = text_of(report_of("none"))
    assert "Worst seconds" in text
    assert "Worst before" not in text
