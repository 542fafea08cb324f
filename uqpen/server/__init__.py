"""Models as a UM-Bridge server."""

from uqpen.server.model_server import ModelServer
from uqpen.server.served_model import ServedModel

__all__ = ["ModelServer", "ServedModel"]
