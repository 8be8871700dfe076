"""The command ``sysid``: parses, calls the library, shows. It holds no mathematics."""
