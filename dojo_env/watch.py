"""Watching an episode: simulated or recorded seconds become frames of a live page or of a video."""

import sys
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Self, Unpack

from dojo_env.camera import read_cameras
from dojo_env.config import EnvConfig, SignalConfig, build_config
from dojo_env.controllers import Controller, make_controller
from dojo_env.errors import ConfigError
from dojo_env.keywords import Settings
from dojo_env.managers.map import MapManager
from dojo_env.metadrive import export_recording
from dojo_env.recording import Recording
from dojo_env.replaying import find_map, open_eyes
from dojo_env.scenario import open_map
from dojo_env.sensors.eyes import Eyes
from dojo_env.signals.plan import SignalPlan
from dojo_env.snapshot import Snapshot
from dojo_env.watching.board import Board, Scoreboard
from dojo_env.watching.pace import Pace
from dojo_env.watching.page import PageState
from dojo_env.watching.poster import draw_poster
from dojo_env.watching.server import LiveServer
from dojo_env.watching.video import Video, open_video
from dojo_env.watching.views import Frame, choose_cameras, draw_views
from dojo_env.world_process import open_world
from dojo_maps.bundle import Bundle
from dojo_maps.interruption import heed

Plans = Mapping[str, SignalPlan]
_LOOKS: Mapping[str, Any] = {"show_links": True, "smooth": True, "width": 480, "height": 344}
"""How people see it, rather than agents."""
_TOLD_EVERY = 300
"""Seconds of a film."""


class LiveShow:
    """Shows seconds on a live page, at the pace that its buttons set."""

    def __init__(self, eyes: Eyes, plans: Plans, title: str, *, port: int = 0, browser: bool = True) -> None:
        """Open the page, and a browser on it if wanted.

        Raises:
            ConfigError: the port is taken.
        """
        self._eyes, self._scores = eyes, Scoreboard(plans)
        self._pace = Pace()
        self._last: tuple[Snapshot, Board] | None = None
        self._drawn = ""
        self.page = PageState(title, tuple(plans), self._pace)
        self._server = LiveServer(self.page, port=port)
        print(f"watch at {self._server.url} (Ctrl-C ends it)", file=sys.stderr)  # noqa: T201
        if browser:
            webbrowser.open(self._server.url)

    @property
    def url(self) -> str:
        """Where the page is."""
        return self._server.url

    def begin(self, seed: int) -> None:
        """Take the conditions of an episode.

        Args:
            seed: of the episode.
        """
        self._eyes.reset(seed)

    def add(self, snapshot: Snapshot) -> None:
        """Show a second; returns when the next one's turn has come.

        Args:
            snapshot: the second.
        """
        board = self._scores.note(snapshot)
        self.page.note(board)
        self._last, self._drawn = (snapshot, board), ""
        while not self._turn():
            pass

    def hold(self) -> None:
        """Say that the episode is over, and keep showing its last second until interrupted."""
        self.page.end()
        while True:
            self._pace.pause()
            self._turn()

    def _turn(self) -> bool:
        """Draw the present second where somebody waits for it, and wait for news or for the next one."""
        heed()
        signal = self.page.signal
        if self._last is not None and self.page.is_asked and self._drawn != signal:
            snapshot, board = self._last
            views = draw_views(self._eyes, choose_cameras(self._eyes, (signal,)), snapshot)
            self._drawn = signal
            self.page.publish(Frame(board=board, views=views))
        return self._pace.wait()

    def close(self) -> None:
        """Close the page."""
        self._server.close()


class FilmShow:
    """Adds a picture per second to a video."""

    def __init__(
        self, eyes: Eyes, plans: Plans, title: str, video: Video, *, on_stage: Callable[[str], None]
    ) -> None:
        """Take where to draw and to write, and who is told how far it is."""
        self._eyes, self._title, self._video = eyes, title, video
        self._plans, self._scores = plans, Scoreboard(plans)
        self._history: list[Board] = []
        self._on_stage, self._seconds = on_stage, 0

    def begin(self, seed: int) -> None:
        """Take the conditions of an episode.

        Args:
            seed: of the episode.
        """
        self._eyes.reset(seed)

    def add(self, snapshot: Snapshot) -> None:
        """Add a second.

        Args:
            snapshot: the second.
        """
        heed()
        board = self._scores.note(snapshot)
        if self._history and board.time <= self._history[-1].time:
            self._history = []
        views = draw_views(self._eyes, choose_cameras(self._eyes, self._plans), snapshot)
        frame = Frame(board=board, views=views)
        self._video.add(draw_poster(frame, title=self._title, history=self._history))
        self._history.append(board)
        self._seconds += 1
        if self._seconds % _TOLD_EVERY == 0:
            self._on_stage(f"{self._seconds:,} seconds drawn")


def open_views(config: EnvConfig) -> tuple[Eyes, Plans]:
    """Open what shows an environment whose world runs in another process.

    Args:
        config: of the environment.

    Returns:
        What draws, and the plan of each signal.

    Raises:
        ConfigError: the map has no signal to control.
    """
    bundle = open_map(config.scenario)
    plans = MapManager(bundle, config.signals, additional=config.scenario.additional).plans
    return Eyes(bundle, config.sensing), plans


def choose_looks(controller: Controller) -> dict[str, Any]:
    """Choose from a controller's settings what people see, too: not how large agents' pictures are.

    Args:
        controller: who acts.

    Returns:
        The keywords that people's views take.
    """
    wanted = controller.complete({})
    return {name: value for name, value in wanted.items() if name not in ("observation", "width", "height")}


def watch(
    controller: str | Controller,
    *,
    seed: int = 0,
    port: int = 0,
    browser: bool = True,
    **keywords: Unpack[Settings],
) -> None:
    """Show an episode live, until interrupted.

    Args:
        controller: its name, or one that is there already.
        seed: of the episode.
        port: of the page; 0 takes any that is free.
        browser: open one on the page.
        keywords: settings of the environment.

    Raises:
        ConfigError: the controller or a setting is unknown, or the port is taken.
        SimulationError: SUMO refuses the scenario.
    """
    acts = make_controller(controller) if isinstance(controller, str) else controller
    config = build_config(**acts.complete({**_LOOKS, **keywords}))
    looks = build_config(**{**choose_looks(acts), **_LOOKS, **keywords})
    title = f"{config.scenario.name}, {acts}, seed {seed}"
    with closing(open_world(config, own_process=True)) as world:
        show = LiveShow(*open_views(looks), title, port=port, browser=browser)
        with closing(show):
            show.begin(seed)
            world.watch(show.add)
            world.run(acts, seed)
            show.hold()


class Rerun:
    """A recording ready to be looked at: its map, its signals and what draws it."""

    def __init__(self, recording: Recording, bundle: Bundle, eyes: Eyes, plans: Plans) -> None:
        """Take all that belongs together; `of` finds it."""
        self._recording, self._bundle, self._eyes, self._plans = recording, bundle, eyes, plans
        self._title = f"{recording.scenario or bundle.road_map.name}, recorded, seed {recording.seed}"

    @classmethod
    def of(
        cls,
        recording: Recording,
        *,
        map: str | Path | None = None,  # noqa: A002 - as in `Scenario`
        signals: Sequence[str] | None = None,
        cameras: Path | None = None,
        **sensing: Any,
    ) -> Self:
        """Open the map of a recording.

        Args:
            recording: the episode.
            map: see `replaying.find_map`.
            signals: ids of those to look at; None for all.
            cameras: a file of cameras for a single signal, instead of those placed from the map.
            sensing: as an environment takes them.

        Returns:
            What shows it; `close` it.

        Raises:
            RecordingError: the map cannot be found, or is another.
            ConfigError: a setting cannot work.
        """
        bundle = find_map(recording, map)
        chosen = tuple(signals) if signals else None
        plans = MapManager(bundle, SignalConfig(ts_ids=chosen)).plans
        if cameras is not None:
            if len(plans) > 1:
                raise ConfigError(f"{cameras}: cameras are for one signal; name it, of {', '.join(plans)}")
            sensing["cameras"] = dict.fromkeys(plans, read_cameras(cameras))
        eyes = open_eyes(recording, bundle, **{**_LOOKS, **sensing})
        return cls(recording, bundle, eyes, plans)

    def watch(self, *, port: int = 0, browser: bool = True) -> None:
        """Show it on a live page, until interrupted.

        Args:
            port: of the page; 0 takes any that is free.
            browser: open one on the page.

        Raises:
            ConfigError: the port is taken.
        """
        with closing(LiveShow(self._eyes, self._plans, self._title, port=port, browser=browser)) as show:
            for snapshot in self._recording:
                show.add(snapshot)
            show.hold()

    def film(self, path: Path, *, on_stage: Callable[[str], None] = lambda _stage: None) -> None:
        """Write a video, a frame per recorded second.

        Args:
            path: of the video.
            on_stage: told now and then how far it is.

        Raises:
            ConfigError: the path cannot be written.
            ToolMissingError: no codec for it is installed.
        """
        with open_video(path) as video:
            show = FilmShow(self._eyes, self._plans, self._title, video, on_stage=on_stage)
            for snapshot in self._recording:
                show.add(snapshot)

    def export(self, folder: Path) -> int:
        """Write MetaDrive's format, whole or not at all.

        Args:
            folder: to make.

        Returns:
            How many scenarios there are.

        Raises:
            ConfigError: the folder is there already.
            ExportError: no vehicle was recorded.
        """
        return export_recording(self._recording, self._bundle, folder)

    def close(self) -> None:
        """Let go of what draws it."""
        self._eyes.close()
