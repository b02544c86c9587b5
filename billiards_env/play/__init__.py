"""A window in which people, and programs, play a game: `python -m billiards_env.play`.

`model` holds what can happen, as pure functions of plain data; it knows neither window nor clock. `players` finds the
programs that play; `screen` draws a model, and `window` turns mouse and keys into a model's inputs. pygame is imported
by the last two.
"""
