"""Numbers to the 16-bit words of a chip's packets, and words to bytes."""


def words_of(value: int) -> tuple[int, int]:
    """Return a 32-bit value, signed or not, as two words, high word first."""
    if not -(1 << 31) <= value < 1 << 32:
        raise ValueError(f"{value} does not fit into 32 bits")
    return value >> 16 & 0xFFFF, value & 0xFFFF


def bytes_of(word: int) -> bytes:
    """Return a 16-bit word, signed or not, as two bytes, high byte first."""
    if not -(1 << 15) <= word < 1 << 16:
        raise ValueError(f"{word} does not fit into 16 bits")
    return (word & 0xFFFF).to_bytes(2, "big")
