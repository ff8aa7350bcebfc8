"""`cosim doctor`: what is installed, what works here, and what the caches hold."""

from typing import Annotated

import typer

from cosim.support.terminal import put, put_json


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False,
) -> None:
    """Say what is installed, what works on this computer, which extras there are, and how large the caches are."""
    from cosim.api.doctor import doctor as look

    found = look()
    put_json(found.as_json()) if as_json else put(str(found))
