"""Networks in ONNX files: settings, inputs and outputs, and the road mask of an image."""

from roadeval.networks.network import Network
from roadeval.networks.settings import NetSettings, NetworkError
