// Projecting points through the lens: in closed form but for panoramas with depth of field, which are solved for.
#include "scene/camera_lens.h"

namespace gi {
namespace {

float frame_area(const Camera& c) { return std::abs((c.right - c.left) * (c.top - c.bottom)); }
Vec2 on_frame(const Camera& c, float x, float y) { return {(x - c.left) / (c.right - c.left), (y - c.bottom) / (c.top - c.bottom)}; }

struct Line {
  Vec3 origin, direction;  // camera space, not unit
};

// Solid angle: dω = cos³θ dA on the plane at distance 1.
float perspective_density(const Camera& c, float cos, float distance) { return 1.0f / (frame_area(c) * cos * cos * cos * sqr(distance)); }

float panoramic_density(const Camera& c, float sin_latitude, float distance) {
  const float cos = safe_sqrt(1.0f - sqr(sin_latitude));
  const float range = std::abs((c.longitude[1] - c.longitude[0]) * (c.latitude[1] - c.latitude[0]));
  return 1.0f / (range * std::max(cos, 1e-6f) * sqr(distance));
}

Vec2 panoramic_film(const Camera& c, Vec3 n) {
  const float middle = 0.5f * (c.longitude[0] + c.longitude[1]);
  float phi = std::atan2(n.x, -n.z);
  phi += 2.0f * kPi * std::round((middle - phi) / (2.0f * kPi));
  const float theta = std::asin(std::clamp(n.y, -1.0f, 1.0f));
  return {(phi - c.longitude[0]) / (c.longitude[1] - c.longitude[0]), (theta - c.latitude[0]) / (c.latitude[1] - c.latitude[0])};
}

// The ray that Camera::sample makes for the film's direction n through this place of the aperture.
Line panoramic_line(const Camera& c, Vec3 n, Vec2 lens) {
  const Frame frame = Frame::from_normal_and_tangent(n, Vec3{-n.z, 0, n.x});
  const Vec3 origin = frame.x * lens.x + frame.y * lens.y;
  return {origin, n * c.focus_distance - origin};
}

// Where the line of n passes p, across `along`.
Vec3 passing(const Camera& c, Vec3 n, Vec2 lens, Vec3 p, Vec3 along) {
  const Line line = panoramic_line(c, n, lens);
  const float t = dot(p - line.origin, along) / dot(line.direction, along);
  return line.origin + line.direction * t;
}

std::optional<LensSample> sample_panorama(const Camera& c, Vec3 p, Vec2 lens) {
  Vec3 n = normalize(p), origin;
  if (length_squared(n) == 0.0f) return {};
  if (lens.x != 0.0f || lens.y != 0.0f) {
    // The direction whose ray meets p: n is where the line from its lens point through p is in focus, and the lens point follows n.
    Vec3 before;
    for (int k = 0; k < 32 && length_squared(n - before) > 1e-13f; ++k) {
      before = n;
      origin = panoramic_line(c, n, lens).origin;
      const Vec3 to = normalize(p - origin);
      const float b = dot(origin, to), root = sqr(b) + sqr(c.focus_distance) - length_squared(origin);
      if (!(root > 0.0f)) return {};
      n = normalize(origin + to * (std::sqrt(root) - b));
    }
    if (length_squared(n - before) > 1e-9f) return {};
  }
  const Vec3 to = p - origin;
  const float distance = length(to);
  if (!(distance > c.clip_start && distance < c.clip_end)) return {};
  const Vec3 along = to / distance;
  float density = panoramic_density(c, n.y, distance);
  if (lens.x != 0.0f || lens.y != 0.0f) {
    // Per steradian of n, by how far the ray moves at p.
    constexpr float kStep = 1e-3f;
    const Frame f = Frame::from_normal(n);
    const Vec3 dx = passing(c, normalize(n + f.x * kStep), lens, p, along) - passing(c, normalize(n - f.x * kStep), lens, p, along);
    const Vec3 dy = passing(c, normalize(n + f.y * kStep), lens, p, along) - passing(c, normalize(n - f.y * kStep), lens, p, along);
    density = panoramic_density(c, n.y, 1.0f) * sqr(2.0f * kStep) / std::max(length(cross(dx, dy)), 1e-20f);
  }
  return LensSample{-along, distance, distance - c.clip_start, panoramic_film(c, n), density};
}

}  // namespace

std::optional<LensSample> sample_lens(const Camera& c, Vec3 position, Vec2 u_lens) {
  // The camera's matrix turns and moves, no more.
  const Vec3 p = c.to_world.transposed_vector(position - c.to_world.translation());
  const Vec2 lens = c.aperture_radius > 0.0f ? c.sample_aperture(u_lens) : Vec2{};
  std::optional<LensSample> s;
  if (c.kind == Camera::Kind::kPanoramic) {
    s = sample_panorama(c, p, lens);
    if (!s) return {};
  } else {
    const float depth = -p.z;
    if (!(depth > c.clip_start && depth < c.clip_end)) return {};
    if (c.kind == Camera::Kind::kPerspective) {
      const Vec3 to = p - Vec3{lens.x, lens.y, 0.0f};
      const float distance = length(to), focus = c.aperture_radius > 0.0f ? c.focus_distance : 1.0f;
      const float x = (lens.x + to.x * (focus / depth)) / focus, y = (lens.y + to.y * (focus / depth)) / focus;
      s = {to / -distance, distance, distance * (1.0f - c.clip_start / depth), on_frame(c, x, y),
           perspective_density(c, depth / distance, distance)};
    } else {
      // All rays through one place of the aperture are parallel.
      const Vec3 along = normalize({-lens.x, -lens.y, -(c.aperture_radius > 0.0f ? c.focus_distance : 1.0f)});
      const float cos = -along.z, ahead = (c.aperture_radius > 0.0f ? c.focus_distance - depth : 0.0f) / cos;
      s = {-along, depth / cos, (depth - c.clip_start) / cos, on_frame(c, p.x + along.x * ahead, p.y + along.y * ahead),
           1.0f / (frame_area(c) * cos)};
    }
  }
  s->wi = c.to_world.vector(s->wi);
  return s;
}

float lens_density(const Camera& c, const Ray& ray, float t) {
  if (c.kind == Camera::Kind::kPanoramic) return panoramic_density(c, dot(ray.direction, c.to_world.column(1)), c.clip_start + t);
  const float cos = -dot(ray.direction, c.to_world.column(2));
  if (c.kind == Camera::Kind::kOrthographic) return 1.0f / (frame_area(c) * cos);
  return perspective_density(c, cos, c.clip_start / cos + t);
}

}  // namespace gi
