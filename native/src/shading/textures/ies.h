// How a luminaire shines by direction, as measured (IES files): a table over horizontal and vertical angles, interpolated by cubics.
// Made by gi_engine/nodes/ies.py, which sees to it that there are two angles of either kind at least. Its floats: both counts, the
// horizontal angles, the vertical ones (radians, ascending), then the values, vertical fastest.
#pragma once
#include "core/vec.h"

namespace gi::texture {

inline float cubic_between(float a, float b, float c, float d, float t) {  // Catmull–Rom
  return b + 0.5f * t * (c - a + t * (2.0f * a - 5.0f * b + 4.0f * c - d + t * (3.0f * (b - c) + d - a)));
}

class IesTable {
 public:
  // `dark_beyond`: curves bend towards 0 at the last angles, as they do up to Blender 4.5, instead of going on.
  explicit IesTable(const float* floats, bool dark_beyond = false)
      : across_(int(floats[0])), up_(int(floats[1])), h_(floats + 2), v_(h_ + across_), values_(v_ + up_), dark_beyond_(dark_beyond) {}

  // 0 outside of what was measured. Angles in radians.
  float at(float h, float v) const {
    if (v < v_[0] || v >= v_[up_ - 1] || h < h_[0] || h >= h_[across_ - 1]) return 0.0f;
    const Place x = find(h_, h), y = find(v_, v);
    const bool round = h_[0] < 1e-7f && h_[across_ - 1] > 2.0f * kPi - 1e-7f;
    const float b = column(x.index, y), c = column(x.index + 1, y);
    const float a = x.index > 0 ? column(x.index - 1, y) : round ? column(across_ - 2, y) : beyond(b);
    // Where nothing follows: as Blender has it, the value before.
    const float d = x.index + 2 < across_ ? column(x.index + 2, y) : round ? column(1, y) : beyond(b);
    return std::max(cubic_between(a, b, c, d, x.past), 0.0f);
  }

 private:
  struct Place {
    int index;
    float past;
  };
  static Place find(const float* angles, float angle) {
    int i = 0;
    while (angles[i + 1] < angle) ++i;
    const float step = angles[i + 1] - angles[i];
    return {i, step != 0.0f ? (angle - angles[i]) / step : 0.0f};
  }
  float beyond(float last) const { return dark_beyond_ ? 0.0f : last; }
  float value(int h, int v) const { return values_[h * up_ + v]; }
  // Over a pole the light is taken for the same on the other side.
  float column(int h, Place y) const {
    const float b = value(h, y.index), c = value(h, y.index + 1);
    const float a = y.index > 0 ? value(h, y.index - 1) : v_[0] < 1e-7f ? value(h, 1) : beyond(b);
    const float d = y.index + 2 < up_ ? value(h, y.index + 2) : v_[up_ - 1] > kPi - 1e-7f ? value(h, up_ - 2) : beyond(c);
    return cubic_between(a, b, c, d, y.past);
  }

  int across_, up_;
  const float *h_, *v_, *values_;
  bool dark_beyond_;
};

}  // namespace gi::texture
