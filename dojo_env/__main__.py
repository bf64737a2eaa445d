"""The command `dojo-env`, as `python -m dojo_env`."""

from dojo_env.cli import main

if __name__ == "__main__":
    main()
