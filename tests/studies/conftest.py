from tests.helpers.training import one_thread, tiny, trained

__all__ = ["one_thread", "tiny", "trained"]
