"""Networks in ONNX files: what a file tells of itself, who runs it, and what its output means."""
