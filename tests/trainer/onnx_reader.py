#!/usr/bin/env python3
"""onnx_reader.py MODEL CASES TOLERANCE: runs an ONNX model by the definitions of its operators (docs/Operators.md of ONNX),
knowing nothing of policies, and compares its outputs. It computes in double precision: differences are the other's rounding.

CASES is a JSON object: "inputs" and "outputs" map a name to rows; "units" map an output's name to what its differences are
measured in, one per column. Prints the largest difference of each output; exit status 1 if one exceeds the tolerance.
"""
import json
import sys

import numpy as np
import onnx
from onnx import numpy_helper


def gemm(a, b, c=None, alpha=1.0, beta=1.0, transA=0, transB=0):
    product = alpha * ((a.T if transA else a) @ (b.T if transB else b))
    return product if c is None else product + beta * c


def clip(x, low=None, high=None):
    assert all(bound is None or bound.shape == () for bound in (low, high)), "bounds are scalars"
    x = x if low is None else np.maximum(x, low)
    return x if high is None else np.minimum(x, high)


OPERATORS = {"Sub": np.subtract, "Div": np.divide, "Mul": np.multiply, "Tanh": np.tanh, "Gemm": gemm, "Clip": clip,
             "Identity": lambda x: x}


def require_shape(value, declared):
    """A dimension that has a name may have any size, but the same everywhere."""
    dims = declared.type.tensor_type.shape.dim
    assert declared.type.tensor_type.elem_type == onnx.TensorProto.FLOAT, declared.name
    assert len(dims) == value.ndim, f"{declared.name} has shape {value.shape}"
    return {(dim.dim_param or dim.dim_value): size for dim, size in zip(dims, value.shape)}


def run(model, inputs):
    graph = model.graph
    assert [entry.domain for entry in model.opset_import] == [""] and not model.functions
    assert all(tensor.data_type == onnx.TensorProto.FLOAT for tensor in graph.initializer)
    values = {tensor.name: numpy_helper.to_array(tensor).astype(np.float64) for tensor in graph.initializer}
    values.update(inputs)
    for node in graph.node:  # in topological order, says the format
        assert node.domain == "" and len(node.output) == 1
        attributes = {a.name: onnx.helper.get_attribute_value(a) for a in node.attribute}
        operands = [values[name] if name else None for name in node.input]
        result = np.asarray(OPERATORS[node.op_type](*operands, **attributes))
        assert node.output[0] not in values, "single assignment"
        values[node.output[0]] = result
    sizes = {}
    for declared in [*graph.input, *graph.output]:
        for name, size in require_shape(values[declared.name], declared).items():
            assert sizes.setdefault(name, size) == size, f"{declared.name}: {name} is {size}"
            assert isinstance(name, str) or name == size, f"{declared.name}: {name} is {size}"
    return {declared.name: values[declared.name] for declared in graph.output}


def main():
    path, cases, tolerance = sys.argv[1], json.load(open(sys.argv[2])), float(sys.argv[3])
    onnx.checker.check_model(path, full_check=True)
    model = onnx.load(path)
    assert {i.name for i in model.graph.input} == set(cases["inputs"])
    outputs = run(model, {name: np.array(rows, np.float64) for name, rows in cases["inputs"].items()})
    assert set(outputs) == set(cases["outputs"])
    worst = 0.0
    for name, value in outputs.items():
        expected = np.array(cases["outputs"][name], np.float64)
        assert expected.shape == value.shape, f"{name} has shape {value.shape}, not {expected.shape}"
        difference = np.max(np.abs(value - expected) / np.array(cases["units"][name]))
        print(f"{name} {difference:.3g}")
        worst = max(worst, difference) if difference == difference else np.inf
    return 0 if worst <= tolerance else 1


if __name__ == "__main__":
    sys.exit(main())
