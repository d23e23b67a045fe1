"""Writes the networks as ONNX files by hand, and runs such files with torch to check what was written."""
import numpy as np
import onnx
import torch
import torch.nn as nn
import torch.nn.functional as F
from onnx import TensorProto, helper, numpy_helper

import manifest

OPSET = 13
PRODUCER = "sst models"


class GraphWriter:
    """Nodes and plain float32 weights of one graph, in order."""

    def __init__(self) -> None:
        self.nodes: list = []
        self.weights: list = []

    def node(self, op: str, inputs: list[str], domain: str = "", **attributes) -> str:
        name = f"t{len(self.nodes)}"
        title = f"{op}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(op, inputs, [name], name=title, domain=domain, **attributes))
        return name

    def constant(self, value: torch.Tensor) -> str:
        name = f"w{len(self.weights)}"
        array = np.ascontiguousarray(value.detach().cpu().numpy(), dtype="<f4")
        self.weights.append(numpy_helper.from_array(array, name))
        return name

    def conv(self, x: str, conv: nn.Conv2d, norm: nn.BatchNorm2d | None = None) -> str:
        """A convolution; a BatchNorm behind it is folded into its weights (in double)."""
        weight = conv.weight.detach().double()
        bias = torch.zeros(conv.out_channels, dtype=torch.double) if conv.bias is None else conv.bias.detach().double()
        if norm is not None:
            gain = norm.weight.detach().double() / torch.sqrt(norm.running_var.double() + norm.eps)
            weight = weight * gain[:, None, None, None]
            bias = (bias - norm.running_mean.double()) * gain + norm.bias.detach().double()
        pad = list(conv.padding) * 2
        return self.node("Conv", [x, self.constant(weight), self.constant(bias)], kernel_shape=list(conv.kernel_size),
                         strides=list(conv.stride), dilations=list(conv.dilation), pads=pad, group=conv.groups)

    def save(self, path: str, in_channels: int, out_channels: int, metadata: dict[str, str]) -> None:
        """The last node added makes the output."""
        self.nodes[-1].output[0] = "output"
        ends = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in (
            ("input", [1, in_channels, "height", "width"]), ("output", [1, out_channels, "out_height", "out_width"]))]
        graph = helper.make_graph(self.nodes, "sst", ends[:1], ends[1:], self.weights)
        imports = [helper.make_opsetid("", OPSET)]
        if any(n.domain for n in self.nodes):
            imports.append(helper.make_opsetid("sst", 1))
        model = helper.make_model(graph, opset_imports=imports, producer_name=PRODUCER, ir_version=7)
        helper.set_model_props(model, metadata)
        onnx.checker.check_model(model)
        with open(path, "wb") as f:
            f.write(model.SerializeToString())
        manifest.renew(path)


def write_mccnn(path: str, convs: list[nn.Conv2d]) -> None:
    """Features of unit length for luma standardised over the whole view; checked by running the file."""
    graph, x = GraphWriter(), "input"
    for i, conv in enumerate(convs):
        x = graph.conv(x, conv)
        if i + 1 < len(convs):
            x = graph.node("Relu", [x])
    graph.node("LpNormalization", [x], axis=1, p=2)
    graph.save(path, 1, convs[-1].out_channels, {"sst.kind": "mccnn-features", "sst.radius": str(len(convs))})
    image = torch.randn(1, 1, 61, 83)
    want = image
    for i, conv in enumerate(convs):
        want = conv(want) if i + 1 == len(convs) else conv(want).relu()
    check(path, image, F.normalize(want, dim=1))


def check(path: str, image: torch.Tensor, want: torch.Tensor, tolerance: float = 1e-4) -> None:
    """The file computes what the trained network computes, or this is an error."""
    with torch.no_grad():
        error = float((run(path, image) - want).abs().max())
    if not error < tolerance:
        raise SystemExit(f"{path}: differs from the trained network by {error}")
    print(f"{path}: equals the trained network within {error:.1e}")


def run(path: str, image: torch.Tensor) -> torch.Tensor:
    """Evaluate a file that this module wrote."""
    model = onnx.load(path)
    values = {w.name: torch.from_numpy(numpy_helper.to_array(w).copy()) for w in model.graph.initializer}
    values[model.graph.input[0].name] = image
    for node in model.graph.node:
        attribute = {a.name: helper.get_attribute_value(a) for a in node.attribute}
        values[node.output[0]] = evaluate(node.op_type, attribute, [values[i] for i in node.input])
    return values[model.graph.output[0].name]


def evaluate(op: str, attribute: dict, x: list[torch.Tensor]) -> torch.Tensor:
    if op == "Conv":
        return F.conv2d(x[0], x[1], x[2], attribute["strides"], attribute["pads"][:2], attribute["dilations"],
                        attribute["group"])
    if op == "Relu":
        return x[0].relu()
    if op == "Add":
        return x[0] + x[1]
    if op == "Concat":
        return torch.cat(x, attribute["axis"])
    if op == "LpNormalization":
        return x[0] / x[0].norm(dim=attribute["axis"], keepdim=True)
    if op == "AdaptiveAveragePool":
        return F.adaptive_avg_pool2d(x[0], attribute["output_size"])
    if op == "ResizeLike":
        return F.interpolate(x[0], size=x[1].shape[2:], mode="bilinear", align_corners=bool(attribute["align_corners"]))
    raise ValueError(f"unknown operator {op}")
