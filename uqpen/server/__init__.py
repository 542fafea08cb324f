"""Models as a UM-Bridge server, and the page of a running study."""

from uqpen.server.hidden_model import HiddenModel
from uqpen.server.model_server import ModelServer
from uqpen.server.run_budget import RunBudget
from uqpen.server.served_model import ServedModel

__all__ = ["HiddenModel", "ModelServer", "RunBudget", "ServedModel"]
