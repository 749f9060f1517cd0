"""Canvas of MuJoCo's renderer without a screen: pictures with transparency, of any camera.

What is drawn has no background. The renderer's several samples of a pixel leave the share that is covered in
its alpha, so that a picture goes on any background with smooth edges.
"""

import atexit
import contextlib
import dataclasses
import os
import weakref

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Layer = NDArray[np.uint8]  # (height, width, 4) red, green, blue and alpha, by which colours are multiplied

HOW_TO_INSTALL = (
    "install libegl1 and libgl1-mesa-dri, or libosmesa6 (apt-get install libegl1 libgl1-mesa-dri)"
)
LARGEST = 4096  # pixels along a side of a picture
_MOST_SHAPES = 4000
_OPEN: "weakref.WeakSet[Canvas]" = weakref.WeakSet()


@dataclasses.dataclass(frozen=True)
class View:
    """Camera: where it is, where it looks, and what it sees."""

    position: Array  # (3,) [m]
    forward: Array  # (3,) unit vector to what it looks at
    up: Array  # (3,) unit vector, at right angles to that
    half_height: float  # half the height that is seen [m]; with perspective, at a distance of 1 m
    parallel: bool = False  # a parallel projection, in which a length is the same wherever it is
    shift: tuple[float, float] = (0.0, 0.0)  # of the picture right and up, in half heights

    @property
    def right(self) -> Array:
        """(3,) unit vector to the right in the picture."""
        return np.cross(self.forward, self.up)

    def project(self, points: Array, width: int, height: int) -> Array:
        """Return where points (..., 3) [m] are in a picture, (..., 2), as (column, row) [pixels]."""
        away = points - self.position
        depth = np.ones(away.shape[:-1]) if self.parallel else away @ self.forward
        across = np.stack([away @ self.right, away @ self.up], axis=-1) / depth[..., None] / self.half_height
        return np.array([width / 2, height / 2]) + (across - self.shift) * [height / 2, -height / 2]


class Canvas:
    """Picture of a model that is drawn as often as wanted."""

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        """Open the renderer, so that a missing library is reported at the start; sizes in pixels."""
        if os.environ.get("MUJOCO_GL", "").lower() in ("disable", "disabled", "off", "false", "0"):
            raise OSError(f"nothing here can draw without a screen (MUJOCO_GL=disable): {HOW_TO_INSTALL}")
        self.width, self.height = width, height
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        self._model = model
        try:
            from mujoco.gl_context import GLContext
            from OpenGL import GL

            self._gl, self._context = GL, GLContext(width, height)
            self._context.make_current()
            self._renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
            if not _OPEN:  # after MuJoCo's own: what is registered last is called first
                atexit.register(_close_all)
            _OPEN.add(self)
        except (ImportError, RuntimeError, AttributeError, mujoco.FatalError, TypeError) as error:
            cause = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise OSError(f"nothing here can draw without a screen ({cause}): {HOW_TO_INSTALL}") from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._renderer)
        self._scene = mujoco.MjvScene(model, _MOST_SHAPES)
        for flag in ("SHADOW", "REFLECTION", "SKYBOX", "HAZE", "FOG"):
            self._scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = 0
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._area = mujoco.MjrRect(0, 0, width, height)
        self._pixel = np.zeros((1, 1, 3), dtype=np.uint8)

    def draw(self, data: mujoco.MjData, view: View) -> Layer:
        """Return a picture of the model as it stands, (height, width, 4)."""
        self._context.make_current()
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, data, self._option, None, self._camera, every, self._scene)
        self._place(view)
        mujoco.mjr_render(self._area, self._scene, self._renderer)
        return self._read()

    def _place(self, view: View) -> None:
        near = 0.01 * view.half_height if view.parallel else 1e-3
        scale = view.half_height * (1.0 if view.parallel else near)
        aspect = self.width / self.height
        for camera in self._scene.camera:  # one for each eye, which see the same
            camera.pos, camera.forward, camera.up = view.position, view.forward, view.up
            camera.orthographic = int(view.parallel)
            camera.frustum_near, camera.frustum_far = near, 100.0 * max(view.half_height, 0.05)
            camera.frustum_center = view.shift[0] * scale
            camera.frustum_width = aspect * scale
            camera.frustum_bottom = (view.shift[1] - 1.0) * scale
            camera.frustum_top = (view.shift[1] + 1.0) * scale

    def _read(self) -> Layer:
        """Return the colours and the alpha of what was drawn: MuJoCo itself reads only colours."""
        gl, width, height = self._gl, self.width, self.height
        mujoco.mjr_readPixels(self._pixel, None, mujoco.MjrRect(0, 0, 1, 1), self._renderer)
        source = self._renderer.offFBO
        if self._renderer.offSamples:
            gl.glBindFramebuffer(gl.GL_READ_FRAMEBUFFER, source)
            gl.glBindFramebuffer(gl.GL_DRAW_FRAMEBUFFER, self._renderer.offFBO_r)
            box = (0, 0, width, height)
            gl.glBlitFramebuffer(*box, *box, gl.GL_COLOR_BUFFER_BIT, gl.GL_NEAREST)
            source = self._renderer.offFBO_r
        gl.glBindFramebuffer(gl.GL_READ_FRAMEBUFFER, source)
        pixels = gl.glReadPixels(0, 0, width, height, gl.GL_RGBA, gl.GL_UNSIGNED_BYTE)
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, self._renderer.offFBO)
        return np.frombuffer(pixels, np.uint8).reshape(height, width, 4)[::-1].copy()

    def close(self) -> None:
        """Free the renderer; nothing can be drawn from then on."""
        if hasattr(self, "_context"):
            with contextlib.suppress(Exception):  # of a library that is gone already
                self._context.make_current()
                self._renderer.free()
                self._context.free()
            del self._context

    def __del__(self) -> None:
        self.close()


def _close_all() -> None:
    """Give all renderers back before the libraries that hold them are closed."""
    for canvas in list(_OPEN):
        canvas.close()
