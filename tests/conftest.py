from hypothesis import settings

# The same examples in every run, and no test that fails because a machine is busy or a kernel is compiled first.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
