// Numbers that Blender's random outputs hang on: hashes of indices, and the islands of a mesh.
#include <nanobind/ndarray.h>

#include <numeric>
#include <utility>
#include <vector>

#include "bind/bind.h"
#include "core/check.h"
#include "shading/textures/hash.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Edges = nb::ndarray<const int32_t, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using Numbers = nb::ndarray<const uint32_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Floats = nb::ndarray<nb::numpy, float, nb::shape<-1>>;

Floats new_floats(size_t n, float*& data) {
  data = new float[n];
  return Floats(data, {n}, nb::capsule(data, [](void* p) noexcept { delete[] static_cast<float*>(p); }));
}

float unit(uint32_t bits) { return float(bits) * (1.0f / float(0xffffffffu)); }

// Which vertices hang together, by union by rank: the root of each island is the one that Cycles finds, and so is its hash.
class Islands {
 public:
  explicit Islands(size_t count) : parent_(count), rank_(count, 0) { std::iota(parent_.begin(), parent_.end(), 0u); }
  uint32_t find(uint32_t x) {
    uint32_t root = x;
    while (parent_[root] != root) root = parent_[root];
    while (parent_[x] != root) x = std::exchange(parent_[x], root);
    return root;
  }
  void join(uint32_t a, uint32_t b) {
    a = find(a), b = find(b);
    if (a == b) return;
    if (rank_[a] < rank_[b]) std::swap(a, b);
    parent_[b] = a;
    rank_[a] += rank_[a] == rank_[b];
  }

 private:
  std::vector<uint32_t> parent_;
  std::vector<uint8_t> rank_;
};

Floats random_by_island(Edges edges, size_t vertices) {
  Islands islands(vertices);
  for (size_t i = 0; i < edges.shape(0); ++i) {
    require(uint32_t(edges(i, 0)) < vertices && uint32_t(edges(i, 1)) < vertices, "an edge has a vertex that is not there");
    islands.join(uint32_t(edges(i, 0)), uint32_t(edges(i, 1)));
  }
  float* data;
  Floats out = new_floats(vertices, data);
  for (uint32_t v = 0; v < vertices; ++v) data[v] = unit(texture::hash_bits<1>({islands.find(v)}));
  return out;
}

Floats random_of_numbers(Numbers numbers) {
  float* data;
  Floats out = new_floats(numbers.shape(0), data);
  for (size_t i = 0; i < numbers.shape(0); ++i) data[i] = unit(texture::hash_bits<2>({numbers(i), 0u}));
  return out;
}

}  // namespace

void bind_hash(nb::module_& m) {
  m.def("random_by_island", random_by_island, nb::arg("edges"), nb::arg("vertices"),
        "(vertices,) float32, 0 to 1: a number for each group of vertices that edges (n, 2) int32 join.");
  m.def("random_of_numbers", random_of_numbers, nb::arg("numbers"), "(n,) float32, 0 to 1: the hash of each of (n,) uint32.");
}

}  // namespace gi::bind
