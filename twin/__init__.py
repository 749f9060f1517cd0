"""The digital twin of a tendon-driven flexible endoscope, and the estimators of its bending angle."""

__version__ = "0.1.0"
