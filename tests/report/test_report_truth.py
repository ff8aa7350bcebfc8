"""What the report says is what the diagnosis holds: limits, probabilities, units, and which effect the model has."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
from report_example import FOUND, REST, RIVALS, diagnosis, report_of
from report_text import text_of

from cosim.delivery.deliver import as_json, chosen_of_sets
from cosim.diagnosis.answer.result import Diagnosis, Finding, Where
from cosim.diagnosis.measure.breakdown import samples
from cosim.diagnosis.measure.findings import advice, visible_from
from cosim.diagnosis.search.sizes import Numbers
from cosim.plots.style import STYLE
from cosim.report import render, words
from cosim.report.figures_dynamic import effect as draw
from cosim.report.findings import block, do, where
from cosim.report.page import identity, unexplained
from cosim.report.quantities import Scales
from cosim.report.sheet import Picture
from cosim.report.tables import looked, proof
from cosim.report.terminal import summary
from pyfmi_models.effects import CATALOGUE
from pyfmi_models.effects.friction_asymmetry import FrictionAsymmetry


def drawn(finding: Finding, of: Diagnosis) -> Picture:
    with mpl.rc_context(STYLE):
        picture = draw(finding, samples(of.traces), Scales.of(of))
    assert picture is not None
    return picture


@pytest.mark.parametrize(("motion", "pitch"), [("rotary", "15.0°"), ("linear", "41.7\N{NO-BREAK SPACE}mm")])
def test_a_ripple_is_folded_over_a_part_of_a_turn_or_of_a_metre(motion: str, pitch: str) -> None:
    assert f"onto one pitch of {pitch}" in drawn(FOUND[0], diagnosis("two", motion)).caption


def test_no_effect_that_the_model_lacks_is_sent_to_it() -> None:
    kinds = {form for forms in CATALOGUE.values() for form in forms if form.action}
    both = [(kind, motion) for kind in kinds for motion in ("rotary", "linear")]
    for kind, motion in both:
        given = kind.action_linear if motion == "linear" and kind.action_linear else kind.action
        without = advice(kind, False, motion)  # type: ignore[arg-type]
        assert "improved model" not in without
        assert without.endswith(".")
        assert given.startswith(without.removesuffix("."))
        assert advice(kind, True, motion) == given  # type: ignore[arg-type]


def test_a_rival_that_fits_as_well_is_less_likely_and_not_ruled_out() -> None:
    close = replace(
        FOUND[0], ruled_out=(), less_likely=("Torque offset: removes 90.3% of the error energy, this 90.9%",)
    )
    whole = diagnosis("two")
    html = render(replace(whole, findings=(close, *FOUND[1:], *RIVALS, *REST)))
    assert "<dt>Less likely</dt><dd>Torque offset: removes 90.3%" in html
    assert as_json(replace(whole, findings=(close,)))["effects"][0]["less_likely"] == list(close.less_likely)


def test_a_direction_has_no_numbers() -> None:
    sides = Where(axis="direction", description="both directions, differently", regions=((-1, -1), (1, 1)))
    whole = diagnosis("two")
    assert where(replace(FOUND[1], where=sides), Scales.of(whole)) == "both directions, differently"
    edge = Where(axis="speed", description="slower than 0.35", regions=((-0.35, 0.35),))
    assert where(replace(FOUND[1], where=edge), Scales.of(whole)) == "slower than 20°/s"
    beyond = Where(axis="speed", description="faster than 0.35", regions=((-1.57, -0.35), (0.35, 1.57)))
    assert where(replace(FOUND[1], where=beyond), Scales.of(whole)) == "faster than 20°/s"


def test_a_probability_stands_beside_what_was_found_and_a_small_one_is_said() -> None:
    unsure = replace(FOUND[0], probability=0.53)
    whole = replace(diagnosis("two"), findings=(unsure, *FOUND[1:], *RIVALS, *REST))
    first = text_of(render(whole)).split("Findings")[0]
    assert "probability 0.53" in first
    assert "probability 0.93" in first
    assert "one more is likely (probability 0.53)" in first
    assert "Friction asymmetry is likely, not certain" not in first
    assert "probability 0.53" in " ".join(summary(whole).split())


def test_what_was_not_seen_has_a_limit_even_where_its_number_is_no_size() -> None:
    whole, joint = diagnosis("two"), Finding
    spring = joint(effect="compliance", title="Compliance", answer="not_seen", probability=0, gain=0)
    whole = replace(whole, findings=(*FOUND, spring))
    limit = words.unseen_torque(whole, Scales.of(whole))
    assert re.fullmatch(r"0\.0\d+\N{NO-BREAK SPACE}N·m RMS", limit)
    assert looked(whole, Scales.of(whole)).rows[-1][-1] == f"a torque of {limit}"


def test_a_limit_that_is_known_is_on_the_page_and_counted_on_the_terminal() -> None:
    absent: Any = {"answer": "not_seen", "probability": 0, "gain": 0}
    skew = Finding(effect="clock_skew", title="Clock skew", evidence="from 18 ms", **absent)
    play = Finding(effect="backlash", title="Backlash", evidence="wider than 0.001 rad", **absent)
    whole = replace(diagnosis("two"), findings=(*FOUND, skew, play))
    assert [row[-1] for row in looked(whole, Scales.of(whole)).rows[-2:]] == ["18 ms", "wider than 3.4′"]
    assert "2 other effects: not detected, limits in the report" in " ".join(summary(whole).split())


def test_an_experiment_is_ordered_for_the_causes_that_it_separates_and_no_others() -> None:
    warm = replace(RIVALS[0], effect="thermal_viscosity", title="Thermal friction", action="Let it warm up.")
    whole = replace(diagnosis("two"), findings=(*FOUND, *RIVALS, warm))
    orders = {one.first.effect: do(one, whole) for one in words.blocks(whole) if one.answer == "ambiguous"}
    assert orders["gravity_unbalance"].startswith("Record one turn")
    assert orders["thermal_viscosity"] == "Let it warm up."


def test_of_a_rest_that_was_not_asked_what_it_goes_with_nothing_of_the_kind_is_said() -> None:
    none = diagnosis("none")
    loud = replace(none, heldout=replace(none.heldout, after_rms=2 * none.heldout.floor_rms))
    said = " ".join(unexplained(loud, Scales.of(loud)))
    assert "stays unexplained, beyond the noise. Friction-model error alone could explain this." in said
    assert "correlates with" not in said


def test_angles_and_lengths_are_in_units_that_need_no_zeros() -> None:
    ring = replace(RIVALS[1], size="7e-06 rad", size_range="6e-06 to 8e-06", visible_from=2.4e-6, units={})
    assert words.sized(ring) == ("1.44″", "1.24 to 1.65")
    assert words.shows_from(ring) == "0.50″"
    assert words.stated(replace(ring, statement="The encoder errs by 7e-06 rad either way")).startswith(
        "The encoder errs by 1.4″ either way."
    )
    assert (
        words.in_handy_units("0.42 N·m at 0.05 rad/s and 0.3 m/s") == "0.42 N·m at 2.9°/s and 0.30\N{NO-BREAK SPACE}m/s"
    )
    whole = diagnosis("two")
    held = replace(whole.heldout, position={"before": 4e-6, "after": 2e-6})
    rows = {row[0]: row for row in proof(replace(whole, heldout=held), Scales.of(whole)).rows}
    assert rows["Position, closed loop [″]"][2:4] == ("0.825", "0.413")


def test_the_header_counts_what_was_recorded_and_not_what_was_judged() -> None:
    whole = diagnosis("two")
    cut = tuple(replace(one, **{n: getattr(one, n)[3000:-500] for n in SIGNALS}) for one in whole.traces)
    assert ", 180 s at 1 kHz" in [
        part["rest"].replace("\N{NO-BREAK SPACE}", " ") for part in identity(replace(whole, traces=cut))
    ]


SIGNALS = ("t", "q", "v", "tau", "before", "after", "missing", "band")


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
    assert (
        "possible causes: gravity unbalance or encoder eccentricity, of which the first is in the improved model"
        in html
    )
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


def test_the_terminal_begins_with_the_verdict_what_to_do_and_the_file_to_open() -> None:
    lines = summary(diagnosis("two"), out=Path("result")).splitlines()
    assert lines[0] == "Two effects are missing from mount.toml"
    assert lines[1].startswith("Do        Cogging: use the improved FMU")
    assert [line for line in lines if line.startswith("Open")] == [f"Open      {Path('result') / 'report.html'}"]
    last_order = next(row for row, line in enumerate(lines) if line.startswith("Use"))
    assert last_order < next(row for row, line in enumerate(lines) if line.startswith("  detected"))


@pytest.mark.parametrize("kind", ["two", "none", "unknown"])
def test_at_most_900_words_stand_before_anything_is_unfolded(kind: str) -> None:
    assert len(text_of(report_of(kind)).split()) <= 900


def test_what_the_first_screen_says_is_not_said_again() -> None:
    read = text_of(report_of("two"))
    for said in (
        "Turning forward takes 0.26 N·m more than backward.",
        "Check clamp brake and lip seal",
        "0.21 to 0.31",
    ):
        assert read.count(said) == 1


def test_doubts_about_the_recordings_stand_before_the_answer() -> None:
    from cosim.diagnosis.answer.doubt_entry import Sanity

    doubt = Sanity(finding="torque_sign", statement="The torque drives the axis backwards.")
    html = render(replace(diagnosis("two"), sanity=(doubt,)))
    assert html.index("The torque drives the axis backwards.") < html.index('class="lead"')


def test_a_limit_is_of_the_number_that_is_told_as_the_size() -> None:
    """The viscous part leads here: three of its standard errors, not of the level's."""
    effect = FrictionAsymmetry(level_asymmetry=0.07, viscous_asymmetry=-0.18)
    numbers = Numbers(
        {"level_asymmetry": 0.07, "viscous_asymmetry": -0.18}, {"level_asymmetry": 0.064, "viscous_asymmetry": 0.006}
    )
    assert visible_from(effect, numbers) == pytest.approx(3 * 200 * 0.006)


@pytest.mark.parametrize("word", ["brake", "seal", "counterweight", "disc", "pier", "tube"])
def test_no_part_of_a_rotary_axis_is_named_for_a_linear_one(word: str) -> None:
    """A ball screw has no shaft seal to look at."""
    for kind in {form for forms in CATALOGUE.values() for form in forms if form.action_linear}:
        assert word not in kind.action_linear
