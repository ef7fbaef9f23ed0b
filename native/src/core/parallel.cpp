// ThreadPool. Every worker flushes denormals to zero, as Embree asks.
#include "core/parallel.h"

#include <exception>
#if defined(__linux__)
#include <pthread.h>
#endif
#if defined(__SSE__)
#include <pmmintrin.h>
#include <xmmintrin.h>
#endif

namespace gi {

ThreadPool::ThreadPool(int threads) {
  const int n = threads > 0 ? threads : std::max(1, int(std::thread::hardware_concurrency()));
  for (int i = 0; i < n; ++i) workers_.emplace_back([this] { work(); });
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  wake_.notify_all();
  for (std::thread& t : workers_) t.join();
}

void ThreadPool::for_each(int count, const std::atomic<bool>& stop, const std::function<void(int)>& f) {
  std::unique_lock lock(mutex_);
  job_ = &f, stop_ = &stop, count_ = count, error_ = nullptr;
  next_ = 0;
  busy_ = size();
  ++generation_;
  wake_.notify_all();
  done_.wait(lock, [this] { return busy_ == 0; });
  job_ = nullptr;
  if (error_) std::rethrow_exception(error_);
}

void ThreadPool::work() {
#if defined(__linux__)
  pthread_setname_np(pthread_self(), "gi-render");  // for profilers
#endif
#if defined(__SSE__)
  _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
  _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
#endif
  uint64_t seen = 0;
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [&] { return quit_ || generation_ != seen; });
    if (quit_) return;
    seen = generation_;
    lock.unlock();
    try {
      for (int i = next_++; i < count_ && !*stop_; i = next_++) (*job_)(i);
    } catch (...) {
      const std::lock_guard error_lock(mutex_);
      if (!error_) error_ = std::current_exception();
      next_ = count_;
    }
    lock.lock();
    if (--busy_ == 0) done_.notify_one();
  }
}

}  // namespace gi
