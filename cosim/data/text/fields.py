"""Fields of a line of text: numbers with a point or a comma, time stamps, words."""

import csv
import re

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.IGNORECASE)
CLOCK = r"\d{1,2}:\d{2}(:\d{2}([.,;:]\d+)?)?( ?[AaPp][Mm])?"
DATE = r"(\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[./-]\d{1,2}[./-]\d{2,4})"
STAMP = re.compile(rf"({DATE}([T ]{CLOCK})?|{CLOCK})(Z| ?[+-]\d{{2}}:?\d{{2}})?")
NOTHING = (
    "", "#N/A", "#N/A N/A", "#NA", "-1.#IND", "-1.#QNAN", "-NaN", "-nan", "1.#IND", "1.#QNAN", "N/A", "NA", "NULL",
    "NaN", "n/a", "nan", "null", "-", "--", "---", "n.a.", "#NV", "#VALUE!", "#DIV/0!", "NaN(ind)", "-nan(ind)", "None",
)  # fmt: skip
"""What stands for no value: Arrow's own words, dashes, and those of spreadsheets and C libraries."""


def split(line: str, separator: str) -> list[str]:
    """Return the fields of a line, without quotes and blanks around them; a blank stands for any run of blanks."""
    if separator == " ":
        return line.split()
    if '"' in line:
        return [field.strip() for field in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    return [field.strip() for field in line.split(separator)]


def is_number(field: str, decimal: str) -> bool:
    """Whether a field is a number with this decimal sign."""
    if decimal == ",":
        field = field.replace(",", "@").replace(".", ",").replace("@", ".")
    return NUMBER.fullmatch(field) is not None


def is_value(field: str, decimal: str) -> bool:
    """Whether a field is a number, a time stamp or a truth value."""
    if is_number(field, decimal) or field.lower() in ("true", "false"):
        return True
    return STAMP.fullmatch(field) is not None
