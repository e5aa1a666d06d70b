"""A run as one USD stage with time samples; needs the extra `usd`.

Each sheet of film and metal is a mesh whose points, faces and primvars change over time, under a prim for
each part of the model. Time codes are seconds; one age lasts as long as it is told.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from weathercoat.errors import UsageError
from weathercoat.output.glb import Material, Node, Sheet, rotation_to_y
from weathercoat.output.textures import PictureFolder

FRAMES_PER_SECOND = 24.0


class Frame(NamedTuple):
    """The nodes of a moment, `seconds` after the start."""

    seconds: float
    nodes: Sequence[Node]


def require_usd() -> None:
    """Raise UsageError where the extra is not installed."""
    if importlib.util.find_spec("pxr") is None:
        raise UsageError("USD needs a library that is not installed", remedy="pip install 'weathercoat[usd]'")


def write_usd(
    path: Path, frames: Iterable[Frame], *, up: tuple[float, float, float], metres_per_unit: float = 1.0
) -> None:
    """Write frames as one stage, in the format of the extension: usdc, usda or usd.

    up: the model's axis against gravity; y and z are kept, others turned to y. Colours are `displayColor`,
    linear; scalars are primvars without their underscore. Raises UsageError without the extra, OSError where
    the stage cannot be written.
    """
    require_usd()
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if up == (0.0, 0.0, 1.0) else UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, metres_per_unit)
    stage.SetTimeCodesPerSecond(FRAMES_PER_SECOND)
    root = UsdGeom.Xform.Define(stage, "/model")
    stage.SetDefaultPrim(root.GetPrim())
    if up not in ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        turned = np.eye(4)
        turned[:3, :3] = rotation_to_y(up)
        root.AddTransformOp().Set(Gf.Matrix4d(*turned.T.ravel().tolist()))
    writer = _Stage(stage, PictureFolder(path.parent))
    codes = []
    for frame in frames:
        code = round(frame.seconds * FRAMES_PER_SECOND, 6)
        codes.append(code)
        writer.add(frame.nodes, code)
    if codes:
        writer.hide_missing(codes)
        stage.SetStartTimeCode(codes[0])
        stage.SetEndTimeCode(codes[-1])
    stage.GetRootLayer().Save()


class _Stage:
    """Meshes and materials of a stage by name."""

    def __init__(self, stage: Any, pictures: PictureFolder) -> None:
        self.stage = stage
        self.pictures = pictures
        self.meshes: dict[str, Any] = {}
        self.shown: dict[str, list[float]] = {}
        self.materials: list[tuple[Material, Any]] = []
        self.paths: dict[str, str] = {}

    def add(self, nodes: Sequence[Node], code: float) -> None:
        for node in nodes:
            below = self._path("/model", node.name)
            seen: dict[str, int] = {}
            for sheet in node.sheets:
                if not len(sheet.faces):
                    continue
                role = sheet.role or "mesh"
                seen[role] = seen.get(role, 0) + 1
                name = f"{role}_{sheet.part}" if sheet.part >= 0 else f"{role}_{seen[role]}"
                self._sample(below, name, sheet, code)

    def _path(self, above: str, name: str) -> str:
        """The path of a prim of this name, which is another for each name."""
        from pxr import Tf, UsdGeom

        key = f"{above}\0{name}"
        if key not in self.paths:
            word, number = Tf.MakeValidIdentifier(name), 2
            path = f"{above}/{word}"
            while path in self.paths.values():
                path, number = f"{above}/{word}_{number}", number + 1
            self.paths[key] = path
            UsdGeom.Xform.Define(self.stage, path).GetPrim().SetDisplayName(name)
        return self.paths[key]

    def _sample(self, above: str, name: str, sheet: Sheet, code: float) -> None:
        from pxr import Sdf, UsdGeom, UsdShade, Vt

        path = f"{above}/{name}"
        if path not in self.meshes:
            mesh = UsdGeom.Mesh.Define(self.stage, path)
            mesh.CreateSubdivisionSchemeAttr().Set(UsdGeom.Tokens.none)
            mesh.CreateDoubleSidedAttr().Set(True)
            mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
            UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(self._material(sheet.material))
            self.meshes[path] = mesh
        mesh = self.meshes[path]
        self.shown.setdefault(path, []).append(code)
        points = np.ascontiguousarray(sheet.vertices, np.float32)
        mesh.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(points), code)
        mesh.CreateExtentAttr().Set(
            Vt.Vec3fArray.FromNumpy(np.stack([points.min(axis=0), points.max(axis=0)])), code
        )
        mesh.CreateFaceVertexCountsAttr().Set(
            Vt.IntArray.FromNumpy(np.full(len(sheet.faces), 3, np.int32)), code
        )
        mesh.CreateFaceVertexIndicesAttr().Set(
            Vt.IntArray.FromNumpy(np.ascontiguousarray(sheet.faces, np.int32).ravel()), code
        )
        normals = np.ascontiguousarray(sheet.normals, np.float32)
        mesh.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(normals), code)
        primvars = UsdGeom.PrimvarsAPI(mesh)

        def primvar(key: str, kind: Any, values: Any) -> None:
            primvars.CreatePrimvar(key, kind, UsdGeom.Tokens.vertex).Set(values, code)

        if sheet.colors is not None:
            colors = np.ascontiguousarray(sheet.colors, np.float32)
            primvar("displayColor", Sdf.ValueTypeNames.Color3fArray, Vt.Vec3fArray.FromNumpy(colors))
        if sheet.uv is not None:
            uv = np.ascontiguousarray(sheet.uv, np.float32)
            primvar("st", Sdf.ValueTypeNames.TexCoord2fArray, Vt.Vec2fArray.FromNumpy(uv))
        for key, values in sheet.scalars.items():
            stored = np.ascontiguousarray(values, np.float32)
            primvar(key.strip("_").lower(), Sdf.ValueTypeNames.FloatArray, Vt.FloatArray.FromNumpy(stored))

    def hide_missing(self, codes: Sequence[float]) -> None:
        """Hide the meshes that are not there at some time, such as film that has all fallen."""
        from pxr import UsdGeom

        for path, shown in self.shown.items():
            if len(shown) < len(codes):
                visibility = self.meshes[path].CreateVisibilityAttr()
                for code in codes:
                    is_there = code in shown
                    visibility.Set(UsdGeom.Tokens.inherited if is_there else UsdGeom.Tokens.invisible, code)

    def _material(self, material: Material) -> Any:
        from pxr import Gf, Sdf, UsdShade

        for known, made in self.materials:
            if known == material:
                return made
        path = self._path("/model", "materials") + f"/material_{len(self.materials)}"
        made = UsdShade.Material.Define(self.stage, path)
        made.GetPrim().SetDisplayName(material.name)
        shader = UsdShade.Shader.Define(self.stage, f"{path}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(material.roughness)
        shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(material.metallic)
        color = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        picture = None if material.source is None else material.source.base_texture
        if picture is not None:
            reader = self._reader(f"{path}/st", "UsdPrimvarReader_float2", "st", Sdf.ValueTypeNames.Float2)
            texture = UsdShade.Shader.Define(self.stage, f"{path}/picture")
            texture.CreateIdAttr("UsdUVTexture")
            texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{self.pictures.add(picture)}")
            texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
            for side in ("wrapS", "wrapT"):
                texture.CreateInput(side, Sdf.ValueTypeNames.Token).Set("repeat")
            texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader)
            color.ConnectToSource(texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
        elif material.source is not None:
            color.Set(Gf.Vec3f(*material.source.base_color[:3]))
        else:
            color.ConnectToSource(
                self._reader(
                    f"{path}/color", "UsdPrimvarReader_float3", "displayColor", Sdf.ValueTypeNames.Float3
                )
            )
        made.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))
        self.materials.append((material, made))
        return made

    def _reader(self, path: str, kind: str, primvar: str, result: Any) -> Any:
        from pxr import Sdf, UsdShade

        reader = UsdShade.Shader.Define(self.stage, path)
        reader.CreateIdAttr(kind)
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(primvar)
        return reader.CreateOutput("result", result)
