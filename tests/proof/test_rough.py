"""Rough machines: what is concealed is not quite its equation, and nulls are rough as well."""

import numpy as np
import pytest

from cosim_studies.proof.generator import make_case


def missing(effects: list[str], rough: bool) -> np.ndarray:
    case = make_case(11, effects, machine="robot joint", duration=12.0, decoy_columns=False, rough=rough)
    return case.oracle[0]["extra"].to_numpy()


def test_a_concealed_torque_is_off_its_equation_by_some_per_cent() -> None:
    case = make_case(11, ["gravity_unbalance"], machine="robot joint", duration=12.0, decoy_columns=False, rough=True)
    weight, hidden = case.truth["effects"][0]["parameters"], case.oracle[0]
    equation = weight["mgl"] * np.sin(hidden["angle"] + weight["phase"])
    off = float(np.sqrt(np.mean((hidden["extra"] - equation) ** 2) / np.mean(equation**2)))
    assert 0.02 < off < 0.3
    assert missing([], rough=True) == pytest.approx(0.0), "a null has no torque of its own"


def test_a_rough_null_has_other_friction_than_a_smooth_one() -> None:
    smooth, rough = (
        make_case(11, [], machine="robot joint", duration=12.0, decoy_columns=False, rough=one) for one in (False, True)
    )
    tau = [case.train[0]["tau"].to_numpy() for case in (smooth, rough)]
    off = float(np.sqrt(np.mean((tau[1] - tau[0]) ** 2) / np.mean(tau[0] ** 2)))
    assert 0.001 < off < 0.2
