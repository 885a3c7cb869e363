#!/usr/bin/env bash
# torch.onnx.export of a wrapper leaves the network inside it in training mode.
#
# Software: PyTorch 2.13.0, its exporter by tracing (`dynamo=False`); onnxruntime 1.27.0.
#
# A segmentation network that returns a dictionary is often exported by a small module around it that
# picks one output. The network is in `eval()`; nobody calls `eval()` on the wrapper, which has no
# layer of its own. The exporter puts the wrapper into evaluation mode, traces it, and afterwards
# gives it back the mode that it had: a new module is in training mode, and `train()` goes down to
# every module inside. The ONNX file is right. But the network in PyTorch now normalises by each
# batch and drops channels at random, so a comparison of the file with its source, made after the
# export, finds that they differ, and blames the file; masks that are written as the reference are
# wrong without a word. `wrapper.eval()` before the export avoids it. The exporter by
# `torch.export` (`dynamo=True`) leaves both modes as they were.
#
# Source: `training` of the network before and after, and the classes of all pixels of one image.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check \
  torch==2.13.0 onnx==1.22.0 onnxscript==0.7.2 onnxruntime==1.27.0 numpy==2.2.6
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
import onnxruntime
import torch


class Segmenter(torch.nn.Module):
    """Returns the logits of two classes as one of several outputs."""

    def __init__(self):
        super().__init__()
        self.layers = torch.nn.Sequential(
            torch.nn.Conv2d(3, 8, 3, padding=1),
            torch.nn.BatchNorm2d(8),
            torch.nn.ReLU(),
            torch.nn.Dropout2d(0.5),
            torch.nn.Conv2d(8, 2, 1),
        )

    def forward(self, image):
        return {"out": self.layers(image)}


class LogitsAlone(torch.nn.Module):
    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, image):
        return self.network(image)["out"]


def classes(network, image):
    with torch.no_grad():
        return network(image)["out"].argmax(1)


torch.manual_seed(0)
image = torch.rand(1, 3, 64, 64)
for told, dynamo in ((False, False), (True, False), (False, True)):
    network = Segmenter().eval()
    wrapper = LogitsAlone(network)
    if told:
        wrapper.eval()
    before = classes(network, image)
    torch.onnx.export(
        wrapper, (image,), "out.onnx", input_names=["image"], dynamo=dynamo, verbose=False
    )
    session = onnxruntime.InferenceSession("out.onnx", providers=["CPUExecutionProvider"])
    (logits,) = session.run(None, {session.get_inputs()[0].name: image.numpy()})
    exported = torch.from_numpy(logits).argmax(1)
    after = classes(network, image)
    how = "torch.export" if dynamo else "tracing"
    print(
        f"{how}, wrapper {'in eval()' if told else 'as made'}: network in training mode: "
        f"{network.training}; pixels of another class: ONNX {(exported != before).float().mean():.1%}"
        f", PyTorch after the export {(after != before).float().mean():.1%}"
    )
    assert (exported != before).float().mean() < 0.001
    assert network.training is (not told and not dynamo)
    assert bool((after != before).float().mean() > 0.02) is network.training
PYTHON
