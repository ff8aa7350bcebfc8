"""`identify` fits the card's own law, at the rate of new readings, and says which numbers nothing determines."""

import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pytest

import cosim
from cosim.data.recording import Recording
from cosim.estimation.identify.deliver import summary
from cosim.estimation.identify.identify import Identified, Options, identify
from cosim.estimation.set_point import set_point
from cosim.support.errors import InputError
from pyfmi_models.card import Card, read_card
from pyfmi_models.friction import Coulomb, FrictionLaw, Stribeck
from pyfmi_models.friction.base import MemorylessLaw
from pyfmi_models.model import Pair, Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class Grease(MemorylessLaw):
    """A law of the user's own: it yields, then thins: [Fc + K |v|^n] sign(v)."""

    key: ClassVar[str] = "grease"
    linear: ClassVar[tuple[str, ...]] = ("Fc", "K")
    Fc: Scalar = parameter("N.m", "Level", low=0)
    K: Scalar = parameter("N.m", "Torque beyond the level at 1 rad/s", low=0)
    n: Scalar = parameter("1", "Exponent", default=0.5, low=0.1, high=1)
    tilt: Scalar = parameter("1", "Of no consequence here", default=0.3)

    def level(self, v: Scalar) -> Scalar:
        """Fc."""
        return self.Fc

    def viscous(self, v: Scalar) -> Scalar:
        """K |v|^n."""
        return self.K * v * ca.exp((self.n - 1) / 2 * ca.log(v * v + 1e-12))


@dataclass(frozen=True, kw_only=True)
class Silent(FrictionLaw):
    """A law that does not say what it is in steady sliding."""

    key: ClassVar[str] = "silent"
    Fc: Scalar = parameter("N.m", "Level", low=0)


def card_of(law: FrictionLaw) -> Card:
    """A card without a controller: the map alone."""
    return replace(read_card("paper_mount"), friction=law, controller=None, unbalance=None, effects=())


def slow(law: Any, inertia: float = 30.0, rate: float = 250.0, peak: float = 0.4, noise: float = 0.01) -> Recording:
    """Three periods of a slow sine, without a set point."""
    omega, t = 2 * np.pi * 0.05, np.arange(int(60 * rate)) / rate
    v, a = peak * np.sin(omega * t), peak * omega * np.cos(omega * t)
    friction = [float(law.level(one) + law.viscous(one)) for one in np.abs(v[:: int(rate / 10)]) + 1e-9]
    torque = np.interp(t, t[:: int(rate / 10)], friction) * np.sign(v)
    random = np.random.default_rng(0)
    tau = torque + inertia * a + random.normal(0, noise, len(t))
    return Recording("slow", {"t": t, "tau": tau, "q": -peak / omega * np.cos(omega * t)})


def found_with(believed: FrictionLaw, truth: FrictionLaw, **options: Any) -> Identified:
    return identify([slow(truth)], card_of(believed), Options(**options))


LAWS = [
    (Grease(Fc=1.0, K=4.0, n=0.5), Grease(Fc=2.0, K=3.0, n=0.7), ("Fc", "K", "n")),
    (Coulomb(Fc=5.0, sigma2=3.0), Coulomb(Fc=2.0, sigma2=8.0), ("Fc", "sigma2")),
    (Coulomb(Fc=5.0, sigma2=0.0), Coulomb(Fc=2.0, sigma2=8.0), ("Fc", "sigma2")),
    (Coulomb(Fc=Pair(5.0, 4.0), sigma2=3.0), Coulomb(Fc=2.0, sigma2=8.0), ("Fc.positive", "Fc.negative")),
    (Stribeck(Fc=5.0, sigma2=3.0), Coulomb(Fc=2.0, sigma2=8.0), ("Fc", "sigma2")),
    (Stribeck(Fc=3.0, Fs=5.0, Vs=0.1, sigma2=3.0), Stribeck(Fc=2.0, Fs=4.0, Vs=0.07, sigma2=8.0), ("Fc", "Vs")),
]


@pytest.mark.parametrize(("believed", "truth", "names"), LAWS)
def test_the_cards_own_law_is_fitted(believed: FrictionLaw, truth: FrictionLaw, names: tuple[str, ...]) -> None:
    found = found_with(believed, truth, free=tuple(f"friction.{name}" for name in names))
    assert type(found.card.friction) is type(believed)
    numbers = {one.name: one.start for one in found.card.plant().parameters()}
    for name in names:
        assert numbers[f"friction.{name}"] == pytest.approx(getattr(truth, name.split(".")[0]), rel=0.05), name
    assert found.kept == ()


def test_numbers_that_nothing_fits_are_said_and_stay(tmp_path: Path) -> None:
    card, told = card_of(Coulomb(Fc=5.0, sigma2=3.0)), {}
    done = cosim.identify(slow(Coulomb(Fc=2.0, sigma2=8.0)), card, tmp_path / "out")
    told = json.loads((tmp_path / "out" / "identify.json").read_text())["not_determined"]
    assert set(told) == {"axis.inertia"}
    assert told["axis.inertia"]["value"] == card.mount.inertia
    assert "Not determined by them, and as in the given card: axis.inertia." in (tmp_path / "out/card.toml").read_text()
    assert "Without a simulated loop no way here determines the inertia (axis.inertia)" in str(done)


def test_one_speed_leaves_a_number_at_the_cards_and_prints_none_that_its_error_swamps() -> None:
    t = np.arange(12_500) / 250
    v = np.where(np.floor(t / 5) % 2, -0.2, 0.2)
    tau = 4.0 * np.sign(v) + np.random.default_rng(1).normal(0, 0.05, len(t))
    given = Recording("one_speed", {"t": t, "tau": tau, "q": np.cumsum(v) / 250})
    card = card_of(Stribeck(Fc=3.0, Fs=5.0, Vs=0.01, sigma2=3.0))
    found = identify([given], card, Options())
    assert len([name for name in found.kept if name.startswith("friction.")]) >= 3
    new, old = ({one.name: one.start for one in c.plant().parameters()} for c in (found.card, card))
    assert all(new[name] == old[name] for name in found.kept)
    assert float(found.card.friction.level(0.2) + found.card.friction.viscous(0.2)) == pytest.approx(4.0, rel=0.05)  # type: ignore[arg-type]
    text = summary(found, card)
    assert "not determined" in text
    assert not re.search(r"\de[+-]\d", text)


def test_a_law_that_cannot_be_fitted_writes_no_card(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no torque in steady sliding"):
        cosim.identify(slow(Coulomb(Fc=2.0, sigma2=8.0)), card_of(Silent(Fc=2.0)), tmp_path / "out", free=("Fc",))
    assert not (tmp_path / "out" / "card.toml").exists()


@pytest.mark.parametrize("column", ["tau", "q"])
def test_repeated_readings_are_taken_at_their_own_rate(column: str) -> None:
    """A torque or a position that is new every 60 ms in rows of 4 ms: late by 30 ms on average, in a quick motion."""
    t = np.arange(15_000) / 250
    v, a = 0.3 * np.sin(2.5 * t), 0.75 * np.cos(2.5 * t)
    table = {"t": t, "tau": 2 * np.sign(v) + 8 * v + 30 * a, "q": -0.12 * np.cos(2.5 * t)}
    table[column] = table[column][np.arange(len(t)) // 15 * 15]
    random = np.random.default_rng(0).normal(0, 1e-3, len(t))[np.arange(len(t)) // 15 * 15]
    table["tau"] = table["tau"] + random
    given = Recording("held", table)
    found = identify([given], card_of(Coulomb(Fc=5.0, sigma2=3.0)), Options(free=("Fc", "sigma2")))
    assert found.card.friction.sigma2 == pytest.approx(8.0, rel=0.1)  # type: ignore[attr-defined]
    assert found.card.friction.Fc == pytest.approx(2.0, rel=0.1)  # type: ignore[attr-defined]


def test_a_set_point_that_is_repeated_is_as_smooth_as_it_was() -> None:
    t = np.arange(5000) / 1000
    wanted = 0.1 * np.sin(2 * t)
    held = Recording("run", {"t": t, "tau": t, "q": wanted, "q_d": wanted[np.arange(5000) // 20 * 20]})
    got = set_point(held, 1e-3)
    inside = slice(200, 4700)
    assert np.abs(got["a_d"] + 0.4 * np.sin(2 * t[: len(got["a_d"])]))[inside].max() < 0.01
