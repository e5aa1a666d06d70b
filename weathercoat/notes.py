"""Every code of a note (`W-...`), what it means and what to do; the documentation is made from this table."""

from __future__ import annotations

from typing import NamedTuple


class Meaning(NamedTuple):
    """What a code says, and the remedy; both full sentences in Markdown."""

    what: str
    remedy: str


_TEXTS: dict[str, tuple[str, str]] = {
    "W-ANIMATION": (
        "The file has animations, which are not kept.",
        "Nothing; export the wanted pose if it matters.",
    ),
    "W-ANGLES": (
        "Remeshed faces have an angle under 10 degrees: creases or rims are closer than edges.",
        "Ask for more faces, or raise `remesh.crease_angle`.",
    ),
    "W-BADINDEX": (
        "Faces with an index that the format does not allow (0 in OBJ, negative in PLY) were dropped; or "
        "corners name a texture coordinate or a normal that does not exist.",
        "Export again if parts are missing.",
    ),
    "W-BOUNDARY": (
        "The surface has open edges. Film ends there: a boundary never cracks, and counts as broken.",
        "Nothing for sheets; close the holes of what should be solid.",
    ),
    "W-COMPONENTS": ("The model has several pieces that are not connected.", "Nothing; all of them age."),
    "W-DEGENERATE": ("Faces without an area were removed.", "Nothing."),
    "W-DUPLICATE": ("Faces on the same vertices as another were dropped.", "Nothing."),
    "W-FACES": (
        "The remeshed surface missed the wanted number of faces by over 2 %.",
        "Ask for more faces, or raise `remesh.crease_angle`: many creases or pieces need many faces.",
    ),
    "W-FLIPPED": ("Faces that looked the other way than their neighbours were turned.", "Nothing."),
    "W-FORMAT": (
        "The content is of another format than the extension says; the content decided.",
        "Rename the file.",
    ),
    "W-GROUP": (
        "Names of `paint.only` or `paint.except` fit no material group or object.",
        "Compare them with the groups that `weathercoat inspect` lists.",
    ),
    "W-INVERTED": ("Closed pieces that were inside out were turned.", "Nothing."),
    "W-KEPT": (
        "Pieces too small for the wanted edge length kept their own triangles.",
        "Nothing; ask for more faces if they matter.",
    ),
    "W-MATERIAL": (
        "A material library or a picture is not beside the model.",
        "Put it there if its colours should show, or if `paint.only` or `paint.except` name materials.",
    ),
    "W-MORPH": ("The file has morph targets, which are not kept.", "Export the wanted shape."),
    "W-NONFINITE": (
        "Vertices with infinite or undefined positions were dropped with their faces; texture coordinates "
        "and colours like that were set to zero.",
        "Export again.",
    ),
    "W-NONMANIFOLD": ("Edges of more than two faces were split, so that the film is a sheet.", "Nothing."),
    "W-NONMANIFOLD-VERTEX": ("Vertices where pieces only touch were split.", "Nothing."),
    "W-NONORIENTABLE": (
        "A piece has only one side, as a Möbius strip has, and was cut open along some edges.",
        "Nothing, unless the cut shows.",
    ),
    "W-OBJECT": (
        "Objects of a scene cannot be weathered (skinned, morphed, flattened or without faces) and stay as "
        "they are; or a camera was passed over.",
        "Export them as plain meshes where they should weather.",
    ),
    "W-POLYGONS": ("Polygons with more than three corners were triangulated.", "Nothing."),
    "W-SELFINT": ("Faces cut through others; looked for by `inspect --self-intersections` only.", "Nothing."),
    "W-SKIN": (
        "A skinned mesh was read as it is modelled, without its pose.",
        "Export the pose as a plain mesh.",
    ),
    "W-SOUP": (
        "Most faces share no edge with another, so that the film cannot hang together.",
        "Merge vertices in a modelling program.",
    ),
    "W-UNKNOWN": (
        "A glTF has properties of its meshes or nodes that glTF does not know and that were passed over.",
        "Look whether a name is misspelt.",
    ),
    "W-UNREFERENCED": ("Vertices that no face uses were dropped.", "Nothing."),
    "W-COLORS": (
        "Vertices at one place have different colours, of which one was kept.",
        "Nothing, or give the parts that have them different materials.",
    ),
    "W-WELDED": ("Vertices at the same position were merged.", "Nothing."),
}

MEANINGS = {code: Meaning(*texts) for code, texts in sorted(_TEXTS.items())}
