"""Checks of somebody's own physics: what is right passes, each planted error fails the check that is meant for it."""

from collections.abc import Iterator
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import Any, ClassVar
from unittest import SkipTest

import casadi as ca
import pytest
from commands import Refused, python

import cosim
from pyfmi_models import plugins
from pyfmi_models.effects import CATALOGUE
from pyfmi_models.effects.base import FrictionEffect, LoadEffect, Main, Motion
from pyfmi_models.friction import LAWS
from pyfmi_models.friction.base import MemorylessLaw
from pyfmi_models.friction.dahl import Dahl
from pyfmi_models.model import Scalar, parameter

SLOW = ("fmu", "found_where_concealed")


@dataclass(frozen=True, kw_only=True)
class Spring(LoadEffect):
    """A spring whose force grows with the third power: torque = c q^3."""

    id: ClassVar[str] = "cubic_spring"
    title: ClassVar[str] = "Cubic spring"
    equation: ClassVar[str] = "c q³"
    main: ClassVar[Main] = Main("coefficient", unit="N.m")
    action: ClassVar[str] = "Look for a bent hose."
    coefficient: Scalar = parameter("N.m/rad3", "Torque at one radian", low=0)

    def load(self, motion: Motion) -> Scalar:
        return self.coefficient * motion.q**3

    def statement(self, unit: str = "N·m") -> str:
        return f"A spring pulls back with {self.coefficient:.3g} {unit} at one radian."


@dataclass(frozen=True, kw_only=True)
class Grease(MemorylessLaw):
    """Grease that thins: F = [Fc + K v / (1 + |v|)] sign(v)."""

    key: ClassVar[str] = "thin_grease"
    linear: ClassVar[tuple[str, ...]] = ("Fc", "K")
    Fc: Scalar = parameter("N.m", "Level", low=0)
    K: Scalar = parameter("N.m.s/rad", "Torque beyond the level, per speed", low=0)

    def level(self, v: Scalar) -> Scalar:
        return self.Fc

    def viscous(self, v: Scalar) -> Scalar:
        return self.K * v / (1 + ca.sqrt(v * v + 1e-12))


@pytest.fixture(autouse=True)
def _forget() -> Iterator[None]:
    """Leave the tables as they were."""
    before = dict(CATALOGUE), dict(LAWS), list(plugins._known)
    yield
    for table, was in zip((CATALOGUE, LAWS), before, strict=False):
        table.clear()
        table.update(was)  # type: ignore[call-overload]
    plugins._known[:] = before[2]


def failing(checks: cosim.Checks, *names: str) -> dict[str, str]:
    """Names of the checks that fail, with why; those that take long only where they are named."""
    found = {}
    for name, check in checks:
        if name not in SLOW or name in names:
            try:
                check()
            except cosim.CheckError as error:
                found[name] = str(error)
            except SkipTest:
                continue
    return found


def test_an_effect_and_a_law_that_are_right_pass() -> None:
    assert failing(cosim.check_effect(Spring), "fmu") == {}
    assert failing(cosim.check_law(Grease), "fmu") == {}
    assert failing(cosim.check_law(Dahl(sigma0=9e4, sigma2=30.0, Fc=2.0))) == {}


def wrong(base: type, fields: dict[str, Any] | None = None, **body: Any) -> Any:
    """A class like another one, with an error planted."""
    listed = [(name, Scalar, one) for name, one in (fields or {}).items()]
    return make_dataclass("Wrong", listed, bases=(base,), namespace=body, frozen=True, kw_only=True)


@pytest.mark.parametrize(
    ("check", "error"),
    [
        ("words", {"action": ""}),
        ("units", {"fields": {"coefficient": parameter("Nm per cubic rad", "Torque at one radian", low=0)}}),
        # an infinite slope at rest
        ("finite", {"load": lambda self, motion: self.coefficient * ca.sqrt(ca.fabs(motion.v))}),
        # steps too fine to be seen
        ("derivatives", {"load": lambda self, motion: self.coefficient * ca.floor(motion.q * 1e9) / 1e9}),
        ("acts", {"load": lambda self, motion: 0 * self.coefficient * motion.q}),
        # a number that does nothing to derivatives: a jump hides it
        ("fits_itself", {"load": lambda self, motion: ca.floor(self.coefficient * 4) / 4 * motion.q}),
    ],
)
def test_a_planted_error_in_an_effect_fails_its_check(check: str, error: dict[str, Any]) -> None:
    if check == "fits_itself":
        error |= {"fields": {"coefficient": parameter("N.m", "Torque at one radian", default=3.0, low=0)}}
    assert check in failing(cosim.check_effect(wrong(Spring, **error)))


def test_friction_that_pushes_fails_its_check() -> None:
    pushing = wrong(
        FrictionEffect,
        {"factor": parameter("1", "Factor of the viscous torque", default=-9.0)},
        id="pushing_friction",
        title="Pushing friction",
        action="Doubt it.",
        viscous=lambda self, viscous, motion: self.factor * viscous,
        statement=lambda self, unit="N·m": "It pushes instead of resisting.",
    )
    assert "resists" in failing(cosim.check_effect(pushing))


def late(law: Dahl, state: Any, v: Scalar, level: Scalar, dt: Scalar) -> Any:
    """A bristle whose closed form is that of another stiffness."""
    return Dahl.advance(law, state, v, level, 1.05 * dt)


@pytest.mark.parametrize(
    ("law", "checks"),
    [
        pytest.param(wrong(Grease, viscous=lambda self, v: self.K * (v + v * v)), {"odd"}, id="heavier forward"),
        pytest.param(wrong(Grease, viscous=lambda self, v: -3 * self.K * v), {"passive", "steady"}, id="pushes"),
        pytest.param(
            wrong(Dahl, key="late_dahl", advance=late)(sigma0=9e4, sigma2=30.0, Fc=2.0), {"advance"}, id="late"
        ),
    ],
)
def test_a_planted_error_in_a_law_fails_its_check(law: Any, checks: set[str]) -> None:
    assert checks <= failing(cosim.check_law(law)).keys()


def test_a_run_of_all_gives_a_table_or_one_error_with_each_reason() -> None:
    checks = cosim.check_effect(wrong(Spring, action=""))
    quick = type(checks)(checks.subject, [one for one in checks if one[0] in ("words", "units", "resists")])
    assert quick.frame()["outcome"].tolist() == ["failed", "passed", "not applicable"]
    with pytest.raises(cosim.CheckError, match="1 of 3 checks of Wrong failed"):
        quick.run()
    assert len(repr(checks)) < 80


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: cosim.check_effect(int), "is no effect"),
        (lambda: cosim.check_law(Spring), "is no friction law"),
        (lambda: cosim.check_effect(LoadEffect), "LoadEffect has no id"),
    ],
)
def test_what_is_no_physics_is_refused_in_a_sentence(call: Any, sentence: str) -> None:
    with pytest.raises(cosim.InputError, match=sentence):
        call()


OWN = """
from dataclasses import dataclass
from typing import ClassVar
from pyfmi_models.effects.base import LoadEffect, Main
from pyfmi_models.model import parameter

@dataclass(frozen=True, kw_only=True)
class Hose(LoadEffect):
    '''A hose: torque = c q.'''
    id: ClassVar[str] = "stiff_hose"
    title: ClassVar[str] = "Hose"
    main: ClassVar[Main] = Main("stiffness")
    stiffness: float = parameter("N.m/rad", "Stiffness", low=0)

    def load(self, motion):
        return self.stiffness * motion.q
"""
CARD = """[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 3.0
[[effects]]\neffect = "stiff_hose"\nstiffness = 2.0
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "hose_of_mine.py").write_text(OWN, "utf-8")
    (tmp_path / "card.toml").write_text(CARD, "utf-8")
    return tmp_path


SHOW = ("-m", "cosim", "show", "card.toml")


def test_a_folder_of_plugins_brings_words_to_cards(own: Path, refused: Refused) -> None:
    assert "'stiff_hose'" in refused("show", own / "card.toml").replace('"', "'")
    done = python(*SHOW, "--plugins", "mine", "--json", folder=own)
    assert done.returncode == 0, done.stderr
    assert "stiff_hose" in done.stdout


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("import nonsense_that_is_nowhere\n", "nonsense_that_is_nowhere"),
        ("def (:\n", "SyntaxError"),
        ("import sys\nsys.exit(3)\n", "SystemExit"),
        (OWN.replace("stiff_hose", "cogging"), "that of an effect of this package"),
    ],
)
def test_a_plugin_that_cannot_be_loaded_is_one_sentence(own: Path, text: str, sentence: str) -> None:
    (own / "mine" / "hose_of_mine.py").write_text(text, "utf-8")
    done = python(*SHOW, "--plugins=mine", folder=own)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("folder", ["nowhere", "card.toml", ""])
def test_a_folder_that_is_none_is_refused(own: Path, folder: str, refused: Refused, monkeypatch: Any) -> None:
    monkeypatch.chdir(own)
    assert "--plugins" in refused("show", "card.toml", "--plugins", folder)


def test_an_entry_point_brings_its_class(monkeypatch: pytest.MonkeyPatch) -> None:
    class Point:
        name = "spring"

        def load(self) -> type:
            return Spring

    monkeypatch.setattr(plugins, "_loaded", set())
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: [Point()] if group == "cosim.effects" else [])
    plugins.load()
    assert CATALOGUE["cubic_spring"] == (Spring,)
