"""Page of `endotwin view`: a session in the browser, by viser (`endotwin[view]`).

The browser holds the shapes and draws them; 30 times a second it is sent their poses and the numbers, and
a third as often the curves. Pages of others are refused as by the live viewer (`scripts/live.py`).
"""

import contextlib
import math
import os
import socket
import threading
import time
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scripts.live import judge, quiet_logger
from twin.episode import WIRE_COLOURS, WIRES
from twin.errors import InputError
from twin.files.assets import assets_folder
from twin.view import Columns, Inputs, LiveTwin, Playback, Session
from twin.view.curves import Curves
from twin.view.shapes import Poses, place, place_sheath

if TYPE_CHECKING:
    import viser

HOST = "127.0.0.1"
RATE_HZ = 30.0  # of poses and numbers
REST_S = 5e-3  # least pause between two updates, which else follow an input at once
CURVES_EVERY = 3  # updates
NARROW = 576  # width of a window from which on the panel is below the scene [pixels]
_BLUE = (11, 95, 165)
_INK, _LINK, _LENS, _FORCE = (38, 43, 54), (158, 166, 178), (89, 158, 217), (160, 40, 150)


def serve(session: Session, listening: socket.socket) -> None:
    """Show a session until a signal ends it."""
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):  # viser prints there
        server = _open_server(listening)
        try:
            panel = _Played(server, session) if isinstance(session, Playback) else _Driven(server, session)
            page = _Page(server, session)
            last = time.monotonic()
            while True:
                now = time.monotonic()
                panel.advance(now - last)
                with server.atomic():
                    page.update()
                server.flush()
                last = now
                time.sleep(REST_S)
                panel.changed.wait(max(now + 1 / RATE_HZ - time.monotonic(), 0.0))
                panel.changed.clear()
        finally:
            server.stop()


def listen(port: int) -> socket.socket:
    """Return a socket that listens on this machine alone; 0 is a free port."""
    try:
        return socket.create_server((HOST, port))
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        rule = "choose another --port, or 0 for a free one"
        raise InputError(f"port {port} of {HOST}: {reason}; {rule}") from error


def _open_server(listening: socket.socket) -> "viser.ViserServer":
    import viser

    with _guarded(listening):
        server = viser.ViserServer(HOST, listening.getsockname()[1], label="EndoTwin", verbose=False)
    server.scene.configure_environment_map(None)  # half of the time that a frame takes without a GPU
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_light_ambient("/light", intensity=1.5)
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
    server.gui.main_panel.dock_right()
    server.gui.set_panel_label("EndoTwin")
    return server


@contextlib.contextmanager
def _guarded(listening: socket.socket) -> Iterator[None]:
    """Context manager: servers of viser use this socket, refuse pages of others, and name the page.

    By itself viser answers every page, and where a port is busy, it takes the next one.
    """
    from websockets.asyncio import server

    serve_any, guarded = server.serve, []
    head = (assets_folder() / "view_head.html").read_bytes()

    def serve_own(handler: Any, host: str, port: int, *, process_request: Any, **options: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            if (refused := judge(connection, request, HOST, (), "")) is not None:
                return refused
            with contextlib.suppress(KeyError):
                del request.headers["Accept-Encoding"]  # the page is compressed within
            if (page := process_request(connection, request)) is not None:
                page.body = page.body.replace(b"<title>Viser</title>", head)
                del page.headers["Content-Length"]
                page.headers["Content-Length"] = str(len(page.body))
            return page

        guarded.append(port)
        return serve_any(handler, sock=listening, process_request=answer, logger=quiet_logger(), **options)

    server.serve = serve_own  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        server.serve = serve_any  # type: ignore[misc]
    if not guarded:
        raise InputError(
            "this version of viser cannot refuse pages of others: install that of the extra `view`"
        )


class _Driven:
    """Sliders of a twin that is driven by hand."""

    def __init__(self, server: "viser.ViserServer", twin: LiveTwin) -> None:
        self._twin, most, gui = twin, twin.limits, server.gui
        add = partial(gui.add_slider, order=1)
        force = 10.0 ** math.floor(math.log10(most.tip_force_n) - 1)
        texts = {"pull_mm": ("Pull wire a [mm]", -most.pull_mm, 0.05)}
        if twin.preset.bending_planes == 2:
            texts["lateral_pull_mm"] = "Pull wire c [mm]", -most.lateral_pull_mm, 0.05
        texts["sheath_bend_deg"] = "Bend the sheath [deg]", 0.0, 5.0
        texts["tip_force_n"] = "Push the tip [N]", -most.tip_force_n, force
        texts["friction"] = "Friction of the sheath [x]", 0.0, 0.1
        self._sliders = {
            name: add(label, low, getattr(most, name), step, getattr(twin.inputs, name))
            for name, (label, low, step) in texts.items()
        }
        gui.add_button("Straight and at rest", order=2, color=_BLUE).on_click(lambda _: self._rest())
        self._resting, self.changed = False, threading.Event()
        for slider in self._sliders.values():
            slider.on_update(lambda _: self.changed.set())

    def advance(self, seconds: float) -> None:
        """Advance the twin towards the sliders."""
        if self._resting:
            self._resting = False
            self._twin.reset()
        wanted = Inputs(**{name: float(slider.value) for name, slider in self._sliders.items()})
        try:
            self._twin.advance(seconds, wanted)
        except FloatingPointError:
            self._rest()

    def _rest(self) -> None:
        rest = Inputs(sheath_bend_deg=math.degrees(self._twin.preset.sheath_bend))
        for name, slider in self._sliders.items():
            slider.value = getattr(rest, name)  # type: ignore[misc]
        self._resting = True


class _Played:
    """Button and slider of time of a recording."""

    def __init__(self, server: "viser.ViserServer", recording: Playback) -> None:
        self._recording, self._playing = recording, False
        self._button = server.gui.add_button("Play", order=1, color=_BLUE)
        self._button.on_click(lambda _: self._toggle())
        step = max(recording.last_s / 1000, 1e-3)
        self._slider = server.gui.add_slider("Time [s]", 0.0, recording.last_s, step, 0.0, order=1)
        self._shown_s, self.changed = 0.0, threading.Event()
        self._slider.on_update(lambda _: self.changed.set())

    def advance(self, seconds: float) -> None:
        """Go on by a time while it plays, and to where the slider was moved."""
        recording = self._recording
        if self._slider.value != self._shown_s:
            recording.time_s = self._shown_s = self._slider.value
        elif self._playing:
            recording.time_s = min(recording.time_s + seconds, recording.last_s)
            self._slider.value = recording.time_s  # type: ignore[misc]
            self._shown_s = self._slider.value  # as viser rounds it
            if recording.time_s == recording.last_s:
                self._toggle()

    def _toggle(self) -> None:
        self._playing = not self._playing
        self._button.label = "Pause" if self._playing else "Play"
        if self._playing and self._recording.time_s == self._recording.last_s:
            self._recording.time_s = 0.0


class _Page:
    """Scene, numbers and curves of a session."""

    def __init__(self, server: "viser.ViserServer", session: Session) -> None:
        self._session, self._updates = session, 0
        preset = session.preset
        wires = (session.trail().shape[1] - Columns.TENSIONS_N) // 2
        most = session.limits if isinstance(session, LiveTwin) else Inputs(pull_mm=1.0, tip_force_n=1.0)
        self._curves = Curves(preset.bending_planes, wires, session.method, most.pull_mm)
        self._numbers = server.gui.add_html(self._text(), order=0)
        self._graph = server.gui.add_html(self._curves.svg(session.trail()), order=3)
        self._scene = _Scene(server, session, most.tip_force_n)

    def update(self) -> None:
        """Send the present."""
        pose = self._session.pose()
        self._scene.update(pose)
        self._numbers.content = self._text()
        if self._updates % CURVES_EVERY == 0:
            self._graph.content = self._curves.svg(self._session.trail())
        self._updates += 1

    def _text(self) -> str:
        now = self._session.trail()[-1]
        cells = [("time", f"{now[Columns.TIME_S]:.1f} s"), ("pull", f"{now[Columns.PULL_MM]:.2f} mm")]
        cells.append(("bend", f"{now[Columns.BEND_DEG]:.1f} deg"))
        if self._session.method:
            low, high = now[Columns.LOW_DEG], now[Columns.HIGH_DEG]
            estimate = f"{now[Columns.ESTIMATE_DEG]:.1f}"
            cells.append(("estimate", f"{estimate} [{low:.1f}, {high:.1f}] deg"))
        ends = now[Columns.TENSIONS_N :]
        pulley = ", ".join(f"{WIRES[w]} {of:.1f}" for w, of in enumerate(ends[: len(ends) // 2]))
        cells += [("tension", f"{pulley} N")] if len(ends) else []
        rows = "".join(f"<dt>{name}</dt><dd style='margin:0;font-weight:600'>{of}</dd>" for name, of in cells)
        style = "display:grid;grid-template-columns:5em 1fr;margin:0.4em 0.75em;font-size:14px"
        return f"<dl style='{style};font-variant-numeric:tabular-nums'>{rows}</dl>".replace("nan", "-")


class _Scene:
    """Endoscope in 3D; lengths are those of the bending section."""

    def __init__(self, server: "viser.ViserServer", session: Session, force_n: float) -> None:
        self._preset, self._force_n, self._sheath_bend = session.preset, force_n, math.nan
        preset, scene = session.preset, server.scene
        radius, link = preset.wire_offset / preset.section_length, 1 / preset.vertebrae
        placed = place(preset, session.pose(), force_n)
        sheath = place_sheath(preset, 0.0)
        part = 1.15 * float(np.linalg.norm(sheath.position[1] - sheath.position[0]))
        count = len(placed.wires.position) // len(placed.links.position)
        colours = np.repeat(
            [[round(255 * of) for of in wire] for wire in WIRE_COLOURS[:count]], preset.vertebrae, 0
        )

        def add(name: str, radius: float, length: float, poses: Poses, colour: Any) -> Any:
            return scene.add_batched_meshes_simple(
                name,
                *_cylinder(radius, length),
                poses.quaternion,
                poses.position,
                batched_colors=colour,
                lod="off",
                cast_shadow=False,
                receive_shadow=False,
            )

        self._links = [
            add("/vertebrae", 1.05 * radius, 0.6 * link, placed.links, _LINK),
            add("/backbone", 0.45 * radius, link, placed.links, _INK),
        ]
        self._wires = [add("/wires", 0.2 * radius, 1.1 * link, placed.wires, colours.astype(np.uint8))]
        self._tip = [
            add("/tip", 1.3 * radius, 0.5 * link, placed.tip, _INK),
            add("/lens", 0.6 * radius, 0.54 * link, placed.tip, _LENS),
        ]
        self._sheath = add("/sheath", 1.35 * radius, part, sheath, _INK)
        self._force = scene.add_arrows(
            "/force",
            placed.force[None],
            _FORCE,
            shaft_radius=0.012,
            head_radius=0.035,
            head_length=0.08,
            visible=False,
        )
        camera = server.initial_camera
        camera.position, camera.look_at, camera.fov = (0.6, -3.0, 1.1), (-0.1, 0.3, 0.1), math.radians(45)
        server.on_client_connect(_fit_narrow)

    def update(self, pose: Any) -> None:
        """Move everything to a pose."""
        placed = place(self._preset, pose, self._force_n)
        for shapes, poses in zip((self._links, self._wires, self._tip), placed[:3], strict=True):
            for shape in shapes:
                _move(shape, poses)
        if pose.sheath_bend != self._sheath_bend:
            self._sheath_bend = pose.sheath_bend
            _move(self._sheath, place_sheath(self._preset, pose.sheath_bend))
        if pose.tip_force_n or self._force.visible:
            self._force.visible = bool(pose.tip_force_n)
            self._force.points = placed.force[None].astype(np.float32)


def _fit_narrow(client: "viser.ClientHandle") -> None:
    """Move the endoscope above the panel of a narrow window."""
    if client.camera.image_width <= NARROW:
        client.camera.position, client.camera.look_at = (0.6, -7.2, 0.9), (-0.1, 0.3, -1.9)


def _move(shape: Any, poses: Poses) -> None:
    shape.batched_positions, shape.batched_wxyzs = poses.position, poses.quaternion


def _cylinder(radius: float, length: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return vertices and faces of a cylinder along x around the origin."""
    import trimesh

    mesh = trimesh.creation.cylinder(radius, length, sections=20)
    return mesh.vertices[:, [2, 0, 1]], mesh.faces
