"""What `cosim show` tells of a blind benchmark."""

from pathlib import Path

from cosim.api.show_results import Shown, document_of, rounded
from cosim.support.plain import Json


def of_proof(path: Path) -> Shown:
    """Tell the scores of a blind benchmark."""
    document = document_of(path, "played", "cases", "scores", "command")
    facts: dict[str, Json] = {
        "blind benchmark": str(path),
        "cases": f"{document['played']} of {document['cases']}, seed {document['seed']}",
        "made by": str(document["command"]),
    }
    page = path.with_name("README.md")
    facts |= {"read": str(page)} if page.is_file() else {}
    names = {"score": "title", "value": "value", "from": "low", "to": "high", "cases": "n", "target": "asked"}
    rows = [{name: rounded(one.get(key)) for name, key in names.items()} for one in document["scores"]]
    return facts, {"scores, with 95 % ranges": rows}
