// A vector for what may be of many megabytes and is read here and there: it asks for large pages, so that the first touch of its memory
// costs less, and so does finding it.
#pragma once
#include <cstdlib>
#include <new>
#include <vector>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace gi {

template <class T>
struct LargeAllocator {
  using value_type = T;
  LargeAllocator() = default;
  template <class U>
  LargeAllocator(const LargeAllocator<U>&) {}

  T* allocate(size_t n) {
    constexpr size_t kPage = size_t(1) << 21;
    const size_t bytes = n * sizeof(T);
#ifdef __linux__
    if (bytes >= 2 * kPage) {
      void* memory = std::aligned_alloc(kPage, (bytes + kPage - 1) / kPage * kPage);
      if (!memory) throw std::bad_alloc();
      madvise(memory, bytes, MADV_HUGEPAGE);
      return static_cast<T*>(memory);
    }
#endif
    void* memory = std::malloc(bytes);
    if (!memory) throw std::bad_alloc();
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, size_t) { std::free(memory); }
  template <class U>
  bool operator==(const LargeAllocator<U>&) const {
    return true;
  }
};

template <class T>
using LargeVector = std::vector<T, LargeAllocator<T>>;

}  // namespace gi
