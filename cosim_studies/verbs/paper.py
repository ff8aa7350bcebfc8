"""`cosim paper`: the paper's experiments to tables, figures and a page."""

from typing import Annotated

import typer

from cosim.cli.options import Force, Out, default_out
from cosim.support.terminal import put, put_json, say, stage

GROUP = "Prove"
EXAMPLES = ("cosim paper --out tables", "cosim paper --out tables --force")


def paper(
    out: Out = None,
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Seeds for the conditions with noise.", max=10_000)] = 20,
    seed: Annotated[int, typer.Option("--seed", min=0, help="The first seed.")] = 1000,
    full: Annotated[
        bool, typer.Option("--full", help="Compare better controllers too: ten minutes on two cores.")
    ] = False,
    design_seed: Annotated[
        int, typer.Option("--design-seed", min=0, help="First of two seeds on which --full chooses a design.")
    ] = 500,
    as_json: Annotated[bool, typer.Option("--json", help="Print table4.json.")] = False,
    force: Force = False,
) -> None:
    """Run every tracking experiment of the paper on FMUs; write tables and figures beside the published numbers."""
    out = out or default_out("paper")
    from cosim_studies.paper.comparison import Plan
    from cosim_studies.paper.report import reproduce

    command = f"cosim paper --out {out} --seeds {seeds} --seed {seed}"
    tested = tuple(range(seed, seed + seeds))
    plan = Plan(seeds=tested, design_seeds=tuple(range(design_seed, design_seed + 2))) if full else None
    if plan:
        command += f" --full --design-seed {design_seed}"
    with stage("the paper's tracking experiments") as progress:
        done = reproduce(out, tested, command, plan, force, progress)
    if as_json:
        put_json(done.table)
    else:
        put("\n".join(map(str, done.files)))
    say(f"read {out / 'README.md'}")
