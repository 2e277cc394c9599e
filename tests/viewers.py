"""A stand-in for viser: it keeps what is drawn, and moves sliders when asked to."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

__all__ = ["Server"]


class Handle(SimpleNamespace):
    """A thing in the scene, or a widget, whose attributes can be set as viser's are."""

    def on_update(self, act: Callable[[Any], None]) -> None:
        self.act = act

    def put(self, value: Any) -> None:
        """Do what a user does to a widget."""
        self.value = value
        self.act(self)


class Server:
    """What `pinbound.explorer.live` asks of a `viser.ViserServer`."""

    def __init__(self, **options: Any) -> None:
        self.options, self.stopped = options, False
        self.frames: dict[str, Handle] = {}
        self.solids: dict[str, Handle] = {}
        self.sliders: list[Handle] = []
        self.scene = self.gui = self

    def on_client_connect(self, act: Callable[[Any], None]) -> None:
        self.window = Handle(camera=Handle(position=None, look_at=None))
        self.connect = act

    def add_frame(self, name: str, show_axes: bool) -> Handle:
        return self.frames.setdefault(name, Handle(show_axes=show_axes))

    def add_mesh_simple(self, name: str, vertices: Any, faces: Any, **options: Any) -> Handle:
        assert faces.max() < len(vertices)
        return self.solids.setdefault(name, Handle(vertices=vertices, faces=faces, **options))

    def add_markdown(self, content: str) -> Handle:
        self.text = Handle(content=content)
        return self.text

    def add_dropdown(self, label: str, options: Any, initial_value: str) -> Handle:
        self.choice = Handle(label=label, options=options, value=initial_value)
        return self.choice

    def add_slider(self, label: str, low: float, high: float, step: float, initial_value: float) -> Handle:
        assert low <= initial_value <= high
        self.sliders.append(Handle(label=label, low=low, high=high, value=initial_value))
        return self.sliders[-1]

    def get_port(self) -> int:
        return int(self.options.get("port", 0))

    def stop(self) -> None:
        self.stopped = True
