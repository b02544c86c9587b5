"""A window that shows frames."""

from __future__ import annotations

import pygame


class Window:
    """A pygame window; with the environment variable SDL_VIDEODRIVER=dummy it is invisible."""

    def __init__(self, size: tuple[int, int], title: str) -> None:
        """Opens a window of `size` (width, height), pixels."""
        pygame.display.init()
        pygame.display.set_caption(title)
        self._screen = pygame.display.set_mode(size)
        self._clock = pygame.time.Clock()

    def show(self, frame: pygame.Surface, fps: float) -> None:
        """Shows a frame at least 1 / fps seconds after the last one."""
        self._screen.blit(frame, (0, 0))
        pygame.event.pump()
        self._clock.tick(fps)
        pygame.display.flip()

    def close(self) -> None:
        """Closes the window."""
        pygame.display.quit()
