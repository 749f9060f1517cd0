"""A small endoscope with friction in its joints and its sheath, and an ideal drive."""

from twin.preset.preset import Preset

PLAIN = Preset(
    "plain",
    vertebrae=5,
    section_stiffness=0.05,
    joint_friction=1e-3,
    wire_stiffness=8e3,
    pretension=3.0,
    sheath_elements=3,
    sheath_friction=0.3,
    sheath_bend=3.0,
    time_step=2.5e-3,
    control_period=5e-3,
)
