// Finds the emissive triangles of a scene and estimates what each emits.
#pragma once
#include <vector>

#include "lights/triangle_light.h"

namespace gi {

struct MeasuredTriangle {
  TriangleLight light;
  float radiance = 0;  // |luminance| of the stronger side, on average
};

struct TrianglePowers {
  std::vector<MeasuredTriangle> lights;
  std::vector<Rgb> constant_emission;  // by material
  std::vector<uint8_t> is_constant;    // the material emits the same everywhere
};

TrianglePowers measure_triangles(const Scene& scene, int threads);

}  // namespace gi
