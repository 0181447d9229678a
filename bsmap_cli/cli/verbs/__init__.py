"""One module a verb: `run` is the command, its docstring the help page."""
