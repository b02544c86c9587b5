"""Pictures, films and pages of recorded shots, drawn from plain arrays and a scene, without the engine.

`recording` is the data of a shot and `style` holds the colours. `canvas` draws frames with pygame, `film` writes GIF
and MP4 files, `plot` draws a picture with matplotlib and `page` writes an HTML player. Each is imported on first use.
"""
