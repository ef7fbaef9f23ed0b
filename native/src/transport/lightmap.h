// A picture laid over the surface of one instance by a UV map: what takes the camera's place in a bake. A texel's samples are uniform
// over the part of the surface that it covers, by exact clipping.
#pragma once
#include <string>
#include <vector>

#include "scene/camera.h"
#include "scene/scene.h"

namespace gi {

enum class LightmapContent {
  kIrradiance,  // over π: what a white surface would show
  kIndirect,    // the same of light that came by way of another surface
  kRadiosity,   // over π: what the surface emits and its diffuse lobes scatter
};

struct LightmapSpec {
  std::string object, uv_map;
  LightmapContent content = LightmapContent::kIrradiance;
};

class Lightmap {
 public:
  // Throws InputError naming the object: no such object, no such map, nothing of it inside the picture, parts on top of one another.
  Lightmap(const Scene& scene, LightmapSpec spec, int width, int height);

  bool covers(int x, int y) const { return first_[index(x, y)] < first_[index(x, y) + 1]; }
  float coverage(int x, int y) const { return coverage_[index(x, y)]; }  // share of the texel's square
  // A short ray that ends on the surface, against its normal.
  CameraRay sample(int x, int y, Vec2 u_place, Vec2 u_choice) const;
  // Makes the surface scatter what is asked for. `normal`: the one that irradiance is to be for.
  void adapt(Bsdf& bsdf, Vec3 wo, Vec3 geometric_normal, Vec3 normal) const;
  // Bounces that light must have made, counted as path depth, to be part of the picture.
  int first_depth() const { return spec_.content == LightmapContent::kIndirect ? 2 : 0; }
  uint32_t instance() const { return instance_; }

 private:
  struct Part {
    uint32_t triangle;
    float end;  // area of this and the parts before, m²
  };
  size_t index(int x, int y) const { return size_t(y) * size_t(width_) + size_t(x); }
  void corners(uint32_t triangle, Vec2 out[3]) const;  // in texels

  const Scene& scene_;
  LightmapSpec spec_;
  int width_, height_;
  uint32_t instance_ = 0;
  const AttributeData* map_ = nullptr;
  std::vector<uint32_t> first_;  // of each texel's parts
  std::vector<Part> parts_;
  std::vector<float> coverage_;
};

}  // namespace gi
