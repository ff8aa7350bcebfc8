"""The benchmark of the learned term: its deck, and what its page makes of rows."""

from typing import Any

import pytest

from bench import learned_terms, learned_terms_page
from cosim_studies.proof.generator import OUTSIDE


def row(family: str, **changes: Any) -> dict[str, Any]:
    own = {"world": "home", "family": family, "size": 1.0, "seed": 1, "verdict": ["unknown"], "tried": [], "step": 1.1}
    numbers = {"base": 1.0, "after": 0.4, "floor": 0.2, "before_learned": 1.0, "seconds": 5.0}
    return own | numbers | {"quantities": ["torque"], "equation": "not given = k1 tanh(u/width)"} | changes


NULL = row("none", size=0.0, quantities=[], equation="", step=None, after=1.0, floor=1.0, verdict=[])


def score(key: str, rows: list[dict[str, Any]]) -> Any:
    (one,) = (bar for bar in learned_terms_page.BARS if bar.key == key)
    return one.of(rows).value


def test_a_deck_has_every_effect_outside_the_catalogue_in_both_sizes_and_the_same_seed_draws_the_same() -> None:
    deck = learned_terms.at_home(7, 2, 3)
    assert deck == learned_terms.at_home(7, 2, 3)
    assert [case.family for case in deck[-3:]] == ["none"] * 3
    for family in OUTSIDE:
        assert {case.size for case in deck if case.family == family} == set(learned_terms.SIZES)
    assert len({case.seed for case in deck}) == len(deck)


def test_what_is_removed_is_a_share_of_what_can_be_removed() -> None:
    assert learned_terms_page.removed(row("dead_band")) == pytest.approx(0.75)
    assert learned_terms_page.removed(row("dead_band", after=1.2)) == pytest.approx(-0.25)
    assert learned_terms_page.removed(row("dead_band", floor=0.95)) is None


def test_the_scores_count_what_their_titles_say() -> None:
    wrong = row("dead_band", after=1.2, equation="not given = k1 u", quantities=["position"], step=1.9)
    silent = row("rubbing", quantities=[], equation="", after=1.0, step=None)
    rows = [row("dead_band"), wrong, silent, NULL, row("drive_deadband", world="abroad", size="subtle")]
    assert score("removed", rows) == pytest.approx(0.25)
    assert score("removed_all", rows) == pytest.approx(0.0)
    assert score("better", rows) == pytest.approx(2 / 3)
    assert score("variables", rows) == score("form", rows) == 0.5
    assert score("nulls", rows) == 0.0
    assert score("nulls", [*rows, NULL | {"quantities": ["speed"]}]) == 0.5
    assert score("worse", rows) == pytest.approx(1 / 3)
    page = learned_terms_page._line(wrong)
    assert "| -0.25 | not given = k1 u | 1.90 |" in page


def test_a_form_over_another_quantity_or_of_another_power_is_not_the_true_one() -> None:
    for family, right, wrong in (
        ("drive_fade", "command × (1 + f), f = k1 T", "command × (1 + f), f = k1 T²"),
        (
            "distance_memory_friction",
            "friction × (1 + f), f = k1 exp(−d/fade)",
            "friction × (1 + f), f = k1 exp(−t/fade)",
        ),
    ):
        assert learned_terms_page.has_form(row(family, equation=right))
        assert not learned_terms_page.has_form(row(family, equation=wrong))
