// Look-ups in the tables of ggx_tables.inc: linear in roughness, cosine and a remapped index of refraction or exponent.
// The tables are unsigned 16-bit fractions of one.
#include "shading/lobes/ggx_tables.h"

#include <cstdint>

#include "core/vec.h"

namespace gi {
namespace {

#include "shading/lobes/ggx_tables.inc"

struct Cell {
  int i;
  float t;
};
Cell cell(float x, int n) {
  const float s = (x > 0.0f ? std::min(x, 1.0f) : 0.0f) * float(n - 1);  // what is not a number must not become an index
  const int i = std::min(int(s), n - 2);
  return {i, s - float(i)};
}
float at_1d(const uint16_t* table, int n, float x) {
  const auto [i, t] = cell(x, n);
  return lerp(float(table[i]), float(table[i + 1]), t);
}
// Four neighbours of a table with rows of n.
float bilinear(const uint16_t* p, int n, float tx, float ty) {
  return lerp(lerp(float(p[0]), float(p[1]), tx), lerp(float(p[n]), float(p[n + 1]), tx), ty);
}
float at_2d(const uint16_t* table, int nx, int ny, float x, float y) {
  const auto [i, tx] = cell(x, nx);
  const auto [j, ty] = cell(y, ny);
  return bilinear(table + j * nx + i, nx, tx, ty);
}
float at_3d(const uint16_t* table, int n, float x, float y, float z) {
  const auto [i, tx] = cell(x, n);
  const auto [j, ty] = cell(y, n);
  const auto [k, tz] = cell(z, n);
  const uint16_t* p = table + (k * n + j) * n + i;
  return lerp(bilinear(p, n, tx, ty), bilinear(p + n * n, n, tx, ty), tz);
}
constexpr float kUnit = 1.0f / 65535.0f;
constexpr float kLeast = 1e-4f;  // energies are divided by

// Indices from 1 to infinity on [0, 1], finest around those of glass: √√F0.
float index_coordinate(float ior) { return std::sqrt(std::abs((ior - 1.0f) / (ior + 1.0f))); }

}  // namespace

GgxEnergy ggx_energy(float roughness, float cos_o) {
  return {std::max(at_2d(kGgxE, 32, 32, roughness, cos_o) * kUnit, kLeast), std::max(at_1d(kGgxEMean, 32, roughness) * kUnit, kLeast)};
}

GgxEnergy ggx_glass_energy(float roughness, float cos_o, float ior) {
  const float z = index_coordinate(ior);
  const bool out = ior < 1.0f;
  return {std::max(at_3d(out ? kGgxGlassOutE : kGgxGlassInE, 16, roughness, cos_o, z) * kUnit, kLeast),
          std::max(at_2d(out ? kGgxGlassOutEMean : kGgxGlassInEMean, 16, 16, roughness, z) * kUnit, kLeast)};
}

float ggx_schlick_weight(float roughness, float cos_o, float exponent) {
  return at_3d(kGgxSchlick, 16, roughness, cos_o, 1.0f / (0.2f * exponent + 1.0f)) * kUnit;
}

float ggx_dielectric_weight(float roughness, float cos_o, float ior) {
  return at_3d(kGgxDielectric, 16, roughness, cos_o, index_coordinate(ior)) * kUnit;
}

}  // namespace gi
