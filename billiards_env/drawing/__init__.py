"""Pictures, films and pages of recorded shots, and the images of environments.

`recording` is the data of a shot, `orientation` computes how the balls turn, and `style` holds the colours. `canvas`
draws frames with pygame, `film` writes GIF and MP4 files, `plot` draws a picture with matplotlib and `page` writes an
HTML player. `rendering` has the render modes of environments and `raster` the images in observations. Each is imported
on first use.
"""
