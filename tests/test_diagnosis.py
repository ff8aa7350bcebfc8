"""The diagnosis names what is missing, says "none" when nothing is, and proves it on data it never saw."""

import hashlib
import json
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import casadi as ca
import jsonschema
import numpy as np
import pyarrow.parquet as pq
import pytest
from benchmarks.diagnosis import null_case
from friction_laws import EXAMPLES, WITH_MEMORY, numeric
from test_prepare import recorded, wander

from cosim.cli import main
from cosim.data.recording import Recording
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.protocol import Structures, judge, traces
from cosim.estimation.blocks import Blocks
from cosim.estimation.equations import _late
from cosim.estimation.fit import fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import prepare
from cosim.support.errors import InputError
from cosim_studies.proof.demo import demo_case
from cosim_studies.proof.generator import make_case, to_toml, write_case
from pyfmi_models.card import Card, parse_card, read_card
from pyfmi_models.effects import ActuatorLag, Delay, FrictionAsymmetry
from pyfmi_models.effects.thermal_viscosity import RubbedViscosity
from pyfmi_models.friction import Coulomb, FrictionLaw
from pyfmi_models.model import Recorded, parameters_of
from pyfmi_models.mount import Axis, Mount


def axis(inertia: float = 5.0, Fc: float = 2.0, effects: tuple = ()) -> Mount:
    return Mount(name="axis", axis=Axis(inertia=inertia), friction=Coulomb(Fc=Fc, sigma2=1.0), effects=effects)


def loaded(case: object, folder: Path) -> tuple[list[Recording], Recording, Card]:
    write_case(case, folder)
    train = [Recording.read(folder / f"train_{k}.parquet") for k in (1, 2)]
    return train, Recording.read(folder / "heldout.parquet"), parse_card(to_toml(case.card), "card.toml")


def walked(law: FrictionLaw, v: np.ndarray, dt: float) -> np.ndarray:
    """States at each row: the law's own step at the speed of its middle, at the level that a straight one amounts to.

    That level lies coth(x/2) - 2/x of the way from the middle to the end, x how often a step would build it up.
    """
    x, speed, level = ca.SX.sym("x", len(law.states())), ca.SX.sym("v"), ca.SX.sym("level")
    step = ca.Function("step", [x, speed, level], [law.advance(x, speed, level, dt), law.rate(0 * x, speed, level)])
    middle, states = (v[1:] + v[:-1]) / 2, [np.zeros(len(law.states()))]
    for now, end in zip(middle, v[1:], strict=True):
        here, there = float(law.level(now)), float(law.level(end))
        times = abs(step(states[-1], now, here)[1].full().sum()) * dt / here
        late = times / 6 if times < 1e-3 else 1 / np.tanh(times / 2) - 2 / times
        states.append(step(states[-1], now, here + (there - here) * late)[0].full().ravel())
    return np.array(states).T


class TestInverse:
    @pytest.mark.parametrize("law", [law for law in EXAMPLES.values() if law.key != "none"], ids=lambda law: law.key)
    def test_derivatives_equal_finite_differences(self, law: FrictionLaw) -> None:
        t, q, _v, a = wander(10.0)
        mount = replace(read_card("paper_mount").plant(), friction=law)
        extra = (FrictionAsymmetry(level_asymmetry=0.1, viscous_asymmetry=0.1), Delay(delay_ms=2.0))
        mount = replace(mount, effects=(*extra, ActuatorLag(time_constant_ms=3.0)))
        free = tuple(v.name for v in mount.parameters() if not v.name.endswith(("limit", "smoothing", "delta")))
        inverse = Inverse(mount, free)
        pieces = prepare([recorded(a, t, q)], 20.0).pieces
        values = np.array([dict(zip(inverse.names, inverse.start, strict=True))[name] for name in free])
        _, slopes = stacked(inverse, pieces, values)
        for column in range(len(free)):
            step = np.zeros_like(values)
            step[column] = 1e-5 * abs(values[column])
            up, down = (stacked(inverse, pieces, values + s * step)[0] for s in (1, -1))
            change = (up - down) / (2 * step[column])
            assert np.abs(change - slopes[:, column]).max() < 5e-4 * np.abs(change).max() + 1e-9, free[column]

    @pytest.mark.parametrize("law", WITH_MEMORY.values(), ids=WITH_MEMORY.keys())
    def test_friction_states_follow_the_recorded_speed_by_the_laws_own_step(self, law: FrictionLaw) -> None:
        t, q, _v, a = wander()
        mount = replace(read_card("paper_mount").plant(), friction=law)
        piece = prepare([recorded(a, t, q)], 20.0).pieces[0]
        inverse = Inverse(mount, ())
        states = inverse._states(piece, inverse._equations.columns(piece), inverse.start)[0]
        np.testing.assert_allclose(states, walked(law, piece.v, piece.dt), rtol=1e-9, atol=1e-9)

    @pytest.mark.parametrize("times", [1e-3, 0.0099, 0.0101, 0.3, 3.0, 40.0, 1e4])
    def test_a_level_that_goes_straight_counts_as_one_that_is_constant_but_later(self, times: float) -> None:
        """The exact solution of z' = times (level(t) - z) over one second, with a level from 1 to 3."""
        start, decay = -0.7, np.exp(-times)
        exact = 3 - 2 / times + (start - 1 + 2 / times) * decay
        assert (2 + float(_late(times))) * (1 - decay) + start * decay == pytest.approx(exact, abs=1e-10)

    @pytest.mark.parametrize("law", WITH_MEMORY.values(), ids=WITH_MEMORY.keys())
    def test_friction_states_are_as_near_to_those_of_fine_steps_as_with_the_level_of_the_middle(
        self, law: FrictionLaw
    ) -> None:
        t, q, _v, a = wander()
        mount = replace(read_card("paper_mount").plant(), friction=law)
        piece = prepare([recorded(a, t, q)], 20.0).pieces[0]
        inverse = Inverse(mount, ())
        states = inverse._states(piece, inverse._equations.columns(piece), inverse.start)[0]
        rows = np.arange(len(piece.v) - 1)
        fine = np.interp((np.arange(50 * len(rows)) + 0.5) / 50, np.arange(len(piece.v)), piece.v)
        exact = numeric(law).along(fine, piece.dt / 50)[:, 49::50]
        middle = numeric(law).along((piece.v[1:] + piece.v[:-1]) / 2, piece.dt)
        wrong, rough = (float(np.sqrt(np.mean((one - exact) ** 2))) for one in (states[:, 1:], middle))
        assert wrong < min(0.06, 1.001 * rough)

    @pytest.mark.parametrize(("given", "low"), [(600.0, 2.0), (0.5, 0.5)])
    def test_a_warm_up_that_the_card_gives_is_not_moved_by_a_bound(self, given: float, low: float) -> None:
        effect = RubbedViscosity(viscous_per_degC=0.0, heat_degC_per_rad=1.0, cooling_s=given)
        (variable,) = [one for one in parameters_of(effect) if one.name == "cooling_s"]
        assert effect.fit_bounds(variable, Recorded(speed=1.0, torque=1.0)) == (low, variable.high)

    def test_a_fit_recovers_what_made_the_torque(self) -> None:
        t, q, v, a = wander()
        tau = 6.2 * a + 2.4 * np.sign(v) + 0.7 * v
        prepared = prepare([recorded(tau, t, q)], 30.0)
        moving = (np.abs(prepared.stacked("v")) > 0.05).astype(float)
        found = fit(axis(), prepared.pieces, moving).parameters()
        assert found["axis.inertia"] == pytest.approx(6.2, rel=2e-3)
        assert found["friction.Fc"] == pytest.approx(2.4, rel=2e-2)
        assert found["friction.sigma2"] == pytest.approx(0.7, rel=0.1)


class TestEvidence:
    def test_blocks_hold_every_kept_row_once_and_know_their_recording(self) -> None:
        t, q, _v, a = wander(60.0)
        prepared = prepare([recorded(a, t, q), recorded(a, t, q, "two")], 30.0)
        blocks = Blocks.of(prepared)
        rows = np.concatenate(blocks.rows)
        np.testing.assert_array_equal(np.sort(rows), np.arange(len(prepared.recording_of)))
        assert all(set(prepared.recording_of[r]) == {o} for r, o in zip(blocks.rows, blocks.recording, strict=True))

    def test_several_recordings_may_be_held_out(self) -> None:
        t, q, v, a = wander()
        pair = [recorded(5 * a + 2 * np.sign(v) + off, t, q, name) for off, name in ((0.3, "one"), (-0.3, "two"))]
        models = Structures(axis(), axis(), axis())
        judged = judge(pair, models, 30.0)
        each = [judge([one], models, 30.0).before_rms for one in pair]
        assert judged.name == "one, two"
        assert judged.before_rms == pytest.approx(np.sqrt(np.mean(np.square(each))), rel=1e-6)
        assert [trace.heldout for trace in traces(pair[:1], pair, models)] == [False, True, True]


class TestAnswers:
    @pytest.mark.parametrize(("seed", "noise"), [(1, 0.0), (2, 3e-7)])
    def test_the_cards_own_physics_with_other_numbers_is_nothing_missing(self, seed: int, noise: float) -> None:
        assert null_case(seed, noise).verdict == ()

    def test_a_null_of_a_foreign_friction_law_is_nothing_missing(self, tmp_path: Path) -> None:
        train, held, card = loaded(make_case(203, []), tmp_path)
        assert diagnose(train, [held], card).diagnosis.verdict == ()

    @pytest.mark.parametrize(("effect", "seed"), [("torque_offset", 200), ("delay", 103), ("gravity_unbalance", 103)])
    def test_a_concealed_effect_is_named_and_proven(self, effect: str, seed: int, tmp_path: Path) -> None:
        case = make_case(seed, [effect])
        train, held, card = loaded(case, tmp_path)
        found = diagnose(train, [held], card).diagnosis
        assert found.verdict == (effect,)
        assert found.heldout.after_rms < 0.5 * found.heldout.before_rms
        assert found.heldout.confidence_interval[0] > 0


DATA = Path(__file__).resolve().parents[2] / "shared" / "recordings" / "emps"


@pytest.mark.skipif(not DATA.exists(), reason="the measured recordings are not beside this checkout")
def test_a_measured_axis_has_direction_dependent_friction_and_a_delay() -> None:
    card = read_card("emps")
    train, held = (Recording.read(DATA / f"{n}.parquet", card.columns) for n in ("estimation", "validation_pulses"))
    found = diagnose([train], [held], card).diagnosis
    delay = next(finding for finding in found.findings if finding.effect == "delay")
    assert {"friction_asymmetry", "delay"} <= set(found.verdict)
    assert 0.4 <= delay.parameters["delay_ms"] <= 0.9
    assert found.heldout.sliding["after_rms"] < 2.3 < 4.2 < found.heldout.sliding["before_rms"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("night")
    write_case(demo_case(), folder)
    return folder


class TestCommand:
    def arguments(self, folder: Path, out: Path, *more: str) -> list[str]:
        train = [str(folder / "train_1.parquet"), str(folder / "train_2.parquet")]
        held = ["--heldout", str(folder / "heldout.parquet")]
        return ["diagnose", *train, *held, "--card", str(folder / "card.toml"), "--out", str(out), *more]

    def run(self, arguments: list[str]) -> int:
        with pytest.raises(SystemExit) as left:
            main(arguments)
        return int(left.value.code or 0)

    def test_files_json_and_improved_card(
        self, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        out = tmp_path / "out"
        assert self.run(self.arguments(folder, out, "--json")) == 0
        printed = json.loads(capsys.readouterr().out)
        assert printed == json.loads((out / "diagnosis.json").read_text())
        schema = json.loads((files("cosim") / "diagnosis" / "schema.json").read_text())
        jsonschema.Draft202012Validator(schema).validate(printed)
        assert sorted(printed["verdict"]) == ["cogging", "friction_asymmetry"]
        assert printed["heldout"]["after_rms"] < 0.3 * printed["heldout"]["before_rms"]
        first = printed["effects"][0]
        assert first["answer"] == "found"
        assert first["standard_errors"]
        assert first["where"]["axis"]
        improved = read_card(out / "card.toml")
        assert {effect.id for effect in improved.effects} == {"cogging", "friction_asymmetry"}
        assert improved.origin["recordings"][0]["sha256"]
        rows = pq.read_table(out / "missing_torque.parquet")
        assert rows.num_rows == sum(
            pq.read_table(folder / f).num_rows for f in ("train_1.parquet", "train_2.parquet", "heldout.parquet")
        )
        assert "<html" in (out / "report.html").read_text()
        assert len(list(out.glob("*.fmu"))) == 2
        assert self.run(self.arguments(folder, out)) == 2
        assert "exists already" in capsys.readouterr().err

    def test_quick_gives_the_same_answer_and_the_card_alone(
        self, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        out = tmp_path / "quick"
        assert self.run(self.arguments(folder, out, "--quick", "--propose", str(tmp_path / "proposed"))) == 0
        printed, said = capsys.readouterr()
        assert "Nothing to propose: nothing is left without a name." in said
        assert not (tmp_path / "proposed").exists()
        assert {path.name for path in out.iterdir()} == {"diagnosis.json", "card.toml"}
        assert "Wrote diagnosis.json card.toml" in printed
        assert "report.html" not in printed
        told = json.loads((out / "diagnosis.json").read_text())
        schema = json.loads((files("cosim") / "diagnosis" / "schema.json").read_text())
        jsonschema.Draft202012Validator(schema).validate(told)
        assert sorted(told["verdict"]) == ["cogging", "friction_asymmetry"]
        assert told["provenance"]["command"].endswith(f"--propose {tmp_path / 'proposed'} --quick")
        assert told["provenance"]["card"]["sha256"] == hashlib.sha256((folder / "card.toml").read_bytes()).hexdigest()
        assert not {"fmu", "scenario"} & (set(told["improved"]) | set(told["next_experiment"]))
        assert {effect.id for effect in read_card(out / "card.toml").effects} == {"cogging", "friction_asymmetry"}
        assert self.run(self.arguments(folder, out, "--quick")) == 2
        assert "exists already" in capsys.readouterr().err

    def spoiled(self, folder: Path, tmp_path: Path, column: str, change: object) -> list[str]:
        import pandas as pd

        frame = pd.read_parquet(folder / "train_1.parquet")
        frame[column] = change(frame[column].to_numpy().copy())  # type: ignore[operator]
        frame.to_parquet(tmp_path / "spoiled.parquet")
        arguments = self.arguments(folder, tmp_path / "out")
        arguments[1] = str(tmp_path / "spoiled.parquet")
        return arguments

    @pytest.mark.parametrize(
        ("column", "change", "said"),
        [
            ("tau", lambda x: np.where(np.arange(len(x)) == 5, np.nan, x), "tau"),
            ("q", lambda x: np.zeros_like(x), "q"),
            ("t", lambda x: x[::-1], "backwards"),
            ("q", np.degrees, "--units q=deg"),
        ],
    )
    def test_bad_recordings_get_one_sentence_and_leave_nothing(
        self, folder: Path, tmp_path: Path, column: str, change: object, said: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert self.run(self.spoiled(folder, tmp_path, column, change)) == 2
        error = capsys.readouterr().err.strip()
        assert said in error
        assert "Traceback" not in error
        assert not (tmp_path / "out").exists()

    def test_several_columns_may_follow_one_option(self, folder: Path, tmp_path: Path) -> None:
        given = self.arguments(folder, tmp_path / "out", "--columns", "tau=torque", "q=angle")
        assert self.run(given) == 2  # the file has no such columns, which is what the sentence is about

    def test_the_held_out_recording_must_not_be_fitted(
        self, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        given = self.arguments(folder, tmp_path / "out")
        given[2] = str(folder / "heldout.parquet")
        assert self.run(given) == 2
        assert "held out" in capsys.readouterr().err


def test_a_card_with_physics_that_the_inverse_model_lacks_is_refused() -> None:
    card = parse_card(
        '[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\n'
        '[[effects]]\neffect = "quadratic_drag"\ncoefficient = 1.0\n'
        '[[effects]]\neffect = "friction_wander"\nstd = 0.1\n',
        "card.toml",
    )
    t, q, _, a = wander()
    with pytest.raises(InputError) as caught:
        diagnose([recorded(2 * a, t, q)], [recorded(2 * a, t, q, "other")], card)
    assert "The card holds friction_wander, which a diagnosis cannot take into account yet" in str(caught.value)


def test_diagnosis_is_not_imported_by_a_run() -> None:
    heavy = "{'casadi', 'matplotlib', 'cosim.diagnosis', 'cosim.estimation'}"
    code = f"import sys, cosim.cli, cosim.master.simulate; assert not {heavy} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
