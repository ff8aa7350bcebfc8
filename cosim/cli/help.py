"""What `cosim --help` says beside each verb's own words: its group, and two examples of each.

A verb that another package plugs in has both in its module, as `GROUP` and `EXAMPLES`.
"""

from types import ModuleType

GROUPS = {
    "Diagnose": ("diagnose", "why", "identify", "card", "compare", "show"),
    "Simulate": ("run", "export", "check"),
    "Machine": ("hardware", "doctor"),
}
"""Verbs of this package by what they are for, in the order in which they are listed."""
ORDER = tuple(verb for several in GROUPS.values() for verb in several)
EXAMPLES = {
    "diagnose": (
        "cosim diagnose monday.csv tuesday.csv",
        "cosim diagnose train.csv --heldout check.csv --card axis.toml --columns tau=force --out found",
    ),
    "why": ("cosim why found", "cosim why found cogging"),
    "identify": (
        "cosim identify steps.csv --card axis.toml",
        "cosim identify swing.csv --card axis.toml --free Fc --free inertia --out numbers",
        "cosim identify --fmu theirs.fmu --free Motor.J Motor.Fc run1.csv run2.csv --heldout run3.csv",
    ),
    "card": ("cosim card monday.csv tuesday.csv --out axis.toml", "cosim card run.csv --motion linear --inertia 12"),
    "compare": ("cosim compare monday.csv tuesday.csv", "cosim compare run_1 measured.csv --out difference"),
    "show": ("cosim show recording.csv", "cosim show cogging"),
    "run": ("cosim run sidereal", "cosim run sidereal --set controller.kp=400 --stop 5 --out tuned"),
    "export": (
        "cosim export paper_mount",
        "cosim export axis.toml --fmi 3 --ssp --out fmus",
        "cosim export sidereal --as-fmu --out fmus",
    ),
    "check": ("cosim check plant.fmu", "cosim check plant.fmu --json"),
    "hardware": ("cosim hardware check machine.toml", "cosim hardware run --help"),
    "doctor": ("cosim doctor", "cosim doctor --json"),
}
"""Command lines of each verb: the plainest, one with what is asked for most, one of another use where there is one."""


def group_of(verb: str, module: ModuleType) -> str:
    """The group that a verb is listed in."""
    own = next((group for group, verbs in GROUPS.items() if verb in verbs), None)
    return own or str(getattr(module, "GROUP", "Other"))


def epilog(verb: str, module: ModuleType) -> str:
    """The examples, as a paragraph each: what is printed below the options."""
    examples: tuple[str, ...] = EXAMPLES[verb] if verb in EXAMPLES else getattr(module, "EXAMPLES", ())
    return "\n\n".join(["Examples:", *(f"  {one}" for one in examples)])
