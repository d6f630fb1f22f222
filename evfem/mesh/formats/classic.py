"""The header of netCDF's classic format (CDF-1, 2 and 5), which the library takes memory for as it declares.

Source: the NetCDF Classic Format Specification, netCDF 4.9, appendix B: a magic number, the number of
records, then lists of dimensions, attributes and variables, each with the number of its entries; names and
values are filled up to 4 bytes.
"""

from __future__ import annotations

from collections.abc import Callable

#: bytes of a number of each type
SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}
#: version -> bytes of a count, and of a place in the file
WIDTHS = {1: (4, 4), 2: (4, 8), 5: (8, 8)}


def check_header(data: bytes) -> None:
    """Raise ValueError for a header that counts more than the file has bytes; other formats pass.

    >>> check_header(b"CDF\\x01" + bytes(4) + b"\\0\\0\\0\\x0a" + b"\\x7f\\xff\\xff\\xff")
    Traceback (most recent call last):
    ValueError: it declares more than it has bytes
    """
    if data[:3] == b"CDF" and data[3:4] in (b"\1", b"\2", b"\5"):
        _Header(data).walk()


class _Header:
    """The bytes of a file, and how far they are read."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.count, self.place = WIDTHS[data[3]]
        self.at = 4 + self.count  # behind the number of records

    def walk(self) -> None:
        """All three lists."""
        self._entries(lambda: self._skip(self.count))  # a dimension has its length
        self._entries(self._values)
        self._entries(self._variable)

    def _entries(self, rest: Callable[[], None]) -> None:
        """A list: its kind, their number, and each with a name and the `rest`."""
        self._skip(4)
        for _ in range(self._number(self.count)):
            self._skip(self._number(self.count))
            rest()

    def _values(self) -> None:
        """An attribute: type, number, values."""
        size = SIZES.get(self._number(4), 1)
        self._skip(size * self._number(self.count))

    def _variable(self) -> None:
        """A variable: its dimensions and attributes, type, size and place."""
        self._skip(self.count * self._number(self.count))
        self._entries(self._values)
        self._skip(4 + self.count + self.place)

    def _number(self, width: int) -> int:
        """A count, of which no file has more than bytes."""
        value = int.from_bytes(self.data[self.at : self.at + width], "big")
        self._skip(width)
        if value > len(self.data) - self.at:
            raise ValueError("it declares more than it has bytes")
        return value

    def _skip(self, size: int) -> None:
        self.at += size + -size % 4
        if self.at > len(self.data):
            raise ValueError("it declares more than it has bytes")
