import pytest


@pytest.fixture(autouse=True)
def one_thread():
    """Networks run on one thread; the programs may change the settings of PyTorch."""
    torch = pytest.importorskip("torch")
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)
    torch.set_flush_denormal(False)
