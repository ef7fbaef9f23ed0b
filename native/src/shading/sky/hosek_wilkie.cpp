// Hosek and Wilkie's sky for one height of the sun: the shape of its radiance over the sky, from the authors' fit. The sun itself
// and their spectral data are left out.
#include <algorithm>
#include <array>

#include "shading/sky/sky.h"

namespace gi {
namespace {

#include "shading/sky/hosek_wilkie.inc"

constexpr int kPoints = 6;  // control points of a Bézier curve of degree 5
constexpr int kTurbidities = 10;

std::array<double, kPoints> bernstein(double t) {
  constexpr double kBinomial[kPoints] = {1, 5, 10, 10, 5, 1};
  std::array<double, kPoints> weight;
  for (int i = 0; i < kPoints; ++i) weight[size_t(i)] = kBinomial[i] * std::pow(t, i) * std::pow(1 - t, kPoints - 1 - i);
  return weight;
}

}  // namespace

HosekWilkieSky hosek_wilkie_sky(float turbidity, float albedo, float sun_elevation) {
  const double haze = std::clamp(double(turbidity), 1.0, double(kTurbidities)), ground = std::clamp(double(albedo), 0.0, 1.0);
  const int low = std::min(int(haze), kTurbidities - 1);
  // The fit's parameter: the lower the sun, the faster the sky changes.
  const double height = std::cbrt(std::clamp(double(sun_elevation) / (0.5 * double(kPi)), 0.0, 1.0));
  const std::array<double, kPoints> curve = bernstein(height);

  HosekWilkieSky sky;
  for (int channel = 0; channel < 3; ++channel) {
    double radiance = 0, shape[9] = {};
    // The four fits around this turbidity and albedo, each with its curve over the sun's height.
    for (int corner = 0; corner < 4; ++corner) {
      const int a = corner & 1, t = corner >> 1;
      const double weight = (a ? ground : 1 - ground) * (t ? haze - low : 1 - (haze - low));
      const int first = ((channel * 2 + a) * kTurbidities + low - 1 + t) * kPoints;
      for (int p = 0; p < kPoints; ++p) {
        const double w = weight * curve[size_t(p)];
        radiance += w * double(kRadiance[first + p]);
        for (int i = 0; i < 9; ++i) shape[i] += w * double(kShape[(first + p) * 9 + i]);
      }
    }
    HosekWilkieSky::Channel& c = sky.xyz[channel];
    c.radiance = float(radiance);
    std::copy_n(shape, 9, c.shape);
  }
  return sky;
}

}  // namespace gi
