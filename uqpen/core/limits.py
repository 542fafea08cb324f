"""What one run may use."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Limits"]


@dataclass(frozen=True)
class Limits:
    """What one run may use.

    Parameters
    ----------
    seconds : float, optional
        Until it is ended.
    bytes : int, optional
        Of memory (of address space, which is what the system can limit).
    """

    seconds: float | None = None
    bytes: int | None = None

    def __bool__(self) -> bool:
        return self.seconds is not None or self.bytes is not None

    @property
    def timeout_reason(self) -> str:
        """Why a run was lost that was ended in time.

        >>> Limits(seconds=90).lateness
        'took longer than 90 s'
        """
        return f"took longer than {self.seconds:g} s"
