"""Archives for tests: one a kind of model, and every law, effect and controller there is."""

from dataclasses import replace
from functools import cache

import pytest
from effect_examples import EXAMPLES, mount
from friction_laws import EXAMPLES as LAWS
from friction_laws import ONE_SIDED

from pyfmi_models.card import read_card
from pyfmi_models.controller_section import AdaptationSection, LearningSection
from pyfmi_models.export import export_fmu


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    """Export a model of export_models once per session."""
    folder = tmp_path_factory.mktemp("fmus")
    return cache(lambda make, fmi: export_fmu(make(), folder / f"{make.__name__}{fmi}.fmu", fmi=fmi))


CONTROLLERS = {
    **{case: {"compensation": case} for case in ("C1", "C2a", "C2b", "C3a", "C3b", "C2a+C3a")},
    "that identifies": {"adaptation": AdaptationSection()},
    "that learns": {"learning": LearningSection(period=1.0, knots=10)},
    "of order 4": {"observer_order": 4},
    "by differences": {"velocity": "difference"},
}


def of_case(case):
    card = read_card("paper_mount")
    return replace(card, controller=card.controller.model_copy(update=CONTROLLERS[case])).controller_model()


EXPORTED = {
    **{f"{key} friction": mount(friction=law) for key, law in LAWS.items()},
    **{f"one-sided {key} friction": mount(friction=law) for key, law in ONE_SIDED.items()},
    **{type(effect).__name__: mount(effect) for effect in EXAMPLES},
    "every effect": mount(*EXAMPLES),
    **{case: case for case in CONTROLLERS},
}
