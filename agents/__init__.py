"""Training and evaluation of agents on `Billiards-v0`: configurations in, trained policies and evaluations out.

`python -m agents.train CONFIG` trains PPO (Stable-Baselines3) into a run folder, `python -m agents.evaluate RUN_DIR`
measures the trained policy beside a random one.
"""
