"""Training and evaluation of agents on `Billiards-v0`.

`python -m agents.train CONFIG` trains PPO (Stable-Baselines3) and writes a run folder. `python -m agents.evaluate
RUN_DIR` measures the trained policy and a random one. `agents.policy_player` lets a trained policy play games.
"""
