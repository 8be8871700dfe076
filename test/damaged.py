"""Files with a few bytes wrong, seeded: flipped, cut, doubled, taken out, overwritten by what programs stumble over."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

_WORDS = (
    b"nan",
    b"-1",
    b"1e999",
    b"\x00",
    b"<",
    b"]",
    b"'",
    b"{}",
    b"\n",
    b"\xff\xff\xff\xff",
    b"0",
    b"e",
    b"%s",
    b"[/x]",
    b"../",
)


def damaged(content: bytes, count: int, seed: int = 0) -> Iterator[bytes]:
    """``count`` copies of a file, each damaged in one to three places."""
    rng = np.random.default_rng([seed, len(content)])
    for _ in range(count):
        data = bytearray(content)
        for _ in range(int(rng.integers(1, 4))):
            at, size = int(rng.integers(max(len(data), 1))), int(rng.integers(1, 40))
            match int(rng.integers(6)):
                case 0:  # a bit
                    if data:
                        data[at] ^= 1 << int(rng.integers(8))
                case 1:  # some bytes
                    data[at : at + size] = rng.bytes(min(size, len(data) - at))
                case 2:  # the end is missing
                    del data[at:]
                case 3:  # a part is missing
                    del data[at : at + size]
                case 4:  # a part is there twice
                    data[at:at] = data[at : at + size]
                case _:
                    word = _WORDS[int(rng.integers(len(_WORDS)))]
                    data[at : at + len(word)] = word
        yield bytes(data)
