"""What `cosim --help` says beside each verb's own words: its group, and two examples of each."""

GROUPS = {
    "Diagnose": ("demo", "diagnose", "why", "identify", "card", "compare", "investigate", "show"),
    "Simulate": ("run", "export", "sweep", "check"),
    "Machine": ("hardware", "serve", "doctor"),
    "Prove": ("prove", "paper"),
}
"""Verbs by what they are for, in the order in which they are listed."""
EXAMPLES = {
    "demo": ("cosim demo", "cosim demo --out mine --force"),
    "diagnose": (
        "cosim diagnose monday.csv tuesday.csv",
        "cosim diagnose train.csv --heldout check.csv --card axis.toml --columns tau=force --out found",
    ),
    "why": ("cosim why found", "cosim why found cogging"),
    "identify": (
        "cosim identify steps.csv --card axis.toml",
        "cosim identify swing.csv --card axis.toml --free Fc --free inertia --out numbers",
    ),
    "card": ("cosim card monday.csv tuesday.csv --out axis.toml", "cosim card run.csv --motion linear --inertia 12"),
    "compare": ("cosim compare monday.csv tuesday.csv", "cosim compare run_1 measured.csv --out difference"),
    "investigate": (
        "cosim investigate sidereal --card paper_mount --machine axis.toml --budget 120s",
        "cosim investigate axis_scenario.toml --card axis.toml --limits speed=0.2 torque=20",
    ),
    "show": ("cosim show recording.csv", "cosim show cogging"),
    "run": ("cosim run sidereal", "cosim run sidereal --set controller.kp=400 --stop 5 --out tuned"),
    "export": ("cosim export paper_mount", "cosim export axis.toml --fmi 3 --ssp --out fmus"),
    "sweep": ("cosim sweep gains.toml", "cosim sweep gains.toml --workers 4 --out gains"),
    "check": ("cosim check plant.fmu", "cosim check plant.fmu --json"),
    "hardware": ("cosim hardware check machine.toml", "cosim hardware run --help"),
    "serve": ("cosim serve", "cosim serve --port 8123 --no-browser"),
    "doctor": ("cosim doctor", "cosim doctor --json"),
    "prove": ("cosim prove --cases 10 --out proof", "cosim prove --seed 7 --workers 2"),
    "paper": ("cosim paper --out tables", "cosim paper --out tables --force"),
}
"""Two command lines of each verb: the plainest, and one with what is asked for most."""


def group_of(verb: str) -> str:
    """The group that a verb is listed in."""
    return next((group for group, verbs in GROUPS.items() if verb in verbs), "Other")


def listed(verbs: list[str]) -> list[str]:
    """Verbs in the order of their groups."""
    order = [verb for several in GROUPS.values() for verb in several]
    return sorted(verbs, key=lambda verb: order.index(verb) if verb in order else len(order))


def epilog(verb: str) -> str:
    """The examples, as a paragraph each: what is printed below the options."""
    return "\n\n".join(["Examples:", *(f"  {one}" for one in EXAMPLES.get(verb, ()))])
