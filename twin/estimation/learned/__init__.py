"""Learned estimators, run by NumPy and ONNX Runtime alone; `rl/` trains them."""
