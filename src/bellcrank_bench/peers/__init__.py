"""The tools that people use today, each set up as fast as it goes: one module a tool, with a `PEER`.

Every module can be imported without its tool, which is loaded when its runs are asked for. `settings.yaml` has the
methods and settings that are tried.
"""
