// What every path from the lights does: it is numbered, and so random in a way that no thread has a say in.
#pragma once
#include "core/sampler.h"
#include "transport/render_context.h"

namespace gi {

// Calls f(sampler, index of the path) for `count` light paths of a pass, in threads. The twin of for_each_pixel: a path's number is its
// sampler's stream, the pass its index. Whatever f adds to must not depend on the order.
template <class F>
void for_each_light_path(const RenderContext& context, int pass, int count, const F& f) {
  constexpr int kBatch = 256;
  constexpr uint32_t kStream = 0x6c696768u;  // apart from the pixels'
  context.pool.for_each((count + kBatch - 1) / kBatch, context.cancelled, [&](int batch) {
    for (int k = batch * kBatch; k < std::min((batch + 1) * kBatch, count); ++k) {
      Sampler sampler(hash_combine(context.seed, kStream), uint32_t(k), uint32_t(pass));
      f(sampler, uint32_t(k));
    }
  });
}

}  // namespace gi
