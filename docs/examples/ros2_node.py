"""ROS 2 node that estimates the bending angle with a trained file, inside its own process.

    python ros2_node.py --ros-args -p policy:=runs/ram_twins/policy.onnx

Each message on `measured` (sensor_msgs/JointState) is one sample: joint `pull` [m] is the command of the
drive, joint `bend` [rad] the reading of the sensor; leave out what is missing. `estimate` answers with joints
`bend`, `bend_low` and `bend_high`, a 95 % interval [rad], and `/diagnostics` with faults and alarms.
"""

import contextlib
import math

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState

from twin.live import Source, load_runtime
from twin.live.reading import flag_names


class EstimatorNode(Node):
    """Node with one estimator: start one node for each endoscope."""

    def __init__(self) -> None:
        super().__init__("endotwin")
        policy = self.declare_parameter("policy", "policy.onnx").value
        variance = self.declare_parameter("noise_variance", 0.0).value  # R [deg^2]; 0: of the trained file
        self.runtime = load_runtime(policy, noise_variance=variance or None)
        self.estimate = self.create_publisher(JointState, "estimate", 10)
        self.diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_subscription(JointState, "measured", self.on_sample, 10)

    def on_sample(self, message: JointState) -> None:
        """Answer one sample."""
        joints = dict(zip(message.name, message.position, strict=False))
        stamp = message.header.stamp
        reading = self.runtime.push(
            time_s=stamp.sec + 1e-9 * stamp.nanosec,
            pull_mm=1e3 * joints.get("pull", math.nan),
            measurement_deg=math.degrees(joints.get("bend", math.nan)),
        )
        angles = [math.radians(angle) for angle in (reading.bend_deg, reading.low_deg, reading.high_deg)]
        names = ["bend", "bend_low", "bend_high"]
        self.estimate.publish(JointState(header=message.header, name=names, position=angles))

        faults, alarms = flag_names(reading.health), flag_names(reading.alarms)
        good = reading.source is Source.ADVANCED and not faults
        status = DiagnosticStatus(
            level=DiagnosticStatus.OK if good else DiagnosticStatus.WARN,
            name="endotwin: bending angle",
            message=", ".join([*faults, *alarms]),
            values=[KeyValue(key="source", value=reading.source.value)],
        )
        self.diagnostics.publish(DiagnosticArray(header=message.header, status=[status]))


def main() -> None:
    """Run the node until it is stopped."""
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(EstimatorNode())


if __name__ == "__main__":
    main()
