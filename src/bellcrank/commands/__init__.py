"""The subcommands of `bellcrank`, a module each with `add_arguments` and `run`."""
