// Lightmap: which triangles each texel covers, and points on them.
#include "transport/lightmap.h"

#include <algorithm>

#include "core/check.h"

namespace gi {
namespace {

// A triangle clipped by a square has up to seven corners.
struct Polygon {
  Vec2 corner[8];
  int count = 0;
  double area() const {
    double twice = 0;
    for (int i = 0; i < count; ++i) {
      const Vec2 a = corner[i], b = corner[(i + 1) % count];
      twice += double(a.x) * b.y - double(b.x) * a.y;
    }
    return 0.5 * std::abs(twice);
  }
};

// Keeps what is on the side of the line where sign · (coordinate − limit) ≥ 0. [Sutherland & Hodgman 1974]
Polygon clip(const Polygon& p, int axis, float limit, float sign) {
  const auto side = [&](Vec2 v) { return sign * ((axis == 0 ? v.x : v.y) - limit); };
  Polygon out;
  for (int i = 0; i < p.count; ++i) {
    const Vec2 a = p.corner[i], b = p.corner[(i + 1) % p.count];
    const float da = side(a), db = side(b);
    if (da >= 0.0f) out.corner[out.count++] = a;
    if ((da >= 0.0f) != (db >= 0.0f)) out.corner[out.count++] = a + (b - a) * (da / (da - db));
  }
  return out;
}

Polygon clip_to_texel(const Vec2 triangle[3], int x, int y) {
  Polygon p{{triangle[0], triangle[1], triangle[2]}, 3};
  p = clip(p, 0, float(x), 1.0f);
  p = clip(p, 0, float(x + 1), -1.0f);
  p = clip(p, 1, float(y), 1.0f);
  return clip(p, 1, float(y + 1), -1.0f);
}

float cross2(Vec2 a, Vec2 b) { return a.x * b.y - a.y * b.x; }

constexpr float kLeastArea = 1e-6f;     // of a texel, to count as covered
constexpr double kMostOverlap = 0.005;  // share of the covered texels that rounding may cover twice

}  // namespace

Lightmap::Lightmap(const Scene& scene, LightmapSpec spec, int width, int height)
    : scene_(scene), spec_(std::move(spec)), width_(width), height_(height) {
  const auto instances = scene.instances();
  const auto it = std::find_if(instances.begin(), instances.end(), [&](const Instance& i) { return i.data->name == spec_.object; });
  require(it != instances.end(), "there is no object '" + spec_.object + "' with faces in the scene");
  instance_ = uint32_t(it - instances.begin());
  const MeshData& mesh = scene.mesh(it->mesh);
  for (const AttributeData& a : mesh.attributes)
    if (a.name == spec_.uv_map && a.domain == Domain::kCorner && a.components == 2) map_ = &a;
  require(map_, "object '" + spec_.object + "' has no UV map '" + spec_.uv_map + "'");

  struct Found {
    uint32_t texel, triangle;
    float area;
  };
  std::vector<Found> found;
  coverage_.assign(size_t(width) * size_t(height), 0.0f);
  double outside = 0, inside = 0;
  for (uint32_t t = 0; t < mesh.triangle_count(); ++t) {
    Vec2 uv[3];
    corners(t, uv);
    Vec3 v[3];
    scene.triangle_vertices(instance_, t, v);
    const double whole = 0.5 * std::abs(double(cross2(uv[1] - uv[0], uv[2] - uv[0])));
    const double world = 0.5 * double(length(cross(v[1] - v[0], v[2] - v[0])));
    if (!(whole > 0) || !std::isfinite(whole) || !(world > 0)) continue;
    const auto [x0, x1] = std::minmax({uv[0].x, uv[1].x, uv[2].x});
    const auto [y0, y1] = std::minmax({uv[0].y, uv[1].y, uv[2].y});
    double seen = 0;
    for (int y = std::max(0, int(std::floor(y0))); y < std::min(double(height), std::ceil(double(y1))); ++y)
      for (int x = std::max(0, int(std::floor(x0))); x < std::min(double(width), std::ceil(double(x1))); ++x) {
        const double area = clip_to_texel(uv, x, y).area();
        if (!(area > kLeastArea)) continue;
        found.push_back({uint32_t(index(x, y)), t, float(area / whole * world)});
        coverage_[index(x, y)] += float(area), seen += area;
      }
    inside += seen, outside += whole - seen;
  }
  require(inside > 0, "UV map '" + spec_.uv_map + "' of object '" + spec_.object + "' covers nothing of the image");
  require(outside < 0.001 * inside + 1.0, "UV map '" + spec_.uv_map + "' of object '" + spec_.object + "' reaches outside of the image");
  double twice = 0;
  for (const float c : coverage_) twice += std::max(0.0, double(c) - 1.0);
  require(twice < kMostOverlap * inside + 1.0,
          "UV map '" + spec_.uv_map + "' of object '" + spec_.object + "' overlaps itself: parts of the surface would share texels");

  std::stable_sort(found.begin(), found.end(), [](const Found& a, const Found& b) { return a.texel < b.texel; });
  first_.assign(coverage_.size() + 1, 0u);
  for (const Found& f : found) ++first_[f.texel + 1];
  for (size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  for (const Found& f : found) parts_.push_back({f.triangle, f.area + (parts_.size() == first_[f.texel] ? 0.0f : parts_.back().end)});
}

void Lightmap::corners(uint32_t triangle, Vec2 out[3]) const {
  const MeshData& mesh = scene_.mesh(scene_.instances()[instance_].mesh);
  for (size_t k = 0; k < 3; ++k) {
    const size_t corner = mesh.corner(3 * size_t(triangle) + k);
    out[k] = {map_->data[2 * corner] * float(width_), map_->data[2 * corner + 1] * float(height_)};
  }
}

CameraRay Lightmap::sample(int x, int y, Vec2 u_place, Vec2 u_choice) const {
  // A part by its area, a triangle of its fan by area, a point within.
  const Part *begin = parts_.data() + first_[index(x, y)], *end = parts_.data() + first_[index(x, y) + 1];
  const float wanted = u_choice.x * end[-1].end;
  const Part* part = std::min(std::find_if(begin, end, [&](const Part& p) { return wanted < p.end; }), end - 1);
  Vec2 uv[3];
  corners(part->triangle, uv);
  const Polygon p = clip_to_texel(uv, x, y);
  float fan[8] = {}, sum = 0;
  for (int k = 1; k + 1 < p.count; ++k) fan[k] = sum += std::abs(cross2(p.corner[k] - p.corner[0], p.corner[k + 1] - p.corner[0]));
  int k = 1;
  while (k + 2 < p.count && u_choice.y * sum >= fan[k]) ++k;
  const Vec2 b = sample_triangle(u_place);
  const Vec2 at = p.corner[0] + (p.corner[k] - p.corner[0]) * b.x + (p.corner[k + 1] - p.corner[0]) * b.y;

  const Vec2 e1 = uv[1] - uv[0], e2 = uv[2] - uv[0], d = at - uv[0];
  const float det = cross2(e1, e2);
  const float b1 = clamp01(cross2(d, e2) / det), b2 = std::clamp(cross2(e1, d) / det, 0.0f, 1.0f - b1);
  const ShadingPoint point = scene_.surface_point(instance_, part->triangle, b1, b2, Vec3{}, {});
  const Vec3 q = point.position;
  const float above = 3e-5f * std::max({std::abs(q.x), std::abs(q.y), std::abs(q.z), 1e-2f});
  return {{q + point.ng * above, -point.ng, 0.0f, 2.0f * above}};
}

void Lightmap::adapt(Bsdf& bsdf, Vec3 wo, Vec3 geometric_normal, Vec3 normal) const {
  if (spec_.content == LightmapContent::kRadiosity) {
    bsdf.transparency = Rgb();
    bsdf.choose(kDiffuse, wo);
    return;
  }
  bsdf.clear(geometric_normal, normal);
  bsdf.add(Rgb(1.0f), Lambert{}, Frame::from_normal(normal));
  bsdf.finish(wo);
}

}  // namespace gi
