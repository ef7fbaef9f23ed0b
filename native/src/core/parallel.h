// A pool of render threads. Work is handed out by an atomic counter; results must not depend on who takes what.
#pragma once
#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace gi {

class ThreadPool {
 public:
  explicit ThreadPool(int threads);  // 0: one for each core
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;

  int size() const { return int(workers_.size()); }
  // Runs f(item) for all items of [0, count) and waits; items not begun when `stop` becomes true are left out.
  // The first exception that an item throws is thrown here.
  void for_each(int count, const std::atomic<bool>& stop, const std::function<void(int)>& f);

 private:
  void work();

  std::mutex mutex_;
  std::condition_variable wake_, done_;
  const std::function<void(int)>* job_ = nullptr;
  const std::atomic<bool>* stop_ = nullptr;
  std::atomic<int> next_{0};
  int count_ = 0, busy_ = 0;
  uint64_t generation_ = 0;
  bool quit_ = false;
  std::exception_ptr error_;
  std::vector<std::thread> workers_;
};

}  // namespace gi
