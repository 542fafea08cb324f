"""Resource limits of one run."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Limits"]


@dataclass(frozen=True)
class Limits:
    """Resource limits of one run.

    Parameters
    ----------
    seconds : float, optional
        Time after which it is ended.
    bytes : int, optional
        Memory (address space, as that is what the system can limit).
    """

    seconds: float | None = None
    bytes: int | None = None

    def __bool__(self) -> bool:
        return self.seconds is not None or self.bytes is not None

    @property
    def timeout_reason(self) -> str:
        """Reason of a run that failed because its time was over.

        >>> Limits(seconds=90).timeout_reason
        'took longer than 90 s'
        """
        return f"took longer than {self.seconds:g} s"
