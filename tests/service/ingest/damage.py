"""Damaged copies of a sound file: bits turned over, ends cut off, stretches lost; always the same ones."""

from collections.abc import Iterator

import numpy as np

# Where HDF5 keeps its own books: superblock, trees of chunks and of names, heaps, object headers.
BOOKS = (b"\x89HDF", b"TREE", b"SNOD", b"HEAP", b"GCOL", b"OHDR", b"FRHP", b"FHDB", b"BTHD", b"BTLF")
# How far behind such a mark its first and most telling bytes reach.
REACH = 96


def damaged(whole: bytes, *, flips: int, cuts: int, losses: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Copies of ``whole`` with their names.

    Args:
        whole: a sound file.
        flips: files with one to eight bits turned over, half of them in the books of HDF5.
        cuts: files that end early.
        losses: files of which a stretch of up to 4 kB is zeros or noise.
        seed: of the random numbers.
    """
    random = np.random.default_rng(seed)
    books = np.array(sorted(_books(whole)))
    for k in range(flips):
        content = bytearray(whole)
        for _ in range(random.integers(1, 9)):
            offset = random.choice(books) if k % 2 else random.integers(len(whole))
            content[offset] ^= 1 << random.integers(8)
        yield f"flip-{k}", bytes(content)
    for k, end in enumerate(np.unique(np.linspace(0, len(whole) - 1, cuts).astype(int))):
        yield f"cut-{k}", whole[:end]
    for k in range(losses):
        begin, length = random.integers(len(whole)), random.integers(16, 4096)
        content = bytearray(whole)
        lost = len(content[begin : begin + length])
        content[begin : begin + lost] = bytes(lost) if k % 2 else random.bytes(lost)
        yield f"loss-{k}", bytes(content)


def _books(whole: bytes) -> set[int]:
    offsets: set[int] = set()
    for mark in BOOKS:
        begin = whole.find(mark)
        while begin >= 0:
            offsets.update(range(begin, min(begin + REACH, len(whole))))
            begin = whole.find(mark, begin + 1)
    return offsets
