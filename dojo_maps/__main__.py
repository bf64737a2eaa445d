"""The command `dojo-maps`, as `python -m dojo_maps`."""

from dojo_maps.cli import main

if __name__ == "__main__":
    main()
