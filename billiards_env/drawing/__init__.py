"""Pictures, films and pages of recorded shots, from plain arrays and a scene; it knows nothing of the engine.

`recording` says what is drawn and `style` in which colours; `canvas` draws frames (pygame), `film` writes GIF and MP4,
`plot` draws a picture (matplotlib) and `page` an HTML player. Each is imported when it is first used.
"""
