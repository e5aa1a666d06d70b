"""Baking: the state of a snapshot onto the texture coordinates of the input, a band of rows at a time.

What a band holds bounds the memory, whatever the size of the maps; bands are the same for any number of
threads, and so are the bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weathercoat.deform.team import Team
from weathercoat.mesh.surface import Indices, Surface, Vectors
from weathercoat.output.display import Normalisation
from weathercoat.output.maps import planes as planes_of
from weathercoat.output.maps.channels import MAPS, MapKind, fitted, map_kinds
from weathercoat.output.maps.dress import dress
from weathercoat.output.maps.film import FilmCover, find_seen, make_film_cover
from weathercoat.output.maps.layout import Tile, make_layout, uv_areas
from weathercoat.output.maps.locate import locate, make_ground
from weathercoat.output.maps.own import OwnLook, moved_places
from weathercoat.output.maps.padding import find_padding
from weathercoat.output.maps.planes import N_PLANES, Planes
from weathercoat.output.maps.raster import rasterise, rasterise_slivers, texel_corners
from weathercoat.output.maps.relief import REACH, carve, emboss
from weathercoat.output.maps.sinks import ExrSink, PngSink, Sink
from weathercoat.output.maps.tangents import make_frames
from weathercoat.output.pictures import PictureParameters, make_palette
from weathercoat.output.shading import to_linear
from weathercoat.sim.snapshot import Snapshot

_BAND = 1 << 20  # texels of a band, about
_LEAST_BAND = 64  # rows
_LEAST_THICKNESS = 8e-4  # in sizes, as in pictures
_BEVEL = 0.4  # of the thickness: half the width of a closed crack, as in pictures


@dataclass(frozen=True)
class MapParameters:
    """What is baked.

    width, height: of each picture, in texels. maps: names of `channels.MAPS`; packs: names and values of
    packed maps, see `channels.parse_pack`. format: png, of 8 or 16 `bits` a channel, or exr, which has half
    floats. padding: texels round the charts that get what is nearest in them.
    """

    width: int = 2048
    height: int = 2048
    maps: tuple[str, ...] = tuple(MAPS)
    packs: tuple[tuple[str, tuple[str, ...]], ...] = ()
    format: str = "png"
    bits: int = 8
    padding: int = 16


@dataclass(frozen=True)
class _State:
    """What a snapshot adds: its film, how high it stands in sizes, and the values of its vertices, see
    `dress`.
    """

    snapshot: Snapshot
    film: FilmCover
    highest: float
    metal_values: Vectors
    film_values: Vectors


class _Sheet(NamedTuple):
    """A tile at the size of its pictures: corners of its faces (see `raster`), and for all faces of the input
    the way from a texel to the next on the right and below, (m, 3), and the side of a texel (m,), in sizes.
    """

    tile: Tile
    corner: NDArray[np.int64]
    along_column: Vectors
    along_row: Vectors
    texel_size: Vectors


class _Band(NamedTuple):
    """Planes (N_PLANES, texels) of a band with rows beyond its ends; for each of its texels the place in them
    that it shows, int32 (r, w); the numbers of texels that a face covers, and that several do.
    """

    planes: Planes
    source: Indices
    covered: int
    claimed_again: int


class Baker:
    """Bakes snapshots of one run; what does not change with them is worked out once.

    surface: the input, which has texture coordinates; is_painted bool (m,): its faces that carry paint;
    snapshot: any of the run; look: colours, the thickness of the film in sizes, and where it shows the
    input's materials; up: against gravity. Raises TextureCoordinatesError, and CorruptError where a texture
    of the input cannot be decoded.
    """

    def __init__(
        self,
        surface: Surface,
        is_painted: NDArray[np.bool_],
        snapshot: Snapshot,
        look: PictureParameters,
        *,
        up: tuple[float, float, float],
    ) -> None:
        self.surface = surface
        self.layout = make_layout(surface)
        self.size = Normalisation.of(snapshot).size
        self._is_painted = is_painted
        self._normalise = Normalisation.of(snapshot)
        self._vertices = self._normalise(surface.vertices)
        self._rest = self._normalise(snapshot.substrate_vertices)
        self.frames = make_frames(surface, self._vertices)
        self._ground = make_ground(self._rest, snapshot.substrate_faces, self._vertices, surface.faces)
        self._own = OwnLook(surface, is_painted, look.look)
        self._thickness = max(look.film_thickness, _LEAST_THICKNESS)
        self._palette = make_palette(look)
        self._paint = np.asarray(to_linear(look.paint), np.float64)
        self._up = np.asarray(up, np.float64)

    def bake(
        self, snapshot: Snapshot, parameters: MapParameters, folder: Path, *, threads: int = 1
    ) -> dict[str, Any]:
        """Write the maps of a snapshot into a folder that is there; what they are, as `maps.json` has it.

        threads change no bytes. Raises UsageError for maps that there are not, OSError where a file cannot be
        written.
        """
        film_vertices = self._normalise(snapshot.film_vertices)
        film = make_film_cover(snapshot, self._rest, film_vertices, self._ground.neighbors)
        state = _State(
            snapshot,
            film,
            max(film.highest, self._thickness),
            np.stack([snapshot.dust, snapshot.substrate_rust], axis=1),
            np.stack([snapshot.film_rust, snapshot.separated, snapshot.separation_age], axis=1),
        )
        ranges = {planes_of.HEIGHT: (-self._thickness, state.highest)}
        # reductions of a picture mix in what is around its charts: better paint than black
        outside = {planes_of.RED + c: float(self._paint[c]) for c in range(3)}
        kinds = {
            name: fitted(kind, ranges, outside)
            for name, kind in map_kinds(parameters.maps, parameters.packs).items()
        }
        team = Team(threads)
        tiles = [self._bake_tile(tile, state, kinds, parameters, folder, team) for tile in self.layout.tiles]
        return {
            "step": int(snapshot.step),
            "age": float(snapshot.age),
            "height": {"low": -self._thickness * self.size, "paint": 0.0, "high": state.highest * self.size},
            "lift": {"low": 0.0, "high": state.highest * self.size},
            "tiles": tiles,
        }

    def _bake_tile(
        self,
        tile: Tile,
        state: _State,
        kinds: Mapping[str, MapKind],
        parameters: MapParameters,
        folder: Path,
        team: Team,
    ) -> dict[str, Any]:
        width, height = parameters.width, parameters.height
        steps = self.frames.along_u / width, self.frames.along_v / -height
        texel_size = np.sqrt(np.linalg.norm(np.cross(*steps), axis=1))
        sheet = _Sheet(tile, texel_corners(tile.uv, width, height), *steps, texel_size)
        files = {name: self._file_name(tile, name, parameters.format) for name in kinds}
        sinks = {name: self._sink(folder / files[name], kinds[name], parameters, state) for name in kinds}
        bands = list(_bands(width, height))
        counts = np.zeros((len(bands), 2), np.int64)
        turn, order, waiting = Lock(), iter(range(len(bands))), dict[int, dict[str, Any]]()
        written = iter(range(len(bands)))
        next_written = next(written, -1)

        def work(_: int) -> None:
            nonlocal next_written
            while True:
                with turn:
                    number = next(order, None)
                if number is None:
                    return
                band = self._bake_band(sheet, state, bands[number], parameters)
                counts[number] = band.covered, band.claimed_again
                parts = {name: sink.prepare(band.planes, band.source) for name, sink in sinks.items()}
                with turn:
                    waiting[number] = parts
                    while next_written in waiting:
                        for name, part in waiting.pop(next_written).items():
                            sinks[name].add(part)
                        next_written = next(written, -1)

        team.share(work)
        for sink in sinks.values():
            sink.finish()
        covered, again = (int(count) for count in counts.sum(axis=0))
        areas = uv_areas(tile.uv)
        return {
            "set": tile.name,
            "tile": tile.number,
            "files": files,
            "faces": len(areas),
            "mirrored_faces": int((areas < 0.0).sum()),
            "faces_without_area": int((areas == 0.0).sum()),
            "texels": covered,
            "overlapping_share": again / max(covered, 1),
        }

    def _file_name(self, tile: Tile, name: str, format: str) -> str:
        before = f"{tile.name}_" if tile.name else ""
        return f"{before}{name}" + (f".{tile.number}" if self.layout.is_udim else "") + f".{format}"

    def _sink(self, path: Path, kind: MapKind, parameters: MapParameters, state: _State) -> Sink:
        if parameters.format == "exr":
            factors = {planes_of.HEIGHT: self.size, planes_of.LIFT: state.highest * self.size}
            return ExrSink(path, kind, factors)
        return PngSink(path, kind, parameters.width, parameters.height, parameters.bits)

    def _bake_band(self, sheet: _Sheet, state: _State, band: range, parameters: MapParameters) -> _Band:
        beyond = parameters.padding + REACH + 1
        first = max(0, band.start - beyond)
        rows, columns = min(parameters.height, band.stop + beyond) - first, parameters.width
        inner = slice(band.start - first, band.stop - first)
        face = np.full((rows, columns), -1, np.int32)
        weights = np.zeros((rows, columns, 2), np.float32)
        again = np.zeros((rows, columns), np.uint8)
        rasterise(sheet.corner, first, face, weights, again)
        covered, claimed_again = int((face[inner] >= 0).sum()), int(again[inner].sum())
        rasterise_slivers(sheet.corner, first, face, weights)
        source = np.empty((rows, columns), np.int32)
        find_padding(face, parameters.padding, source)
        texels = np.flatnonzero(face.ravel() >= 0)
        face.ravel()[texels] = sheet.tile.faces[face.ravel()[texels]]
        is_shown = np.zeros(face.size, np.bool_)
        is_shown[source[inner][source[inner] >= 0]] = True
        planes = np.empty((N_PLANES, rows * columns), np.float32)
        texel = (1.0 / columns, 1.0 / parameters.height)
        self._fill(sheet, state, face, weights, texels, texels[is_shown[texels]], texel, planes)
        return _Band(planes, source[inner], covered, claimed_again)

    def _fill(
        self,
        sheet: _Sheet,
        state: _State,
        face: Indices,
        weights: NDArray[np.float32],
        texels: NDArray[np.int64],
        shown: NDArray[np.int64],
        texel: tuple[float, float],
        planes: Planes,
    ) -> None:
        """Fill the planes at the texels that are shown, and their relief at all, since it counts beside."""
        film, snapshot, frames, metal = state.film, state.snapshot, self.frames, self._ground.faces
        ground, where = locate(self._ground, face, weights, self._vertices, self.surface.faces)
        seen, seen_where = np.empty_like(face), np.zeros_like(weights)
        height, is_back = np.empty(face.shape, np.float32), np.empty(face.shape, np.bool_)
        find_seen(
            ground, where, self._rest, metal, film.normals, film.covering, film.has_moved, film.first,
            film.reach, film.vertices, film.faces, seen, seen_where, height, is_back,
        )  # fmt: skip
        flat, flat_weights = face.ravel(), weights.reshape(-1, 2)
        flat_seen, flat_where = seen.ravel(), seen_where.reshape(-1, 2)
        emboss(
            texels, flat, flat_weights, self._is_painted, frames.normals, sheet.texel_size, ground.ravel(),
            self._rest, metal, flat_seen, flat_where, height.ravel(), is_back.ravel(), film.covering,
            film.metal_face, film.corner_normals, film.sides, self._thickness, _BEVEL * self._thickness,
            state.highest, planes,
        )  # fmt: skip
        uv = None if snapshot.surface is None else snapshot.surface.uv
        moved = moved_places(film, uv, flat_seen[shown], flat_where[shown])
        color, orm, tilt = self._own.at(flat[shown], flat_weights[shown], texel, moved)
        dress(
            shown, flat, self._is_painted, self._own.material >= 0, self._own.shows, color, orm,
            ground.ravel(), where.reshape(-1, 2), self._rest, metal, state.metal_values, flat_seen,
            flat_where, is_back.ravel(), film.faces, film.metal_face, state.film_values,
            float(snapshot.age), self._paint, self._palette, self._up, planes,
        )  # fmt: skip
        carve(
            shown, face, weights, frames.chart, frames.normals, frames.tangents, frames.signs,
            sheet.along_column, sheet.along_row, tilt, planes,
        )  # fmt: skip


def _bands(width: int, height: int) -> Iterator[range]:
    """Rows that are baked together."""
    rows = max(_LEAST_BAND, _BAND // width)
    for start in range(0, height, rows):
        yield range(start, min(start + rows, height))
