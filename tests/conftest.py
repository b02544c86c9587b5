from hypothesis import settings

# The examples are the same in every run. No test fails because a machine is slow or a kernel is compiled.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
