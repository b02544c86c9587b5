import math
import os
import re
import sys
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from gymnasium.utils.env_checker import check_env

from billiards_env import billiards_v0
from billiards_env import envs as billiards_envs
from billiards_env.drawing.recording import recording_of
from billiards_env.engine import typed_run
from billiards_env.envs import RecordVideo, make_env, step
from billiards_env.envs.billiards import FPS, RENDER_MODES
from billiards_env.jit import Typed
from billiards_env.shots import simulation
from tests.helpers.environments import same
from tests.helpers.films import read_mp4

make: Any = gym.make  # Any: the type of the result of `render` depends on the render mode
make_vec: Any = gym.make_vec
BilliardsEnv: Any = billiards_envs.BilliardsEnv

INTO_THE_CORNER = {"positions": [[0.97, 0.335], [1.07, 0.435]]}
SLOWLY = np.array([0.1, 0.1], np.float32)


@pytest.fixture(autouse=True)
def pygame():
    return pytest.importorskip("pygame")


def n_frames(info):
    return math.ceil(FPS * info["shot_time"] - 1e-6) + 1


@pytest.mark.parametrize("kwargs", [{}, {"mode": "pit", "dt": 0.01}], ids=["pic", "pit"])
def test_a_render_mode_does_not_change_the_results(kwargs):
    def played(mode):
        """Returns the results of two episodes."""
        env: Any = make_env(render_mode=mode, max_shots=3, n_object_balls=2, max_speed=0.3, **kwargs)
        rng, log = np.random.default_rng(0), []
        for seed in range(2):
            log.append(env.reset(seed=seed))
            over = False
            while not over:
                log.append(env.step(rng.uniform(-1, 1, 2)))
                over = log[-1][2]
                if mode:
                    env.render()
        return log

    plain = played(None)
    for mode in ("rgb_array", "rgb_array_list"):
        same(played(mode), plain)


@pytest.mark.parametrize("render_mode", RENDER_MODES)
@pytest.mark.parametrize("vector", [False, True])
def test_each_shot_runs_the_engine_once(render_mode, vector, monkeypatch):
    limits = []

    def counting(*choice):
        engine = typed_run(*choice)

        def run(begin, end, scene, limit, *rest):
            limits.append(limit)
            engine.call(begin, end, scene, limit, *rest)

        return Typed(run)

    for module in (step, simulation):
        monkeypatch.setattr(module, "typed_run", counting)
    make_one = {"id": "Billiards-v0", "render_mode": render_mode, "max_shots": 2}
    env = make_vec(**make_one, num_envs=2) if vector else make(**make_one)
    env.reset(seed=0)
    for _ in range(2):
        env.step(0.2 * np.stack([SLOWLY, SLOWLY]) if vector else 0.2 * SLOWLY)
        env.render()
    shown = [0] if not vector or render_mode == "human" else [0, 1]
    assert list(env.unwrapped._episodes.state.recorded) == shown  # a window shows the first environment
    env.close()
    # Balls at rest are drawn as a shot of 0 s.
    assert sum(limit > 0 for limit in limits) == (4 if vector else 2)


def test_an_array_may_be_modified_and_a_reset_shows_the_start():
    env = make("Billiards-v0", render_mode="rgb_array", max_shots=2)
    env.reset(seed=0)
    start = env.render()
    assert (start.shape, start.dtype) == ((462, 800, 3), np.uint8)
    env.step(SLOWLY)
    env.render()[:] = 0
    assert env.render().any()
    env.reset(seed=0)
    assert (env.render() == start).all()


OBSTACLE = {"base": "pool", "balls": {"radius": [0.03, 0.05, 0.03], "mass": [0.2, "inf", 0.2]}}


APART, MISSED = [[0.0, 0.0], [0.3, 0.0], [0.6, 0.1]], ("reward 0   score 0", "reward 0   score 0")


FILMS = {
    "a ball was potted before": (
        {"n_object_balls": 2},
        [*INTO_THE_CORNER["positions"], [-0.5, -0.3]],
        ("1.98", "0.57"),
        ("reward 1   score 1", "reward 0   score 1"),
    ),
    "an obstacle": ({"scene": OBSTACLE, "task": "carom", "max_speed": 1.0}, APART, ("0.49", "0.14"), MISSED),
    "a goal": (
        {"n_object_balls": 2, "task": "place", "max_speed": 1.0, "goal_radius": 0.2},
        APART,
        ("0.49", "0.14"),
        MISSED,
    ),
}


@pytest.mark.parametrize(("kwargs", "positions", "speeds", "results"), FILMS.values(), ids=FILMS)
def test_the_frames_are_those_of_the_shots_with_texts(kwargs, positions, speeds, results):
    from billiards_env.drawing.canvas import Canvas, pixels

    both: list[Any] = [make_env(render_mode=mode, max_shots=3, **kwargs) for mode in ("rgb_array_list", "rgb_array")]
    env, single = both
    canvas, places, in_play, films = Canvas(env.scene), np.array(positions), np.ones(3, bool), []

    def add(shot, *texts):
        circles = [(*goal, 0.2) for goal in env.goals.tolist()]
        film = canvas.film(recording_of(shot), FPS, *texts, circles=circles)
        films.extend(pixels(frame) for frame in film)
        assert np.array_equal(single.render(), films[-1])

    for one in both:
        one.reset(seed=0, options={"positions": positions})
    add(simulation.simulate(env.scene, positions, [0.0, 0.0], max_time=0.0, record=True), env.task)
    for number, (action, speed, result) in enumerate(zip((3.5 * SLOWLY, -SLOWLY), speeds, results, strict=True), 1):
        for one in both:
            one.step(action)
        velocity = env.max_speed * action.astype(float)
        shot = simulation.simulate(env.scene, places, velocity, in_play=in_play, record=True)
        add(shot, f"{env.task}   shot {number} of 3   {speed} m/s", result)
        places, in_play = shot.positions, ~shot.potted
    assert np.array_equal(env.render(), films)
    assert env.render() == []
    env.reset(seed=0)
    env.step(SLOWLY)
    env.reset(seed=1)
    assert len(env.render()) == 1  # a reset discards earlier frames


def test_human_shows_a_shot_in_real_time(pygame, monkeypatch):
    from billiards_env.drawing.window import LINE, Window

    shown, paces = [], []
    show = Window.show
    monkeypatch.setattr(
        Window,
        "show",
        lambda self, frame, fps: shown.append(frame.get_size()) or paces.append(fps) or show(self, frame, fps),
    )
    env = make("Billiards-v0", render_mode="human")
    env.reset(seed=0)
    assert shown == [(800, 462)]
    assert pygame.display.get_surface().get_size() == (800, 462 + LINE)
    *_, info = env.step(0.1 * SLOWLY)
    assert len(shown) == 1 + n_frames(info)
    assert set(paces) == {FPS}
    assert env.render() is None
    env.close()
    assert not pygame.display.get_init()
    env.close()


def test_without_a_display_human_draws_off_screen_with_a_warning(pygame, monkeypatch):
    from billiards_env.drawing import window

    shown = []
    monkeypatch.setattr(window, "os", SimpleNamespace(environ={}))  # SDL_VIDEODRIVER is not set
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
    monkeypatch.setattr(window.Screen, "wait", lambda self, fps: shown.append(fps))
    env = make("Billiards-v0", render_mode="human")
    with pytest.warns(UserWarning, match="^display = 'offscreen': expected .* the frames are drawn off screen") as said:
        check_env(env.unwrapped, skip_render_check=True)
    env.reset(seed=0)
    env.step(SLOWLY)
    assert len([warning for warning in said if "offscreen" in str(warning.message)]) == 1
    assert len(shown) > 1
    env.close()


@pytest.mark.parametrize("key", [None, "q", "escape"])
def test_a_closed_window_ends_the_rendering(key, pygame, monkeypatch):
    env = make("Billiards-v0", render_mode="human", max_shots=5)
    env.reset(seed=0)
    event = {"key": pygame.key.key_code(key), "mod": 0} if key else {}
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN if key else pygame.QUIT, event))
    with pytest.warns(UserWarning, match="The window was closed: the environment continues without it"):
        env.step(SLOWLY)
    assert not pygame.display.get_init()
    monkeypatch.setattr(env.unwrapped._renderer, "_films", None)  # nothing is drawn
    env.step(SLOWLY)
    env.reset(seed=1)
    assert env.render() is None
    env.close()


def test_keys_change_the_pace_of_a_window(pygame, monkeypatch):
    from billiards_env.drawing.window import Screen, Window

    waits = []
    monkeypatch.setattr(Screen, "wait", lambda self, fps: waits.append(fps))
    window = Window((320, 200), "test")
    frame = pygame.Surface((320, 200))
    window.show(frame, 30)
    plain = pygame.surfarray.array3d(pygame.display.get_surface())
    for key in (pygame.K_PLUS, pygame.K_EQUALS, pygame.K_MINUS):
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key, mod=0))
        window.show(frame, 30)
    assert waits == [30, 60, 120, 60]
    assert (pygame.surfarray.array3d(pygame.display.get_surface()) != plain).any()  # the pace is shown
    pygame.display.set_mode((400, 500), pygame.RESIZABLE)
    window.show(frame, 30)
    assert pygame.display.get_surface().get_size() == (400, 500)
    window.close()


def test_record_video_films_every_frame_of_every_shot(tmp_path):
    pytest.importorskip("moviepy")
    env = make("Billiards-v0", render_mode="rgb_array_list", max_shots=2)
    env = RecordVideo(env, str(tmp_path / "films"), episode_trigger=lambda episode: episode != 1)
    twin = make("Billiards-v0", render_mode="rgb_array_list", max_shots=2)
    expected = {}
    for episode in range(3):
        env.reset(seed=episode)
        twin.reset(seed=episode)
        over = False
        while not over:
            *_, over, _, info = env.step(0.2 * SLOWLY)
            twin.step(0.2 * SLOWLY)
            if episode != 1:  # `render` returns the recorded frames, as in Gymnasium's wrapper
                assert len(env.render()) == n_frames(info)
        expected[episode] = twin.render()
    env.close()
    assert sorted(os.listdir(tmp_path / "films")) == ["rl-video-episode-0.mp4", "rl-video-episode-2.mp4"]
    for episode in (0, 2):
        _, film = read_mp4(tmp_path / "films" / f"rl-video-episode-{episode}.mp4")
        assert len(film) == len(expected[episode])
        for one, other in zip(film[::25], expected[episode][::25], strict=True):
            assert np.abs(one.astype(int) - other).mean() < 4


def test_record_video_by_length(tmp_path):
    pytest.importorskip("moviepy")
    env = make("Billiards-v0", render_mode="rgb_array_list")
    env = RecordVideo(
        env, str(tmp_path / "films"), episode_trigger=lambda _: False, step_trigger=lambda s: s == 1, video_length=5
    )
    lengths = []
    for episode in range(3):
        env.reset(seed=episode)
        *_, info = env.step(SLOWLY)
        lengths.append(1 + n_frames(info))  # the starting state and the shot
    env.close()
    assert os.listdir(tmp_path / "films") == ["rl-video-step-1.mp4"]
    assert len(read_mp4(tmp_path / "films" / "rl-video-step-1.mp4")[1]) == lengths[1]  # a shot is not cut short


@pytest.mark.filterwarnings("ignore:Exception ignored in. .function RecordVideo")  # the destructor of Gymnasium 1.2
def test_record_video_raises_for_another_render_mode(tmp_path):
    with pytest.raises(ValueError, match="render_mode = 'rgb_array': expected 'rgb_array_list'"):
        RecordVideo(make("Billiards-v0", render_mode="rgb_array"), str(tmp_path))


@pytest.mark.parametrize(
    ("autoreset_mode", "mode"), [("NextStep", "rgb_array"), ("SameStep", "rgb_array"), ("SameStep", "rgb_array_list")]
)
def test_the_vector_environment_renders_the_frames_of_each_environment(autoreset_mode, mode):
    game = {"task": "place", "render_mode": mode, "max_shots": 2, "n_object_balls": 2}
    envs = make_vec("Billiards-v0", num_envs=2, autoreset_mode=autoreset_mode, **game)
    single: Any = make_env(**game)
    envs.reset(seed=5)
    layouts = envs.render()
    actions = np.random.default_rng(0).uniform(-0.06, 0.06, (3, 2, 2))
    steps = []
    for action in actions:
        envs.step(action)
        steps.append(envs.render())
    assert type(layouts) is tuple
    assert {len(frames) for frames in (layouts, *steps)} == {2}
    for k in range(2):
        single.reset(seed=5 + k)
        assert np.array_equal(single.render(), layouts[k])
        over = False
        for action, frames in zip(actions, steps, strict=True):
            reset = over
            if reset:
                single.reset()
            if reset and autoreset_mode == "NextStep":
                over = False
            else:
                if reset:
                    single.render()  # SameStep: the frames of a step are those of its shot
                *_, over, _, _ = single.step(action[k])
            assert np.array_equal(single.render(), frames[k])
    envs.close()


def test_the_wrappers_of_gymnasium_for_vectors_film_and_show_the_frames(tmp_path):
    pytest.importorskip("moviepy")
    wrappers = pytest.importorskip("gymnasium.wrappers.vector.rendering")
    envs = make_vec("Billiards-v0", num_envs=3, render_mode="rgb_array", max_shots=3, autoreset_mode="NextStep")
    envs = wrappers.RecordVideo(envs, str(tmp_path / "films"), video_aspect_ratio=(3, 1))
    envs.reset(seed=0)
    for sign in (1, -1, 1):
        envs.step(np.tile(sign * SLOWLY, (3, 1)))
    assert [frame.shape for frame in envs.recorded_frames] == [(462, 3 * 800, 3)] * 4
    envs.close()
    assert os.listdir(tmp_path / "films") == ["rl-video-episode-0.mp4"]


@pytest.mark.parametrize("make", [make_env, billiards_v0.env], ids=["an environment", "a game"])
def test_rendering_without_a_render_mode_warns(make):
    env: Any = make()
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="without a render.mode"):
        assert env.render() is None
    env.close()


@pytest.mark.parametrize("mode", RENDER_MODES)
def test_the_error_without_pygame_contains_the_command_to_install_it(mode, monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    monkeypatch.delitem(sys.modules, "billiards_env.drawing.canvas", raising=False)
    env: Any = make_env(render_mode=mode)  # no error yet, as in Gymnasium's environments
    if mode != "human":
        env.reset(seed=0)
    with pytest.raises(DependencyNotInstalled, match=re.escape("(in a clone: pip install '.[render]')")):
        env.reset(seed=0) if mode == "human" else env.render()


@pytest.mark.parametrize(("render_mode", "fps"), [("rgb_array", 1), ("rgb_array_list", 30), ("human", 30)])
def test_a_video_of_single_frames_shows_each_shot_for_a_second(render_mode, fps):
    # SyncVectorEnv of Gymnasium 1.2 adds the mode of its autoreset to this dict.
    metadata = {key: value for key, value in BilliardsEnv.metadata.items() if key != "autoreset_mode"}
    assert metadata == {"render_modes": list(RENDER_MODES), "render_fps": FPS}
    assert gym.make("Billiards-v0", render_mode=render_mode).metadata["render_fps"] == fps
    assert make_vec("Billiards-v0", num_envs=2, render_mode=render_mode).metadata["render_fps"] == fps


def test_the_frame_of_a_game_names_the_next_player_and_its_group(pygame):
    env = make_env(task="eight_ball", n_players=2, render_mode="rgb_array")
    env.reset(seed=0)
    env.reset(options={"positions": env.positions, "state": {"solids": 1, "player": 0}})
    env.step([0.01, 0.0, 0.0, 0.0])
    renderer: Any = env._renderer
    assert renderer._steps[-1][0].right == "no hit   next: player 1 (solids)"
