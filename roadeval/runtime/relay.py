"""What a frame leaves for the next one, handed on in the frames' order whichever threads work.

Frames are begun in order (`ordered`), and each waits for nothing but what the one
before it leaves, which began earlier: nothing can wait for itself, and any number of threads
computes the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import Future
from types import TracebackType
from typing import Any


class Baton:
    """What one variant's frame before left, and what this frame leaves."""

    def __init__(self, before: Future[Any], after: Future[Any]) -> None:
        self._before = before
        self._after = after

    def recall(self) -> Any:
        """Give what the frame before left, as soon as it has; None on the first frame."""
        return self._before.result()

    def leave(self, value: Any) -> None:
        """Leave a value to the frame after this one, which need not wait for the rest of it."""
        self._after.set_result(value)

    def pass_on(self) -> None:
        """Leave what the frame before left, unless something has been left; waits for nothing."""
        if not self._after.done():
            self._before.add_done_callback(lambda before: self._after.set_result(before.result()))


class Turn:
    """A frame's batons, by variant. A frame that fails hands on what it was given."""

    def __init__(self, batons: Mapping[str, Baton]) -> None:
        self.batons = batons

    def __enter__(self) -> Turn:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for baton in self.batons.values():
            baton.pass_on()


class Relay:
    """Gives each frame its turn; to be asked in the frames' order.

    Parameters
    ----------
    names
        The variants.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._last: dict[str, Future[Any]] = {name: Future() for name in names}
        for future in self._last.values():
            future.set_result(None)

    def turn(self) -> Turn:
        """Give the next frame its turn."""
        before, self._last = self._last, {name: Future() for name in self._last}
        return Turn({name: Baton(before[name], after) for name, after in self._last.items()})
