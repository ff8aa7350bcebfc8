"""Found means more likely than not: heading, lead and terminal agree with the data, and say what has no name."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from learned_told import TOLD
from report_example import FOUND, KINDS, REST, RIVALS, diagnosis, report_of, text_of

from cosim.delivery.deliver import chosen_of_sets
from cosim.diagnosis.answer.result import Diagnosis, Finding, Sanity, Where
from cosim.report import lead, render, words
from cosim.report.findings import block
from cosim.report.page import unexplained
from cosim.report.quantities import Scales
from cosim.report.terminal import summary
from cosim_serve.work import in_words

TWO, SCALES = diagnosis("two"), Scales.of(diagnosis("two"))

MAYBE = replace(FOUND[1], effect="cable_wrap", title="Cable wrap", answer="ambiguous", probability=0.49)


def of(*findings: Finding, unknown: bool = False) -> Diagnosis:
    named = tuple(finding.effect for finding in findings if finding.answer in ("found", "ambiguous"))
    verdict = (*named, "unknown") if unknown else named
    held = tuple(finding.effect for finding in findings if finding.where)
    return replace(diagnosis("two"), findings=(*findings, *REST), verdict=verdict, delivered=held)


def said(whole: Diagnosis) -> str:
    return " ".join(lead.lead(whole, Scales.of(whole)))


CAUSES, REST_UNKNOWN = "gravity unbalance or encoder eccentricity", "part of the error fits no known effect"
THIRD = replace(RIVALS[1], effect="cogging", title="Cogging")
TOGETHER = {p: tuple(replace(one, probability=p) for one in RIVALS) for p in (0.1, 0.3)}


@pytest.mark.parametrize(
    ("whole", "heading"),
    [
        (of(*FOUND, MAYBE), "Two effects are missing from the model, perhaps one more"),
        (of(*FOUND, *RIVALS), "Two effects are missing from the model"),
        (of(*FOUND, MAYBE, unknown=True), f"Two effects are missing from the model, perhaps one more; {REST_UNKNOWN}"),
        (of(MAYBE), "One effect may be missing from the model"),
        (of(MAYBE, unknown=True), f"One effect may be missing from the model; {REST_UNKNOWN}"),
        (
            replace(of(MAYBE, unknown=True), verdict=("unknown", MAYBE.effect)),
            f"P{REST_UNKNOWN[1:]}; one effect may be missing from the model",
        ),
        (of(MAYBE, *RIVALS), "Two effects may be missing from the model, with more than one possible cause"),
        (of(*RIVALS), f"One effect is missing from the model: {CAUSES}"),
        (of(*TOGETHER[0.1], unknown=True), f"One effect may be missing from the model: {CAUSES}; {REST_UNKNOWN}"),
        (of(*TOGETHER[0.3]), f"One effect is likely missing from the model: {CAUSES}"),
        (
            replace(of(*RIVALS, THIRD), ambiguous_with=(tuple(one.effect for one in (*RIVALS, THIRD)),)),
            "One effect is missing from the model, with three possible causes",
        ),
    ],
    ids=lambda one: one if isinstance(one, str) else "",
)
def test_the_heading_counts_what_was_found_and_what_may_be(whole: Diagnosis, heading: str) -> None:
    """It is as sure as rivals are together."""
    assert lead.heading(whole) == heading


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


def test_what_has_no_name_stands_beside_what_is_named_and_every_open_question_is_named() -> None:
    pair = tuple(replace(one, effect=f"other_{one.effect}", title=f"Other {one.title.lower()}") for one in RIVALS)
    sets = tuple(tuple(one.effect for one in rivals) for rivals in (RIVALS, pair))
    told = said(replace(of(*FOUND, *RIVALS, *pair), ambiguous_with=sets))
    assert "two possible causes: gravity unbalance or encoder eccentricity" in told
    assert "two possible causes: other gravity unbalance or other encoder eccentricity" in told
    held = replace(of(*RIVALS, unknown=True), delivered=(RIVALS[0].effect,))
    assert said(held).startswith("With gravity unbalance or encoder eccentricity")
    assert "an error remains that none of the" in said(held)
    assert said(replace(held, delivered=())).startswith("The error is one that none of the")
    both = replace(TWO, verdict=("cogging", "friction_asymmetry", "unknown"), depends_on=("time",))
    assert "cogging (0.42 N·m)" in said(both)
    assert "other known effects" in said(both)
    assert len(lead.lead(both, SCALES)) == 2
    assert "The remaining error correlates with: time" in summary(both)


def test_what_rests_hide_is_said_of_clear_motion_on_page_and_terminal_and_never_called_clear() -> None:
    assert lead.improvement(TWO, SCALES).startswith("The validation error falls from ")
    hidden = replace(TWO, heldout=replace(TWO.heldout, confidence_interval=(-0.02, 0.3)))
    said = lead.improvement(hidden, SCALES)
    assert said.startswith("In clear motion the validation error falls from 0.35 to 0.17")
    assert "over all samples, rests included, it does not clearly fall: from" in said
    worse = replace(hidden, heldout=replace(hidden.heldout, sliding={"before_rms": 0.17, "after_rms": 0.35}))
    assert lead.improvement(worse, SCALES).startswith("The validation error does not clearly fall: from")
    """A law without memory says nothing about rest: an error of its own level there is no fault of the model."""
    told = {"before_rms": 0.05, "after_rms": 0.05}
    whole = diagnosis("none")
    held = replace(whole.heldout, before_rms=0.46, after_rms=0.46, sliding=told)
    resting = replace(whole, heldout=held)
    assert "0.050 in clear motion" in " ".join(summary(resting).split())
    near = replace(whole, heldout=replace(held, sliding={"before_rms": 0.4, "after_rms": 0.4}))
    assert "in clear motion" not in " ".join(summary(near).split())


def held(first: Finding, *others: Finding) -> Diagnosis:
    """Two possible causes, the first of which was asked for in the delivered model."""
    first = replace(first, where=Where(axis="position", description="everywhere"))
    improved = {"card": "card.toml", "fmu": "axis_improved.fmu"}
    told = {"verdict": (first.effect,), "delivered": (first.effect,), "improved": improved}
    return replace(diagnosis("two"), findings=(first, *others, *REST), **told)


def test_the_first_of_several_possible_causes_is_said_to_be_in_the_model() -> None:
    whole = held(*RIVALS)
    html = " ".join(render(whole).split())
    assert "The improved model holds the likelier, gravity unbalance." in html
    assert "gravity unbalance or encoder eccentricity, of which the first is in the improved model" in html
    assert "No improved model was written" not in html
    assert "Neither" not in html
    assert "with the likeliest cause" in html
    assert "axis_improved.fmu" in summary(whole)
    said = "These recordings cannot tell gravity unbalance from encoder eccentricity; the likelier is in the model."
    assert list(chosen_of_sets(whole)) == [said]
    special = replace(RIVALS[0], effect="torque_offset", title="Torque offset")
    other = replace(RIVALS[1], effect="cable_wrap", title="Cable wrap")
    pair = replace(held(special, other), ambiguous_with=(("torque_offset", "cable_wrap"),))
    scales = Scales.of(pair)
    shown = block(words.blocks(pair)[0], pair, scales, None)
    assert "The improved model holds torque offset: it is a special case of the other." in shown.sentences


@pytest.mark.parametrize(("kind", "motion"), KINDS)
def test_a_heading_has_one_sentence_a_lead_two_and_the_terminal_80_columns(kind: str, motion: str) -> None:
    whole = diagnosis(kind, motion)
    assert len(re.findall(r"[.!?](?= [A-Z]|$)", said(whole))) <= 2
    assert len(re.findall(r"[.!?](?= [A-Z])", lead.heading(whole))) == 0
    text = summary(whole)
    assert max(map(len, text.splitlines())) <= 80
    assert "not detected" in text
    assert "\033" not in summary(diagnosis(mount="\033[31mred"))
    assert ("either    gravity unbalance" in text) == (kind == "two")


def test_the_terminal_begins_with_the_verdict_what_to_do_and_the_file_to_open_and_folds_remarks(tmp_path: Path) -> None:
    lines = summary(diagnosis("two"), out=Path("result")).splitlines()
    assert lines[0] == "Two effects are missing from mount.toml"
    assert lines[1].startswith("Do        Cogging: use the improved FMU")
    assert [line for line in lines if line.startswith("Open")] == [f"Open      {Path('result') / 'report.html'}"]
    last_order = next(row for row, line in enumerate(lines) if line.startswith("Use"))
    assert last_order < next(row for row, line in enumerate(lines) if line.startswith("  detected"))
    remarks = tuple(Sanity(finding="encoder_step", statement=f"Remark {k}.") for k in range(7))
    whole = replace(diagnosis("two"), sanity=remarks)
    assert summary(whole).count("Remark") == 7  # without a folder there is no report to read
    told = summary(whole, out=tmp_path)
    assert told.count("Remark") == 3
    assert "4 more remarks in report.html" in told


def test_a_probability_stands_beside_what_was_found_and_what_did_not_prove_itself_has_no_size() -> None:
    unsure = replace(FOUND[0], probability=0.53)
    whole = replace(diagnosis("two"), findings=(unsure, *FOUND[1:], *RIVALS, *REST))
    first = text_of(render(whole)).split("Findings")[0]
    assert "probability 0.53" in first
    assert "probability 0.93" in first
    assert "one more is likely (probability 0.53)" in first
    assert "Friction asymmetry is likely, not certain" not in first
    assert "probability 0.53" in " ".join(summary(whole).split())
    weak = replace(FOUND[0], answer="not_proven", size="663 N·m", size_range="1 to 1,325", action="Check the bearing.")
    whole = replace(diagnosis("two"), findings=(weak, *FOUND[1:], *REST), verdict=("friction_asymmetry",))
    assert "663" not in summary(whole)
    assert "not confirmed" in summary(whole)
    assert "Nothing yet: not confirmed. “cosim why” names the rule." in render(whole)
    assert "Check the bearing" not in render(whole) + summary(whole)


# What has no name: learned as a table, or tried and left out; where it lies.


def learned() -> Diagnosis:
    improved: Any = {"card": "card.toml", "fmu": "m_improved.fmu", "speed": [0.3, 1.5], "position": [-1.0, 1.0]}
    return replace(diagnosis("unknown"), learned=TOLD, improved=improved)


def section(html: str) -> str:
    found = re.search(r'<section class="nameless".*?</section>', html, re.DOTALL)
    return found[0]


def test_what_was_learned_is_said_with_size_error_range_and_band_and_the_model_is_not_called_unchanged() -> None:
    html, text = render(learned()), " ".join(summary(learned()).split())
    told = re.sub(r"<[^>]*>", " ", section(html)).replace("\N{NO-BREAK SPACE}", " ")
    for part in ("position and temperature", "0.31 N·m", "0.42 → 0.15 N·m", "0.21 to 0.33 N·m", "below 10 Hz"):
        assert part in told
    assert "temperature 18 to 26 °C" in told
    assert "torque = k1 q³; k1 0.310 N·m/rad³ (0.290 to 0.330)" in told
    assert "No improved model was written" not in html
    assert "there is no gain to prove" not in html
    assert "with what was learned" in html
    for part in (TOLD["statement"], "shorter: torque = k1 q³; k1 0.31 N.m/rad3", "→ 0.39 (with what was learned)"):
        assert part in text


def test_a_table_that_does_not_help_is_said_to_be_left_out() -> None:
    assert 'class="nameless"' not in report_of("unknown")
    said = "A table over position was tried for what has no name and is not in the model."
    told = replace(diagnosis("unknown"), not_learned={"quantities": ["position"], "statement": said})
    assert said in section(render(told))
    assert said in " ".join(summary(told).split())


def limited(limit: float, trained: float) -> Diagnosis:
    """Something unknown that acts on the held-out run alone, where its torque passes a limit."""
    whole = diagnosis("none")
    *fitted, held = whole.traces
    large = held.tau > limit
    held = replace(held, after=held.after - 3.0 * large)
    fitted = [replace(one, tau=np.minimum(one.tau, trained)) for one in fitted]
    after = float(np.sqrt(np.mean((held.tau - held.after) ** 2)))
    return replace(whole, verdict=("unknown",), traces=(*fitted, held), heldout=replace(whole.heldout, after_rms=after))


def test_a_rest_is_said_to_lie_where_training_never_was_and_nowhere_if_it_was_there_too_or_was_not_asked() -> None:
    top = float(np.quantile(diagnosis("none").traces[-1].tau, 0.97))
    beyond = limited(top, top)
    page, terminal = " ".join(unexplained(beyond, Scales.of(beyond))), " ".join(summary(beyond).split())
    where = r"9\d % of the error energy on validation runs lies at torques outside .* \(3 % of the time\)"
    assert re.search(where, page)
    assert "which the fit never had (3 % of the time): what acts there" in terminal
    for known in (limited(top, np.inf), limited(-np.inf, top)):
        assert "the fit never had" not in " ".join(unexplained(known, Scales.of(known))) + summary(known)
    none = diagnosis("none")
    loud = replace(none, heldout=replace(none.heldout, after_rms=2 * none.heldout.floor_rms))
    said = " ".join(unexplained(loud, Scales.of(loud)))
    assert "stays unexplained, beyond the noise. Friction-model error alone could explain this." in said
    assert "correlates with" not in said
