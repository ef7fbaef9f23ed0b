// Texture ops: thin wrappers that read operands and call the textures in textures/. Enum immediates are listed with each op.
#include "shading/images.h"
#include "shading/ops.h"
#include "shading/resources.h"
#include "shading/textures/brick.h"
#include "shading/textures/checker.h"
#include "shading/textures/gabor.h"
#include "shading/textures/gradient.h"
#include "shading/textures/ies.h"
#include "shading/textures/magic.h"
#include "shading/textures/noise.h"
#include "shading/textures/projection.h"
#include "shading/textures/sky.h"
#include "shading/textures/voronoi.h"
#include "shading/textures/wave.h"
#include "shading/voxels.h"

namespace gi {
namespace {

using namespace texture;

// noise(value, colour; vector, w, scale, detail, roughness, lacunarity, offset, gain, distortion;
//       dimensions, Fractal, normalize, colour wanted)
void noise(const Operands& a, ShadeState&) {
  FractalSettings s;
  s.type = Fractal(a.imm(12)), s.normalize = a.imm(13) != 0;
  s.detail = std::clamp(a.f(5), 0.0f, 15.0f), s.roughness = std::max(a.f(6), 0.0f);
  s.lacunarity = a.f(7), s.offset = a.f(8), s.gain = a.f(9);
  const float scale = a.f(4);
  with_dimensions(a.imm(11), [&]<int N>() {
    const Rgb c = noise_texture(coordinates<N>(a.v(2), a.f(3)) * scale, s, a.f(10), a.imm(14) != 0);
    a.set(0, c.r()), a.set(1, c);
  });
}

// white_noise(value, colour; vector, w; dimensions)
void white_noise(const Operands& a, ShadeState&) {
  with_dimensions(a.imm(4), [&]<int N>() {
    const Point<N> p = coordinates<N>(a.v(2), a.f(3));
    a.set(0, hash_value(p)), a.set(1, hash_rgb(p));
  });
}

// voronoi(distance or radius, colour, position, w; vector, w, scale, detail, roughness, lacunarity, smoothness, exponent,
//         randomness; dimensions, VoronoiFeature, VoronoiMetric, normalize, float hash)
void voronoi(const Operands& a, ShadeState&) {
  VoronoiSettings s;
  const float scale = a.f(6);
  s.detail = std::clamp(a.f(7), 0.0f, 15.0f), s.roughness = clamp01(a.f(8)), s.lacunarity = a.f(9);
  s.smoothness = std::clamp(a.f(10) * 0.5f, 0.0f, 0.5f), s.exponent = a.f(11), s.randomness = clamp01(a.f(12));
  s.feature = VoronoiFeature(a.imm(14)), s.metric = VoronoiMetric(a.imm(15)), s.normalize = a.imm(16) != 0, s.float_hash = a.imm(17) != 0;
  with_dimensions(a.imm(13), [&]<int N>() {
    const VoronoiSample<N> v = voronoi_texture(coordinates<N>(a.v(4), a.f(5)) * scale, s);
    const Point<N> p = map(v.position, [scale](float x) { return safe_divide(x, scale); });
    Vec3 position;
    for (int d = 0; d < std::min(N, 3) && N != 1; ++d) position[d] = p[d];
    a.set(0, v.distance), a.set(1, v.color), a.set(2, position), a.set(3, N == 1 || N == 4 ? p[N - 1] : 0.0f);
  });
}

// gabor(value, phase, intensity; vector, scale, frequency, anisotropy, orientation 2D, orientation 3D; dimensions)
void gabor_texture(const Operands& a, ShadeState&) {
  const Gabor g = gabor(a.v(3) * a.f(4), a.imm(9), a.f(5), a.f(6), a.f(7), a.v(8));
  a.set(0, g.value), a.set(1, g.phase), a.set(2, g.intensity);
}

// affine(result; vector, three rows of the matrix, translation): the Texture Mapping of old files
void affine(const Operands& a, ShadeState&) {
  const Vec3 p = a.v(1);
  a.set(0, Vec3{dot(a.v(2), p), dot(a.v(3), p), dot(a.v(4), p)} + a.v(5));
}

// checker(colour, value; vector, colour 1, colour 2, scale)
void checker_texture(const Operands& a, ShadeState&) {
  const float value = checker(a.v(2) * a.f(5));
  const Vec3 color = a.v(value == 1.0f ? 3 : 4);
  a.set(0, color), a.set(1, value);
}

// gradient(value; vector; Gradient)
void gradient_texture(const Operands& a, ShadeState&) { a.set(0, gradient(a.v(1), Gradient(a.imm(2)))); }

// brick(colour, mortar; vector, colour 1, colour 2, mortar colour, scale, mortar size, mortar smooth, bias, width, row height,
//       offset, squash; offset frequency, squash frequency)
void brick_texture(const Operands& a, ShadeState&) {
  BrickSettings s;
  s.mortar_size = a.f(7), s.mortar_smooth = a.f(8), s.bias = a.f(9), s.width = a.f(10), s.row_height = a.f(11);
  s.offset = a.f(12), s.squash = a.f(13), s.offset_frequency = a.imm(14), s.squash_frequency = a.imm(15);
  const Brick b = brick(a.v(2) * a.f(6), s);
  const Rgb color = lerp(lerp(a.c(3), a.c(4), b.tint), a.c(5), b.mortar);
  a.set(0, color), a.set(1, b.mortar);
}

// wave(value; vector, scale, distortion, detail, detail scale, detail roughness, phase; Wave, WaveDirection, WaveProfile)
void wave_texture(const Operands& a, ShadeState&) {
  WaveSettings s;
  s.distortion = a.f(3), s.detail = a.f(4), s.detail_scale = a.f(5), s.detail_roughness = a.f(6), s.phase = a.f(7);
  s.type = Wave(a.imm(8)), s.direction = WaveDirection(a.imm(9)), s.profile = WaveProfile(a.imm(10));
  a.set(0, wave(a.v(1) * a.f(2), s));
}

// magic(colour, value; vector, scale, distortion; depth)
void magic_texture(const Operands& a, ShadeState&) {
  const Rgb color = magic(a.v(2), a.f(3), a.imm(5), a.f(4));
  a.set(0, color), a.set(1, average(color));
}

enum class Projection { kFlat, kSphere, kTube };
enum class EnvironmentProjection { kEquirectangular, kMirrorBall };

// Magenta where there are no images at all, as for one that is missing.
Texel lookup(const ShadeState& s, int image, Vec2 uv, Interpolation interpolation, Extension extension, bool unassociate) {
  static const ImageSet none;
  const ImageSet& images = s.resources.images ? *s.resources.images : none;
  return images.lookup(image, uv, interpolation, extension, unassociate);
}
void set_texel(const Operands& a, const Texel& t) { a.set(0, t.color), a.set(1, t.alpha); }

// image(colour, alpha; vector; image, Projection, Interpolation, Extension, unassociate)
void image_texture(const Operands& a, ShadeState& s) {
  const Vec3 p = a.v(2);
  Vec2 uv{p.x, p.y};
  if (Projection(a.imm(4)) == Projection::kSphere) uv = project_to_sphere(p);
  if (Projection(a.imm(4)) == Projection::kTube) uv = project_to_tube(p);
  set_texel(a, lookup(s, a.imm(3), uv, Interpolation(a.imm(5)), Extension(a.imm(6)), a.imm(7) != 0));
}

// image_box(colour, alpha; vector, blend, normal in object space; image, Interpolation, Extension, unassociate)
void image_box_texture(const Operands& a, ShadeState& s) {
  const Vec3 p = a.v(2), n = a.v(4), weights = box_weights(n, a.f(3));
  // No side shows the image mirrored.
  const Vec2 uv[3] = {{n.x < 0.0f ? 1.0f - p.y : p.y, p.z}, {n.y > 0.0f ? 1.0f - p.x : p.x, p.z}, {n.z > 0.0f ? 1.0f - p.y : p.y, p.x}};
  Texel sum{Rgb(), 0};
  for (int i = 0; i < 3; ++i) {
    if (weights[i] <= 0.0f) continue;
    const Texel t = lookup(s, a.imm(5), uv[i], Interpolation(a.imm(6)), Extension(a.imm(7)), a.imm(8) != 0);
    sum.color += weights[i] * t.color, sum.alpha += weights[i] * t.alpha;
  }
  set_texel(a, sum);
}

// voxels(colour, density; place in the unit cube; image, its side, Interpolation)
void voxels(const Operands& a, ShadeState& s) {
  const ImageSet* images = s.resources.images.get();
  const bool known = images && a.imm(3) >= 0 && size_t(a.imm(3)) < images->size();
  const Texel nothing{Rgb(), 0.0f};
  set_texel(a, known ? lookup_voxels((*images)[size_t(a.imm(3))], a.imm(4), a.v(2), Interpolation(a.imm(5))) : nothing);
}

// environment(colour, alpha; direction; image, EnvironmentProjection, Interpolation)
void environment_texture(const Operands& a, ShadeState& s) {
  const bool ball = EnvironmentProjection(a.imm(4)) == EnvironmentProjection::kMirrorBall;
  const Vec2 uv = ball ? direction_to_mirror_ball(a.v(2)) : direction_to_equirectangular(a.v(2));
  set_texel(a, lookup(s, a.imm(3), uv, Interpolation(a.imm(5)), Extension::kRepeat, false));
}

// Reads a struct of floats from the program's tables.
template <class T>
T from_table(const ShadeState& s, int offset) {
  static_assert(std::is_trivially_copyable_v<T> && alignof(T) == alignof(float));
  T value;
  std::memcpy(static_cast<void*>(&value), s.tables + offset, sizeof(T));
  return value;
}

// Whether the tables hold a T at the offset that immediate I gives.
template <class T, int I>
bool table_has(const int32_t* immediates, size_t tables) {
  return immediates[I] >= 0 && size_t(immediates[I]) + sizeof(T) / sizeof(float) <= tables;
}

// sky(colour; direction; image, offset of a SkyDisc)
void sky_texture(const Operands& a, ShadeState& s) {
  const Vec3 d = a.v(1);  // not made unit
  const SkyDisc disc = from_table<SkyDisc>(s, a.imm(3));
  const Rgb sky = lookup(s, a.imm(2), sky_coordinates(d, disc.rotation), Interpolation::kLinear, Extension::kExtend, false).color;
  a.set(0, positive(with_sun_disc(sky, d, disc)));
}

// sky_preetham(colour; direction; offset of a PreethamSky)
void preetham_texture(const Operands& a, ShadeState& s) {
  a.set(0, preetham(texture::by_angles(a.v(1)), from_table<PreethamSky>(s, a.imm(2))));
}

// sky_hosek_wilkie(colour; direction; offset of a SunnyHosekWilkieSky)
void hosek_wilkie_texture(const Operands& a, ShadeState& s) {
  a.set(0, hosek_wilkie(texture::by_angles(a.v(1)), from_table<SunnyHosekWilkieSky>(s, a.imm(2))));
}

// ies(factor; direction, strength; offset of an IesTable, its size, whether it is followed by darkness)
void ies_texture(const Operands& a, ShadeState& s) {
  const Vec3 d = normalize(a.v(1));
  const float h = std::atan2(d.x, d.y) + kPi, v = std::acos(std::clamp(-d.z, -1.0f, 1.0f));
  a.set(0, a.f(2) * IesTable(s.tables + a.imm(3), a.imm(5) != 0).at(h, v));
}
bool ies_fits(const int32_t* immediates, size_t tables) {
  return immediates[0] >= 0 && immediates[1] >= 6 && int64_t(immediates[0]) + immediates[1] <= int64_t(tables);
}

constexpr Op kTextureOps[] = {
    {"noise", "fv", "vffffffff", 4, OpKind::kPure, noise},
    {"white_noise", "fv", "vf", 1, OpKind::kPure, white_noise},
    {"voronoi", "fvvf", "vffffffff", 5, OpKind::kPure, voronoi},
    {"gabor", "fff", "vffffv", 1, OpKind::kPure, gabor_texture},
    {"affine", "v", "vvvvv", 0, OpKind::kPure, affine},
    {"checker", "vf", "vvvf", 0, OpKind::kPure, checker_texture},
    {"gradient", "f", "v", 1, OpKind::kPure, gradient_texture},
    {"brick", "vf", "vvvvffffffff", 2, OpKind::kPure, brick_texture},
    {"wave", "f", "vffffff", 3, OpKind::kPure, wave_texture},
    {"magic", "vf", "vff", 1, OpKind::kPure, magic_texture},
    {"image", "vf", "v", 5, OpKind::kContext, image_texture},
    {"image_box", "vf", "vfv", 4, OpKind::kContext, image_box_texture},
    {"voxels", "vf", "v", 3, OpKind::kContext, voxels},
    {"environment", "vf", "v", 3, OpKind::kContext, environment_texture},
    {"sky", "v", "v", 2, OpKind::kContext, sky_texture, 0, table_has<SkyDisc, 1>},
    {"sky_preetham", "v", "v", 1, OpKind::kContext, preetham_texture, 0, table_has<PreethamSky, 0>},
    {"sky_hosek_wilkie", "v", "v", 1, OpKind::kContext, hosek_wilkie_texture, 0, table_has<SunnyHosekWilkieSky, 0>},
    {"ies", "f", "vf", 3, OpKind::kPure, ies_texture, 0, ies_fits},
};

}  // namespace

std::span<const Op> texture_ops() { return kTextureOps; }

}  // namespace gi
