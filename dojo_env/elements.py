"""Read SUMO's small XML files, which come from anywhere: no document types, no entities, one clear error."""

import gzip
from collections.abc import Callable
from pathlib import Path
from xml.parsers import expat

from dojo_env.errors import ConfigError

_PIECE = 1 << 20


def read_elements(path: Path, visit: Callable[[str, dict[str, str]], None] | None = None) -> None:
    """Call `visit`, if any, with name and attributes of each element, in their order; gzip is unpacked.

    Raises:
        ConfigError: the file cannot be read, is no XML, or has a document type.
    """

    def refuse(*_: object) -> None:
        raise ConfigError(f"{path}: has a document type, which no file of SUMO's has; refused as unsafe")

    parser = expat.ParserCreate()
    parser.StartElementHandler = visit
    parser.StartDoctypeDeclHandler = refuse
    try:
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            while piece := file.read(_PIECE):
                parser.Parse(piece, False)
            parser.Parse(b"", True)
    except (expat.ExpatError, gzip.BadGzipFile, EOFError, ValueError, LookupError) as error:
        raise ConfigError(f"{path}: not a file that SUMO can read ({error})") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror}); correct the path") from error
