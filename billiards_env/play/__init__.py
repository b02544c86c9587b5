"""A window in which people and programs play a game: `python -m billiards_env.play`.

`model` is the state of the window with pure functions that update it. It uses neither pygame nor a clock. `preview`
predicts the start of an aimed shot and `labels` makes the texts. `view` places the parts of a frame and draws a model
with pygame, and `panel` draws the controls. `window` has the table of the keys, converts mouse and keyboard events to
actions of the model, and calls the programs that play, each in a thread. These programs are in `billiards_env.players`.
"""
