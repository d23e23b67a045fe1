#!/usr/bin/python3
"""Weighted mean of the weights of two networks of one shape: `average.py A.onnx B.onnx --share 0.4 --out C.onnx`, 0.4 A."""
import argparse

import numpy as np
import onnx
from onnx import numpy_helper


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first")
    parser.add_argument("second", help="its graph and metadata are kept")
    parser.add_argument("--share", type=float, default=0.5, help="of the first network, 0..1")
    parser.add_argument("--out", required=True)
    args = parser.parse_args()
    first, second = onnx.load(args.first), onnx.load(args.second)
    weights = {w.name: numpy_helper.to_array(w) for w in first.graph.initializer}
    if {w.name: tuple(w.dims) for w in second.graph.initializer} != {k: w.shape for k, w in weights.items()}:
        raise SystemExit(f"{args.first} and {args.second} are not of one shape")
    for w in second.graph.initializer:
        mean = args.share * weights[w.name] + (1 - args.share) * numpy_helper.to_array(w)
        w.CopyFrom(numpy_helper.from_array(mean.astype(np.float32), w.name))
    onnx.save(second, args.out)


if __name__ == "__main__":
    main()
