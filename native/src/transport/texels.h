// Power gathered on the surfaces of a scene, and read back as power per area: a lattice of nodes for each instance, each side of its
// surfaces apart. Order and number of threads do not matter to the sums. Knows nothing of what is gathered.
#pragma once
#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "core/parallel.h"
#include "transport/texel_lattice.h"

namespace gi {

class Texels {
 public:
  // `size`: the wished edge of a texel in metres; made larger until everything fits into `memory` bytes. Stops early, useless,
  // when `cancelled`.
  Texels(const Scene& scene, double size, size_t memory, ThreadPool& pool, const std::atomic<bool>& cancelled);
  ~Texels();

  // Forgets what was gathered. `largest`: a power that no deposit and no sum of a node will be far above.
  void clear(double largest);
  // Any thread. `back`: the side that the triangle's normal points away from. The share of each node near the point is by its hat.
  // Returns what the power is worth to those who read; 0 before `appraise`.
  double deposit(const ShadingPoint& point, bool back, Rgb power);
  Rgb density(const ShadingPoint& point, bool back) const;  // per square metre

  // Learning where power is wanted. From `watch` on, density() counts how often each node is read. `appraise`: from what was read and
  // gathered until now, deposit() knows Σ readers · density that it adds / the node's, times a constant.
  void watch();
  void appraise();
  void stop_watching() { readers_.reset(); }
  void forget_worth() { std::vector<float>().swap(worth_); }

  double size() const { return size_; }
  size_t node_count() const;
  size_t memory_bytes() const;
  std::string description() const;

 private:
  struct Sum {
    std::atomic<int64_t> channel[3];
  };
  struct Side {
    Sum* sums = nullptr;  // of its lattice's nodes
    // Small triangles that something stands on or cuts: there nodes count only for the points that see them. One bit each; empty
    // if there are none, and then `area` is, too.
    std::vector<uint32_t> split;
    std::vector<float> area;
    std::vector<bool> walled;  // nodes that a wall stands on: they would belong to both of its sides
    std::atomic<bool> touched{false};
    Side() = default;
    Side(Side&& o) noexcept : sums(o.sums), split(std::move(o.split)), area(std::move(o.area)), walled(std::move(o.walled)) {}
  };
  struct Place {
    std::shared_ptr<const TexelLattice> lattice;
    float area_scale = 1;  // of this instance, over the one that the lattice was made for
    Side side[2];
  };

  double bytes_at(double size) const;
  void place_lattices();
  void find_splits(ThreadPool& pool, const std::atomic<bool>& cancelled);
  struct Splits {
    std::vector<uint32_t> cells;   // triangle, small triangle
    std::vector<uint32_t> walled;  // nodes
  };
  void test_triangle(uint32_t instance, uint32_t triangle, bool back, Splits& found) const;
  static bool is_walled(const Side& side, const TexelLattice& lattice, const LatticeCell& cell, int corner);
  void add_walled(const TexelLattice& lattice, Side& side, std::vector<uint32_t>& cells) const;
  void measure_split(uint32_t instance, bool back, uint32_t triangle, uint32_t cell, int samples,
                     std::vector<std::pair<uint32_t, double>>& changes) const;
  LatticeCell cell_of(const ShadingPoint& point, bool back) const;
  double area(const Place& place, bool back, uint32_t node) const;
  size_t index_of(const Side& side, uint32_t node) const { return size_t(side.sums - sums_.get()) + node; }
  void weigh_by_sight(uint32_t instance, bool back, Vec3 position, LatticeCell& cell) const;

  const Scene& scene_;
  double size_;
  std::vector<Place> places_;
  std::unique_ptr<Sum, void (*)(void*)> sums_;
  double unit_ = 0;  // power of one count
  std::unique_ptr<std::atomic<uint32_t>[]> readers_;  // of every node, while watched
  std::vector<float> worth_;                          // of a watt in every node, once appraised
  size_t splits_ = 0;
  bool split_all_ = true;
};

}  // namespace gi
