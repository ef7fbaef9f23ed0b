"""The contract between export and the native engine: plain NumPy arrays, no bpy.

Lengths are metres, angles radians, colours scene-linear RGB. Matrices are 4x4, row-major, object to world.
Every name is the Blender name, so that errors can say it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

# Visibility bits: which rays see an instance or a lamp. The native RayKind has the same values.
CAMERA, SHADOW, DIFFUSE, GLOSSY, TRANSMISSION, VOLUME = 1, 2, 4, 8, 16, 128
VISIBLE_TO_ALL = CAMERA | SHADOW | DIFFUSE | GLOSSY | TRANSMISSION | VOLUME


@dataclass
class Attribute:
    """A named attribute of a mesh: UV maps, colours, geometry-nodes data."""

    name: str
    domain: str  # POINT, CORNER or FACE
    data: np.ndarray  # (elements, components) float32, components 1..4


@dataclass
class Mesh:
    name: str
    positions: np.ndarray  # (V, 3) float32, object space; the native scene shares it and may move it to world space
    corner_vert: np.ndarray  # (C,) int32
    tri_corner: np.ndarray | None  # (T, 3) int32; None: the faces are triangles, corners and faces as they come
    tri_face: np.ndarray | None  # (T,) int32, needed for FACE attributes and materials where there is tri_corner
    face_material: np.ndarray | None  # (F,) int32 slot of each face; None: all 0
    normals_domain: str  # POINT, CORNER or FACE (flat)
    # (V or C, 3) float32, object space; of flat meshes the vertices', where something may be displaced, else None.
    normals: np.ndarray | None
    # (F,) uint8, of meshes with normals of corners where something may be displaced: not 0 where flat; needs tri_face.
    sharp_face: np.ndarray | None = None
    attributes: list[Attribute] = field(default_factory=list)
    active_uv: str = ""  # the UV map that renders by default
    texture_space: tuple = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))  # location, size of Generated coordinates

    @property
    def triangle_count(self) -> int:
        return len(self.corner_vert) // 3 if self.tri_corner is None else len(self.tri_corner)


@dataclass
class Strands:
    """Curves, as hair is, or points: what stands among Scene.meshes where there are no triangles. An attribute of domain FACE is one of
    whole curves."""

    name: str
    # RIBBON (turned to whoever sees it, shaded as if round), THICK (a round spline), THICK_LINEAR (round, straight between
    # its points) or SPHERE (points)
    shape: str
    positions: np.ndarray  # (K, 3) float32, object space
    radius: np.ndarray  # (K,) float32
    first_vertex: np.ndarray | None  # (S + 1,) int32: where each curve begins, and K; None for points
    subdivisions: int  # of ribbons: a segment is cut into 2**n + 1 straight pieces, 17 at the most
    attributes: list[Attribute] = field(default_factory=list)
    active_uv: str = ""
    texture_space: tuple = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


@dataclass
class Instance:
    """A mesh in one place, or in n places that differ by nothing but matrix and random."""

    name: str
    mesh: int  # index into Scene.meshes
    matrix: np.ndarray  # (4, 4) or (n, 4, 4) float32
    materials: list[int]  # program index of each slot, into Scene.programs; empty slots hold Scene.default_material
    visibility: int = VISIBLE_TO_ALL
    color: tuple = (1.0, 1.0, 1.0, 1.0)
    object_index: int = 0
    random: float | np.ndarray = 0.0  # 0..1, Object Info's Random; (n,) float32 for n places
    holdout: bool = False
    shadow_terminator_offset: float = 0.0  # Blender's Shading Offset
    shadow_terminator_geometry_offset: float = 0.0
    # Object and instancer attributes: name -> 4 floats, or (n, 4) float32 for n places.
    attributes: dict = field(default_factory=dict)

    @property
    def count(self) -> int:
        return 1 if np.ndim(self.matrix) < 3 else len(self.matrix)


@dataclass
class Light:
    """A lamp. `color` is colour x temperature x strength x 2**exposure (W, or W/m2 for the sun)."""

    name: str
    kind: str  # POINT, SPOT, AREA or SUN
    matrix: np.ndarray  # (4, 4) float32, shines along its -Z
    color: tuple  # 3 floats
    normalize: bool = True
    radius: float = 0.0  # POINT, SPOT
    soft_falloff: bool = True  # POINT, SPOT
    spot_size: float = 0.7853982  # SPOT, full angle
    spot_blend: float = 0.0  # SPOT
    shape: str = "RECTANGLE"  # AREA: RECTANGLE (also square) or ELLIPSE (also disk)
    size: tuple = (1.0, 1.0)  # AREA, before the matrix's scale
    spread: float = 3.1415927  # AREA, full angle
    angle: float = 0.0  # SUN, full angle
    program: int = -1  # emission program (index into Scene.programs), multiplies `color`; -1: none
    visibility: int = VISIBLE_TO_ALL & ~CAMERA
    cast_shadow: bool = True
    use_mis: bool = True
    max_bounces: int = 1024


@dataclass
class Camera:
    name: str
    kind: str  # PERSP, ORTHO or PANO (equirectangular)
    matrix: np.ndarray  # (4, 4) float32, without scale
    # The rectangle of the view plane that the frame covers: at distance 1 for PERSP, in metres for ORTHO.
    view_plane: tuple = (-1.0, 1.0, -1.0, 1.0)  # left, right, bottom, top
    clip_start: float = 0.1
    clip_end: float = 1000.0
    aperture_radius: float = 0.0  # metres; 0 is a pinhole
    focus_distance: float = 10.0
    aperture_blades: int = 0
    aperture_rotation: float = 0.0
    aperture_ratio: float = 1.0
    latitude: tuple = (-1.5707963, 1.5707963)  # PANO
    longitude: tuple = (-3.1415927, 3.1415927)


@dataclass
class Image:
    """Pixels of an image texture, row 0 at the bottom."""

    name: str
    pixels: np.ndarray  # (H, W, 4) uint8 (encoded) or float32 (scene-linear)
    srgb: bool = False  # uint8 only: decode sRGB to scene-linear at lookup
    alpha: str = "STRAIGHT"  # STRAIGHT, PREMULTIPLIED, CHANNEL_PACKED or NONE
    tile: int = 1001  # UDIM tile


@dataclass
class Program:
    """A compiled node tree; see native/src/shading/program.h for the instruction format."""

    name: str  # of the material, light or world
    code: np.ndarray  # (n,) int32
    constants: np.ndarray  # (k,) float32, preloaded into registers 0..k
    register_count: int
    tables: np.ndarray  # (m,) float32, lookup tables
    pass_index: int = 0  # Material Index pass
    emission_sampling: str = "AUTO"  # NONE, AUTO, FRONT, BACK, FRONT_BACK: how its triangles are picked as lights
    transparent_shadows: bool = True
    bump_correction: bool = True  # Cycles' Bump Map Correction
    volume: int = -1  # index of the program of what fills objects of this material; -1: nothing
    only_volume: bool = False  # the surface is not there
    volume_program: Program | None = None  # until it has its index
    displacement: int = -1  # index of the program that moves vertices; -1: none
    bumps_displacement: bool = False  # what it moves is bumped by the displacement as well
    displacement_program: Program | None = None  # until it has its index
    # What an integrator has to carry: "subsurface", "absorption" (volumes that do no more), "volumes" or "portals".
    needs: list[str] = field(default_factory=list)
    approximated: list[str] = field(default_factory=list)  # what is rendered as something else, one text for each node


@dataclass
class World:
    program: int = -1  # index into Scene.programs; -1: black
    visibility: int = VISIBLE_TO_ALL
    sampling: str = "AUTOMATIC"  # NONE, AUTOMATIC, MANUAL
    map_resolution: int = 1024
    max_bounces: int = 1024


@dataclass
class Film:
    width: int
    height: int  # full frame, pixels
    region: tuple = ()  # x0, y0, x1, y1 of what is rendered, row 0 at the bottom; () is all
    filter: str = "BLACKMAN_HARRIS"  # BOX, GAUSSIAN or BLACKMAN_HARRIS
    filter_width: float = 1.5  # pixels
    exposure: float = 1.0
    transparent: bool = False
    transparent_glass: bool = False
    transparent_roughness: float = 0.1
    passes: list[str] = field(default_factory=lambda: ["Combined"])  # Cycles' 5.x names
    # Passes that AOV outputs of node trees fill: name, channels (4 or 1). Ops refer to the index.
    aovs: list[tuple[str, int]] = field(default_factory=list)


LIGHTMAP_CONTENTS = (
    (
        "IRRADIANCE",
        "Irradiance",
        "What a white diffuse surface would show: irradiance over pi. Multiply by the surface's colour",
    ),
    ("INDIRECT", "Indirect", "As Irradiance, without what comes straight from luminaires"),
    (
        "RADIOSITY",
        "Radiosity",
        "What the surface emits and scatters diffusely: radiosity over pi. Show it by emission of strength 1",
    ),
)


@dataclass
class Lightmap:
    """A bake: the film lies over an object's surface, as a UV map says."""

    object: str  # name of the Instance
    uv_map: str
    content: str = (
        "IRRADIANCE"  # IRRADIANCE or INDIRECT, over pi: what a white surface shows; RADIOSITY: what it does show
    )


@dataclass
class Scene:
    meshes: list[Mesh | Strands] = field(default_factory=list)
    instances: list[Instance] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    programs: list[Program] = field(default_factory=list)
    images: list[list[Image]] = field(
        default_factory=list
    )  # the tiles of each image texture; ops refer to the outer index
    attribute_names: list[str] = field(default_factory=list)  # ops refer to the index; "" is the active UV map
    world: World = field(default_factory=World)
    camera: Camera | None = None
    film: Film | None = None


@dataclass
class Denoising:
    """What the denoiser is to do with the finished picture; choices as Cycles names them."""

    inputs: str = "RGB_ALBEDO_NORMAL"
    prefilter: str = "ACCURATE"
    quality: str = "HIGH"

    @property
    def guides(self) -> dict[str, str]:
        """The denoiser's name of each guide, and the pass that it is."""
        every = {"albedo": "Denoising Albedo", "normal": "Denoising Normal"}
        return {name: passed for name, passed in every.items() if name.upper() in self.inputs}


@dataclass
class Settings:
    """How to render. `parameters` are the chosen integrator's own, by name."""

    integrator: str = "path"
    samples: int = 128
    time_limit: float = 0.0  # seconds of sampling; 0: none
    noise_target: float = 0.0  # 95th percentile of relative standard error; 0: none
    seed: int = 0
    threads: int = 0  # 0: all
    parameters: dict = field(default_factory=dict)
    keep: bool = True  # what the integrator can keep serves further frames
    kept_file: str = ""  # which holds it from render to render; "": none
    kept_misfit: str = "WITHOUT"  # WITHOUT, REPLACE or STOP: what happens where the file cannot be used
    denoising: Denoising | None = None
