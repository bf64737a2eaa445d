"""Charts show what was measured, whole and the same each time; what cannot be drawn is said in a line."""

import copy
import csv
import math
from pathlib import Path

import numpy as np
import pytest
from commands import run_env

import dojo_env
from dojo_env.charts import Plot, average
from dojo_env.errors import ConfigError
from dojo_env.learning.settings import RunFileError
from dojo_env.replaying import find_map
from dojo_env.runs import Episodes
from dojo_env.series import Series
from dojo_env.snapshot import Snapshot

pytest.importorskip("matplotlib")
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("plots")


@pytest.fixture(scope="module")
def episodes(folder: Path) -> Episodes:
    return dojo_env.run_controller(
        "max-pressure", 2, scenario="two-way", num_seconds=120, out_csv_name=str(folder / "rows"),
        record_name=str(folder / "seen"),
    )  # fmt: skip


def curves(plot: Plot) -> dict[str, list[np.ndarray]]:
    """Read the curves back from a chart, by the titles of its panels."""
    return {
        place.get_title(loc="left"): [line.get_ydata() for line in place.get_lines()]
        for place in plot.figure.axes
        if place.get_lines()
    }


def test_episodes_draw_what_their_files_hold(episodes: Episodes, folder: Path) -> None:
    tables = [
        list(csv.DictReader((folder / f"rows_conn0_ep{n}.csv").read_text().splitlines())) for n in (1, 2)
    ]
    told = np.mean([[float(row["agents_total_stopped"]) for row in table] for table in tables], axis=0)
    drawn = curves(episodes.plot("queue", smooth=5))
    assert list(drawn) == ["queue (vehicles)"]
    assert np.allclose(drawn["queue (vehicles)"], told)
    again = dojo_env.plot([folder / "rows_conn0_ep1.csv", folder / "rows_conn0_ep2.csv"], "queue", smooth=5)
    assert np.allclose(np.mean(curves(again)["queue (vehicles)"], axis=0), told)


def test_every_figure_that_is_measured_can_be_drawn(episodes: Episodes) -> None:
    names = list(episodes.series[0].figures)
    assert {"queue", "co2", "delay", "accumulated_waiting", "t_phase", "safety_violations"} <= set(names)
    assert len(curves(episodes.plot(*names))) == len(names)
    assert len(curves(episodes.plot())) == 6


def test_recording_tells_what_the_simulation_told(episodes: Episodes, folder: Path) -> None:
    recording = dojo_env.Recording.open(folder / "seen_ep1.npz")
    found, told = recording.series, episodes.series[0]
    seconds = np.searchsorted(found.at, told.at)
    for name in ("system_total_running", "system_total_stopped"):
        assert np.array_equal(found.figures[name][seconds], told.figures[name]), name
    assert np.allclose(found.figures["system_mean_speed"][seconds], told.figures["system_mean_speed"])
    assert len(curves(dojo_env.plot({"seconds": recording, "decisions": episodes}))) == 3


def test_lights_are_those_that_were_shown(episodes: Episodes, folder: Path) -> None:
    recording = dojo_env.Recording.open(folder / "seen_ep1.npz")
    (place,) = recording.plot_signals().figure.axes
    (image,) = place.get_images()
    pixels = np.asarray(image.get_array())
    assert pixels.shape[:2] == (len(recording[0].signals["t"]), len(recording))
    for second in (0, 60, 119):
        green = [letter in "Gg" for letter in recording[second].signals["t"]]
        assert [bool(red < 0.6) for red in pixels[:, second, 0]] == green
    with pytest.raises(ConfigError, match=r"\['x'\]: not in the recording; it has t"):
        recording.plot_signals("x")


def test_traffic_is_drawn_where_it_is(folder: Path) -> None:
    recording = dojo_env.Recording.open(folder / "seen_ep1.npz")
    snapshot = recording[100]
    plot = snapshot.plot(find_map(recording).road_map)
    bodies = plot.figure.axes[0].collections[-1]
    assert len(bodies.get_paths()) == len(snapshot.ids) > 5
    corners = bodies.get_paths()[0].vertices[:4]
    assert np.allclose(corners[:2].mean(axis=0), snapshot.positions[0, :2])
    behind = corners[2:].mean(axis=0) - corners[:2].mean(axis=0)
    assert math.isclose(math.hypot(*behind), snapshot.sizes[0, 0], rel_tol=1e-6)
    assert math.isclose(math.atan2(-behind[1], -behind[0]), snapshot.headings[0], abs_tol=1e-6)
    assert Snapshot(time=0.0).plot()._repr_png_().startswith(PNG)


def test_training_draws_its_validations(folder: Path) -> None:
    training = folder / "training"
    training.mkdir()
    (training / "curve.csv").write_text(
        "steps,part,reward,travel_time_all\n10,training,-9,90\n10,validation,-5,80\n20,validation,-4,70\n"
    )
    drawn = curves(dojo_env.plot(training))
    assert [list(curve) for curve in drawn["mean trip, of all vehicles (s)"]] == [[80, 70]]
    with pytest.raises(ConfigError, match="draw them apart"):
        dojo_env.plot([training, folder / "rows_conn0_ep1.csv"])


@pytest.mark.slow
def test_same_chart_has_the_same_bytes_and_shows_itself(episodes: Episodes, tmp_path: Path) -> None:
    for kind in ("png", "svg", "pdf"):
        first, again = (episodes.plot("co2").save(tmp_path / f"{n}.{kind}").read_bytes() for n in range(2))
        assert first == again
    assert episodes.plot()._repr_png_().startswith(PNG)
    assert "max-pressure: 2 episodes" in episodes._repr_html_()
    assert f"<td>{np.mean([e['travel_time'] for e in episodes]):,.2f}</td>" in episodes._repr_html_()


def test_infos_of_a_loop_of_ones_own_are_drawn(episodes: Episodes) -> None:
    infos = [{"step": 5 * k, "agents_total_stopped": k} for k in range(1, 9)]
    drawn = curves(dojo_env.plot(infos, smooth=5))
    assert [list(curve) for curve in drawn["queue (vehicles)"]] == [list(range(1, 9))]
    assert list(Series.of_infos(infos).at) == [5 * k for k in range(1, 9)]
    assert len(dojo_env.plot([*infos, *infos], smooth=5).figure.axes[0].collections) == 1  # Their range.
    assert len(curves(dojo_env.plot([episodes, episodes], "co2"))["CO₂ (g/s)"]) == 2
    copied = copy.deepcopy(episodes)  # As pickle does it.
    assert copied == episodes
    assert np.array_equal(copied.series[1].figures["co2"], episodes.series[1].figures["co2"])


def test_averages_take_in_what_was_before() -> None:
    values = np.random.default_rng(0).random(50)
    assert np.allclose(average(values, 4)[3:], np.convolve(values, np.ones(4) / 4, "valid"))
    assert np.allclose(average(values, 4)[:2], [values[0], values[:2].mean()])


def test_what_cannot_be_drawn_is_said(episodes: Episodes, folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"figure 'queu': not measured here; .*; did you mean queue\?"):
        episodes.plot("queu")
    with pytest.raises(ConfigError, match=r"a plot's name ends in \.png, \.svg, \.pdf"):
        episodes.plot().save("x.jpeg")
    with pytest.raises(ConfigError, match="nothing was measured"):
        dojo_env.plot([])
    with pytest.raises(ConfigError, match="int: has no figures over time"):
        dojo_env.plot(5)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"smooth=-1: expected seconds above 0"):
        episodes.plot(smooth=-1)
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(RunFileError, match="no figures over time"):
        dojo_env.plot(tmp_path / "other.csv")
    with pytest.raises(RunFileError, match="no training"):
        dojo_env.plot(tmp_path)


@pytest.mark.slow
def test_commands_draw(folder: Path, episodes: Episodes, tmp_path: Path) -> None:
    table, recording = folder / "rows_conn0_ep1.csv", folder / "seen_ep1.npz"
    for arguments in (
        ["plot", table, recording, "-o", tmp_path / "both.svg"],
        ["plot", recording, "--lights", "-o", tmp_path / "lights.png"],
        [
            "run",
            "--scenario",
            "two-way",
            "--controller",
            "cycle",
            "--seconds",
            20,
            "--plot",
            tmp_path / "r.pdf",
        ],
    ):
        done = run_env(*arguments)
        assert done.returncode == 0, done.stderr
        assert (
            next(Path(name) for name in arguments if Path(str(name)).parent == tmp_path).stat().st_size > 1000
        )
    done = run_env("plot", table, recording, "--lights", "-o", tmp_path / "x.png")
    assert (done.returncode, done.stderr) == (2, "dojo-env: --lights draws one recording, and no figures\n")
    assert not (tmp_path / "x.png").exists()
