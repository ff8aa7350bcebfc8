"""What of a rebuilt result is committed: pictures as small PNG, JSON without its long lists, no large tables.

    python bench/slim.py [results/FOLDER ...]

`results/` is read by people and by a few tests; the rows behind a score are made again by the page's command. An SVG
becomes a PNG of 16 colours, a link to it follows. JSON has no spaces, and above 25 kB no lists and tables above 4 kB:
"left_out" names them. A CSV above 60 kB goes, and what linked to it says so. Pictures need Chromium and playwright.
"""

import io
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/tools"))
from browsing import chromium

RESULTS = Path(__file__).parents[1] / "results"
JSON_FILE, JSON_PART, TABLE = 25_000, 4_000, 60_000
"""Bytes: of a JSON file that is kept whole, of a part of a larger one, of a table."""
COLOURS, PIXELS = 16, 0.85
"""Of a picture: colours of its palette, and pixels for each 1/96 inch."""


def main() -> None:
    """Make folders of results small."""
    for folder in [Path(one) for one in sys.argv[1:]] or sorted(one for one in RESULTS.iterdir() if one.is_dir()):
        gone = [*tables(folder), *pictures(folder)]
        for path in folder.glob("*.json"):
            shortened(path)
        for page in folder.glob("*.md"):
            mended(page, gone)
        print(f"{folder}: {sum(one.stat().st_size for one in folder.iterdir()) / 1000:.0f} kB")


def tables(folder: Path) -> Iterator[str]:
    """Remove large tables; their names."""
    for path in folder.glob("*.csv"):
        if path.stat().st_size > TABLE:
            path.unlink()
            yield path.name


def pictures(folder: Path) -> Iterator[str]:
    """Turn each SVG into a PNG with a palette; names of what went."""
    found = sorted(folder.glob("*.svg"))
    if not found:
        return
    with chromium() as browser:
        context = browser.new_context(device_scale_factor=PIXELS)
        for path in found:
            page = context.new_page()
            text = path.read_text("utf-8")
            page.set_content(f'<body style="margin:0">{text[text.find("<svg") :]}')
            shot = page.locator("svg").first.screenshot()
            page.close()
            image = Image.open(io.BytesIO(shot)).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
            image.save(path.with_suffix(".png"), optimize=True)
            path.unlink()
            yield path.name


def shortened(path: Path) -> None:
    """Write a JSON file without spaces, a large one without its long lists, which it names.

    Scores stay, of which SCORES.md is made.
    """
    document: Any = json.loads(path.read_text("utf-8"))
    if path.stat().st_size > JSON_FILE:
        long = [name for name, part in document.items() if name != "scores" and len(json.dumps(part)) > JSON_PART]
        document = {name: part for name, part in document.items() if name not in long} | {"left_out": long}
    path.write_text(json.dumps(document, ensure_ascii=False, separators=(",", ":")) + "\n", "utf-8")


def mended(page: Path, gone: list[str]) -> None:
    """Let links follow pictures; what is not kept is named without a link."""
    text = page.read_text("utf-8")
    for name in gone:
        if name.endswith(".svg"):
            text = text.replace(f"({name})", f"({Path(name).with_suffix('.png')})")
        else:
            text = re.sub(rf"\[[^\]]*\]\({re.escape(name)}\)", f"`{name}` (written by the command, not kept)", text)
    page.write_text(text, "utf-8")


if __name__ == "__main__":
    main()
