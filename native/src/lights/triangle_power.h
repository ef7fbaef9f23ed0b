// Finds the emissive triangles of a scene and estimates what each emits.
#pragma once
#include <vector>

#include "lights/triangle_light.h"

namespace gi {

struct MeasuredTriangle {
  TriangleLight light;
  float radiance = 0;  // |luminance| of the stronger side, on average
};

std::vector<MeasuredTriangle> measure_triangles(const Scene& scene, int threads);

}  // namespace gi
