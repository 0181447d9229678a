"""Something for each level of the ladder, made when it is asked for."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from typing import TypeVar, overload

Level = TypeVar("Level")


class Levels(Sequence[Level]):
    """A sequence, coarse to fine, that needs only its length and `_at`."""

    @overload
    def __getitem__(self, index: int) -> Level: ...

    @overload
    def __getitem__(self, index: slice) -> list[Level]: ...

    def __getitem__(self, index: int | slice) -> Level | list[Level]:
        if index == -1:  # the finest, which every scan asks for
            return self._at(len(self) - 1)
        places = range(len(self))[index]
        return self._at(places) if isinstance(places, int) else [self._at(k) for k in places]

    def __iter__(self) -> Iterator[Level]:
        return map(self._at, range(len(self)))

    @abstractmethod
    def _at(self, k: int) -> Level:
        """The level at `k`, from 0 to the length."""
