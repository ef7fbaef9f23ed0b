// The camera: from a point of the film to a ray. Conventions are Blender's: looks along -Z, +Y is up.
#pragma once
#include <string>

#include "core/vec.h"
#include "core/warp.h"

namespace gi {

struct CameraRay {
  Ray ray;
  float spread = 0;     // radius that the footprint of a pixel gains per metre
  float footprint = 0;  // its radius at the origin (orthographic cameras)
};

struct Camera {
  enum class Kind { kPerspective, kOrthographic, kPanoramic };

  std::string name;
  Kind kind = Kind::kPerspective;
  Affine to_world;
  float left = -1, right = 1, bottom = -1, top = 1;  // view plane: at distance 1, or in metres (orthographic)
  float clip_start = 0.1f, clip_end = 1000.0f;
  float aperture_radius = 0, focus_distance = 10;
  int aperture_blades = 0;
  float aperture_rotation = 0, aperture_ratio = 1;
  float latitude[2] = {-kPi / 2, kPi / 2}, longitude[2] = {-kPi, kPi};

  // (x, y) in [0, 1]² over the full frame, origin at the lower left; `pixel` is the size of a pixel in those units.
  CameraRay sample(Vec2 film, Vec2 pixel, Vec2 u_lens) const {
    CameraRay r;
    Vec3 origin, direction;
    float start = clip_start, end = clip_end;
    const float x = lerp(left, right, film.x), y = lerp(bottom, top, film.y);
    if (kind == Kind::kPerspective) {
      const Vec2 lens = sample_aperture(u_lens);
      origin = {lens.x, lens.y, 0.0f};
      direction = Vec3{x, y, -1.0f} * focus_distance - origin;
      // Clip planes are at distances along the axis, not along the ray.
      const float scale = length(direction) / -direction.z;
      start *= scale, end *= scale;
      r.spread = pixel_radius(pixel);
    } else if (kind == Kind::kOrthographic) {
      origin = {x, y, 0.0f}, direction = {0, 0, -1};
      if (has_lens()) {
        const Vec2 lens = sample_aperture(u_lens);
        const Vec3 focus = origin + focus_distance * direction;
        origin += Vec3{lens.x, lens.y, 0.0f};
        direction = focus - origin;
        const float scale = length(direction) / -direction.z;
        start *= scale, end *= scale;
      }
      r.footprint = pixel_radius(pixel);
    } else {  // equirectangular: the middle of the frame looks ahead
      const float phi = lerp(longitude[0], longitude[1], film.x), theta = lerp(latitude[0], latitude[1], film.y);
      direction = {std::sin(phi) * std::cos(theta), std::sin(theta), -std::cos(phi) * std::cos(theta)};
      if (has_lens()) {
        const Vec3 focus = direction * focus_distance;
        const Vec2 lens = sample_aperture(u_lens);
        const Frame frame = Frame::from_normal_and_tangent(direction, Vec3{-direction.z, 0, direction.x});
        origin = frame.x * lens.x + frame.y * lens.y;
        direction = focus - origin;
      }
      r.spread = 0.5f * std::abs(latitude[1] - latitude[0]) * pixel.y;
    }
    // The ray starts at the near clip plane: Blender's Ray Length counts from there.
    const Vec3 towards = normalize(to_world.vector(direction));
    r.ray = {to_world.point(origin) + towards * start, towards, 0.0f, end - start};
    r.footprint += r.spread * start;
    return r;
  }

  bool has_lens() const { return aperture_radius > 0.0f; }
  bool is_pinhole() const { return kind == Kind::kPerspective && !has_lens(); }
  // As N calls of `sample`, for the commonest camera: several at a time, and without what it has no need of.
  template <int N>
  void sample_pinhole(const float* x, const float* y, Vec2 pixel, CameraRay* rays) const {
    const Affine& m = to_world;
    float dx[N], dy[N], dz[N], norm[N];
    for (int i = 0; i < N; ++i) {
      const float u = lerp(left, right, x[i]), v = lerp(bottom, top, y[i]);
      dx[i] = m.m[0][0] * u + m.m[0][1] * v - m.m[0][2];
      dy[i] = m.m[1][0] * u + m.m[1][1] * v - m.m[1][2];
      dz[i] = m.m[2][0] * u + m.m[2][1] * v - m.m[2][2];
      norm[i] = std::sqrt(dx[i] * dx[i] + dy[i] * dy[i] + dz[i] * dz[i]);
    }
    const Vec3 origin = m.translation();
    const float spread = pixel_radius(pixel);
    for (int i = 0; i < N; ++i) {
      const Vec3 d{dx[i], dy[i], dz[i]};
      rays[i] = {{origin + d * clip_start, d / norm[i], 0.0f, (clip_end - clip_start) * norm[i]}, spread, spread * clip_start * norm[i]};
    }
  }

  // Distance along the camera's axis: Blender's Depth pass. Panoramas measure along the ray.
  float depth(Vec3 position) const {
    const Vec3 d = position - to_world.translation();
    return kind == Kind::kPanoramic ? length(d) : -dot(d, normalize(to_world.column(2)));
  }

  // A place on the lens, metres from its middle.
  Vec2 sample_aperture(Vec2 u) const {
    Vec2 lens;
    if (aperture_blades < 3) {
      lens = sample_disk(u);
    } else {  // one of the polygon's triangles, then uniform over it
      const float wedge = std::min(std::floor(u.x * float(aperture_blades)), float(aperture_blades - 1));
      const Vec2 b = sample_triangle({u.x * float(aperture_blades) - wedge, u.y});
      const float step = 2.0f * kPi / float(aperture_blades), start = aperture_rotation + step * (wedge - 0.5f);
      lens = {b.x * std::cos(start) + b.y * std::cos(start + step), b.x * std::sin(start) + b.y * std::sin(start + step)};
    }
    lens.x /= aperture_ratio;
    return lens * aperture_radius;
  }

 private:
  float pixel_radius(Vec2 pixel) const { return 0.5f * std::max(std::abs(right - left) * pixel.x, std::abs(top - bottom) * pixel.y); }
};

}  // namespace gi
