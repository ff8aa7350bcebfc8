"""FMUs built from cards and models, kept in the user's cache under the content they were made from.

Looking one up hashes the card and the sources that make FMUs; CasADi and the compiler are imported only to build one.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from cosim.support.errors import ScenarioError
from cosim.support.files import cache_home, directory, sha256
from cosim.system.scenario import Scenario
from cosim.system.sections import ComponentSection
from pyfmi_models import plugins

FMI: Literal[3] = 3
"""Version of the FMUs built for a run."""


def with_fmus(scenario: Scenario, on_build: Callable[[str], None] = lambda text: None) -> Scenario:
    """Return the scenario with an FMU for every component made from a card or model; `on_build` is told of each built.

    Raises:
        ScenarioError: there is no such card.
        ModelError: the card is not good, or cannot be exported.
    """
    made = {}
    for name, component in scenario.components.items():
        if component.fmu is None and component.card is not None:
            made[name] = _fmu(component, f"{scenario.path}: components.{name}.card", on_build)
        elif component.fmu is None and component.model is not None:
            made[name] = _fmu_of_model(component.model, on_build)
    return scenario.with_fmus(made)


def cards_of(scenario: Scenario) -> dict[str, dict[str, str]]:
    """Return by component the card that it is built from: its name in the scenario and its hash."""
    named = {name: one.card for name, one in scenario.components.items() if one.card is not None}
    return {name: {"card": Path(card).name, "sha256": hash_of_card(card, name)} for name, card in named.items()}


def hash_of_card(card: str, where: str = "card") -> str:
    """Return the hash of a card's file; raises ScenarioError where there is none."""
    return sha256(_card_file(card, where))


def fmu_of_card(card: str, part: Literal["plant", "controller"], on_build: Callable[[str], None]) -> Path:
    """Return the FMU of a part of a card, built if need be.

    Raises:
        ScenarioError: there is no such card.
        ModelError: the card is not good, or cannot be exported.
    """
    return _fmu(ComponentSection(card=card, part=part), "card", on_build)


def _fmu(component: ComponentSection, where: str, on_build: Callable[[str], None]) -> Path:
    card, part = str(component.card), str(component.part)
    source = _card_file(card, where)
    made_by = f"{_sources()} {part} {FMI} ".encode() + b"".join(path.read_bytes() for path in plugins.files())
    made_by += b" carried" if b"[origin]" in source.read_bytes() else b""
    key = hashlib.sha256(made_by + source.read_bytes()).hexdigest()[:16]
    path = _home() / f"{source.stem}-{part}-{key}.fmu"
    if not path.exists():
        on_build(f"building the FMU of the {part} of {card}")
        _build(card if not Path(card).exists() else str(source), part, path)
    return path


def _fmu_of_model(model: str, on_build: Callable[[str], None]) -> Path:
    key = hashlib.sha256(f"{_sources()} {model} {FMI}".encode()).hexdigest()[:16]
    path = _home() / f"{model}-{key}.fmu"
    if not path.exists():
        on_build(f"building the FMU of {model}")
        _export(_model(model), path)
    return path


def _model(name: str) -> Any:
    from pyfmi_models.pointing import PointingError

    return {"pointing_error": PointingError}[name]().model()


def _build(card: str, part: str, path: Path) -> None:
    from cosim.models.carried import related_of
    from pyfmi_models.card import read_card

    read = read_card(card)
    if part == "plant":
        model = read.plant().model()
        _export(model, path, related_of(read, model.name))
    else:
        _export(read.controller_model(), path)


def _export(model: Any, path: Path, related: Any = ()) -> None:
    from pyfmi_models.export import export_fmu

    directory(path.parent)
    export_fmu(model, path, fmi=FMI, force=True, related=related)


def _card_file(card: str, where: str) -> Path:
    path = Path(card)
    if path.is_file():
        return path
    shipped = _package() / "cards"
    if (shipped / f"{card}.toml").is_file():
        return shipped / f"{card}.toml"
    choices = tuple(sorted(one.stem for one in shipped.glob("*.toml")))
    rule = f"a card is a .toml file or one of: {', '.join(choices)}."
    raise ScenarioError(f'{where} = "{card}": no such card; {rule}', culprit=where, value=card, choices=choices)


@cache
def _sources() -> str:
    """Return a hash of everything that makes an FMU of a card."""
    digest = hashlib.sha256()
    for path in sorted(
        one for one in _package().rglob("*") if one.suffix in {".py", ".c", ".h", ".j2", ".xml", ".svg", ".png", ".txt"}
    ):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def _package() -> Path:
    found = find_spec("pyfmi_models")
    assert found is not None  # both packages come in one distribution
    assert found.origin is not None
    return Path(found.origin).parent


def _home() -> Path:
    return cache_home() / "fmus"
