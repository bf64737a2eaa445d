"""Edits that a bundle keeps: a patch in its folder `edits`, put on every network that is imported into it."""

from pathlib import Path

from dojo_maps import bundle
from dojo_maps.errors import SourceError
from dojo_maps.issue import Element, Issue, Severity
from dojo_maps.sources.edits import KINDS, Misfit, Patch, apply_patch, make_patch, read_patch
from dojo_maps.sources.files import read_bytes
from dojo_maps.whole_file import work_folder

_ELEMENT_KINDS = {"node": "junction", "edge": "road", "tlLogic": "signal"}


def keep_edits(folder: Path, edited: Path) -> int:
    """Store how a network that a user saved differs from what was imported; earlier edits are part of it.

    Args:
        folder: the bundle.
        edited: the network as netedit saved it.

    Returns:
        How many elements the user changed, created or deleted.

    Raises:
        SourceError: the folder is no bundle, or the file no SUMO network.
    """
    bundle.read_bundle(folder)
    base = folder / bundle.BASE_NETWORK
    source = base if base.is_file() else folder / bundle.NETWORK
    patch = make_patch(read_bytes(source), read_bytes(edited), path=edited)
    with work_folder(folder.parent, f".{folder.name}.") as work:
        fresh, old = work / "new", work / "old"
        fresh.mkdir()
        for kind, data in patch.items():
            (fresh / f"{kind}.xml").write_bytes(data)
        target = folder / bundle.EDITS
        if target.exists():
            target.rename(old)
        fresh.rename(target)
    return sum(len(read_patch(data, kind, edited)) for kind, data in patch.items())


def reapply_edits(
    network: bytes, folder: Path, position: tuple[float, float, float]
) -> tuple[bytes, tuple[Issue, ...]]:
    """Put a bundle's edits on a network that is about to replace its own.

    Args:
        network: as imported.
        folder: the bundle that will be replaced, if there is one.
        position: where on the map to report what no longer fits.

    Returns:
        The network with the edits, and an issue for each that no longer fits.

    Raises:
        SourceError: the edits are broken or unsafe.
    """
    edits = folder / bundle.EDITS
    files = {kind: edits / f"{kind}.xml" for kind in KINDS}
    patch: Patch = {kind: read_bytes(file) for kind, file in files.items() if file.exists()}
    if not patch:
        return network, ()
    try:
        changed, misfits = apply_patch(network, patch, path=edits)
    except SourceError as error:
        raise SourceError(edits, f"{error}; mend or remove this folder") from error
    return changed, tuple(_issue(misfit, position) for misfit in misfits)


def _issue(misfit: Misfit, position: tuple[float, float, float]) -> Issue:
    return Issue(
        check="osm.edit_lost",
        severity=Severity.WARNING,
        elements=(Element(kind=_ELEMENT_KINDS.get(misfit.kind, "connection"), id=misfit.id),),
        position=position,
        message=f"a kept edit of {misfit.kind} {misfit.id} no longer fits: {misfit.reason}",
        hint="make the edit again in netedit and keep it, or remove it from the bundle's folder edits",
    )
