"""Bytes of real exports, changed, cut, doubled, or with what readers dislike put between them."""

import numpy as np


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Change, cut or double some bytes: mostly once, so that some files can still be read."""
    data = bytearray(content)
    for _ in range(int(rng.geometric(0.5))):
        place = int(rng.integers(0, max(1, len(data))))
        match int(rng.integers(0, 7)):
            case 0:
                data[place : place + 1] = rng.bytes(1)
            case 5:
                data[place : place + 1] = b"%d" % rng.integers(0, 10)
            case 6:
                del data[place:]
            case 1:
                del data[place : place + int(rng.integers(1, 200))]
            case 2:
                data[place:place] = rng.bytes(int(rng.integers(1, 40)))
            case 3:
                data[place:place] = data[: int(rng.integers(1, 400))]
            case _:
                data[place:place] = (b"\0", b"nan,", b"1e999;", b'"', b"\xff\xfe", b"\n\n", b",,,,")[rng.integers(0, 7)]
    return bytes(data)
