"""Windows that show frames, with pygame. With SDL_VIDEODRIVER=dummy or offscreen they are invisible."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable

from billiards_env.drawing.canvas import pygame  # raises with a hint if pygame is missing
from billiards_env.drawing.pace import faster, slower
from billiards_env.drawing.style import CHALK, CLOTH, GREY, INK
from billiards_env.drawing.text import write

PACE_KEYS = {"-": slower, "[-]": slower, "+": faster, "=": faster, "[+]": faster}
"""The keys that change the playback speed, by their names in pygame; "[-]" is on the keypad."""

INVISIBLE = ("dummy", "offscreen")
"""The video drivers of SDL without a display."""

LINE = 26
"""Height of the line under a film, pixels."""


def open_display(visible: bool = True) -> None:
    """Connects to the display. Without one, raises an OSError, or warns if the window need not be `visible`.

    If SDL_VIDEODRIVER selects an invisible display, that is no error and no warning.
    """
    pygame.display.init()
    driver = pygame.display.get_driver()
    if driver in INVISIBLE and os.environ.get("SDL_VIDEODRIVER") not in INVISIBLE:
        text = f"display = {driver!r}: expected one that shows a window (is DISPLAY or WAYLAND_DISPLAY set?)"
        if visible:
            pygame.display.quit()
            raise OSError(f"{text}; SDL_VIDEODRIVER=dummy runs without a display")
        warnings.warn(f"{text}; the frames are drawn off screen", stacklevel=2)


class Screen:
    """A window of the desktop with the project's name and icon, which the user can resize."""

    def __init__(self, size: tuple[int, int], title: str, visible: bool = True) -> None:
        """Opens a window of `size` (width, height), pixels. See `open_display` for `visible`."""
        for system in ("X11", "WAYLAND"):
            os.environ[f"SDL_VIDEO_{system}_WMCLASS"] = "billiards-env"  # the name of the application
        open_display(visible)
        pygame.display.set_caption(title)
        pygame.display.set_icon(make_icon())
        pygame.display.set_mode(size, pygame.RESIZABLE)
        self._clock = pygame.time.Clock()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the window, pixels."""
        return pygame.display.get_window_size()

    def show(self, frame: pygame.Surface) -> None:
        """Shows a frame in the middle of the window, reduced or enlarged to fit."""
        width, height = self.size
        if frame.get_size() != (width, height):
            zoom = min(width / frame.get_width(), height / frame.get_height())
            frame = pygame.transform.smoothscale(frame, [max(1, round(zoom * side)) for side in frame.get_size()])
        surface = pygame.display.get_surface()
        surface.fill(frame.get_at((0, 0)))
        surface.blit(frame, frame.get_rect(center=(width // 2, height // 2)))
        pygame.display.flip()

    def wait(self, fps: float) -> float:
        """Waits until 1 / fps seconds after the last call and returns the seconds since then."""
        return self._clock.tick(fps) / 1000

    def close(self) -> None:
        """Closes the window."""
        pygame.display.quit()


class Window:
    """A window that shows films. Keys change the pace; the close button, Q and Escape close the window.

    Attributes:
        open: False after the window was closed.
        pace: Playback speed over real time.
    """

    def __init__(self, size: tuple[int, int], title: str, visible: bool = True) -> None:
        """Opens a window for frames of `size` (width, height), pixels. See `open_display` for `visible`."""
        self.open, self.pace = True, 1.0
        self._frame = pygame.Surface((size[0], size[1] + LINE), 0, 32)
        self._screen = Screen(self._frame.get_size(), title, visible)

    def show(self, frame: pygame.Surface, fps: float) -> None:
        """Shows a frame at least 1 / (fps * pace) seconds after the last one; closes the window at a key."""
        for event in pygame.event.get((pygame.QUIT, pygame.KEYDOWN)):
            if event.type == pygame.QUIT or event.key in (pygame.K_q, pygame.K_ESCAPE):
                self.close()
                return
            self.pace = PACE_KEYS.get(pygame.key.name(event.key), float)(self.pace)
        self._frame.fill(frame.get_at((0, 0)))
        self._frame.blit(frame, (0, 0))
        text = f"speed {self.pace:g} x   slower, faster: - +   close: Q"
        left = frame.get_width() // 40, frame.get_height() + LINE * 2 // 5
        write(self._frame, text, 17, GREY, frame.get_width() - 2 * left[0], midleft=left)
        self._screen.show(self._frame)
        self._screen.wait(fps * self.pace)

    def play(self, film: Iterable[pygame.Surface], fps: float) -> None:
        """Shows the frames of a film until the window is closed."""
        for frame in film:
            if not self.open:
                break
            self.show(frame, fps)

    def close(self) -> None:
        """Closes the window."""
        self.open = False
        self._screen.close()


def make_icon() -> pygame.Surface:
    """Returns the icon of the windows, 64 pixels wide: the eight ball on the cloth."""
    large = pygame.Surface((256, 256), pygame.SRCALPHA, 32)
    large.fill((*pygame.Color(CLOTH)[:3], 0))
    pygame.draw.rect(large, CLOTH, large.get_rect(), border_radius=56)
    pygame.draw.circle(large, INK, (128, 128), 104)
    pygame.draw.circle(large, CHALK, (128, 128), 58)
    write(large, "8", 130, INK, center=(128, 132))
    return pygame.transform.smoothscale(large, (64, 64))
