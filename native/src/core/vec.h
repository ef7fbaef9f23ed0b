// Small vectors, colours and frames. Lengths are metres, colours scene-linear RGB. Leaves out anything Embree or Python.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace gi {

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;
inline constexpr float kInf = __builtin_huge_valf();
inline constexpr float kOneMinusEpsilon = 0x1.fffffep-1f;

inline float sqr(float x) { return x * x; }
inline float safe_sqrt(float x) { return std::sqrt(std::max(x, 0.0f)); }
inline float clamp01(float x) { return std::clamp(x, 0.0f, 1.0f); }
inline float lerp(float a, float b, float t) { return a + (b - a) * t; }
inline float safe_divide(float a, float b) { return b != 0.0f ? a / b : 0.0f; }

struct Vec2 {
  float x = 0, y = 0;
};
inline Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
inline Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
inline Vec2 operator*(Vec2 a, float s) { return {a.x * s, a.y * s}; }
inline Vec2 operator*(float s, Vec2 a) { return a * s; }
inline float dot(Vec2 a, Vec2 b) { return a.x * b.x + a.y * b.y; }

// A point, a direction or a normal; also the three floats of a vector socket.
struct Vec3 {
  float x = 0, y = 0, z = 0;
  float& operator[](int i) { return (&x)[i]; }
  float operator[](int i) const { return (&x)[i]; }
};
inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Vec3 operator*(Vec3 a, float s) { return {a.x * s, a.y * s, a.z * s}; }
inline Vec3 operator*(float s, Vec3 a) { return a * s; }
inline Vec3 operator/(Vec3 a, float s) { return a * (1.0f / s); }
inline Vec3& operator+=(Vec3& a, Vec3 b) { return a = a + b; }
inline Vec3& operator*=(Vec3& a, float s) { return a = a * s; }
inline bool operator==(Vec3 a, Vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
inline float dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline float abs_dot(Vec3 a, Vec3 b) { return std::abs(dot(a, b)); }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline float length_squared(Vec3 a) { return dot(a, a); }
inline float length(Vec3 a) { return std::sqrt(dot(a, a)); }
inline Vec3 lerp(Vec3 a, Vec3 b, float t) { return a + (b - a) * t; }
inline Vec3 reflect(Vec3 w, Vec3 n) { return 2.0f * dot(w, n) * n - w; }  // w points away from the surface
inline Vec3 min(Vec3 a, Vec3 b) { return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}; }
inline Vec3 max(Vec3 a, Vec3 b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }
inline bool is_finite(Vec3 a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }
// Unit vector; the zero vector and non-finite ones give `fallback`.
inline Vec3 normalize_or(Vec3 a, Vec3 fallback) {
  const float l2 = dot(a, a);
  return l2 > 0.0f && std::isfinite(l2) ? a * (1.0f / std::sqrt(l2)) : fallback;
}
inline Vec3 normalize(Vec3 a) { return normalize_or(a, {0, 0, 0}); }

// Scene-linear RGB: radiance, throughput, albedo. The channels lie side by side in one vector register, of which the fourth lane
// means nothing, so that one instruction does all three.
class Rgb {
 public:
  using Lanes = float __attribute__((vector_size(16)));
  Rgb() = default;
  constexpr Rgb(float r, float g, float b) : lanes_{r, g, b, 0.0f} {}
  explicit constexpr Rgb(float v) : lanes_{v, v, v, v} {}
  explicit constexpr Rgb(Lanes lanes) : lanes_(lanes) {}
  explicit Rgb(Vec3 v) : Rgb(v.x, v.y, v.z) {}
  float r() const { return lanes_[0]; }
  float g() const { return lanes_[1]; }
  float b() const { return lanes_[2]; }
  float operator[](int i) const { return lanes_[i]; }
  float& operator[](int i) { return reinterpret_cast<float*>(&lanes_)[i]; }
  Lanes lanes() const { return lanes_; }

 private:
  Lanes lanes_{};
};
inline Rgb operator+(Rgb a, Rgb b) { return Rgb(a.lanes() + b.lanes()); }
inline Rgb operator-(Rgb a, Rgb b) { return Rgb(a.lanes() - b.lanes()); }
inline Rgb operator*(Rgb a, Rgb b) { return Rgb(a.lanes() * b.lanes()); }
inline Rgb operator*(Rgb a, float s) { return Rgb(a.lanes() * s); }
inline Rgb operator*(float s, Rgb a) { return a * s; }
inline Rgb operator/(Rgb a, Rgb b) { return Rgb(a.lanes() / b.lanes()); }
inline Rgb operator/(Rgb a, float s) { return a * (1.0f / s); }
inline Rgb& operator+=(Rgb& a, Rgb b) { return a = a + b; }
inline Rgb& operator*=(Rgb& a, Rgb b) { return a = a * b; }
inline Rgb& operator*=(Rgb& a, float s) { return a = a * s; }
inline float max_component(Rgb a) { return std::max({a.r(), a.g(), a.b()}); }
inline float average(Rgb a) { return (a.r() + a.g() + a.b()) * (1.0f / 3.0f); }
inline float luminance(Rgb a) { return 0.2126f * a.r() + 0.7152f * a.g() + 0.0722f * a.b(); }  // Rec. 709 primaries
inline bool is_black(Rgb a) {
  const auto bits = std::bit_cast<std::array<uint64_t, 2>>(a.lanes());
  return ((bits[0] | uint32_t(bits[1])) & 0x7fffffff7fffffffu) == 0;  // of either sign
}
inline bool is_finite(Rgb a) { return is_black(a - a); }
inline Rgb max(Rgb a, Rgb b) { return Rgb(a.lanes() < b.lanes() ? b.lanes() : a.lanes()); }  // a where that is not a number
inline Rgb min(Rgb a, Rgb b) { return Rgb(b.lanes() < a.lanes() ? b.lanes() : a.lanes()); }
inline Rgb positive(Rgb a) { return max(a, Rgb()); }
inline Rgb clamp01(Rgb a) { return min(positive(a), Rgb(1.0f)); }
inline Rgb abs(Rgb a) { return max(a, Rgb() - a); }
inline Rgb lerp(Rgb a, Rgb b, float t) { return a * (1.0f - t) + b * t; }
inline Rgb exp(Rgb a) { return {std::exp(a.r()), std::exp(a.g()), std::exp(a.b())}; }

// Orthonormal right-handed frame; z is the normal. [Duff et al. 2017, "Building an orthonormal basis, revisited"]
struct Frame {
  Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  Vec3 to_local(Vec3 v) const { return {dot(v, x), dot(v, y), dot(v, z)}; }
  Vec3 to_world(Vec3 v) const { return v.x * x + v.y * y + v.z * z; }
  static Frame from_normal(Vec3 n) {
    const float s = std::copysign(1.0f, n.z), a = -1.0f / (s + n.z), b = n.x * n.y * a;
    return {{1.0f + s * n.x * n.x * a, s * b, -s * n.x}, {b, s + n.y * n.y * a, -n.y}, n};
  }
  // x is `tangent` made orthogonal to n; falls back on from_normal where the two are parallel.
  static Frame from_normal_and_tangent(Vec3 n, Vec3 tangent) {
    const Vec3 t = tangent - n * dot(n, tangent);
    if (length_squared(t) < 1e-12f) return from_normal(n);
    const Vec3 x = normalize(t);
    return {x, cross(n, x), n};
  }
};

// Affine transform, 3 rows of 4 (row-major): p' = A p + t.
struct Affine {
  float m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  Vec3 point(Vec3 p) const {
    return {m[0][0] * p.x + m[0][1] * p.y + m[0][2] * p.z + m[0][3], m[1][0] * p.x + m[1][1] * p.y + m[1][2] * p.z + m[1][3],
            m[2][0] * p.x + m[2][1] * p.y + m[2][2] * p.z + m[2][3]};
  }
  Vec3 vector(Vec3 v) const {
    return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
            m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
  }
  // Aᵀ v: applied to the inverse transform this carries normals (not normalised).
  Vec3 transposed_vector(Vec3 v) const {
    return {m[0][0] * v.x + m[1][0] * v.y + m[2][0] * v.z, m[0][1] * v.x + m[1][1] * v.y + m[2][1] * v.z,
            m[0][2] * v.x + m[1][2] * v.y + m[2][2] * v.z};
  }
  Vec3 column(int i) const { return {m[0][i], m[1][i], m[2][i]}; }
  Vec3 translation() const { return column(3); }
  float determinant() const { return dot(column(0), cross(column(1), column(2))); }
  Affine inverse() const {  // of a singular transform: the zero transform
    const Vec3 a = column(0), b = column(1), c = column(2), t = translation();
    const float d = determinant();
    Affine r;
    const float inv = d != 0.0f && std::isfinite(1.0f / d) ? 1.0f / d : 0.0f;
    const Vec3 rows[3] = {cross(b, c) * inv, cross(c, a) * inv, cross(a, b) * inv};
    for (int i = 0; i < 3; ++i) {
      r.m[i][0] = rows[i].x, r.m[i][1] = rows[i].y, r.m[i][2] = rows[i].z, r.m[i][3] = -dot(rows[i], t);
    }
    return r;
  }
  bool is_identity() const {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 4; ++j)
        if (m[i][j] != (i == j ? 1.0f : 0.0f)) return false;
    return true;
  }
};

struct Bounds {
  Vec3 lo{kInf, kInf, kInf}, hi{-kInf, -kInf, -kInf};
  void add(Vec3 p) { lo = min(lo, p), hi = max(hi, p); }
  void add(const Bounds& b) { lo = min(lo, b.lo), hi = max(hi, b.hi); }
  bool empty() const { return !(lo.x <= hi.x); }
  Vec3 center() const { return (lo + hi) * 0.5f; }
  Vec3 extent() const { return hi - lo; }
};

struct Ray {
  Vec3 origin, direction;  // direction is unit
  float t_min = 0.0f, t_max = kInf;
  // The strand or point of an instance that it does not meet: the one that it leaves; all ones where that is a surface.
  uint32_t left_instance = 0xffffffffu, left_strand = 0xffffffffu;
  bool goes_on = false;  // straight through what it leaves
};

}  // namespace gi
