"""Docstrings as HTML: paragraphs, and indented formulas set so that they can be read."""

import re
import textwrap
from html import escape

_LETTERS = "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi pi rho sigma tau phi psi omega"
_GREEK = dict(zip(_LETTERS.split(), "αβγδεζηθκλμνξπρστφψω", strict=True))
_SIGNS = {"<=": "≤", ">=": "≥", "''": "″", "'": "′", "*": "·", " - ": " − ", "(-": "(−", "+-": "±", "...": "…"}


def prose(text: str) -> str:
    """Paragraphs of a docstring as HTML; those that are indented are formulas, a word in backticks is code."""
    return "\n".join(_paragraph(paragraph) for paragraph in re.split(r"\n\s*\n", text.strip("\n")) if paragraph.strip())


def _paragraph(paragraph: str) -> str:
    if paragraph.startswith(" "):
        return f"<pre>{formula(textwrap.dedent(paragraph).rstrip())}</pre>"
    plain, *coded = paragraph.strip().split("`")
    parts = [_words(plain)]
    for k, part in enumerate(coded):
        parts.append(_words(part) if k % 2 else f"<code>{escape(part, quote=False)}</code>")
    return f"<p>{''.join(parts)}</p>"


def _words(text: str) -> str:
    """Set a Greek letter with a number behind it, `sigma0`, as a letter with an index; other words are words."""
    numbered = rf"(?<!\w)({'|'.join(_GREEK)})(\d)(?!\w)"
    return re.sub(numbered, lambda m: _GREEK[m[1]] + "₀₁₂₃₄₅₆₇₈₉"[int(m[2])], escape(text, quote=False))


def formula(text: str) -> str:
    """Set a formula of plain text as HTML: Greek letters, indices, powers and signs.

    `sigma0` is σ with the index 0, `tau_f` τ with f, `|v/Vs|^delta` has the power δ; other names stay as they are.
    """
    found = _signs(text)
    found = re.sub(r"(?<![A-Za-z0-9])([A-Za-z]{1,7})(\d+)(?![\w.])", r"\1<sub>\2</sub>", found)
    found = re.sub(r"(?<!\w)([A-Za-z]|tau|dF)_([A-Za-z]{1,3}|\d)(?!\w)", r"\1<sub>\2</sub>", found)
    found = re.sub(r"\^(-?\w+|\([^()]*\))", r"<sup>\1</sup>", found)
    return re.sub(rf"(?<![A-Za-z])(d?)({'|'.join(_GREEK)})(?![A-Za-z])", lambda m: m[1] + _GREEK[m[2]], found)


def _signs(text: str) -> str:
    found = text
    for plain, sign in _SIGNS.items():
        found = found.replace(plain, sign)
    return escape(found, quote=False)
