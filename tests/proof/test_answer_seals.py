"""An answer of a proof cannot be changed without breaking its seal."""

import json
from pathlib import Path

import pytest

from cosim.support.errors import ProofError
from cosim_studies.proof.seal import Seals


def test_an_answer_cannot_be_changed_without_breaking_its_seal(tmp_path: Path) -> None:
    row = {"run": 0, "answer": {"verdict": ["cogging"], "share": 0.1 + 0.2, "gap": float("nan")}, "status": "ok"}
    Seals(tmp_path / "seals.jsonl").write_answer(row)
    seals = Seals(tmp_path / "seals.jsonl")
    seals.check_answers([json.loads(json.dumps(row))])
    for change in ({"answer": []}, {"status": "failed"}, {"answer": row["answer"] | {"verdict": []}}):
        with pytest.raises(ProofError, match="Case 0: its answer is not the answer that was sealed; remove its line"):
            seals.check_answers([row | change])
    with pytest.raises(ProofError, match="Case 1: its answer has no seal"):
        seals.check_answers([row | {"run": 1}])
