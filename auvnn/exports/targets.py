"""The table of what a model can be written as."""

from auvnn.catalogue import Catalogue

TARGETS = Catalogue(
    "export target",
    {
        "c": "auvnn.exports.c:CTarget",
        "casadi": "auvnn.exports.casadi:CasadiTarget",
        "fmu": "auvnn.exports.fmu:FmuTarget",
        "onnx": "auvnn.exports.onnx:OnnxTarget",
        "torch": "auvnn.exports.torch_program:TorchTarget",
        "sdf": "auvnn.exports.sdf:SdfTarget",
    },
    "auvnn.exports",
)
