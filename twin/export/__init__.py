"""Episodes for other programs: a dataset that LeRobot reads, in a folder that appears when it is whole."""

from twin.files.whole_folder import WholeFolder

__all__ = ["WholeFolder"]
