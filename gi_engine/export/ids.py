"""Numbers that Blender's own engines derive from names, so that Object Info's Random is the same in all of them."""

from __future__ import annotations

MASK = 0xFFFFFFFF


def rotate(x: int, k: int) -> int:
    return ((x << k) | (x >> (32 - k))) & MASK


def hash_words(x: int, y: int) -> int:
    """Bob Jenkins' lookup3 hash of two 32-bit words."""
    a = b = c = (0xDEADBEEF + 8 + 13) & MASK
    a, b = (a + x) & MASK, (b + y) & MASK
    c = ((c ^ b) - rotate(b, 14)) & MASK
    a = ((a ^ c) - rotate(c, 11)) & MASK
    b = ((b ^ a) - rotate(a, 25)) & MASK
    c = ((c ^ b) - rotate(b, 16)) & MASK
    a = ((a ^ c) - rotate(c, 4)) & MASK
    b = ((b ^ a) - rotate(a, 14)) & MASK
    return ((c ^ b) - rotate(b, 24)) & MASK


def hash_name(name: str) -> int:
    h = 0
    for byte in name.encode():
        h = (h * 37 + byte) & MASK
    return h


def random_of_name(name: str) -> float:
    """Object Info's Random of an object that is not an instance, 0 to 1."""
    return hash_words(hash_name(name), 0) / MASK
