"""The errors of mutations.py in a C file: one token of one line, as this house writes C (blanks around operators)."""

import re
from collections.abc import Iterator

from mutations import COMMUTING, SCALES, Site, changed

TURNED = {"<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",)}
COMPUTED = {"+": "-", "-": "+", "*": "/", "/": "*", "%": "*", "&": "|", "+=": "-=", "-=": "+="}
WORDS = {"&&": "||", "||": "&&", "true": "false", "false": "true"}
NOT_CODE = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'|^[ \t]*#.*?$|//.*?$', re.DOTALL | re.MULTILINE)
"""Comments, texts, and lines of the preprocessor."""
SIZED = re.compile(r"^ *(?:static |const |extern |struct )*\w+ \**\w+(?:\[\w+\])+(?= =|;|,)")
"""What declares an array: where there is room for one more, nobody sees it."""
TOKENS = re.compile(
    r"(?<= )(?P<comparison><=|>=|==|!=|<|>)(?= )"
    r"|(?<= )(?P<operator>\+=|-=|[-+*/%&])(?= )"
    r"|(?<= )(?P<truth>&&|\|\|)(?= )|\b(?P<word>true|false)\b"
    r"|(?<=[(=,?: ])(?P<sign>-(?=[\w(])|!(?=[\w(]))"
    r"|(?<=\[)(?P<index>\w+)(?=\])"
    r"|(?<![\w.\[])(?P<number>\d+\.\d+(?:e-?\d+)?|\d+e-?\d+|\d+)(?![\w.\]])"
    r"|\b(?=(?P<swap>\w+\((?P<first>[\w.>-]+), (?P<second>[\w.>-]+)(?=[,)])))\w+\("
    r"|(?<=\n)(?=(?P<call>[ ]{4,}\w+\([^;{}\n]*\);(?=\n)))"
)


def sites(source: str) -> list[Site]:
    """Every place of a file where an error can be planted, in the order of the text."""
    return [site for site, _, _ in _sites(source)]


def mutated(source: str, number: int) -> tuple[Site, str]:
    """Return a site by its number, and the text of the file with that error."""
    site, (first, last), other = list(_sites(source))[number]
    return site, source[:first] + other + source[last:]


def _sites(source: str) -> Iterator[tuple[Site, tuple[int, int], str]]:
    code = NOT_CODE.sub(lambda found: re.sub(r"[^\n]", "_", found[0]), source)
    for found in TOKENS.finditer(code):
        kind = found.lastgroup or ""
        text, line = found[kind], code.count("\n", 0, found.start(kind) + (kind == "call")) + 1
        sized = SIZED.match(code[code.rfind("\n", 0, found.start(kind)) + 1 :]) if kind == "index" else None
        if sized and code.rfind("\n", 0, found.start(kind)) + 1 + sized.end() > found.start(kind):
            continue
        for name, other in _others(kind, text, found):
            yield (
                Site(line, name, f"{_around(source, line)}: {text.strip()} -> {other or 'left out'}"),
                found.span(kind),
                other,
            )


def _others(kind: str, text: str, found: re.Match[str]) -> Iterator[tuple[str, str]]:
    """What a token becomes, each with its kind of error."""
    if kind == "comparison":
        yield from ((kind, one) for one in TURNED[text])
    elif kind == "operator":
        yield kind, COMPUTED[text]
    elif kind in ("truth", "word"):
        yield "truth", WORDS[text]
    elif kind == "call" and text.strip().startswith("free("):
        return  # memory that is not given back is seen by no test
    elif kind in ("sign", "call"):
        yield kind, ""
    elif kind == "index":
        yield kind, str(int(text) + 1) if text.isdigit() else f"{text} - 1"
    elif kind == "number":
        value = int(text) if text.isdigit() else float(text)
        yield kind, repr(changed(value))
        if value in SCALES:
            yield "unit", repr(value * 1000)
    elif kind == "swap" and found["first"] != found["second"] and text.split("(")[0] not in COMMUTING:
        yield kind, text.replace(f"({found['first']}, {found['second']}", f"({found['second']}, {found['first']}")


def _around(source: str, line: int) -> str:
    text = source.split("\n")[line - 1].strip().replace("|", "\\|")
    return text if len(text) <= 60 else f"{text[:57]}..."
