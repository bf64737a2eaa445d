"""Data sets of labelled pictures of simulated traffic: `write_dataset`, and the command `dojo-env dataset`.

settings -> plan of episodes -> parts, each: episodes (SUMO) -> rendering -> labelling -> formats
                             -> writing: the whole from all parts, and its card
"""

from dojo_env.datasets.formats import FORMATS
from dojo_env.datasets.settings import DatasetSettings
from dojo_env.datasets.writing import write_dataset

__all__ = ["FORMATS", "DatasetSettings", "write_dataset"]
