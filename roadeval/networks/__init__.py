"""Networks in ONNX files: what a file says of itself, its inputs and outputs, and its road mask."""

from roadeval.networks.network import Network
from roadeval.networks.settings import NetSettings, NetworkError
