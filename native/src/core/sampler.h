// Random numbers keyed by (seed, pass, pixel or light path, dimension): padded (0,2)-sequences, Owen-scrambled and
// shuffled [Burley 2020, "Practical hash-based Owen scrambling"], made in batches of four dimension pairs.
#pragma once
#include "core/vec.h"

namespace gi {

inline uint32_t hash32(uint32_t x) {  // [Wellons 2018, "lowbias32"]
  x ^= x >> 16, x *= 0x7feb352du, x ^= x >> 15, x *= 0x846ca68bu;
  return x ^ (x >> 16);
}
inline uint32_t hash_combine(uint32_t a, uint32_t b) { return hash32(a ^ (hash32(b) + 0x9e3779b9u + (a << 6) + (a >> 2))); }
inline uint32_t reverse_bits(uint32_t x) {
  x = __builtin_bswap32(x);
  x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  return ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
}
inline float to_unit_float(uint32_t x) { return float(x >> 8) * 0x1p-24f; }  // in [0, 1)

class Sampler {
 public:
  Sampler() {}  // to be assigned
  // `stream` is the pixel or light path, `index` the pass: one stream over all passes is one stratified sequence.
  Sampler(uint32_t seed, uint32_t stream, uint32_t index) : index_(reverse_bits(index)), key_(hash_combine(seed, stream)) {}

  Vec2 next_2d() {
    const uint32_t k = dimension_++ & kMask;
    if (k == 0) fill();
    return {x_[k], y_[k]};
  }
  // Two numbers in a row are the halves of one pair.
  float next_1d() {
    if (has_spare_) return has_spare_ = false, spare_;
    const Vec2 pair = next_2d();
    has_spare_ = true, spare_ = pair.y;
    return pair.x;
  }
  // An independent sequence for a sub-estimate (a splitting branch, a light path of the same index).
  Sampler fork(uint32_t salt) const {
    Sampler s = *this;
    s.key_ = hash_combine(key_, salt), s.dimension_ = 0, s.has_spare_ = false;
    return s;
  }
  // The k-th of `count` for as many branches of one path: those of all passes are one stratified sequence.
  Sampler branch(uint32_t k, uint32_t count) const {
    constexpr uint32_t kBranches = 0x6272616eu;
    Sampler s = fork(kBranches);
    s.index_ = reverse_bits(reverse_bits(index_) * count + k);
    return s;
  }
  // Moves on to batch `b` of dimension pairs: a bounce starts there however many numbers
  // the one before used. The camera has batch 0.
  void jump_to(uint32_t b) { dimension_ = b * kBatch, has_spare_ = false; }

 private:
  // Laine–Karras permutation in the reversed-bit domain, constants by Vegdahl (2022).
  static uint32_t permute(uint32_t x, uint32_t seed) {
    x ^= x * 0x3d20adeau, x += seed, x *= (seed >> 16) | 1u, x ^= x * 0x05526c56u;
    return x ^ (x * 0x53a22864u);
  }
  // Second Sobol dimension (Pascal matrix modulo 2) of an index, its bits reversed.
  static uint32_t sobol_1(uint32_t v) {
    v ^= v >> 16, v ^= (v >> 8) & 0x00ff00ffu, v ^= (v >> 4) & 0x0f0f0f0fu, v ^= (v >> 2) & 0x33333333u;
    return v ^ ((v >> 1) & 0x55555555u);
  }
  // One pair of one stream, by the pass with its bits reversed.
  static void make_pair(uint32_t index, uint32_t key, uint32_t dimension, float& x, float& y) {
    const uint32_t h = hash32(key ^ (dimension * 0x9e3779b9u));
    uint32_t hx = h * 0x85ebca6bu + 0x3c6ef372u, hy = h * 0xc2b2ae35u + 0x1b873593u;
    hx ^= hx >> 15, hy ^= hy >> 15;
    const uint32_t shuffled = reverse_bits(permute(index, h));
    x = to_unit_float(reverse_bits(permute(shuffled, hx)));
    y = to_unit_float(reverse_bits(permute(sobol_1(shuffled), hy)));
  }
  void fill() {
    const uint32_t first = dimension_ & ~kMask;
    for (uint32_t k = 0; k < kBatch; ++k) make_pair(index_, key_, first + k, x_[k], y_[k]);
  }

  template <int N>
  friend class SamplerRow;
  static constexpr uint32_t kBatch = 4, kMask = kBatch - 1;  // what one vector register holds
  uint32_t index_ = 0, key_ = 0, dimension_ = 0;
  bool has_spare_ = false;
  float spare_ = 0;
  float x_[kBatch], y_[kBatch];
};

// The samplers of N streams in a row, and their first pairs several at a time: what next_2d of each would give.
template <int N>
class SamplerRow {
 public:
  SamplerRow(uint32_t seed, uint32_t first_stream, uint32_t index) : index_(reverse_bits(index)) {
    for (int i = 0; i < N; ++i) keys_[i] = hash_combine(seed, first_stream + uint32_t(i));
  }
  void pairs(uint32_t dimension, float* x, float* y) const {
    for (int i = 0; i < N; ++i) Sampler::make_pair(index_, keys_[i], dimension, x[i], y[i]);
  }
  // That of stream i, past its first batch, which is the camera's.
  Sampler sampler(int i) const {
    Sampler s;
    s.index_ = index_, s.key_ = keys_[i];
    s.jump_to(1);
    return s;
  }

 private:
  uint32_t index_, keys_[N];
};

}  // namespace gi
