"""Speed reference for the twin: a plain MuJoCo chain of the same size, without friction and wires."""

import mujoco


def run_plain_chain(degrees: int, time_step: float, seconds: float) -> None:
    """Simulate a chain of hinges with springs and damping: no wires, no friction, no contact."""
    spec = mujoco.MjSpec()
    spec.option.timestep = time_step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    body = spec.worldbody
    for _ in range(degrees):
        body = body.add_body(pos=[0.0025, 0, 0])
        body.add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0, 1, 0],
            stiffness=[0.4, 0, 0],
            damping=[0.01, 0, 0],
            armature=1e-6,
        )
        body.mass, body.ipos, body.inertia, body.explicitinertial = 1e-5, [0, 0, 0], [1e-10] * 3, True
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.05
    mujoco.mj_step(model, data, round(seconds / time_step))
