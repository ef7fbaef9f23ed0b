// What every path from the lights does: it is numbered, and so random in a way that no thread has a say in.
#pragma once
#include "core/sampler.h"
#include "transport/render_context.h"

namespace gi {

// The random numbers of the k-th of the `count` light paths of a pass: all paths of all passes are one stratified sequence, since any of
// them may light any pixel.
inline Sampler light_sampler(const RenderContext& context, int pass, int count, uint32_t k) {
  constexpr uint32_t kStream = 0x6c696768u;  // apart from the pixels'
  const uint64_t index = uint64_t(pass) * uint64_t(count) + k;
  return Sampler(hash_combine(context.seed, kStream), uint32_t(index >> 32), uint32_t(index));
}

// Calls f(sampler, number of the path) for `count` light paths of a pass, in threads: the twin of for_each_pixel. Whatever f adds to must
// not depend on the order.
template <class F>
void for_each_light_path(const RenderContext& context, int pass, int count, const F& f) {
  constexpr int kBatch = 256;
  context.pool.for_each((count + kBatch - 1) / kBatch, context.cancelled, [&](int batch) {
    for (int k = batch * kBatch; k < std::min((batch + 1) * kBatch, count); ++k) {
      Sampler sampler = light_sampler(context, pass, count, uint32_t(k));
      f(sampler, uint32_t(k));
    }
  });
}

}  // namespace gi
