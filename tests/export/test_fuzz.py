"""Random calls of the C interface: a sample of what bench/fuzz.py does for long and under sanitizers."""

import fuzz_models
import pytest
from fuzz_calls import functions

from pyfmi_models.export.build import compile_shared, sources_of
from pyfmi_models.export.platforms import PLATFORMS, host

EXAMPLES = 25


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", fuzz_models.MODELS)
def test_no_call_crashes_and_every_answer_keeps_the_rules(name, fmi, tmp_path):
    machine, generated = PLATFORMS[host()], fuzz_models.code_of(name)
    library = compile_shared(sources_of(generated), f"played{machine.suffix}", machine.target)
    facts = fuzz_models.facts_of(generated, library, fmi, shrink=True)
    played = fuzz_models.play(facts, tmp_path, EXAMPLES, seed=20, timeout=120)
    assert played.code == 0, played.reason
    assert played.counts["calls"] > played.counts["granted"] > 300
    assert len({*functions(fmi)} - {*played.counts["functions"]}) <= len(functions(fmi)) / 3
