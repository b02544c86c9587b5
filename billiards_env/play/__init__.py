"""A window in which people and programs play a game: `python -m billiards_env.play`.

`model` is the state of the window with pure functions that update it. It uses neither pygame nor a clock. `preview`
predicts the start of an aimed shot, `hint` computes the aim for a pot, `labels` makes the texts, `pages` holds the keys
and the rules, and `view` draws a model with pygame. `window` converts mouse and keyboard events to actions of the
model, and calls the programs that play, each in a thread. These programs are in `billiards_env.players`.
"""
