from tests.helpers.training import tiny, trained  # noqa: F401  (fixtures)
