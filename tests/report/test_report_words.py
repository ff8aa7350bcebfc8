"""Numbers, units and orders of the report: limits, sizes and ranges as a mechanic reads them, checks and repairs."""

import re
import tomllib
from dataclasses import replace
from importlib.resources import files
from typing import Any, get_args

import pytest
from effect_examples import EXAMPLES
from plain_words import unplain
from report_example import FOUND, REST, RIVALS, diagnosis, report_of, text_of

from cosim.api.show import show
from cosim.delivery.deliver import as_json, without_files
from cosim.diagnosis.answer.result import Finding, Where
from cosim.diagnosis.effects import TRIED
from cosim.diagnosis.measure.findings import advice, visible_from
from cosim.diagnosis.search.admissibility import Numbers
from cosim.plots.quantities import FAMILIES, Scale, minus, number, spelled
from cosim.report import render, tables, words
from cosim.report.figures_proof import relative
from cosim.report.findings import block, do, where
from cosim.report.next_experiment import motion
from cosim.report.quantities import Scales
from cosim.report.repairs import MACHINES, MOTIONS, for_machine, machines_of, repairs_of
from cosim.report.tables import proof
from cosim.report.terminal import summary
from cosim.report.words import blocks
from cosim.support.errors import InputError
from cosim.support.units import unit
from cosim_serve.work import in_words
from pyfmi_models.card import MachineKind
from pyfmi_models.effects import CATALOGUE
from pyfmi_models.effects.friction_asymmetry import FrictionAsymmetry

TWO, SCALES = diagnosis("two"), Scales.of(diagnosis("two"))


def test_numbers_read_well_and_a_range_ends_where_the_parameter_does() -> None:
    assert [number(x) for x in (0.4203, 0.0, -12.34, 1234.0, float("nan"))] == ["0.42", "0", "−12", "1,200", "–"]
    assert minus("-0.01 to 0.11, run-3") == "−0.01 to 0.11, run-3"
    long, short = "2.32e+06 N/m, 1.8e+03 to -4.1e-04, 1e+09, 3e-05x", "2,320,000 N/m, 1,800 to −0.00041, 1e+09, 3e-05x"
    assert spelled(long) == short
    stiff = replace(FOUND[0], size="2.32e+06 N/m", size_range="2091449 to 2546496")
    assert words.sized(stiff) == ("2,320,000 N/m", "2,091,449 to 2,546,496")
    assert relative(FOUND[0]) == pytest.approx((8.4, 7.8, 9.0))
    speeds = replace(REST[0], effect="stribeck", answer="found", parameters={"Vs": 0.018}, units={"Vs": "rad/s"})
    wide = replace(speeds, ranges={"Vs": (-0.19, 0.227)})
    assert tables.numbers(wide).rows == (("Vs", "0.01800", "up to 0.227", "rad/s"),)
    signed = replace(wide, effect="gravity", parameters={"phase": 0.1}, ranges={"phase": (-0.1, 0.3)}, units={})
    assert tables.numbers(signed).rows[0][2] == "−0.100 to 0.300"
    rows = {row[0]: row[1] for row in tables.numbers(FOUND[0]).rows}
    assert (rows["amplitude"], rows["amplitude, wave 2"], rows["phase, wave 2"]) == ("0.4200", "0.1250", "−0.3000")


@pytest.mark.parametrize(
    ("motion", "units"), [("rotary", ["kg·m²", "N·m", "N·m·s/rad"]), ("linear", ["kg", "N", "N·s/m"])]
)
def test_numbers_of_the_base_have_units(motion: str, units: list[str]) -> None:
    base = dict.fromkeys(("axis.inertia", "friction.Fc.positive", "friction.sigma2"), (1.0, 1.0, 1.0))
    assert [row[-1] for row in tables.parameters(replace(diagnosis("two", motion), base_parameters=base)).rows] == units


@pytest.mark.parametrize(
    ("share", "why"),
    [("97.0", "but fits worse where noise is low"), ("90.7", "the detail of what is left decides"), ("80.0", "90.9 %")],
)
def test_a_rival_that_removes_more_is_said_to_fit_worse(share: str, why: str) -> None:
    told = f"Torque offset: removes {share} % of the error energy, this 90.9 %"
    close = replace(FOUND[0], ruled_out=(), less_likely=(told,))
    whole = replace(diagnosis("two"), findings=(close, *REST))
    said = dict(block(blocks(whole)[0], whole, Scales.of(whole), None).rows)["Less likely"]
    assert why in said
    assert ("decides" in said) == (share == "90.7")


def test_a_rival_that_fits_as_well_is_less_likely_and_how_far_one_is_behind_stands_among_the_numbers() -> None:
    told = "Torque offset: removes 90.3% of the error energy, this 90.9%"
    close = replace(FOUND[0], ruled_out=(), less_likely=(told,))
    html = render(replace(TWO, findings=(close, *FOUND[1:], *RIVALS, *REST)))
    assert "<dt>Less likely</dt><dd>Torque offset: removes 90.3%" in html
    assert as_json(replace(TWO, findings=(close,)))["effects"][0]["less_likely"] == [told]
    behind = replace(FOUND[0], ruled_out=("Torque offset: removes 70.7%, this 83.0% (126 nats behind)",))
    html = render(replace(TWO, findings=(behind, *FOUND[1:], *RIVALS, *REST)))
    assert "<dd>Torque offset: removes 70.7%, this 83.0%</dd>" in html
    assert "nats" not in text_of(html)
    assert "Evidence by which rivals are behind: Torque offset, 126 nats." in html


SIGNS = {"°": "deg", "′": "arcmin", "″": "arcsec", "·": "."}
SHOWN = [(si, scale) for si, family in FAMILIES.items() for scale in family]


@pytest.mark.parametrize(("si", "scale"), SHOWN, ids=[f"{si} as {scale.unit}" for si, scale in SHOWN])
def test_a_scale_is_the_size_of_its_unit(si: str, scale: Scale) -> None:
    name = scale.unit
    for sign, word in SIGNS.items():
        name = name.replace(sign, word)
    assert unit(name).dimension == unit(si).dimension
    assert scale.factor * unit(name).factor == pytest.approx(1.0, rel=1e-12)
    factors = [one.factor for one in FAMILIES[si]]  # the largest unit first, each smaller
    assert factors == sorted(set(factors))
    assert len(factors) == 3


def test_each_limit_stands_beside_the_effect_that_it_is_of_and_is_counted_on_the_terminal() -> None:
    absent = {"answer": "not_seen", "probability": 0, "gain": 0}
    seen = (
        *(
            replace(REST[0], effect=f"e{k}", title=f"E{k}", visible_from=0.5 + k, evidence="at 2 cycles")
            for k in (0, 1)
        ),
        Finding(effect="clock_skew", title="Clock skew", evidence="from 18 ms", **absent),
        Finding(effect="backlash", title="Backlash", evidence="wider than 0.001 rad", **absent),
    )
    told = ["0.5 ms at 2 cycles", "1.5 ms at 2 cycles", "18 ms", "wider than 3.4′"]
    whole = replace(diagnosis("none"), findings=seen)
    rows = tables.limits(whole, Scales.of(whole)).rows
    assert [(row[0], row[2].replace("\N{NO-BREAK SPACE}", " ")) for row in rows] == [
        (one.title, limit) for one, limit in zip(seen, told, strict=True)
    ]
    beside = replace(diagnosis("two"), findings=(*FOUND, *seen[2:]))
    assert [row[-1] for row in tables.looked(beside, Scales.of(beside)).rows[-2:]] == told[2:]
    assert "2 other effects: not detected, limits in the report" in " ".join(summary(beside).split())
    spring = Finding(effect="compliance", title="Compliance", **absent)  # its number is no size
    whole = replace(beside, findings=(*FOUND, spring))
    limit = words.unseen_torque(whole, Scales.of(whole))
    assert re.fullmatch(r"0\.0\d+\N{NO-BREAK SPACE}N·m RMS", limit)
    assert tables.looked(whole, Scales.of(whole)).rows[-1][-1] == f"a torque of {limit}"
    none = diagnosis("none")
    cells = " ".join(row[0] for row in tables.limits(none, Scales.of(none)).rows).lower()
    assert all(one.title.lower() in cells for one in none.findings if one.answer in ("not_seen", "not_testable"))


def test_angles_and_lengths_are_in_units_that_need_no_zeros_and_a_direction_has_none() -> None:
    ring = replace(RIVALS[1], size="7e-06 rad", size_range="6e-06 to 8e-06", visible_from=2.4e-6, units={})
    assert words.sized(ring) == ("1.44″", "1.24 to 1.65")
    assert words.shows_from(ring) == "0.50″"
    erring = replace(ring, statement="The encoder errs by 7e-06 rad either way")
    assert words.stated(erring).startswith("The encoder errs by 1.4″ either way.")
    handy = words.in_handy_units("0.42 N·m at 0.05 rad/s and 0.3 m/s")
    assert handy == "0.42 N·m at 2.9°/s and 0.30\N{NO-BREAK SPACE}m/s"
    held = replace(TWO.heldout, position={"before": 4e-6, "after": 2e-6})
    rows = {row[0]: row for row in proof(replace(TWO, heldout=held), SCALES).rows}
    assert rows["Position, closed loop [″]"][2:4] == ("0.825", "0.413")
    whole = diagnosis("two", "linear")
    said = motion({"kind": "chirp", "amplitude": 1.3e-5, "start": 0.5, "stop": 49}, Scales.of(whole))
    assert said.replace("\N{NO-BREAK SPACE}", " ") == "a sine of 13 µm to each side that rises from 0.5 Hz to 49 Hz"
    sides = Where(axis="direction", description="both directions, differently", regions=((-1, -1), (1, 1)))
    assert where(replace(FOUND[1], where=sides), SCALES) == "both directions, differently"
    edge = Where(axis="speed", description="slower than 0.35", regions=((-0.35, 0.35),))
    assert where(replace(FOUND[1], where=edge), SCALES) == "slower than 20°/s"
    beyond = Where(axis="speed", description="faster than 0.35", regions=((-1.57, -0.35), (0.35, 1.57)))
    assert where(replace(FOUND[1], where=beyond), SCALES) == "faster than 20°/s"


def test_a_limit_is_of_the_number_that_is_told_as_the_size() -> None:
    """The viscous part leads here: three of its standard errors, not of the level's."""
    values = {"level_asymmetry": 0.07, "viscous_asymmetry": -0.18}
    numbers = Numbers(values, {"level_asymmetry": 0.064, "viscous_asymmetry": 0.006})
    assert visible_from(FrictionAsymmetry(**values), numbers) == pytest.approx(3 * 200 * 0.006)


PARTS = re.compile("brake|seal|counterweight|disc|pier|tube")
"""Parts of a rotary axis: a ball screw has no shaft seal to look at."""


@pytest.mark.parametrize("motion", ["rotary", "linear"])
@pytest.mark.parametrize(
    "kind", sorted({form for forms in CATALOGUE.values() for form in forms if form.action}, key=str)
)
def test_an_action_is_for_the_motion_and_no_effect_that_the_model_lacks_is_sent_to_it(kind: Any, motion: Any) -> None:
    given = kind.action_linear if motion == "linear" and kind.action_linear else kind.action
    without = advice(kind, False, motion)
    assert "improved model" not in without
    assert without.endswith(".")
    assert given.startswith(without.removesuffix("."))
    assert advice(kind, True, motion) == given
    assert not PARTS.search(kind.action_linear)


def test_an_experiment_is_ordered_for_the_causes_that_it_separates_and_names_no_file_that_is_not_there() -> None:
    warm = replace(RIVALS[0], effect="thermal_viscosity", title="Thermal friction", action="Let it warm up.")
    whole = replace(diagnosis("two"), findings=(*FOUND, *RIVALS, warm))
    orders = {one.first.effect: do(one, whole) for one in words.blocks(whole) if one.answer == "ambiguous"}
    assert orders["gravity_unbalance"].startswith("Record one turn")
    assert orders["thermal_viscosity"] == "Let it warm up."
    whole = without_files(diagnosis("two"))
    assert "Wrote" not in summary(replace(whole, improved={}))
    assert "scenario" not in whole.next_experiment


def test_a_proposed_friction_law_is_told_on_page_and_terminal_and_the_bases_own_is_not() -> None:
    said = "Friction law: maxwell_slip instead of lugre would reduce the residual variance by up to 8 %"
    assert words.law(TWO).startswith(said)
    assert said in render(TWO)
    assert said in " ".join(summary(TWO).split())
    assert words.law(replace(TWO, friction_law={"base": "lugre", "proposed": "lugre", "gain": 0.0})) == ""
    bent = words.law(replace(TWO, friction_law={"base": "lugre", "proposed": "lugre", "gain": 0.0, "curve": 0.87}))
    assert "a curve over speed that is not that of lugre would reduce the residual variance by up to 87 %" in bent


# Every effect that a diagnosis looks for has three checks with their results, and a repair by kind of machine.


@pytest.mark.parametrize("effect", sorted(TRIED))
def test_an_effect_has_three_checks_with_two_results_and_a_repair_by_machine(effect: str) -> None:
    known = repairs_of(effect)
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


def test_files_and_kinds_of_machines_are_those_that_there_are_and_no_path_is_an_effect() -> None:
    there = [one for one in files("cosim.report.repairs").iterdir() if one.name.endswith(".toml")]
    assert {one.name.removesuffix(".toml") for one in there} == set(TRIED)
    assert all(set(tomllib.loads(one.read_text("utf-8"))) == {"checks", "repair"} for one in there)
    assert set(get_args(MachineKind)) == set(MACHINES) == {kind for kinds in MOTIONS.values() for kind in kinds}
    assert repairs_of("my_own") is None
    assert repairs_of("../cogging") is None


def test_the_report_has_checks_and_the_repairs_that_fit_the_motion() -> None:
    html = report_of("two")
    known = repairs_of("friction_asymmetry")
    assert all(check.do.split(",")[0] in html for check in known.checks)
    for kind, text in known.by_machine.items():
        assert (text.split(",")[0].replace("'", "&#39;") in html) == (kind in MOTIONS["rotary"]), kind
    unsure = replace(FOUND[1], answer="not_proven")
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
