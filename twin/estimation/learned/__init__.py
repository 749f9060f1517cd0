"""Learned estimators, run by NumPy and ONNX Runtime only; `rl/` trains them."""
