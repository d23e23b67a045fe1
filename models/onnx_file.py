# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes the networks as ONNX files, and runs the files with torch to verify them."""
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
        """A convolution; a following BatchNorm is folded into its weights (in double)."""
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
        """The last node added produces the output."""
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
    """Verify that the file computes the same as the trained network."""
    with torch.no_grad():
        error = float((run(path, image) - want).abs().max())
    if not error < tolerance:
        raise SystemExit(f"{path}: differs from the trained network by {error}")
    print(f"{path}: equals the trained network within {error:.1e}")


def run(path: str, image: torch.Tensor, see=lambda name, value: None) -> torch.Tensor:
    """Evaluate a file with the layers that sst supports; see() is called with the input and every computed value."""
    model = onnx.load(path)
    values = {w.name: torch.from_numpy(numpy_helper.to_array(w).copy()) for w in model.graph.initializer}
    source = next(i.name for i in model.graph.input if i.name not in values)
    values[source] = image
    see(source, image)
    for node in model.graph.node:
        attribute = {a.name: helper.get_attribute_value(a) for a in node.attribute}
        values[node.output[0]] = evaluate(node.op_type, attribute, [values.get(i) for i in node.input])
        see(node.output[0], values[node.output[0]])
    return values[model.graph.output[0].name]


def evaluate(op: str, a: dict, x: list) -> torch.Tensor:
    """One node with attributes a and inputs x; omitted inputs are None or missing."""
    def given(i: int, name: str):
        """Input i, or the equivalent attribute of older files."""
        value = x[i] if i < len(x) else None
        value = a.get(name) if value is None else value
        return value.tolist() if isinstance(value, torch.Tensor) else value

    if op in WINDOWED:
        return WINDOWED[op](x, a)
    if op in PLAIN:
        return PLAIN[op](*x)
    if op == "Constant":
        return torch.from_numpy(numpy_helper.to_array(a["value"]).copy())
    if op == "Concat":
        return torch.cat(x, a["axis"])
    if op == "Softmax":
        return x[0].softmax(a.get("axis", -1))
    if op == "LpNormalization":
        return x[0] / x[0].norm(dim=a.get("axis", -1), keepdim=True).clamp(min=1e-30)
    if op == "BatchNormalization":
        return F.batch_norm(x[0], x[3], x[4], x[1], x[2], eps=a.get("epsilon", 1e-5))
    if op == "AdaptiveAveragePool":
        return F.adaptive_avg_pool2d(x[0], a["output_size"])
    if op == "ResizeLike":
        return F.interpolate(x[0], size=x[1].shape[2:], mode="bilinear", align_corners=bool(a.get("align_corners", 0)))
    if op in ("Resize", "Upsample"):
        scales, sizes = given(len(x) - 1 if op == "Upsample" else 2, "scales"), given(3, "sizes")
        size = sizes[2:] if sizes else [int(n * s) for n, s in zip(x[0].shape[2:], scales[2:])]
        align = a.get("coordinate_transformation_mode", b"") == b"align_corners"
        return F.interpolate(x[0], size=size, mode="bilinear", align_corners=align)
    if op == "Pad":
        pads = given(1, "pads")
        return F.pad(x[0], (pads[3], pads[7], pads[2], pads[6]))
    if op == "Clip":
        return x[0].clamp(min=given(1, "min"), max=given(2, "max"))
    if op == "Slice":
        return x[0][given(1, "starts")[0]:given(2, "ends")[0]]
    if op.startswith("Reduce"):
        x = x[0] if op == "ReduceSum" else x[0] ** 2
        x = x.sum(1, keepdim=True)
        return x.sqrt() if op == "ReduceL2" else x
    raise ValueError(f"unknown operator {op}")


PLAIN = {
    "Relu": torch.relu, "Add": torch.add, "Mul": torch.mul, "Div": torch.div, "Pow": torch.pow, "Sqrt": torch.sqrt,
    "Max": torch.maximum, "Identity": lambda x: x, "Dropout": lambda x, *_: x,
    "Shape": lambda x: torch.tensor(x.shape), "Expand": lambda x, shape: x.expand(tuple(shape)),
    "GlobalAveragePool": lambda x: x.mean((2, 3), keepdim=True),
}


def windows(pool):
    """Apply a function of a padded image and attributes after the padding that ONNX gives for each side."""
    def call(x: list, a: dict) -> torch.Tensor:
        top, left, bottom, right = a.get("pads", (0, 0, 0, 0))
        return pool(F.pad(x[0], (left, right, top, bottom), value=pool.fill), x, a)
    return call


def conv(padded: torch.Tensor, x: list, a: dict) -> torch.Tensor:
    return F.conv2d(padded, x[1], x[2] if len(x) > 2 else None, a.get("strides", 1), 0, a.get("dilations", 1),
                    a.get("group", 1))


def max_pool(padded: torch.Tensor, x: list, a: dict) -> torch.Tensor:
    return F.max_pool2d(padded, a["kernel_shape"], a.get("strides", 1), 0, a.get("dilations", 1),
                        bool(a.get("ceil_mode", 0)))


def average_pool(padded: torch.Tensor, x: list, a: dict) -> torch.Tensor:
    """Average with the padding counted as zeros or, by default, ignored."""
    def mean(y: torch.Tensor) -> torch.Tensor:
        return F.avg_pool2d(y, a["kernel_shape"], a.get("strides", 1), 0, bool(a.get("ceil_mode", 0)))
    if a.get("count_include_pad", 0):
        return mean(padded)
    top, left, bottom, right = a.get("pads", (0, 0, 0, 0))
    return mean(padded) / mean(F.pad(torch.ones_like(x[0]), (left, right, top, bottom)))


conv.fill, max_pool.fill, average_pool.fill = 0.0, float("-inf"), 0.0
WINDOWED = {"Conv": windows(conv), "MaxPool": windows(max_pool), "AveragePool": windows(average_pool)}
