"""What one more recording would tell, and how to take it."""

from collections.abc import Iterator

from cosim.diagnosis.report import words
from cosim.diagnosis.report.motion import motion
from cosim.diagnosis.report.quantities import Scales
from cosim.diagnosis.result import Diagnosis

SMALL = 0.1
"""A difference below this share of the noise takes longer to show than a recording lasts."""


def next_experiment(diagnosis: Diagnosis, scales: Scales) -> dict[str, object] | None:
    """Return its sentences and what to type; None where nothing is open."""
    plan = diagnosis.next_experiment
    if not plan:
        return None
    titles = {finding.effect: words.lowered(finding.title) for finding in diagnosis.findings}
    names = [titles.get(str(name), str(name)) for name in plan.get("separates", ())]
    said = [words.started(words.closed(str(plan.get("description", ""))))]
    if how := motion(plan.get("set_point", {}), scales):
        said.append(words.closed(f"That is {how}, measured from the middle of what was visited"))
    said.append(f"It separates {' from '.join(names)}." if len(names) > 1 else "")
    gap = float(plan.get("expected_difference") or 0.0)
    said.append(_difference(gap, diagnosis.heldout.floor_rms, scales) if gap and len(names) > 1 else "")
    return {"sentences": [text for text in said if text], "steps": list(_steps(diagnosis))}


def _difference(gap: float, noise: float, scales: Scales) -> str:
    text = scales.torque.text(gap)
    if gap >= SMALL * noise:
        return f"They will then differ by {text}."
    return (
        f"They will then differ by only {text}, far below the noise: where the axis may move further or faster than in "
        "these recordings, record that instead."
    )


def _steps(diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
    """What to type: try the motion on the model, then diagnose again with the new recording."""
    plan, command = diagnosis.next_experiment, str(diagnosis.provenance.get("command", ""))
    if plan.get("command"):
        yield "Then", str(plan["command"])
    if plan.get("scenario"):
        yield "Try it on the model first", f"cosim run {plan['scenario']} --out next"
    if " --" in command:
        train, options = command.split(" --", 1)
        yield "With the new recording", f"{train} new_recording.parquet --{options} --force"
