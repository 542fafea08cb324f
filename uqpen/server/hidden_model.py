"""A model whose inputs a client does not see: their stand-ins are standard normal numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr

from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.server.served_model import RefusedError, ServedModel

__all__ = ["HiddenModel"]


@dataclass(frozen=True)
class HiddenModel:
    """A served model in standard normal space, under a name that says nothing of it.

    A client needs to know neither names nor units nor distributions of the inputs: a vector of
    independent standard normal numbers becomes a draw of them, by their own transformation.

    Parameters
    ----------
    name : str
        Its name for the clients.
    served : ServedModel
        The model, with random inputs in its vector.
    joint : JointDistribution
        The inputs. Each random one has a place in the vector, also one that the model does not
        take.
    """

    name: str
    served: ServedModel
    joint: JointDistribution

    @property
    def identity(self) -> dict[str, Any]:
        """All that decides the result of a run with a vector, for JSON."""
        return {
            **self.served.identity,
            "random": {each.variable.name: repr(each.distribution) for each in self.joint.random},
            "dependence": self.joint.dependence_text,
        }

    @property
    def input_size(self) -> int:
        """Length of the input vector."""
        return len(self.joint.random)

    @property
    def output_sizes(self) -> list[int]:
        """Lengths of the output vectors."""
        return self.served.output_sizes

    def run(self, values: Sequence[float]) -> list[list[float | None]]:
        """Return the output vectors of one run; a `RefusedError` says that it failed, and no more.

        A reason would name the inputs.
        """
        points = self.joint.points(ndtr(np.array([values], dtype=np.float64)), {})
        try:
            return self.served.run([points[name].item() for name in self.served.varied_inputs])
        except RefusedError as refused:
            message = "the run has no result"
            raise RefusedError(refused.kind, message, refused.code) from None
