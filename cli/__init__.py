"""The command `dualdrive`: one file per verb, each holding its click command as `command`."""
