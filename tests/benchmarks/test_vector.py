"""Every step of the environments that the benchmark measures plays a shot."""

from benchmarks import vector


def test_every_step_of_every_environment_plays_a_shot_and_draws_a_layout():
    envs = vector.native(16)
    last = envs.reset(seed=0)[0]
    for action in vector.actions_for(16):
        observations, _, terminated, _, infos = envs.step(action)
        assert terminated.all()
        assert infos["final_info"]["_n_events"].all()
        assert not (observations == last).any()
        last = observations
