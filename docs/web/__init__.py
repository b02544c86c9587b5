"""The engines as WebAssembly, for browsers.

Modules:
    build: Compiles the engines and writes the module and the page: `python -m docs.web.build`, or `make page`.
    check: Compares shots in a browser with those of Python, bit for bit: `python -m docs.web.check`.

The other files are the run time of the compiled code (runtime.c), the JavaScript module (engine.js and checks.js) and
the page (play.html).
"""
