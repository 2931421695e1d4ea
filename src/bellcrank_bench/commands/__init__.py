"""The subcommands `bench` and `verify` of `bellcrank`."""
