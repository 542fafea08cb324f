"""Models as a UM-Bridge server, and the page of a running study."""

from uqpen.server.model_server import ModelServer
from uqpen.server.served_model import HiddenModel, RunBudget, ServedModel

__all__ = ["HiddenModel", "ModelServer", "RunBudget", "ServedModel"]
