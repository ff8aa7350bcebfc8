"""Two more measured machines, in the words of their READMEs: a pendulum on a quasi-direct drive, a motor with cogging.

Each in both roles: which recordings are fitted and which are held out must not decide what is found.
"""

from collections.abc import Iterator
from pathlib import Path

import pandas as pd
from judges import moving
from measured import Machine

from cosim.diagnosis.diagnose import Outcome
from pyfmi_models.effects import GravityUnbalance

PENDULUM = """
[mount]
name = "pendulum"
inertia = 0.15
torque_limit = 12.0
[friction]
model = "coulomb"
Fc = 0.1
sigma2 = 0.02
[encoder]
counts_per_rev = 2094
"""
LENGTH = 9.81 / 0.5
"""g / l [1/s2], which m g l / J must come out near: the arm is 0.5 m long, and the scale of the torque cancels."""
CHOICES = {
    "": (("ddp", "energy_shaping"), ("direct_collocation",)),
    ", runs exchanged": (("energy_shaping", "direct_collocation"), ("ddp",)),
}


def pendulum(folder: Path) -> Iterator[Machine]:
    """Swing-ups of one weight by several controllers; judged in clear motion below 5 Hz.

    `sac` is left out: no inertia, weight and lag bring its torque and its motion together (0.56 N m are left as 0.69).
    """
    tables = {path.stem: pd.read_parquet(path) for path in sorted(folder.glob("*.parquet"))}
    for label, (train, held) in CHOICES.items():
        yield Machine(
            name="pendulum, quasi-direct drive" + label,
            concealed="gravity_unbalance, delay; no presliding, backlash, thermal_viscosity",
            card=PENDULUM,
            train={name: tables[name] for name in train},
            heldout={name: tables[name] for name in held},
            score=moving(0.3, 5.0),
            unit="N.m",
            bar=0.3,
            first_look="1.08 -> 0.20",
            derived=gravity_over_inertia,
        )


def gravity_over_inertia(outcome: Outcome) -> str:
    """`m g l / J` of the delivered card, beside what the arm's length says."""
    found = [effect for effect in outcome.card.effects if isinstance(effect, GravityUnbalance)]
    if not found:
        return "no gravity"
    ratio = float(found[0].mgl) / float(outcome.card.mount.inertia)
    return f"m g l / J = {ratio:.1f} /s2 (g / l = {LENGTH:.1f}), phase {float(found[0].phase):.2f}"


BRUSHLESS = """
[mount]
name = "motor"
inertia = 5e-6
[friction]
model = "coulomb"
Fc = 1.5e-3
sigma2 = 1e-5
"""
TURNS = {"": (("sp0_off", "sp1_off"), ("spo_off",)), ", runs exchanged": (("spo_off", "sp0_off"), ("sp1_off",))}


def anticogging(folder: Path) -> Iterator[Machine]:
    """Turns at about one a second, where the 72 waves come at 72 Hz, and a run up to 150 rad/s, where they are gone."""

    def tables(*names: str) -> dict[str, pd.DataFrame]:
        return {name: pd.read_parquet(folder / f"{name}.parquet") for name in names}

    for label, (train, held) in TURNS.items():
        yield Machine(
            name="brushless motor, one turn a second" + label,
            concealed="cogging (72 a turn)",
            card=BRUSHLESS,
            train=tables(*train),
            heldout=tables(*held),
            score=moving(0.0, 100.0, 1e3),
            unit="mN.m",
            bar=1.5,
            first_look="3.55 -> 0.97" if not label else "",
            derived=cogging_said,
        )
    yield Machine(
        name="brushless motor, accelerated",
        concealed="nothing that can be seen",
        card=BRUSHLESS,
        train=tables("acc_a"),
        heldout=tables("acc_b"),
        score=moving(0.0, 30.0, 1e3),
        unit="mN.m",
        bar=0.6,
        first_look="",
    )


def cogging_said(outcome: Outcome) -> str:
    """Which orders are named, or what is said of cogging instead."""
    found = next((one for one in outcome.diagnosis.findings if one.effect == "cogging"), None)
    if found is None:
        return "cogging is not spoken of"
    if found.answer in ("found", "ambiguous"):
        orders = [one.cycles_per_rev for one in outcome.card.effects if one.id == "cogging"]  # type: ignore[attr-defined]
        return f"{found.answer}: orders {', '.join(f'{order:.4g}' for order in orders)}"
    bound = f" (< {found.visible_from:.2g})" if found.visible_from is not None else ""
    return f"{found.answer}{bound}: {found.statement}"
