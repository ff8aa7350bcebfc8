"""The cases of the net: recordings, card and options of a diagnosis each, made from a seed or read where they lie.

Home cases come from the generator of `cosim prove`. Foreign ones and measured machines lie beside the checkout
(`../shared`) and are left out where they do not; nothing of them is stored here but what was answered.
"""

import subprocess
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path

import pandas as pd

from cosim_studies.proof.cases import cases_of
from cosim_studies.proof.demo import demo_case
from cosim_studies.proof.generator import make_case, to_toml, write_given
from pyfmi_models.card import read_card
from pyfmi_models.export import export_fmu

ROOT = Path(__file__).parents[2]
SHARED = ROOT.parent / "shared"
HOME_SEED = 20261126
KINDS = {"none": 8, "one": 10, "several": 6, "outside": 6}
"""Home cases by what they conceal, in the words of `cosim_studies.proof.cases`."""
SMALL = {"none": 3, "one": 5, "several": 2, "outside": 2}
"""Of these the first are short and slow (30 s at 500 Hz), so that a run of all tests has time for them."""
FOREIGN_SEED = 26112
FOREIGN = ("none", "cogging", "delay", "stribeck", "backlash", "compliance", "gravity_unbalance", "friction_asymmetry")
FOREIGN += ("presliding", "thermal_viscosity", "inertia_variation", "position_friction", "torque_saturation")
FOREIGN += ("encoder_eccentricity", "unknown")
EMPS_CARD = """[mount]
name = "EMPS"
motion = "linear"
inertia = 95.0
[friction]
model = "coulomb"
Fc = 20.0
sigma2 = 200.0
[columns]
tau = "force"
"""


@dataclass(frozen=True)
class NetCase:
    """One diagnosis: how its files are made in a folder, and which of them serve as what."""

    name: str
    group: str
    write: Callable[[Path], None]
    train: tuple[str, ...] = ("train_1.parquet", "train_2.parquet")
    heldout: tuple[str, ...] = ("heldout.parquet",)
    card: str = "card.toml"
    options: tuple[str, ...] = field(default=())
    small: bool = False

    def arguments(self, folder: Path) -> list[str]:
        """Arguments of `cosim diagnose`, but for `--out`."""
        train, heldout = ([str(folder / one) for one in names] for names in (self.train, self.heldout))
        options = [one.format(folder=folder) for one in self.options]
        return [*train, "--heldout", *heldout, "--card", str(folder / self.card), *options, "--quick", "--json"]


def cases(foreign_python: str = "") -> Iterator[NetCase]:
    """All cases whose files can be had here; the foreign generator needs an interpreter that has numba."""
    yield from home()
    yield from special()
    yield from machines(SHARED / "recordings")
    if foreign_python and (SHARED / "foreign" / "make_cases.py").exists():
        yield from foreign(foreign_python)


def home() -> Iterator[NetCase]:
    """Thirty of the own generator: nulls, single effects, several, and effects outside the list."""
    deck = cases_of(HOME_SEED, 120)
    for kind, many in KINDS.items():
        for number, spec in enumerate(islice((one for one in deck if one.kind == kind), many)):
            small = number < SMALL[kind]
            shape = {"duration": 30.0, "rate_hz": 500} if small else {"duration": 60.0, "rate_hz": 1000}
            made = partial(_home, spec.seed, spec.effects, spec.size, shape)
            label = "_".join(spec.effects) or "none"
            yield NetCase(f"home_{kind}_{number}_{label}", "home", made, small=small)


def _home(seed: int, effects: tuple[str, ...], size: float, shape: dict[str, float], folder: Path) -> None:
    write_given(make_case(seed, effects, size, **shape), folder)  # type: ignore[arg-type]


def special() -> Iterator[NetCase]:
    """What has a way of its own: the demo, a speed in place of a position, a linear axis, many recordings."""
    yield NetCase("demo", "special", lambda folder: write_given(demo_case(duration=30.0), folder))
    yield NetCase("no_position", "special", partial(_speed_alone, 11))
    yield NetCase("linear", "special", partial(_linear, 12))
    yield NetCase("black_box", "special", partial(_black_box, 14), options=("--fmu", "{folder}/theirs.fmu"))
    many = tuple(f"part_{k}.parquet" for k in range(16))
    yield NetCase("many_recordings", "special", partial(_many, 13), many[:12], many[12:])


def _black_box(seed: int, folder: Path) -> None:
    """The card's plant as somebody else's FMU, and a card of which every number is off."""
    case = make_case(seed, ["cogging"], duration=40.0, rate_hz=500)
    write_given(case, folder)
    export_fmu(read_card(folder / "card.toml").plant().model(), folder / "theirs.fmu")
    case.card["mount"]["inertia"] *= 1.1
    case.card["friction"]["Fc"] *= 0.95
    (folder / "card.toml").write_text(to_toml(case.card), "utf-8")


def _speed_alone(seed: int, folder: Path) -> None:
    case = make_case(seed, ["friction_asymmetry"], duration=40.0, rate_hz=500)
    write_given(case, folder)
    for path in folder.glob("*.parquet"):
        table = pd.read_parquet(path)
        speed = table["q"].diff().shift(-1).ffill() / table["t"].diff().median()
        table.assign(v=speed).drop(columns=[one for one in ("q", "q_d") if one in table]).to_parquet(path)


def _linear(seed: int, folder: Path) -> None:
    case = make_case(seed, ["cogging"], duration=40.0, rate_hz=500)
    write_given(case, folder)
    case.card["mount"]["motion"] = "linear"  # the same numbers in m, N and kg
    case.card.pop("encoder", None)
    (folder / "card.toml").write_text(to_toml(case.card), "utf-8")


def _many(seed: int, folder: Path) -> None:
    case = make_case(seed, ["cogging", "friction_asymmetry"], duration=80.0, rate_hz=500)
    write_given(case, folder)
    tables = [*case.train, case.heldout]
    parts = [table.iloc[k * len(table) // 6 : (k + 1) * len(table) // 6] for table in tables for k in range(6)]
    for number, part in enumerate(parts[:16]):
        part.reset_index(drop=True).to_parquet(folder / f"part_{number}.parquet")


def machines(recordings: Path) -> Iterator[NetCase]:
    """Measured machines, as the list that lies with each says which of its recordings train and which are held out."""
    for listed in sorted(recordings.glob("*/expected.toml")):
        for one in tomllib.loads(listed.read_text("utf-8"))["case"][:2]:
            names = (*one["train"], *one["heldout"])
            yield NetCase(
                f"{listed.parent.name}_{one['name']}",
                "machines",
                partial(_linked, listed.parent, (*names, one["card"])),
                tuple(one["train"]),
                tuple(one["heldout"]),
                one["card"],
                tuple(one.get("options", ())),
            )
    if (recordings / "emps").exists():
        names = ("estimation.parquet", "validation_pulses.parquet")
        made = partial(_linked, recordings / "emps", names, EMPS_CARD)
        options = ("--columns", "q_d=q_ref")
        yield NetCase("emps", "machines", made, names[:1], names[1:], options=options)


def _linked(source: Path, names: tuple[str, ...], folder: Path | str, card: Path | None = None) -> None:
    text, where = (folder, card) if card else ("", folder)
    assert isinstance(where, Path)
    for name in names:
        (where / name).symlink_to(source / name)
    if text:
        (where / "card.toml").write_text(str(text), "utf-8")


def foreign(python: str) -> Iterator[NetCase]:
    """One case of each of fifteen families of the foreign generator."""
    names = tuple(f"{one}.csv.gz" for one in ("train_1", "train_2", "heldout"))
    for family in FOREIGN:
        made = partial(_foreign, python, family)
        yield NetCase(f"foreign_{family}", "foreign", made, names[:2], names[2:], "model.toml")


def _foreign(python: str, family: str, folder: Path) -> None:
    generator = SHARED / "foreign" / "make_cases.py"
    work = folder / "made"
    words = ["--seed", str(FOREIGN_SEED), "--n-per-family", "1", "--families", family, "--out", str(work)]
    subprocess.run([python, str(generator), *words], check=True, capture_output=True)
    for path in next(work.glob("case_*")).iterdir():
        path.rename(folder / path.name)
