"""What stands on a page of HTML."""

import re


def text_of(html: str) -> str:
    """The page as it is read before anything is unfolded."""
    body = re.sub(r"<(style|script|noscript).*?</\1>", " ", html.split("<body>")[1], flags=re.S)
    inner = re.compile(
        r"<details(?![^>]*open)[^>]*><summary>((?:(?!</summary>).)*)</summary>(?:(?!<details).)*?</details>", re.S
    )
    while inner.search(body):
        body = inner.sub(r"\1", body)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", body))
