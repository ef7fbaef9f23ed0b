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

// Follows `count` light paths of a pass in batches, in threads, and calls f(vertices, sampler, what the paths of the batch are given to).
// The batches' order is that of the paths.
template <class Batch, class F>
std::vector<Batch> trace_light_paths(const RenderContext& context, const SubpathSettings& settings, int pass, int count, const F& f) {
  constexpr int kBatch = 1024;
  std::vector<Batch> found(size_t((count + kBatch - 1) / kBatch));
  context.pool.for_each(int(found.size()), context.cancelled, [&](int b) {
    static thread_local LightVertices kept;
    LightVertices& path = kept;  // found once
    for (int k = b * kBatch; k < std::min((b + 1) * kBatch, count); ++k) {
      Sampler sampler = light_sampler(context, pass, count, uint32_t(k));
      path.clear();
      trace_from_light(context, settings, sampler, path);
      f(path, sampler, found[size_t(b)]);
    }
  });
  return found;
}

// Appends what they were given to.
template <class T, class All>
void append(std::vector<std::vector<T>> batches, All& all) {
  for (auto& batch : batches) all.insert(all.end(), batch.begin(), batch.end()), std::vector<T>().swap(batch);
}
template <class T>
std::vector<T> joined(std::vector<std::vector<T>> batches) {
  std::vector<T> all;
  append(std::move(batches), all);
  return all;
}

// Learns where light paths should start, from rounds of trial paths.
class EmissionLearner {
 public:
  explicit EmissionLearner(float even = EmissionGuide::kEven) : even_(even) {}
  const EmissionGuide& guide() const { return guide_; }
  size_t size() const { return trials_.size(); }  // paths that brought something
  void forget() { trials_.clear(); }              // but not what has been learnt from them, by which the next are sent

  // One more round, of about `count` paths; worth(vertices, sampler) says what each brings.
  template <class Worth>
  void learn(const RenderContext& context, SubpathSettings settings, int count, const Worth& worth) {
    constexpr int kFewest = 1000, kMost = 40000;
    settings.guide = &guide_;
    // Numbered apart from the paths that count: what is learnt from a path must not decide on the same path.
    const int pass = -++rounds_;
    const auto found = trace_light_paths<Trials>(context, settings, pass, std::clamp(count, kFewest, kMost),
                                                 [&](const LightVertices& path, Sampler& sampler, Trials& batch) {
                                                   const float brought = worth(path, sampler);
                                                   if (brought > 0.0f) batch.push_back({path.start, brought});
                                                 });
    for (const auto& part : found) trials_.insert(trials_.end(), part.begin(), part.end());
    guide_ = EmissionGuide(trials_, even_);
  }
  static constexpr int kFirstRounds = 3;  // before the first paths that count

 private:
  using Trials = std::vector<EmissionGuide::Trial>;
  float even_;
  int rounds_ = 0;
  Trials trials_;
  EmissionGuide guide_;
};

}  // namespace gi
