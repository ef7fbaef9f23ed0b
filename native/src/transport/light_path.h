// What every path from the lights does: it is numbered, and so random in a way that no thread has a say in.
#pragma once
#include "core/sampler.h"
#include "transport/subpath.h"

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

// Follows `count` light paths of a pass in batches, in threads, and calls f(vertices, what the paths of the batch are given to). The
// batches' order is that of the paths.
template <class Batch, class F>
std::vector<Batch> trace_light_paths(const RenderContext& context, const SubpathSettings& settings, int pass, int count, const F& f) {
  constexpr int kBatch = 1024;
  std::vector<Batch> found(size_t((count + kBatch - 1) / kBatch));
  context.pool.for_each(int(found.size()), context.cancelled, [&](int b) {
    static thread_local LightVertices path;
    for (int k = b * kBatch; k < std::min((b + 1) * kBatch, count); ++k) {
      Sampler sampler = light_sampler(context, pass, count, uint32_t(k));
      path.clear();
      trace_from_light(context, settings, sampler, path);
      f(path, found[size_t(b)]);
    }
  });
  return found;
}

// What they were given to, in one piece.
template <class T>
std::vector<T> joined(std::vector<std::vector<T>> batches) {
  size_t total = 0;
  for (const auto& batch : batches) total += batch.size();
  std::vector<T> all;
  all.reserve(total);
  for (auto& batch : batches) all.insert(all.end(), batch.begin(), batch.end()), std::vector<T>().swap(batch);
  return all;
}

}  // namespace gi
