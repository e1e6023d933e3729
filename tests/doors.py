"""A contract for import-linter: nobody imports past another package's `__init__`.

A file may import its neighbours, the neighbours of the folders that it lies in, and their faces: for every import, what
is named lies at most one level below the nearest folder that both share. So a folder can be rebuilt behind its face.
"""

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, output


class DoorsContract(Contract):
    """No import names a module more than one level below the nearest package that holds both ends."""

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        past = sorted(
            (importer, imported)
            for importer in graph.modules
            if importer.startswith("midair")
            for imported in graph.find_modules_directly_imported_by(importer)
            if imported.startswith("midair") and not through_the_door(importer, imported, graph)
        )
        return ContractCheck(kept=not past, metadata={"past": past})

    def render_broken_contract(self, check: ContractCheck) -> None:
        for importer, imported in check.metadata["past"]:
            output.print_error(f"{importer} imports {imported}; take it from the face of its folder", bold=False)


def through_the_door(importer: str, imported: str, graph: ImportGraph) -> bool:
    """Whether one module may import another by name."""
    home = importer if graph.find_children(importer) else importer.rpartition(".")[0]
    shared = []
    for one, other in zip(home.split("."), imported.split("."), strict=False):
        if one != other:
            break
        shared.append(one)
    below = len(imported.split(".")) - len(shared)
    # 0: the face of a folder that the importer lies in, which would be a circle. The top face hands on nothing upwards.
    return below == 1
